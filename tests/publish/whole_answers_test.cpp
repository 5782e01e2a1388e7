// Addresses, names and datagrams as they are read, held as they once were.
#include <gtest/gtest.h>

#include <string>

#include "publish/channel_name.h"
#include "publish/lcm_datagram.h"
#include "publish/lcm_url.h"
#include "tests/support/recorded_answer.h"
#include "tests/support/shared_data.h"

namespace imuscope {
namespace {

TEST(PublishWhole, Addresses) {
  std::string text;
  for (const char* url : {"udpm://",
                          "udpm://239.255.76.67:7667",
                          "udpm://239.255.76.67:7667?ttl=1",
                          "udpm://224.0.0.0:1?ttl=0",
                          "udpm://239.255.255.255:65535?ttl=255",
                          "udpm://223.255.255.255:1",
                          "udpm://240.0.0.0:1",
                          "udpm://:1234",
                          "udpm://?ttl=3",
                          "udpm://239.0.0.1",
                          "udpm://239.0.0.1:",
                          "udpm://239.0.0.1:0",
                          "udpm://239.0.0.1:65536",
                          "udpm://239.0.0.1:12x",
                          "udpm://239.0.0:1",
                          "udpm://239.0.0.1:1?",
                          "udpm://239.0.0.1:1?ttl=",
                          "udpm://239.0.0.1:1?ttl=256",
                          "udpm://239.0.0.1:1?ttl=-1",
                          "udpm://239.0.0.1:1?TTL=1",
                          "udpm://239.0.0.1:1?ttl=1&x=2",
                          "udp://",
                          "",
                          "file:///tmp/x?mode=w"}) {
    const auto bus = parse_udpm_url(url);
    text += std::string(url) + ": ";
    if (bus) {
      for (const int shift : {24, 16, 8, 0}) text += std::to_string(bus->group >> shift & 0xFFU) + '.';
      text += ' ' + std::to_string(bus->port) + ' ' + std::to_string(bus->ttl) + '\n';
    } else {
      text += std::to_string(static_cast<int>(bus.error().kind)) + ' ' + bus.error().text() + '\n';
    }
  }
  for (const char* url : {"file:///nowhere/x.lcm?mode=w", "file:///nowhere/x.lcm",
                          "file:///nowhere/x.lcm?mode=r", "file:///nowhere/x?y?mode=w", "file:///?mode=w",
                          "tcpq://", "memq://", "udpm://1.2.3.4:5", "file://?mode=w"}) {
    const auto checked = check_lcm_url(url);
    text +=
        std::string(url) + ": " +
        (checked ? std::string("good")
                 : std::to_string(static_cast<int>(checked.error().kind)) + ' ' + checked.error().text()) +
        '\n';
  }
  test::expect_recorded("publish/addresses.txt", text);
}

TEST(PublishWhole, NamesOfChannels) {
  std::string text;
  for (const char* device : {"", "mtx1", "a-b.c d", "\xC3\xA9", "_"})
    text += channel_name("IMUSCOPE", "ERROR", device) + '\n';
  text += channel_name(std::string(50, 'p'), "KIND", std::string(20, 'd')) + '\n' +
          channel_name(std::string(57, 'p'), "KIND") + '\n' + channel_name(std::string(59, 'p'), "KIND") +
          '\n';
  test::expect_recorded("publish/channels.txt", text);
}

TEST(PublishWhole, DatagramsOfEveryForm) {
  std::string text;
  const auto add = [&](const std::string& bytes) {
    const auto read = read_short_message({reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size()});
    text += std::to_string(bytes.size()) + ": " +
            (read ? std::to_string(read->channel.size()) + " '" + std::string(read->channel.substr(0, 5)) +
                        "' " + std::to_string(read->message.size())
                  : "nothing") +
            '\n';
  };
  const std::string head("LC02\0\0\0\1", 8);
  for (std::size_t n = 0; n < head.size(); ++n) add(head.substr(0, n));
  add(head), add(head + '\0'), add(head + std::string("a\0", 2)), add(head + "a"),
      add(head + std::string("a\0bc", 4));
  for (const std::size_t n : {61U, 62U, 63U, 64U, 65U}) add(head + std::string(n, 'c') + '\0' + "xy");
  for (std::size_t i = 0; i < 4; ++i) {
    std::string other = head + std::string("a\0bc", 4);
    other[i] = static_cast<char>(other[i] + 1);
    add(other);
  }
  for (const std::size_t n : {kMaxDatagramBytes - 1, kMaxDatagramBytes, kMaxDatagramBytes + 1})
    add(head + std::string("a\0", 2) + std::string(n - 10, 'x'));
  test::expect_recorded("publish/datagrams.txt", text);
}

}  // namespace
}  // namespace imuscope
