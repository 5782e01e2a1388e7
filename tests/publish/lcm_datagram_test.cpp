#include "publish/lcm_datagram.h"

#include <gtest/gtest.h>

#include <string>

#include "tests/support/lcm_datagrams.h"

namespace imuscope {
namespace {

std::optional<LcmDatagram> read_datagram(const std::string& bytes) {
  return read_short_message({reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size()});
}

TEST(LcmDatagram, GivesChannelAndMessage) {
  const std::string datagram = test::lc02("IMUSCOPE_EVENT", std::string("a\0b", 3));
  const auto read_back = read_datagram(datagram);
  ASSERT_TRUE(read_back);
  EXPECT_EQ(read_back->channel, "IMUSCOPE_EVENT");
  EXPECT_EQ(std::string(read_back->message.begin(), read_back->message.end()), std::string("a\0b", 3));
}

TEST(LcmDatagram, AnEmptyMessageAndTheLongestChannelAreTaken) {
  const auto empty = read_datagram(test::lc02(std::string(kMaxChannelBytes, 'c'), ""));
  ASSERT_TRUE(empty);
  EXPECT_EQ(empty->channel.size(), kMaxChannelBytes);
  EXPECT_TRUE(empty->message.empty());
}

TEST(LcmDatagram, NothingIsReadFromWhatIsNoWholeShortMessage) {
  const std::string datagram = test::lc02("IMUSCOPE_EVENT", "");
  for (std::size_t n = 0; n < datagram.size(); ++n) EXPECT_FALSE(read_datagram(datagram.substr(0, n))) << n;
  EXPECT_FALSE(read_datagram(test::lc02(std::string(kMaxChannelBytes + 1, 'c'), "x")));
  EXPECT_FALSE(read_datagram(test::lc02("c", std::string(kMaxDatagramBytes, 'x'))));
  EXPECT_FALSE(read_datagram(test::lc03({10, 0, 0, 1}, std::string("c\0"
                                                                   "12345678910",
                                                                   13))));
}

}  // namespace
}  // namespace imuscope
