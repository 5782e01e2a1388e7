// How devices are connected: serial, TCP, UDP, several behind one Xbus Master, and the search for a baud rate.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <set>

#include "drivers/nmea/decoder.h"
#include "drivers/rtklib_pos/decoder.h"
#include "drivers/ubx/decoder.h"
#include "service/baud_search.h"
#include "service/config.h"
#include "service/device_factory.h"
#include "service/line_factory.h"

namespace imuscope {
namespace {

using testing::HasSubstr;

constexpr const char* kBus = R"(
[[device]]
name = "r"
role = "reference"
protocol = "ixblue_stdbin"
transport = { kind = "udp", port = 8200 }
[[device]]
name = "a"
role = "study"
protocol = "xsens_mt"
transport = { kind = "serial", port = "/dev/ttyUSB0", baud = 460800 }
bus_id = 1
[[device]]
name = "b"
role = "study"
protocol = "xsens_mt"
transport = { kind = "serial", port = "/dev/ttyUSB0", baud = 115200 }
bus_id = 3
[[device]]
name = "g"
role = "gnss"
)";

Result<Configuration> parse(const std::string& text) { return parse_configuration(text, "x.toml"); }

TEST(Lines, DevicesBehindOneXbusMasterShareTheLineOfTheFirst) {
  const auto c = parse(std::string(kBus) + "protocol = \"nmea\"\n");
  ASSERT_TRUE(c) << c.error().text();
  EXPECT_EQ(c->devices[0].line_owner, 0U);
  EXPECT_EQ(c->devices[1].line_owner, 1U);
  EXPECT_EQ(c->devices[2].line_owner, 1U);
  EXPECT_EQ(c->devices[2].serial->baud, 460800U);
  EXPECT_EQ(c->devices[1].xsens.bus_size, 3);
  EXPECT_EQ(c->devices[2].xsens.bus_size, 3);
  EXPECT_EQ(c->devices[3].line_owner, 3U);
}

TEST(Lines, TwoDevicesOnOnePortWithoutBusIdsAreRefused) {
  std::string text = kBus;
  text.erase(text.find("bus_id = 3"), 10);
  const auto c = parse(text + "protocol = \"nmea\"\n");
  ASSERT_FALSE(c);
  EXPECT_THAT(c.error().text(), HasSubstr("'a' and 'b' on the same port /dev/ttyUSB0"));
  std::string twice = kBus;
  twice.replace(twice.find("bus_id = 3"), 10, "bus_id = 1");
  EXPECT_THAT(parse(twice + "protocol = \"nmea\"\n").error().text(), HasSubstr("bus_id 1 twice"));
}

TEST(Lines, ANetworkLineNeedsItsPortAndTcpItsHost) {
  const std::string gnss = std::string(kBus) + "protocol = \"rtklib_pos\"\n";
  const auto c = parse(gnss + "transport = { kind = \"tcp\", host = \"localhost\", port = 5013 }\n");
  ASSERT_TRUE(c) << c.error().text();
  ASSERT_TRUE(c->devices[3].net);
  EXPECT_FALSE(c->devices[3].net->udp);
  EXPECT_EQ(c->devices[3].net->port, 5013);
  EXPECT_TRUE(has_line(c->devices[3]));
  EXPECT_TRUE(c->devices[0].net->udp);
  EXPECT_THAT(parse(gnss + "transport = { kind = \"tcp\", port = 5013 }\n").error().text(), HasSubstr("host"));
  EXPECT_THAT(parse(gnss + "transport = { kind = \"tcp\", host = \"x\", port = 70000 }\n").error().text(),
              HasSubstr("port"));
  EXPECT_THAT(parse(gnss + "transport = { kind = \"avian\", port = 1 }\n").error().text(),
              HasSubstr("serial"));
}

TEST(Lines, EveryGnssProtocolHasADecoderAndASessionOfItsOwn) {
  for (const char* protocol : {"greis", "nmea", "ubx", "rtklib_pos", "xsens_mt"}) {
    const auto c = parse(std::string(kBus) + "protocol = \"" + protocol + "\"\n");
    ASSERT_TRUE(c) << c.error().text();
    EXPECT_NE(make_decoder(c->devices[3], 3, ClockMapConfig{}), nullptr) << protocol;
    EXPECT_NE(make_session(c->devices[3]), nullptr) << protocol;
  }
  const auto imu = parse(std::string(kBus) + "protocol = \"ixblue_stdbin\"\n");
  ASSERT_FALSE(imu);
  EXPECT_THAT(imu.error().text(), HasSubstr("ixblue_stdbin does not fit role gnss"));
}

TEST(Lines, ASessionThatOnlyListensSaysWhatToDoInItsProtocolsWords) {
  for (const auto& [protocol, word] : {std::pair{"nmea", "GGA and RMC"}, std::pair{"ubx", "NAV-PVT"},
                                       std::pair{"rtklib_pos", "output format"}}) {
    const auto c = parse(std::string(kBus) + "protocol = \"" + protocol + "\"\n");
    ASSERT_TRUE(c) << c.error().text();
    const auto session = make_session(c->devices[3]);
    const std::vector<std::uint8_t> noise(200, 0x55);
    session->on_bytes(noise, HostTime{});
    EXPECT_TRUE(session->poll(HostTime{std::chrono::seconds(6)}).empty());
    EXPECT_EQ(session->state(), SessionState::kFailed) << protocol;
    EXPECT_THAT(std::string(session->problem()), HasSubstr(word));
    EXPECT_TRUE(session->wants_other_baud()) << protocol;
  }
}

TEST(Lines, SolutionsRelativeToAnUnknownBaseAreToldWithTheRemedy) {
  const auto c = parse(std::string(kBus) + "protocol = \"rtklib_pos\"\n");
  ASSERT_TRUE(c) << c.error().text();
  struct Sink final : SampleSink {
    void on_sample(const Sample&) noexcept override { ++n; }
    int n = 0;
  } sink;
  const std::string text =
      "%  GPST  e-baseline(m)  n-baseline(m)  u-baseline(m)  Q ns sde(m) sdn(m) sdu(m) sden(m) sdnu(m) sdue(m) "
      "age(s) ratio\n2026/03/14 12:34:56.100 1 2 3 1 12 0.01 0.01 0.02 0 0 0 0.1 12\n";
  const std::vector<std::uint8_t> bytes(text.begin(), text.end());
  const auto decoder = make_decoder(c->devices[3], 3, ClockMapConfig::fixed(HostTime{}, 1.0));
  decoder->push(bytes, HostTime{}, sink);
  EXPECT_EQ(sink.n, 0);
  EXPECT_THAT(decoder_problem(c->devices[3], *decoder), HasSubstr("base_lat_lon_height"));

  const auto known = parse(std::string(kBus) +
                           "protocol = \"rtklib_pos\"\nbase_lat_lon_height = [48.0, 2.0, 80.0]\n");
  ASSERT_TRUE(known) << known.error().text();
  make_decoder(known->devices[3], 3, ClockMapConfig::fixed(HostTime{}, 1.0))->push(bytes, HostTime{}, sink);
  EXPECT_EQ(sink.n, 1);
}

TEST(BaudSearch, ComesToEveryRateAndBackToTheConfiguredOne) {
  for (const std::uint32_t configured : {115200U, 38400U, 1000000U}) {
    BaudSearch search(configured);
    EXPECT_EQ(search.current(), configured);
    EXPECT_FALSE(search.searching());
    std::set<std::uint32_t> tried;
    for (search.next(); search.searching(); search.next()) {
      EXPECT_TRUE(tried.insert(search.current()).second) << search.current();
    }
    EXPECT_EQ(search.current(), configured);
    for (const std::uint32_t rate : {9600U, 19200U, 57600U, 115200U, 230400U, 460800U, 921600U}) {
      EXPECT_TRUE(rate == configured || tried.contains(rate)) << rate;
    }
  }
}

}  // namespace
}  // namespace imuscope
