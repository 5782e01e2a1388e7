// Everything that a configuration says arrives, with its unit; everything it may not say is refused with its words.
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <gtest/gtest.h>
#include <fstream>

#include "base/text.h"
#include "configuration/config.h"
#include "configuration/config_reference.h"
#include "configuration/toml_depth.h"
#include "configuration/toml_reader.h"
#include "tests/support/recorded_answer.h"
#include "tests/support/shared_data.h"

namespace imuscope {
namespace {

std::string written(double value) { return fmt::format("{:.9g}", value); }
std::string written(const std::optional<double>& value) { return value ? written(*value) : "-"; }
std::string written(bool value) { return value ? "yes" : "no"; }
std::string written(const std::string& value) { return fmt::format("'{}'", value); }
template <std::size_t N>
std::string written(const std::array<double, N>& values) {
  return fmt::format("[{:.9g}]", fmt::join(values, " "));
}
template <typename Texts>
std::string listed(const Texts& texts) {
  return fmt::format("[{}]", fmt::join(texts, "|"));
}

/// "title: value value ..."
template <typename... Values>
std::string line(std::string_view title, const Values&... values) {
  std::string text = fmt::format("  {}:", title);
  ((text += ' ' + written(values)), ...);
  return text + '\n';
}

std::string noise_text(const ImuNoiseConfig& n) {
  return line("gyro", n.gyro_white_sd_radps, n.gyro_white_sd_static_radps, n.gyro_bias_sd_radps,
              n.gyro_gm_sd_radps, n.gyro_gm_tau_s, n.gyro_scale_sd) +
         line("accel", n.accel_white_sd_mps2, n.accel_white_sd_static_mps2, n.accel_bias_sd_mps2,
              n.accel_gm_sd_mps2, n.accel_gm_tau_s, n.accel_scale_sd);
}

std::string study_text(const DeviceConfig& device) {
  const MountingPriorConfig& p = device.prior;
  const DataSheetConfig& d = device.data_sheet;
  return line("rotation", p.C_b_s.value_or(std::array<double, 9>{})) +
         line("prior", p.boresight_sd_rad, p.r_bs_b_m, p.lever_arm_sd_m, p.time_offset_s, p.time_offset_sd_s,
              p.accel_boresight_sd_rad, p.accel_time_offset_sd_s, p.creep_rad_per_sqrt_s) +
         line("data sheet", d.gyro_density_radps_per_sqrt_hz, d.gyro_bias_stability_radps,
              d.accel_density_mps2_per_sqrt_hz, d.accel_bias_stability_mps2, d.bias_time_s) +
         line("averages", static_cast<double>(device.average_samples));
}

std::string transport_text(const DeviceConfig& device) {
  std::string text;
  if (device.serial)
    text += fmt::format("  serial: {} {} {}\n", device.serial->port, device.serial->baud,
                        device.serial->stop_bits);
  if (device.can)
    text += fmt::format("  can: {} {}\n", device.can->interface, device.can->log_has_common_clock);
  if (device.net)
    text += fmt::format("  net: {} {} {}\n", device.net->udp, device.net->host, device.net->port);
  if (device.pps) text += fmt::format("  pps: {} {}\n", device.pps->port, device.pps->clear_edge);
  const XsensConfig& x = device.xsens;
  text += fmt::format("  xsens: {} {} {:08X}", x.bus_id, x.bus_size, x.device_id.value_or(0));
  if (x.sync_in) text += fmt::format(" {} {} {}", x.sync_in->mode, x.sync_in->skip, x.sync_in->offset);
  return text + fmt::format("\n  line of: {}\n", device.line_owner);
}

std::string file_text(const DeviceConfig& device) {
  const CsvConfig& c = device.csv;
  const MessagesConfig& m = device.messages;
  return line("csv", c.time_column, c.time_unit_s, c.time_offset_s, c.gyro_in_degps, c.accel_in_g,
              c.counter_column, c.latitude_column, c.longitude_column, c.height_column, c.common_clock) +
         fmt::format("  columns: {} {} {} {}\n", listed(c.gyro_columns), listed(c.accel_columns),
                     listed(c.velocity_columns), listed(c.position_sd_columns)) +
         line("messages", m.topic, m.velocity_topic, m.frame_id, static_cast<double>(m.time), m.times_are_utc,
              m.common_clock);
}

std::string gnss_text(const GnssOptions& g) {
  return line("gnss", g.antenna_lever_arm_b_m, g.antenna_lever_arm_sd_m, g.position_sd_m, g.velocity_sd_mps,
              g.position_sd_floor_m, g.velocity_sd_floor_mps, g.latency_s, g.latency_sd_s,
              g.geoid_separation_m, g.common_clock, g.base_lat_lon_height.value_or(Vector3{}));
}

std::string odometry_text(const OdometryOptions& o) {
  const can_odometry::Choice& c = o.choice;
  return fmt::format("  signals: {} {} {} {} {}\n", listed(c.speed_signals), listed(c.backward_values),
                     listed(c.fault_signals), c.direction_signal, c.counter_signal) +
         line("wheels", c.unit ? static_cast<double>(*c.unit) : -1.0, c.wheel_radius_m, c.has_no_sign,
              fmt::format("{}", fmt::join(c.invalid_raw, " ")), o.database != nullptr) +
         line("odometry", o.latency_s, o.max_speed_mps, o.max_acceleration_mps2, o.use_speed,
              o.use_non_holonomic, o.use_zero_velocity, o.axle_lever_arm_b_m, o.axle_lever_arm_sd_m,
              o.mounting_sd_rad, o.scale_sd, o.speed_sd_mps, o.sideways_sd_mps, o.upwards_sd_mps,
              o.zero_velocity_sd_mps, o.dead_band_mps);
}

std::string device_text(const DeviceConfig& device) {
  std::string ids;
  for (const CanId& id : device.xsens_can_ids)
    ids += fmt::format(" {:X}{}", id.id, id.is_extended ? "x" : "");
  return fmt::format("device {} {} {}\n", device.name, name_of(device.role), name_of(device.protocol)) +
         line("rate and axes", device.rate_hz, device.axes) + transport_text(device) +
         noise_text(device.noise) + study_text(device) + file_text(device) + gnss_text(device.gnss) +
         odometry_text(device.odometry) + "  ids:" + ids + '\n';
}

std::string options_text(const Configuration& c) {
  const MotionLimits& l = c.regimes.limits;
  std::string text = fmt::format("run {}, file {}\n", c.run_name, c.file.string());
  text += line("estimator", static_cast<double>(c.estimator.states), c.estimator.batch_mounting,
               c.estimator.navigation, static_cast<double>(c.estimator.differentiator_points));
  text += line("noise", c.noise.model, c.noise.refit_interval_s, c.noise.remove_scale_error,
               c.noise.apply_to_filter);
  text += line("limits", l.rest_speed_mps, l.motion_speed_mps, l.rest_rate_spread_radps,
               l.motion_rate_spread_radps, l.rest_force_spread_mps2, l.motion_force_spread_mps2,
               l.rest_vibration_mps2, l.motion_vibration_mps2, l.shortest_static_s, l.guard_s);
  text += line("regimes", static_cast<double>(c.regimes.by), static_cast<double>(c.regimes.intensity),
               static_cast<double>(c.regimes.bins), c.regimes.block_s, c.regimes.window_s);
  text += line("error process", c.error_process.low_pass_hz);
  for (const VirtualImuMember& member : c.virtual_imu)
    text += line("member", static_cast<double>(member.device), member.gyro, member.accel);
  text += line("lcm", c.lcm.url, c.lcm.channel_prefix, c.lcm.bridge);
  text +=
      line("record", c.record.folder, c.record.sync_s, c.record.file_bytes, c.record.file_s, c.record.mcap,
           c.record.remove_older_than_s, c.record.remove_beyond_bytes, c.record.remove_below_free_bytes);
  text += line("metrics", c.metrics.address, static_cast<double>(c.metrics.port));
  text += fmt::format("  cores: {} {}\n", listed(c.threads.io_cores), listed(c.threads.estimator_cores));
  return text;
}

std::string whole_text(const std::string& toml) {
  const auto read = parse_configuration(toml, "folder/car.toml");
  if (!read) return read.error().text() + '\n';
  std::string text = options_text(*read);
  for (const DeviceConfig& device : read->devices) text += device_text(device);
  text += fmt::format("reference {}, studies {}, gnss {}, odometry {}, sha256 {}\n", read->reference_index(),
                      listed(read->study_indices()), read->gnss_index().value_or(99),
                      read->odometry_index().value_or(99), read->sha256);
  return text;
}

constexpr const char* kTwo = R"([[device]]
name = "r"
role = "reference"
protocol = "ixblue_stdbin"
[[device]]
name = "s"
role = "study"
protocol = "xsens_mt"
)";

std::string device(std::string_view name, std::string_view role, std::string_view protocol,
                   std::string_view more = {}) {
  return fmt::format("[[device]]\nname = \"{}\"\nrole = \"{}\"\nprotocol = \"{}\"\n{}", name, role, protocol,
                     more);
}

/// Every key, each with a number of its own.
constexpr const char* kEverything = R"([run]
name = "a run"
[estimator]
states = "rigid"
mounting = "filter"
navigation = false
differentiator_points = 9
[noise]
model = "WN+RW"
refit_interval_s = 31.0
remove_scale_error = false
apply_to_filter = true
[regimes]
by = "intensity"
motion_speed_mps = 0.41
motion_rate_deg_per_s = 0.73
motion_force_mps2 = 0.19
motion_vibration_mps2 = 0.83
shortest_static_s = 1.7
guard_s = 0.37
intensity = "speed"
bins = 4
block_s = 11.0
window_s = 23.0
[error_process]
low_pass_hz = 7.5
[lcm]
url = "udpm://239.255.76.67:7667?ttl=1"
channel_prefix = "CAR"
bridge = true
[record]
folder = "runs"
mcap = true
sync_s = 0.7
file_gb = 1.5
file_hours = 2.5
remove_older_than_days = 3.0
remove_beyond_gb = 5.5
remove_below_free_gb = 6.5
[metrics]
address = "127.0.0.2"
port = 9847
[threads]
io_cores = [1, 2]
estimator_cores = [3]
[virtual_imu]
imus = ["can", "mt"]
gyro_x = [0.31, 0.69]
gyro_y = [0.32, 0.68]
gyro_z = [0.33, 0.67]
accel_x = [0.34, 0.66]
accel_y = [0.35, 0.655]
accel_z = [0.36, 0.635]
[simulation]
anything = 1
[[device]]
name = "r"
role = "reference"
protocol = "ixblue_stdbin"
rate_hz = 90.0
axes = [[0.6, 0.8, 0.0], [-0.8, 0.6, 0.0], [0.0, 0.0, 1.0]]
transport = { kind = "tcp", host = "airins", port = 8111 }
[device.noise]
gyro_white_sd_degps = 0.11
gyro_white_sd_static_degps = 0.12
gyro_bias_sd_degps = 0.13
gyro_gm_sd_degps = 0.14
gyro_gm_tau_s = 15.0
accel_white_sd_mps2 = 0.16
accel_white_sd_static_mps2 = 0.17
accel_bias_sd_mps2 = 0.18
accel_gm_sd_mps2 = 0.19
accel_gm_tau_s = 21.0
gyro_scale_sd_percent = 2.2
accel_scale_sd_percent = 2.3
[[device]]
name = "mt"
role = "study"
protocol = "xsens_mt"
rate_hz = 25.0
axes = "-y +x +z"
bus_id = 3
average_samples = 7
transport = { kind = "serial", port = "/dev/ttyUSB0", baud = 460800, stop_bits = 2 }
sync_in = { mode = 18, skip = 4, offset_33_9ns = 4294967295.0 }
[device.noise]
gyro_white_deg_per_sqrt_h = 3.1
gyro_bias_sd_deg_per_h = 32.0
accel_white_ug_per_sqrt_hz = 330.0
[device.prior]
rotation_vector_b_s_deg = [10.0, -20.0, 30.0]
boresight_sd_deg = 1.1
lever_arm_b_m = [0.21, -0.22, 0.23]
lever_arm_sd_m = 0.024
time_offset_ms = -4.5
time_offset_sd_ms = 5.5
accel_boresight_sd_deg = 0.6
accel_time_offset_sd_ms = 0.65
mount_creep_deg_per_sqrt_h = 0.7
[device.data_sheet]
gyro_density_degps_per_sqrt_hz = 0.05
gyro_bias_stability_deg_per_h = 12.0
accel_density_ug_per_sqrt_hz = 150.0
accel_bias_stability_ug = 40.0
bias_time_s = 900.0
[[device]]
name = "mt2"
role = "study"
protocol = "xsens_mt"
bus_id = 5
transport = { kind = "serial", port = "/dev/ttyUSB0", baud = 9600 }
[[device]]
name = "alone"
role = "study"
protocol = "xsens_mt"
device_id = "00300A2B"
transport = { kind = "serial", port = "/dev/ttyUSB1" }
[[device]]
name = "can"
role = "study"
protocol = "xsens_can"
transport = { kind = "can", interface = "can0", log_clock = "common" }
[device.xsens_can]
ids = { delta_v = "7FF", delta_q = "1FFFFFFF", error = "0A1" }
[[device]]
name = "dot"
role = "study"
protocol = "csv_imu"
[device.csv]
time_column = "t"
time_unit_s = 1e-3
time_offset_s = -5.5
gyro_columns = ["gx", "-gy", "gz"]
accel_columns = ["ax", "ay", "-az"]
gyro_unit = "deg/s"
accel_unit = "g"
counter_column = "n"
clock = "own"
[[device]]
name = "gnss"
role = "gnss"
protocol = "rtklib_pos"
rate_hz = 4.5
clock = "common"
base_lat_lon_height = [46.5, 6.5, 500.5]
antenna_lever_arm_b_m = [1.1, 1.2, 1.3]
antenna_lever_arm_sd_m = 0.014
position_sd_m = [0.15, 0.16, 0.17]
velocity_sd_mps = [0.18, 0.19, 0.21]
position_sd_floor_m = 0.0022
velocity_sd_floor_mps = 0.0023
latency_ms = 24.0
[[device]]
name = "wheels"
role = "odometry"
protocol = "can_odometry"
[device.odometry]
dbc = "car.dbc"
speed_signals = ["REAR.RL", "REAR.RR"]
speed_unit = "rad/s"
wheel_radius_m = 0.31
speed_has_no_sign = true
direction_signal = "GEAR.LEVER"
backward_values = ["reverse"]
fault_signals = ["GEAR.FAULT"]
invalid_raw = [65535.0, 65534.0]
counter_signal = "REAR.COUNT"
latency_ms = 20.0
max_speed_mps = 61.0
max_acceleration_mps2 = 12.0
speed = false
non_holonomic = false
zero_velocity = false
axle_lever_arm_b_m = [-1.2, 0.1, 0.5]
axle_lever_arm_sd_m = 0.051
mounting_sd_deg = 1.3
scale_sd_percent = 2.4
speed_sd_mps = 0.11
sideways_sd_mps = 0.12
upwards_sd_mps = 0.13
zero_velocity_sd_mps = 0.014
dead_band_mps = 0.21
[[device]]
name = "pulses"
role = "time"
protocol = "pps"
transport = { kind = "pps", port = "/dev/pps0", edge = "clear" }
[attached]
"car.dbc" = """
BO_ 170 REAR: 8 ECU
 SG_ RL : 7|16@0- (0.01,0) [0|0] "rad/s" X
 SG_ RR : 23|16@0- (0.01,0) [0|0] "rad/s" X
 SG_ COUNT : 40|4@1+ (1,0) [0|0] "" X
BO_ 171 GEAR: 2 ECU
 SG_ LEVER : 0|8@1+ (1,0) [0|0] "" X
 SG_ FAULT : 8|1@1+ (1,0) [0|0] "" X
VAL_ 171 LEVER 0 "park" 1 "reverse" ;
"""
)";

TEST(WholeConfiguration, EveryKeyArrivesInItsUnit) {
  test::expect_recorded("configuration/everything.txt", whole_text(kEverything));
}

TEST(WholeConfiguration, WhatIsLeftOutHoldsAsThePresetsSay) {
  std::string text = whole_text(kTwo);
  text +=
      whole_text(kTwo + device("gnss", "gnss", "greis", "transport = { kind = \"udp\", port = 65535 }\n") +
                 device("can", "study", "xsens_can", "transport = { kind = \"can\", interface = \"c\" }\n"));
  text += whole_text("[estimator]\nstates = \"paper\"\n" + std::string(kTwo) +
                     device("gnss", "gnss", "csv_gnss",
                            "[device.csv]\nlatitude_column = \"a\"\n"
                            "longitude_column = \"b\"\nheight_column = \"c\"\n"
                            "velocity_columns = [\"d\", \"e\", \"f\"]\n"
                            "position_sd_columns = [\"g\", \"h\", \"i\"]\n"));
  text += whole_text(kTwo +
                     device("gnss", "gnss", "nmea",
                            "geoid_separation_m = 49.5\nlatency_sd_ms = 7.0\n"
                            "transport = { kind = \"udp\", host = \"239.1.1.1\", port = 1 }\n") +
                     device("bag", "study", "rosbag",
                            "[device.messages]\ntopic = \"/imu\"\nframe_id = \"f\"\n"
                            "time = \"log\"\ntimes_are_utc = true\nclock = \"own\"\n"));
  for (const std::string_view log : {"mcap", "ulog", "dataflash"}) {
    text += whole_text(kTwo +
                       device("gnss", "gnss", log,
                              "[device.messages]\nvelocity_topic = \"/v\"\n"
                              "time = \"publish\"\n") +
                       device("wheels", "odometry", log, "[device.odometry]\nspeed_sd_mps = 0.3\n") +
                       device("pulses", "time", log));
  }
  text += whole_text(device("r", "reference", "xsens_mt") + device("s", "study", "ixblue_stdbin") +
                     device("g", "gnss", "xsens_mt") +
                     device("pulses", "time", "pps", "transport = { kind = \"pps\", port = \"p\" }\n"));
  test::expect_recorded("configuration/presets.txt", text);
}

TEST(WholeConfiguration, TheReferenceHoldsEveryKeyWithItsRangeAndPreset) {
  std::string text;
  for (const KeyReference& key : configuration_reference()) {
    text += fmt::format("{} | {} | {} | {} | {}\n", key.name, key.values, fmt::join(key.presets, ", "),
                        key.required, key.about);
  }
  test::expect_recorded("configuration/reference.txt", text);
}

const std::vector<std::string>& refused_documents() {
  const auto s_with = [](std::string_view keys) { return std::string(kTwo) + std::string(keys); };
  const auto before = [](std::string_view tables) { return std::string(tables) + '\n' + kTwo; };
  const std::string serial = "transport = { kind = \"serial\", port = \"/dev/a\" }\n";
  const std::string s2 = device("s2", "study", "xsens_mt");
  const auto virtual_imu = [&](std::string_view keys) {
    return std::string(kTwo) + s2 + "[virtual_imu]\n" + std::string(keys) + '\n';
  };
  const auto gnss = [&](std::string_view keys, std::string_view protocol = "nmea") {
    return std::string(kTwo) + device("g", "gnss", protocol, keys);
  };
  static const std::vector<std::string> all{
      "", " \t\r\n", "a", "[run]\nname = \n", "x = 1\n", "device = 1\n", "device = [1]\n",
      "[device]\nname = \"r\"\n",
      // Devices.
      "[[device]]\nrole = \"study\"\nprotocol = \"greis\"\n", "[[device]]\nname = \"a\"\n",
      device("a", "reference", "x"), device("a", "reference", "greis"), device("a", "gnss", "csv_imu"),
      device("a", "odometry", "xsens_mt"), device("a", "time", "xsens_mt"),
      device("a", "time", "can_odometry"), device("a b", "study", "xsens_mt"),
      device("r", "reference", "xsens_mt"), s2, kTwo + device("r2", "reference", "xsens_mt"),
      kTwo + device("s", "study", "xsens_mt"), gnss("") + device("g2", "gnss", "ubx"),
      kTwo + device("w", "odometry", "mcap") + device("v", "odometry", "mcap"),
      kTwo + device("w", "time", "mcap") + device("v", "time", "mcap"),
      kTwo + s2 + device("s3", "study", "xsens_mt") + device("s4", "study", "xsens_mt") +
          device("s5", "study", "xsens_mt") + device("s6", "study", "xsens_mt") +
          device("s7", "study", "xsens_mt"),
      // Axes.
      s_with("axes = \"+x -y\"\n"), s_with("axes = \"+x -y -z +x\"\n"), s_with("axes = \"+x *y -z\"\n"),
      s_with("axes = \"+x -w -z\"\n"), s_with("axes = \"+x -{ -z\"\n"), s_with("axes = \"+x -yy -z\"\n"),
      s_with("axes = 1\n"), s_with("axes = [[1, 0, 0], [0, 1, 0]]\n"),
      s_with("axes = [[1, 0, 0], [0, 1, 0], [0, 0]]\n"), s_with("axes = [[1, 0, 0], [0, 1, 0], 1]\n"),
      s_with("axes = [[1, 0, 0], [0, 1, 0], [0, 0, \"1\"]]\n"),
      s_with("axes = [[1, 0, 0], [0, 1, 0], [0, 0, -1]]\n"), s_with("axes = \"+y +x +z\"\n"),
      s_with("axes = \"+x +x +z\"\n"), s_with("axes = [[1, 0, 0], [0, 1, 1e-3], [0, 0, 1]]\n"),
      s_with("axes = [[1.000001, 0, 0], [0, 1, 0], [0, 0, 1]]\n"),
      s_with("axes = [[1, 1.5e-6, 0], [0, 1, 0], [0, 0, 1]]\n"),
      s_with("axes = [[1, 0, 0], [0, 0, 1], [0, 1, 0]]\n"),
      s_with("axes = [[0, 0, 1], [0, 1, 0], [1, 0, 0]]\n"), s_with("axes = [[1], [0, 1, 0], [0, 0, 1]]\n"),
      // Transports.
      s_with("transport = 1\n"), s_with("transport = { kind = \"usb\" }\n"),
      s_with("transport = { kind = \"serial\" }\n"), s_with("transport = { kind = \"tcp\", port = 1 }\n"),
      s_with("transport = { kind = \"tcp\", host = \"h\" }\n"), s_with("transport = { kind = \"udp\" }\n"),
      s_with("transport = { kind = \"can\" }\n"), s_with("transport = { kind = \"pps\" }\n"),
      s_with("transport = { kind = \"pps\", port = \"p\" }\n"),
      s_with("transport = { kind = \"tcp\", host = \"h\", port = 0 }\n"),
      s_with("transport = { kind = \"tcp\", host = \"h\", port = 65536 }\n"),
      s_with("transport = { kind = \"serial\", port = \"/dev/a\", baud = 49 }\n"),
      s_with("transport = { kind = \"serial\", port = \"/dev/a\", baud = 4000001 }\n"),
      s_with("transport = { kind = \"serial\", port = \"/dev/a\", stop_bits = 3 }\n"),
      s_with("transport = { kind = \"serial\", port = \"/dev/a\", stop_bits = 1.5 }\n"),
      s_with("transport = { kind = \"serial\", port = \"/dev/a\", bauds = 1 }\n"),
      kTwo + device("b", "study", "mcap", "transport = { kind = \"tcp\", host = \"h\", port = 1 }\n"),
      s_with(serial) + s2 + serial, s_with("bus_id = 1\n" + serial) + s2 + serial,
      s_with(serial) + s2 + "bus_id = 2\n" + serial,
      s_with("bus_id = 2\n" + serial) + s2 + "bus_id = 2\n" + serial,
      // XSens.
      s_with("bus_id = 0\n"), s_with("bus_id = 11\n"), s_with("device_id = \"0030\"\n"),
      s_with("device_id = \"0030XA2B\"\n"), s_with("device_id = \"0030A2B1F\"\n"),
      s_with("bus_id = 1\ndevice_id = \"00300A2B\"\n"), s_with("sync_in = {}\n"),
      s_with("sync_in = { mode = 65536 }\n"), s_with("sync_in = { mode = 1, skip = -1 }\n"),
      s_with("sync_in = { mode = 1, offset_33_9ns = 4294967296.0 }\n"),
      s_with("sync_in = { mode = 1, delay = 1 }\n"), s_with("average_samples = 51\n"),
      s_with("average_samples = -1\n"), s_with("rate_hz = 2000.1\n"), s_with("rate_hz = nan\n"),
      // Noise.
      s_with("[device.noise]\ngyro_white_sd_degps = 1.0\ngyro_white_deg_per_sqrt_h = 1.0\n"),
      s_with("[device.noise]\naccel_white_sd_mps2 = 1.0\naccel_white_ug_per_sqrt_hz = 1.0\n"),
      s_with("[device.noise]\ngyro_bias_sd_degps = 1.0\ngyro_bias_sd_deg_per_h = 1.0\n"),
      s_with("[device.noise]\nx = 1\n"), s_with("[device.prior]\nlever_arm_b_m = [1, 2]\n"),
      s_with("[device.prior]\nlever_arm_b_m = [1, 2.0, 3]\n"),
      s_with("[device.prior]\nlever_arm_b_m = \"1\"\n"),
      s_with("[device.prior]\nlever_arm_b_m = [\"1\", \"2\", \"3\"]\n"),
      s_with("[device.prior]\ntime_offset_ms = \"1\"\n"), s_with("[device.data_sheet]\nbias_time = 1\n"),
      s_with("[device.csv]\nclock = \"own\"\n"),
      kTwo + device("d", "study", "csv_imu", "[device.csv]\ngyro_columns = [\"a\", \"b\"]\n"),
      kTwo + device("d", "study", "csv_imu", "[device.csv]\ngyro_columns = [\"a\", \"b\", 1]\n"),
      kTwo + device("d", "study", "csv_imu", "[device.csv]\ngyro_columns = \"a\"\n"),
      kTwo + device("d", "study", "csv_imu", "[device.csv]\ngyro_columns = [\"a\", \"b\", \"\\u0001\"]\n"),
      kTwo + device("d", "study", "csv_imu", "[device.csv]\ngyro_unit = \"rpm\"\n"),
      kTwo + device("d", "study", "csv_imu", "[device.csv]\ngyro_unit = 1\n"),
      kTwo + device("d", "study", "mcap", "[device.messages]\nvelocity_topic = \"/v\"\n"),
      gnss("geoid_separation_m = 201\n"), gnss("geoid_separation_m = 1\n", "ubx"),
      gnss("base_lat_lon_height = [1.0, 2.0, 3.0]\n"), gnss("clock = \"common\"\n"),
      gnss("base_lat_lon_height = 1\n", "rtklib_pos"), kTwo + device("w", "odometry", "can_odometry"),
      kTwo + device("w", "odometry", "can_odometry", "[device.odometry]\nspeed = true\n"),
      kTwo + device("w", "odometry", "can_odometry",
                    "[device.odometry]\ndbc = \"a.dbc\"\nspeed_signals = [\"A.B\"]\n"),
      kTwo + device("w", "odometry", "can_odometry",
                    "[device.odometry]\ndbc = \"a.dbc\"\nspeed_signals = [1]\n"),
      kTwo + device("w", "odometry", "can_odometry",
                    "[device.odometry]\ndbc = \"a.dbc\"\nspeed_signals = \"A.B\"\n"),
      kTwo + device("w", "odometry", "can_odometry",
                    "[device.odometry]\ndbc = \"a.dbc\"\ninvalid_raw = [\"1\"]\n"),
      kTwo + device("w", "odometry", "can_odometry", "[device.odometry]\ndbc = \"a.dbc\"\ninvalid_raw = 1\n"),
      kTwo + device("w", "odometry", "mcap", "[device.odometry]\ndbc = \"a.dbc\"\n"),
      kTwo +
          device(
              "w", "odometry", "can_odometry",
              "[device.odometry]\ndbc = \"a.dbc\"\nspeed_signals = [\"A.B\"]\n[attached]\n\"a.dbc\" = \"BO_ x\"\n"),
      kTwo +
          device(
              "w", "odometry", "can_odometry",
              "[device.odometry]\ndbc = \"a.dbc\"\nspeed_signals = [\"A.B\"]\n[attached]\n\"a.dbc\" = \"BO_ 1 A: 8 E\"\n"),
      kTwo + device("c", "study", "xsens_can", "[device.xsens_can]\nids = { error = \"800\" }\n"),
      kTwo + device("c", "study", "xsens_can", "[device.xsens_can]\nids = { error = \"20000000\" }\n"),
      kTwo + device("c", "study", "xsens_can", "[device.xsens_can]\nids = { error = \"00G\" }\n"),
      kTwo + device("c", "study", "xsens_can", "[device.xsens_can]\nids = { error = \"0\" }\n"),
      kTwo + device("c", "study", "xsens_can", "[device.xsens_can]\nid = {}\n"),
      s_with("[attached]\na = 1\n"),
      // Options.
      before("run = 1"), before("[run]\nnam = \"a\""), before("[run]\nname = 1"),
      before("[estimator]\nstates = \"six\""), before("[estimator]\ndifferentiator_points = 6"),
      before("[estimator]\ndifferentiator_points = 4"), before("[estimator]\ndifferentiator_points = 12"),
      before("[estimator]\ndifferentiator_points = 5.5"), before("[estimator]\nnavigation = 1"),
      before("[noise]\nrefit_interval_s = 0.9"), before("[lcm]\nbridge = \"yes\""), before("[lcm]\nport = 1"),
      before("[regimes]\nbins = 1"), before("[regimes]\nbins = 11"), before("[regimes]\nbegin = 1"),
      before("[error_process]\nlow_pass_hz = 40.1"),
      before("[error_process]\nlow_pass_hz = 4.1") + "rate_hz = 10.0\n",
      before("[error_process]\nhigh_pass_hz = 4"), before("[record]\nsync_s = 0.05"),
      before("[record]\nfolders = \"a\""), before("[metrics]\nport = 65536"), before("[metrics]\nport = -1"),
      before("[metrics]\naddress = \"localhost\""), before("[metrics]\nadress = \"::1\""),
      before("[threads]\nio_cores = [1024]"), before("[threads]\nio_cores = [-1]"),
      before("[threads]\nestimator_cores = [1.5]"), before("[threads]\nio_cores = 1"),
      before("[threads]\ncores = [1]"), virtual_imu(""), virtual_imu("imus = [\"s\"]"),
      virtual_imu("imus = [\"s\", \"s\"]"), virtual_imu("imus = [\"s\", \"r\"]"),
      virtual_imu("imus = [\"s\", \"s2\"]\ngyro_x = [1.0]"),
      virtual_imu("imus = [\"s\", \"s2\"]\naccel_z = [0.5, 0.5101]"),
      virtual_imu("imus = [\"s\", \"s2\"]\naccel_z = [0.5, 0.4899]"),
      virtual_imu("imus = [\"s\", \"s2\"]\naccel_z = [0.5, \"a\"]"),
      virtual_imu("imus = [\"s\", \"s2\"]\nweights = [1.0]"), virtual_imu("imus = [1, 2]")};
  return all;
}

TEST(WholeConfiguration, WhatItMayNotSayIsToldWithItsPlaceAndARemedy) {
  std::string text;
  for (const std::string& document : refused_documents()) {
    const auto read = parse_configuration(document, "car.toml");
    text += read ? "accepted:\n" + document
                 : fmt::format("{} ({})\n", read.error().text(), static_cast<int>(read.error().kind));
  }
  test::expect_recorded("configuration/refused.txt", text);
}

TEST(WholeConfiguration, ValuesAtTheirLimitsAreAccepted) {
  const std::vector<std::string> documents{
      std::string(
          "[regimes]\nbins = 2\nblock_s = 1.0\nwindow_s = 2.0\n[error_process]\nlow_pass_hz = 40.0\n") +
          kTwo,
      std::string(
          "[regimes]\nbins = 10\nguard_s = 0.0\nmotion_speed_mps = 100.0\n[estimator]\ndifferentiator_points = 11\n") +
          kTwo,
      std::string("[error_process]\nlow_pass_hz = 0.8\n") + kTwo + "rate_hz = 2.0\n",
      std::string("[estimator]\ndifferentiator_points = 5\n[metrics]\nport = 65535\naddress = \"::1\"\n") +
          kTwo,
      std::string("[threads]\nio_cores = [0, 1023]\n") + kTwo,
      std::string(kTwo) + "rate_hz = 0.1\nbus_id = 1\naverage_samples = 50\n",
      std::string(kTwo) + "rate_hz = 2000\nbus_id = 10\n",
      std::string(kTwo) + "axes = [[1, 0.9e-6, 0], [0, 1, 0], [0, 0, 1]]\n",
      std::string(kTwo) + "axes = \"+y +z +x\"\n",
      std::string(kTwo) + "axes = \"-z -x +y\"\n",
      std::string(kTwo) + "sync_in = { mode = 65535, skip = 65535 }\n",
      std::string(kTwo) + "transport = { kind = \"serial\", port = \"p\", baud = 4000000 }\n",
      std::string(kTwo) + "transport = { kind = \"serial\", port = \"p\", baud = 50 }\n",
      std::string(kTwo) + device("s2", "study", "xsens_mt") +
          "[virtual_imu]\nimus = [\"s\", \"s2\"]\naccel_z = [0.5, 0.5099]\n"
          "gyro_x = [0.5, 0.4901]\n",
      std::string(kTwo) + device("s2", "study", "xsens_mt") + device("s3", "study", "xsens_mt") +
          device("s4", "study", "xsens_mt") + device("s5", "study", "xsens_mt") +
          device("s6", "study", "xsens_mt")};
  for (const std::string& document : documents) {
    const auto read = parse_configuration(document, "car.toml");
    EXPECT_TRUE(read) << document << read.error().text();
  }
}

TEST(WholeConfiguration, DevicesOfOneLineHaveTheFirstOnesSettingsAndTheirOwnOwner) {
  const std::string a = "transport = { kind = \"serial\", port = \"/dev/a\", baud = 9600 }\n";
  const std::string b = "transport = { kind = \"serial\", port = \"/dev/b\" }\n";
  const std::string text =
      whole_text(device("r", "reference", "xsens_mt", "bus_id = 1\n" + a) +
                 device("s1", "study", "xsens_mt", "bus_id = 2\n" + b) +
                 device("s2", "study", "xsens_mt", "bus_id = 4\n" + a) +
                 device("s3", "study", "xsens_mt", "bus_id = 7\n" + b) +
                 device("s4", "study", "xsens_mt", "bus_id = 3\n" + a) + device("s5", "study", "csv_imu"));
  test::expect_recorded("configuration/lines.txt", text);
}

std::string key_of(std::size_t words) {
  std::string key = "a";
  for (std::size_t i = 1; i < words; ++i) key += ".a";
  return key;
}

TEST(WholeConfiguration, AKeyHasAtMostSoManyWords) {
  const std::string most = key_of(kTomlDepthMax);
  const std::string more = key_of(kTomlDepthMax + 1);
  for (const std::string_view start :
       {"", "x = 1\n", "x = 'a.b\n", "x = '\\'\n", "x = \"\\\"\"\n", "x = \"\"\n", "x = ''\n",
        "x = '''a'b\n''' # .\n", "x = \"\"\"a\\\"\"\"\"\n", "# a.a.a 'a\n", "\"a.b\" = 1\n", "[a]\n", "x = {",
        "x = [", "x = 1,", "a = "}) {
    EXPECT_FALSE(has_key_too_deep(std::string(start) + most)) << start;
    EXPECT_TRUE(has_key_too_deep(std::string(start) + more)) << start;
  }
  for (const std::string_view hidden : {"# ", "x = \"", "x = '", "x = '''\n", "x = \"\"\"\n'", "x = \"\\\""})
    EXPECT_FALSE(has_key_too_deep(std::string(hidden) + more)) << hidden;
  // Dots of several keys do not add up; those around strings do.
  EXPECT_FALSE(has_key_too_deep(most + " = 1\n" + most + " = {" + most + " = [" + most + "]}," + most));
  EXPECT_TRUE(has_key_too_deep(key_of(kTomlDepthMax - 1) + ".\"b.c\".'d'"));
  EXPECT_FALSE(has_key_too_deep(""));
  EXPECT_FALSE(has_key_too_deep("\""));
}

TEST(WholeConfiguration, ATextThatIsOneLineOfTheLongestIsAccepted) {
  const auto named = [](std::size_t length) {
    return "[run]\nname = \"" + std::string(length, 'x') + "\"\n" + kTwo;
  };
  EXPECT_TRUE(parse_configuration(named(kLineMax), "x.toml"));
  EXPECT_FALSE(parse_configuration(named(kLineMax + 1), "x.toml"));
}

TEST(WholeConfiguration, FilesAreAttachedInQuotesThatTomlReadsBack) {
  const auto folder = test::scratch_folder();
  const std::string name = "a\"b\\c.dbc";
  std::ofstream(folder / name) << "BO_ 170 REAR: 8 ECU\n SG_ RL : 7|16@0- (0.01,0) [0|0] \"km/h\" X\n"
                                  "CM_ \"tab\tand \x01\x1F \x7F ~\";\n";
  const std::string toml =
      std::string(kTwo) + device("w", "odometry", "can_odometry",
                                 "[device.odometry]\ndbc = 'a\"b\\c.dbc'\nspeed_signals = [\"REAR.RL\"]\n");
  std::ofstream(folder / "car.toml") << toml;
  const auto read = load_configuration(folder / "car.toml");
  ASSERT_TRUE(read) << read.error().text();
  EXPECT_EQ(
      read->text,
      toml +
          "\n[attached]\n\"a\\\"b\\\\c.dbc\" = \"BO_ 170 REAR: 8 ECU\\u000A SG_ RL : 7|16@0- "
          "(0.01,0) [0|0] \\\"km/h\\\" X\\u000ACM_ \\\"tab\\u0009and \\u0001\\u001F \\u007F ~\\\";\\u000A\"\n");
  const auto again = parse_configuration(read->text, "car.toml");
  ASSERT_TRUE(again) << again.error().text();
  EXPECT_EQ(again->text, read->text) << "what is attached already is not attached again";
}

}  // namespace
}  // namespace imuscope
