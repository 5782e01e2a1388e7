// How devices are connected: serial, TCP, UDP, several behind one Xbus Master, and the search for a baud
// rate.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <set>

#include "configuration/config.h"
#include "drivers/nmea/decoder.h"
#include "drivers/rtklib_pos/decoder.h"
#include "drivers/ubx/decoder.h"
#include "service/lines/baud_search.h"
#include "service/lines/line_factory.h"
#include "service/pipeline/device_factory.h"
#include "service/recording/recording.h"
#include "tests/drivers/xsens_mt/mt_frames.h"
#include "tests/support/shared_data.h"

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
  EXPECT_THAT(parse(gnss + "transport = { kind = \"tcp\", port = 5013 }\n").error().text(),
              HasSubstr("host"));
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
      "%  GPST  e-baseline(m)  n-baseline(m)  u-baseline(m)  Q ns sde(m) sdn(m) sdu(m) sden(m) sdnu(m) "
      "sdue(m) age(s) ratio\n2026/03/14 12:34:56.100 1 2 3 1 12 0.01 0.01 0.02 0 0 0 0.1 12\n";
  const std::vector<std::uint8_t> bytes(text.begin(), text.end());
  const auto decoder = make_decoder(c->devices[3], 3, ClockMapConfig::fixed(HostTime{}, 1.0));
  decoder->push(bytes, HostTime{}, sink);
  EXPECT_EQ(sink.n, 0);
  EXPECT_THAT(decoder_problem(c->devices[3], *decoder), HasSubstr("base_lat_lon_height"));

  const auto known =
      parse(std::string(kBus) + "protocol = \"rtklib_pos\"\nbase_lat_lon_height = [48.0, 2.0, 80.0]\n");
  ASSERT_TRUE(known) << known.error().text();
  make_decoder(known->devices[3], 3, ClockMapConfig::fixed(HostTime{}, 1.0))->push(bytes, HostTime{}, sink);
  EXPECT_EQ(sink.n, 1);
}

/// A dump with the arrival of each frame beside it.
void write_dump(const std::filesystem::path& file, const std::vector<std::vector<std::uint8_t>>& frames) {
  std::ofstream bytes(file, std::ios::binary);
  std::ofstream arrivals(std::filesystem::path(file).replace_extension(".arrivals.csv"));
  arrivals << "byte_offset,n_bytes,arrival_ns\n";
  std::size_t offset = 0;
  std::int64_t arrival_ns = 1'000'000'000;
  for (const auto& frame : frames) {
    bytes.write(reinterpret_cast<const char*>(frame.data()), static_cast<std::streamsize>(frame.size()));
    arrivals << offset << ',' << frame.size() << ',' << arrival_ns << '\n';
    offset += frame.size();
    arrival_ns += 10'000'000;
  }
}

TEST(Lines, ADumpOfAnXbusLineFeedsEveryDeviceBehindIt) {
  namespace mt = xsens::test_frames;
  const auto folder = test::scratch_folder();
  std::vector<std::vector<std::uint8_t>> alone;
  std::vector<std::vector<std::uint8_t>> bus;
  for (int i = 0; i < 50; ++i) {
    const auto counter = static_cast<std::uint16_t>(i);
    alone.push_back(mt::mtdata(counter));
    auto data = mt::u16(counter);
    for (int device = 0; device < 3; ++device) {
      const auto block = mt::mtdata(counter, {device + 0.25, 0.001 * i, 9.8});
      data.insert(data.end(), block.begin() + 4, block.end() - 1);
    }
    bus.push_back(mt::frame(0x32, data));
  }
  write_dump(folder / "r.bin", alone);
  write_dump(folder / "bus.bin", bus);
  std::string text = kBus;
  text.replace(text.find("ixblue_stdbin"), 13, "xsens_mt");
  std::ofstream(folder / "bus.toml") << text << "protocol = \"nmea\"\n";

  const auto opened = open_recording(
      {"r=" + (folder / "r.bin").string(), "a=" + (folder / "bus.bin").string()}, folder / "bus.toml");
  ASSERT_TRUE(opened) << opened.error().text();
  const auto& recording = opened->recording;
  EXPECT_EQ(recording.present, (std::vector<bool>{true, true, true, false}));
  struct Sink final : SampleSink {
    void on_sample(const Sample& sample) noexcept override {
      ++n;
      last = sample;
    }
    int n = 0;
    Sample last{};
  };
  // Bus ids 1 and 3: the first and the third block.
  for (const auto& [index, force] : {std::pair{1, 0.25}, std::pair{2, 2.25}}) {
    const auto device = static_cast<DeviceIndex>(index);
    const auto decoder = make_decoder(opened->configuration.devices[device], device, ClockMapConfig{});
    auto source = recording.open(device);
    ASSERT_TRUE(source) << source.error().text();
    Sink sink;
    for (auto read = (*source)->next(); read && *read; read = (*source)->next()) {
      decoder->push((*read)->bytes, (*read)->arrival.value_or(HostTime{}), sink);
    }
    EXPECT_EQ(sink.n, 50);
    EXPECT_EQ(sink.last.device, device);
    EXPECT_NEAR(sink.last.imu.f_mps2[0], force, 1e-6);
  }
}

TEST(BaudSearch, ComesToEveryRateAndBackToTheConfiguredOne) {
  for (const std::uint32_t configured : {115200U, 38400U, 1000000U}) {
    BaudSearch search(configured);
    EXPECT_EQ(search.current(), configured);
    EXPECT_FALSE(search.searching());
    EXPECT_FALSE(search.repeats());
    std::set<std::uint32_t> tried;
    for (search.next(); search.searching(); search.next()) {
      EXPECT_TRUE(tried.insert(search.current()).second) << search.current();
    }
    EXPECT_EQ(search.current(), configured);
    EXPECT_TRUE(search.repeats());
    for (const std::uint32_t rate : {9600U, 19200U, 57600U, 115200U, 230400U, 460800U, 921600U}) {
      EXPECT_TRUE(rate == configured || tried.contains(rate)) << rate;
    }
  }
}

}  // namespace
}  // namespace imuscope
