/// The vehicle that tests change: its text holds what its file holds, and of changes nothing but what was asked.

#include "demo_vehicle.h"

#include <gtest/gtest.h>
#include <optional>
#include <stdexcept>

#include "careful_toml.h"
#include "programs.h"
#include "tests/support/shared_data.h"

namespace imuscope::test {
namespace {

/// The tables that the changes below make another.
constexpr const char* kChanged = R"(
lcm.url = "udpm://239.255.76.67:7667?ttl=0"
virtual_imu.gyro_x = [0.25, 0.75]

[[device]]
name = "airins"
role = "reference"
protocol = "ixblue_stdbin"
rate_hz = 100.0
axes = "+x -y -z"
transport = { kind = "udp", port = 29200 }
[device.noise]
gyro_white_deg_per_sqrt_h = 0.0015
accel_white_ug_per_sqrt_hz = 10.0
gyro_bias_sd_deg_per_h = 0.005
accel_bias_sd_mps2 = 5e-4
[[device]]
name = "mtx1"
role = "study"
protocol = "xsens_mt"
rate_hz = 100.0
transport = { kind = "serial", port = "/run/x/mtx1", baud = 115200 }
[device.prior]
rotation_vector_b_s_deg = [0.0, 0.0, 0.0]
boresight_sd_deg = 3.0
lever_arm_sd_m = 0.5
time_offset_ms = 0.0
time_offset_sd_ms = 10.0
[[device]]
name = "mtx2"
role = "study"
protocol = "xsens_mt"
rate_hz = 100.0
transport = { kind = "serial", port = "/run/x/mtx2", baud = 921600 }
[device.prior]
rotation_vector_b_s_deg = [0.0, 0.0, 91.0]
boresight_sd_deg = 3.0
lever_arm_sd_m = 0.5
time_offset_ms = 0.0
time_offset_sd_ms = 10.0
[[device]]
name = "gnss"
role = "gnss"
protocol = "greis"
rate_hz = 10.0
antenna_lever_arm_b_m = [-0.50, 0.20, -1.30]
transport = { kind = "serial", port = "/run/x/gnss", baud = 115200 }
[[device]]
name = "mti"
role = "study"
transport = { kind = "serial", port = "/run/x/mti", baud = 115200 }

[simulation]
duration_s = 900.0
seed = 1
start_utc = 2016-12-31T23:57:30Z
[[simulation.imu]]
name = "mtx1"
rotation_vector_b_s_deg = [0.8, -1.1, 0.6]
lever_arm_b_m = [0.35, -0.22, 0.12]
latency_ms = 2.0
first_counter = 50536
[[simulation.imu]]
name = "mtx2"
rotation_vector_b_s_deg = [0.9, 0.7, 91.2]
lever_arm_b_m = [-0.30, 0.25, 0.10]
latency_ms = 3.4
[[simulation.imu]]
name = "mti"
model = "mti"
)";

toml::table parsed(const std::string& text) { return toml::parse(text); }

TEST(DemoVehicle, UnchangedHoldsWhatItsFileHolds) {
  for (const char* file : {"config/demo.toml", "config/can_vehicle.toml"}) {
    const DemoVehicle vehicle(source_path(file));
    EXPECT_TRUE(parsed(vehicle.text()) == parsed(read_text(source_path(file)))) << vehicle.text();
  }
}

TEST(DemoVehicle, TakesChangesOfEveryKind) {
  const std::string text =
      DemoVehicle()
          .ports_in("/run/x")
          .with_priors()
          .start_at("2016-12-31T23:57:30Z")
          .set("lcm.url", "udpm://239.255.76.67:7667?ttl=0")
          .set("virtual_imu.gyro_x", std::vector<double>{0.25, 0.75})
          .set_device("mtx2", "transport.baud", 921600)
          .set_truth("mtx1", "first_counter", 50536)
          .put_on_line("airins", udp_line(29200))
          .without("mtx3")
          .add_device({{"name", "mti"}, {"role", "study"}}, serial_line("/run/x/mti", 115200))
          .set_truth("mti", "model", "mti")
          .text();
  toml::table wanted = parsed(read_text(source_path("config/demo.toml")));
  for (auto&& [key, value] : parsed(kChanged)) wanted.insert_or_assign(key, value);
  EXPECT_TRUE(parsed(text) == wanted) << text;
}

TEST(DemoVehicle, RefusesADeviceThatItDoesNotHaveAndADateThatIsNone) {
  DemoVehicle vehicle;
  EXPECT_THROW(vehicle.set_device("mtx9", "rate_hz", 100.0), std::invalid_argument);
  EXPECT_THROW(vehicle.set_truth("mtx9", "latency_ms", 1.0), std::invalid_argument);
  EXPECT_THROW(vehicle.without("mtx9"), std::invalid_argument);
  EXPECT_THROW(vehicle.set("run.name.short", "demo"), std::invalid_argument);
  EXPECT_THROW(vehicle.start_at("1"), std::bad_optional_access);
}

}  // namespace
}  // namespace imuscope::test
