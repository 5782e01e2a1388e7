#include "service/lines/line_rate.h"

#include <gtest/gtest.h>

#include <cstdlib>

#include "base/limits.h"
#include "capture/capture_reader.h"
#include "capture/raw_chunk.h"
#include "configuration/config.h"
#include "tests/support/shared_data.h"

namespace imuscope {
namespace {

/// What simulated devices really sent, against what their configuration lets expect.
TEST(LineRate, IsNoLessThanWhatTheDevicesOfTheGoldenCaptureSend) {
  const auto capture = test::scratch_folder() / "capture.lcm";
  const std::string unpack = "gzip -dc '" + test::source_path("tests/golden/capture.lcm.gz").string() +
                             "' > '" + capture.string() + "'";
  ASSERT_EQ(std::system(unpack.c_str()), 0);
  const auto summary = summarise_capture(capture);
  ASSERT_TRUE(summary.has_value());
  const auto configuration = parse_configuration(summary->run.configuration, "golden");
  ASSERT_TRUE(configuration.has_value()) << configuration.error().text();
  double needed = 0.0;
  for (const auto& [name, captured] : summary->devices) {
    const DeviceConfig* device = configuration->find(name);
    ASSERT_NE(device, nullptr) << name;
    const double seconds = to_seconds(captured.last - captured.first);
    ASSERT_GT(seconds, 10.0) << name;
    const LineRate rate = line_rate(*device);
    const double bytes_per_s = static_cast<double>(captured.bytes_read) / seconds;
    EXPECT_GE(rate.bytes_per_s, bytes_per_s) << name;
    needed += bytes_per_s;
  }
  EXPECT_GE(static_cast<double>(raw_ring_bytes(configuration->devices)), kRecordStall_s * needed);
}

TEST(LineRate, ASerialLineCarriesNoMoreThanItsBaudRate) {
  DeviceConfig device;
  device.role = DeviceRole::kStudy;
  device.rate_hz = 1000.0;
  device.serial = SerialConfig{"/dev/null", 115200, 1};
  EXPECT_DOUBLE_EQ(line_rate(device).bytes_per_s, 11520.0);
  device.serial->stop_bits = 2;
  EXPECT_DOUBLE_EQ(line_rate(device).bytes_per_s, 115200.0 / 11.0);
  device.serial.reset();
  EXPECT_EQ(line_rate(device).bytes_per_s, 0.0) << "a device of a file brings nothing to the recorder";
}

TEST(LineRate, MemoryIsBoundedHoweverFastTheDevices) {
  std::vector<DeviceConfig> devices(kMaxDevices);
  for (auto& device : devices) {
    device.rate_hz = kMaxRate_hz;
    device.net = NetConfig{};
  }
  EXPECT_EQ(raw_ring_bytes(devices), kRawRingBytesMax);
  EXPECT_EQ(raw_ring_bytes({}), kRawRingBytesMin);
}

}  // namespace
}  // namespace imuscope
