#include "configuration/config_devices.h"

#include <fmt/format.h>
#include <algorithm>
#include <charconv>
#include <cmath>
#include <set>

#include "base/limits.h"
#include "base/text.h"
#include "base/units.h"
#include "configuration/config_vehicle.h"
#include "configuration/toml_reader.h"

namespace imuscope {

namespace {

constexpr std::array kRoleNames{std::string_view("reference"), std::string_view("study"),
                                std::string_view("gnss"), std::string_view("odometry"),
                                std::string_view("time")};
std::vector<std::string_view> protocol_names() {
  std::vector<std::string_view> names;
  for (const ProtocolTraits& traits : kProtocols) names.push_back(traits.name);
  return names;
}

/// Those that a device of a role can have, for people.
std::string protocols_of(DeviceRole role) {
  std::vector<std::string_view> names;
  for (const ProtocolTraits& traits : kProtocols) {
    if (fits(traits.protocol, role)) names.push_back(traits.name);
  }
  const std::string_view last = names.back();
  names.pop_back();
  return names.empty() ? std::string(last) : fmt::format("{} or {}", fmt::join(names, ", "), last);
}

constexpr int kMaxAveraged = 50;
constexpr double kMaxBaud = 4'000'000.0;

template <std::size_t N>
std::vector<std::string_view> words(const std::array<std::string_view, N>& names) {
  return {names.begin(), names.end()};
}

/// White noise can be given per sample or as a density; not both.
void read_white(TomlReader& in, std::optional<double>& sd, std::string_view per_sample_key,
                double per_sample_unit, std::string_view density_key, double density_unit, double rate_hz) {
  if (in.has(per_sample_key) && in.has(density_key)) {
    in.fail(density_key, fmt::format("says again what {} says", per_sample_key), "keep one of the two");
  }
  in.number(per_sample_key, sd, per_sample_unit, 0.0, 1e6);
  std::optional<double> density;
  in.number(density_key, density, density_unit * std::sqrt(rate_hz), 0.0, 1e9);
  if (density) sd = density;
}

void read_noise(TomlReader in, double rate_hz, ImuNoiseConfig& noise) {
  read_white(in, noise.gyro_white_sd_radps, "gyro_white_sd_degps", kRadPerDeg, "gyro_white_deg_per_sqrt_h",
             kRadPerDeg / 60.0, rate_hz);
  read_white(in, noise.accel_white_sd_mps2, "accel_white_sd_mps2", 1.0, "accel_white_ug_per_sqrt_hz",
             kMps2PerMicroG, rate_hz);
  in.number("gyro_white_sd_static_degps", noise.gyro_white_sd_static_radps, kRadPerDeg, 0.0, 1e6);
  in.number("accel_white_sd_static_mps2", noise.accel_white_sd_static_mps2, 1.0, 0.0, 1e6);
  if (in.has("gyro_bias_sd_degps") && in.has("gyro_bias_sd_deg_per_h")) {
    in.fail("gyro_bias_sd_deg_per_h", "says again what gyro_bias_sd_degps says", "keep one of the two");
  }
  in.number("gyro_bias_sd_degps", noise.gyro_bias_sd_radps, kRadPerDeg, 0.0, 1e3);
  in.number("gyro_bias_sd_deg_per_h", noise.gyro_bias_sd_radps, kRadPerDeg / kSecondsPerHour, 0.0, 1e6);
  in.number("accel_bias_sd_mps2", noise.accel_bias_sd_mps2, 1.0, 0.0, 100.0);
  in.number("gyro_gm_sd_degps", noise.gyro_gm_sd_radps, kRadPerDeg, 0.0, 1e3);
  in.number("gyro_gm_tau_s", noise.gyro_gm_tau_s, 1.0, 1e-3, 1e7);
  in.number("accel_gm_sd_mps2", noise.accel_gm_sd_mps2, 1.0, 0.0, 100.0);
  in.number("accel_gm_tau_s", noise.accel_gm_tau_s, 1.0, 1e-3, 1e7);
  in.number("gyro_scale_sd_percent", noise.gyro_scale_sd, 0.01, 0.0, 50.0);
  in.number("accel_scale_sd_percent", noise.accel_scale_sd, 0.01, 0.0, 50.0);
  in.finish();
}

/// Of devices that are one make: "MTi and MTx User Manual", MT0100P revision N, section 4.4, gyroscopes of
/// 1200 deg/s, which are the MTx's default (those of 300 deg/s have half the density); MTi 600-series data
/// sheet, MT1603P, MTi-630, accelerometer z.
DataSheetConfig default_data_sheet(Protocol protocol) {
  DataSheetConfig sheet;
  if (protocol == Protocol::kXsensMt) {
    sheet.gyro_density_radps_per_sqrt_hz = 0.1 * kRadPerDeg;
    sheet.gyro_bias_stability_radps = 1.0 * kRadPerDeg;
    sheet.accel_density_mps2_per_sqrt_hz = 0.002;
    sheet.accel_bias_stability_mps2 = 0.02;
  }
  if (protocol == Protocol::kXsensCan) {
    sheet.gyro_density_radps_per_sqrt_hz = 0.007 * kRadPerDeg;
    sheet.gyro_bias_stability_radps = 8.0 * kRadPerDeg / kSecondsPerHour;
    sheet.accel_density_mps2_per_sqrt_hz = 60.0 * kMps2PerMicroG;
    sheet.accel_bias_stability_mps2 = 15.0 * kMps2PerMicroG;
  }
  return sheet;
}

void read_data_sheet(TomlReader in, DataSheetConfig& sheet) {
  in.number("gyro_density_degps_per_sqrt_hz", sheet.gyro_density_radps_per_sqrt_hz, kRadPerDeg, 1e-9, 1e3);
  in.number("gyro_bias_stability_deg_per_h", sheet.gyro_bias_stability_radps, kRadPerDeg / kSecondsPerHour,
            0.0, 1e6);
  in.number("accel_density_ug_per_sqrt_hz", sheet.accel_density_mps2_per_sqrt_hz, kMps2PerMicroG, 1e-6, 1e7);
  in.number("accel_bias_stability_ug", sheet.accel_bias_stability_mps2, kMps2PerMicroG, 0.0, 1e7);
  in.number("bias_time_s", sheet.bias_time_s, 1.0, 1e-3, 1e7);
  in.finish();
}

std::array<double, 9> rotation_from_vector(const Vector3& rotation_rad) {
  const double angle = std::sqrt(rotation_rad[0] * rotation_rad[0] + rotation_rad[1] * rotation_rad[1] +
                                 rotation_rad[2] * rotation_rad[2]);
  if (angle == 0.0) return {1, 0, 0, 0, 1, 0, 0, 0, 1};
  const double x = rotation_rad[0] / angle;
  const double y = rotation_rad[1] / angle;
  const double z = rotation_rad[2] / angle;
  const double c = std::cos(angle);
  const double s = std::sin(angle);
  const double v = 1.0 - c;
  return {c + x * x * v,     x * y * v - z * s, x * z * v + y * s, y * x * v + z * s, c + y * y * v,
          y * z * v - x * s, z * x * v - y * s, z * y * v + x * s, c + z * z * v};
}

void read_prior(TomlReader in, MountingPriorConfig& prior) {
  Vector3 rotation_rad{};
  in.vector("rotation_vector_b_s_deg", rotation_rad, kRadPerDeg);
  if (in.has("rotation_vector_b_s_deg")) prior.C_b_s = rotation_from_vector(rotation_rad);
  in.number("boresight_sd_deg", prior.boresight_sd_rad, kRadPerDeg, 1e-6, 180.0);
  in.vector("lever_arm_b_m", prior.r_bs_b_m, 1.0);
  in.number("lever_arm_sd_m", prior.lever_arm_sd_m, 1.0, 1e-6, 100.0);
  double offset_s = 0.0;
  in.number("time_offset_ms", offset_s, 1e-3, -1e6, 1e6);
  if (in.has("time_offset_ms")) prior.time_offset_s = offset_s;
  in.number("time_offset_sd_ms", prior.time_offset_sd_s, 1e-3, 1e-6, 1e6);
  in.number("accel_boresight_sd_deg", prior.accel_boresight_sd_rad, kRadPerDeg, 1e-6, 180.0);
  in.number("accel_time_offset_sd_ms", prior.accel_time_offset_sd_s, 1e-3, 1e-6, 1e3);
  in.number("mount_creep_deg_per_sqrt_h", prior.creep_rad_per_sqrt_s, kRadPerDeg / std::sqrt(kSecondsPerHour),
            0.0, 1e3);
  in.finish();
}

void read_csv(TomlReader in, CsvConfig& csv) {
  in.text("time_column", csv.time_column);
  in.number("time_unit_s", csv.time_unit_s, 1.0, 1e-12, 1e6);
  in.number("time_offset_s", csv.time_offset_s, 1.0, -1e9, 1e9);
  in.texts("gyro_columns", csv.gyro_columns);
  in.texts("accel_columns", csv.accel_columns);
  csv.gyro_in_degps = in.choice("gyro_unit", {"rad/s", "deg/s"}, 0) == 1;
  csv.accel_in_g = in.choice("accel_unit", {"m/s2", "g"}, 0) == 1;
  in.text("counter_column", csv.counter_column);
  in.text("latitude_column", csv.latitude_column);
  in.text("longitude_column", csv.longitude_column);
  in.text("height_column", csv.height_column);
  in.texts("velocity_columns", csv.velocity_columns);
  in.texts("position_sd_columns", csv.position_sd_columns);
  csv.common_clock = in.choice("clock", {"common", "own"}, 0) == 0;
  in.finish();
}

void read_messages(TomlReader in, DeviceRole role, MessagesConfig& messages) {
  in.text("topic", messages.topic);
  if (role == DeviceRole::kGnss) in.text("velocity_topic", messages.velocity_topic);
  in.text("frame_id", messages.frame_id);
  messages.time = static_cast<MessageTime>(in.choice("time", {"header", "log", "publish"}, 0));
  in.boolean("times_are_utc", messages.times_are_utc);
  messages.common_clock = in.choice("clock", {"common", "own"}, 0) == 0;
  in.finish();
}

/// Samples per second where the configuration gives none.
double default_rate_hz(Protocol protocol, DeviceRole role) {
  if (!is_message_log(protocol)) return traits_of(protocol).rate_hz;
  // Those of the devices that have the role by their protocol.
  switch (role) {
    case DeviceRole::kGnss:
      return traits_of(Protocol::kCsvGnss).rate_hz;
    case DeviceRole::kOdometry:
      return traits_of(Protocol::kCanOdometry).rate_hz;
    case DeviceRole::kTime:
      return traits_of(Protocol::kPps).rate_hz;
    default:
      return traits_of(protocol).rate_hz;
  }
}

/// A permutation of axes as the configuration writes it.
std::string axes_text(const std::array<double, 9>& axes) {
  std::string text = "\"";
  for (std::size_t i = 0; i < axes.size(); ++i) {
    if (axes[i] == 0.0) continue;
    if (text.size() > 1) text += ' ';
    text += axes[i] > 0.0 ? '+' : '-';
    text += static_cast<char>('x' + static_cast<char>(i % 3));
  }
  return text + '"';
}

/// "+x -y -z" or three rows of three numbers.
void read_axes(TomlReader& in, std::array<double, 9>& axes) {
  const auto* node = in.node("axes", "three signed axes, or three rows of three numbers", axes_text(axes));
  if (node == nullptr) return;
  std::array<double, 9> read{};
  bool good = false;
  if (const auto text = node->value_exact<std::string>()) {
    std::istringstream words(*text);
    std::string word;
    std::size_t row = 0;
    for (; words >> word; ++row) {
      const bool shape =
          word.size() == 2 && (word[0] == '+' || word[0] == '-') && word[1] >= 'x' && word[1] <= 'z';
      if (!shape || row > 2) break;
      read[3 * row + static_cast<std::size_t>(word[1] - 'x')] = word[0] == '+' ? 1.0 : -1.0;
    }
    good = row == 3 && words.fail();  // no fourth word
  } else if (const auto* rows = node->as_array(); rows != nullptr && rows->size() == 3) {
    good = true;
    for (std::size_t i = 0; i < 3 && good; ++i) {
      const auto* row = (*rows)[i].as_array();
      good = row != nullptr && row->size() == 3;
      for (std::size_t j = 0; j < 3 && good; ++j) {
        const auto value = (*row)[j].is_number() ? (*row)[j].value<double>() : std::nullopt;
        good = value.has_value();
        if (good) read[3 * i + j] = *value;
      }
    }
  }
  if (!good) {
    in.fail("axes", "is neither three signed axes nor three rows of three numbers",
            "write for example \"+x -y -z\"");
    return;
  }
  constexpr double kOrthonormal = 1e-6;
  for (std::size_t i = 0; i < 3; ++i) {
    for (std::size_t j = 0; j < 3; ++j) {
      double dot = 0.0;
      for (std::size_t k = 0; k < 3; ++k) dot += read[3 * i + k] * read[3 * j + k];
      if (std::abs(dot - (i == j ? 1.0 : 0.0)) > kOrthonormal) good = false;
    }
  }
  const double determinant = read[0] * (read[4] * read[8] - read[5] * read[7]) -
                             read[1] * (read[3] * read[8] - read[5] * read[6]) +
                             read[2] * (read[3] * read[7] - read[4] * read[6]);
  if (!good || determinant < 0.0) {
    in.fail("axes", "is not a rotation", "its rows must be orthogonal unit axes of a right-handed frame");
    return;
  }
  axes = read;
}

constexpr std::array kTransportKinds{std::string_view("serial"), std::string_view("tcp"),
                                     std::string_view("udp"), std::string_view("can"),
                                     std::string_view("pps")};

void read_serial(TomlReader& in, DeviceConfig& device) {
  SerialConfig config;
  in.text("port", config.port);
  in.require("port", "give the device's path, such as /dev/serial/by-id/...");
  double baud = config.baud;
  in.number("baud", baud, 1.0, 50.0, kMaxBaud);
  config.baud = static_cast<std::uint32_t>(baud);
  in.integer("stop_bits", config.stop_bits, 1, 2);
  device.serial = config;
}

void read_can(TomlReader& in, DeviceConfig& device) {
  CanConfig config;
  in.text("interface", config.interface);
  in.require("interface", "give the CAN interface, such as can0");
  config.log_has_common_clock = in.choice("log_clock", {"utc", "common"}, 0) == 1;
  device.can = config;
}

void read_pps(TomlReader& in, DeviceConfig& device) {
  PpsConfig config;
  in.text("port", config.port);
  in.require("port", "give the device's path, such as /dev/pps0");
  config.clear_edge = in.choice("edge", {"assert", "clear"}, 0) == 1;
  device.pps = config;
}

void read_net(TomlReader& in, bool udp, DeviceConfig& device) {
  constexpr int kMaxPort = 65535;
  NetConfig config;
  config.udp = udp;
  in.text("host", config.host);
  if (!udp) in.require("host", "give the name or address of the server");
  int port = 0;
  in.integer("port", port, 1, kMaxPort);
  in.require("port", udp ? "give the port that datagrams are sent to" : "give the server's port");
  config.port = static_cast<std::uint16_t>(port);
  device.net = config;
}

void read_transport(TomlReader in, DeviceConfig& device) {
  if (!in.present()) return;
  switch (in.choice("kind", words(kTransportKinds), 0)) {
    case 0:
      read_serial(in, device);
      break;
    case 1:
      read_net(in, false, device);
      break;
    case 2:
      read_net(in, true, device);
      break;
    case 3:
      read_can(in, device);
      break;
    default:
      read_pps(in, device);
      break;
  }
  if (is_message_log(device.protocol))
    in.fail("kind", fmt::format("is given for {}", name_of(device.protocol)),
            "such messages are read from a file alone");
  if (device.pps.has_value() != (device.protocol == Protocol::kPps)) {
    in.fail("kind", fmt::format("does not carry {}", name_of(device.protocol)),
            "kind = \"pps\" is for protocol pps, which has no other");
  }
  in.finish();
}

/// Eight hexadecimal digits, as the device's label and `imuscope probe` have them.
void read_device_id(TomlReader& in, XsensConfig& xsens) {
  constexpr std::size_t kDigits = 8;
  constexpr int kHexadecimal = 16;
  std::string text;
  in.text("device_id", text);
  if (text.empty()) return;
  std::uint32_t id = 0;
  const char* const text_end = text.data() + text.size();
  const auto [end, error] = std::from_chars(text.data(), text_end, id, kHexadecimal);
  if (error != std::errc{} || end != text_end || text.size() != kDigits) {
    in.fail("device_id", "must be eight hexadecimal digits, such as \"00300A2B\"",
            "the device's label and imuscope probe show them");
  }
  if (xsens.bus_id > 0) {
    in.fail("device_id", "is for a device that has its line for itself",
            "devices behind an Xbus Master are told apart by their bus_id");
  }
  xsens.device_id = id;
}

void read_xsens(TomlReader& in, XsensConfig& xsens) {
  constexpr int kMaxBusId = 10;
  in.integer("bus_id", xsens.bus_id, 1, kMaxBusId);
  read_device_id(in, xsens);
  auto sync = in.table("sync_in");
  if (!sync.present()) return;
  constexpr int kMax16 = 65535;
  constexpr double kMax32 = 4294967295.0;
  int mode = 0;
  int skip = 0;
  double offset = 0.0;
  sync.require("mode",
               "edge (1 rising, 2 falling, 3 both) plus 0 to sample, 4 to send the latest, 16 to keep time");
  sync.integer("mode", mode, 0, kMax16);
  sync.integer("skip", skip, 0, kMax16);
  sync.number("offset_33_9ns", offset, 1.0, 0.0, kMax32);
  sync.finish();
  xsens.sync_in = {static_cast<std::uint16_t>(mode), static_cast<std::uint16_t>(skip),
                   static_cast<std::uint32_t>(offset)};
}

void check_name(TomlReader& in, const std::string& name) {
  if (!is_device_name(name))
    in.fail("name", "must be 1 to 32 letters, digits, '_' or '-'", "it becomes part of file names");
}

void read_rtklib(TomlReader& in, GnssOptions& gnss) {
  gnss.common_clock = in.choice("clock", {"utc", "common"}, 0) == 1;
  if (!in.has("base_lat_lon_height")) return;
  gnss.base_lat_lon_height.emplace();
  in.vector("base_lat_lon_height", *gnss.base_lat_lon_height, 1.0);
}

DeviceConfig read_device(TomlReader in, AttachedFiles& files) {
  DeviceConfig device;
  in.require("name", "every [[device]] needs a name of its own");
  in.text("name", device.name);
  if (in.has("name")) check_name(in, device.name);
  in.require("role", fmt::format("valid: {}", fmt::join(kRoleNames, ", ")));
  device.role = static_cast<DeviceRole>(in.choice("role", words(kRoleNames), 0));
  in.require("protocol", fmt::format("valid: {}", fmt::join(protocol_names(), ", ")));
  device.protocol = static_cast<Protocol>(in.choice("protocol", protocol_names(), 0));
  if (!fits(device.protocol, device.role)) {
    in.fail("protocol",
            fmt::format("{} does not fit role {}", name_of(device.protocol), name_of(device.role)),
            fmt::format("a {} device speaks {}", name_of(device.role), protocols_of(device.role)));
  }
  device.rate_hz = default_rate_hz(device.protocol, device.role);
  in.number("rate_hz", device.rate_hz, 1.0, 0.1, kMaxRate_hz);
  // The StdBin telegram is in forward-port-up axes, b is forward-right-down.
  if (device.protocol == Protocol::kIxblueStdbin) device.axes = {1, 0, 0, 0, -1, 0, 0, 0, -1};
  read_axes(in, device.axes);
  read_transport(in.table("transport"), device);
  if (device.protocol == Protocol::kXsensMt) read_xsens(in, device.xsens);
  read_noise(in.table("noise"), device.rate_hz, device.noise);
  read_prior(in.table("prior"), device.prior);
  if (device.role == DeviceRole::kStudy) {
    in.integer("average_samples", device.average_samples, 0, kMaxAveraged);
    device.data_sheet = default_data_sheet(device.protocol);
    read_data_sheet(in.table("data_sheet"), device.data_sheet);
  }
  if (traits_of(device.protocol).is_text) read_csv(in.table("csv"), device.csv);
  if (is_message_log(device.protocol)) read_messages(in.table("messages"), device.role, device.messages);
  if (device.role == DeviceRole::kGnss) {
    device.gnss.position_sd_m = {0.02, 0.02, 0.04};
    device.gnss.velocity_sd_mps = {0.05, 0.05, 0.10};
    device.gnss.position_sd_floor_m = 0.005;
    device.gnss.velocity_sd_floor_mps = 0.01;
    in.vector("antenna_lever_arm_b_m", device.gnss.antenna_lever_arm_b_m, 1.0);
    in.number("antenna_lever_arm_sd_m", device.gnss.antenna_lever_arm_sd_m, 1.0, 0.0, 10.0);
    in.vector("position_sd_m", device.gnss.position_sd_m, 1.0);
    in.vector("velocity_sd_mps", device.gnss.velocity_sd_mps, 1.0);
    in.number("position_sd_floor_m", device.gnss.position_sd_floor_m, 1.0, 0.0, 1e3);
    in.number("velocity_sd_floor_mps", device.gnss.velocity_sd_floor_mps, 1.0, 0.0, 1e3);
    in.number("latency_ms", device.gnss.latency_s, 1e-3, 0.0, 1e4);
    if (device.protocol == Protocol::kRtklibPos) read_rtklib(in, device.gnss);
    // A recorder made one clock of both devices' times. Where it did not, a consumer IMU whose accelerometers
    // are late, or that a running engine shakes, would tell a wrong latency and be sure of it.
    if (traits_of(device.protocol).is_text || device.gnss.common_clock) device.gnss.latency_sd_s = 0.0;
    in.number("latency_sd_ms", device.gnss.latency_sd_s, 1e-3, 0.0, 1e4);
    if (device.protocol == Protocol::kNmea)
      in.number("geoid_separation_m", device.gnss.geoid_separation_m, 1.0, -200.0, 200.0);
  }
  if (device.protocol == Protocol::kCanOdometry)
    read_odometry(in.table("odometry"), files, device.odometry);
  else if (device.role == DeviceRole::kOdometry)
    read_odometry_filter(in.table("odometry"), device.odometry);
  if (device.protocol == Protocol::kXsensCan) read_xsens_can(in.table("xsens_can"), device.xsens_can_ids);
  in.finish();
  return device;
}

/// Devices on one serial port: behind an Xbus Master, each with its bus id, and the first one's settings
/// hold.
void share_lines(TomlReader& root, std::vector<DeviceConfig>& devices) {
  for (std::size_t i = 0; i < devices.size(); ++i) devices[i].line_owner = i;
  for (std::size_t i = 0; i < devices.size(); ++i) {
    auto& device = devices[i];
    if (!device.serial) continue;
    for (std::size_t j = 0; j < i; ++j) {
      const auto& other = devices[j];
      if (other.line_owner != j || !other.serial || other.serial->port != device.serial->port) continue;
      if (device.xsens.bus_id == 0 || other.xsens.bus_id == 0) {
        root.fail("device",
                  fmt::format("lists '{}' and '{}' on the same port {}", other.name, device.name,
                              device.serial->port),
                  "give each a port of its own, or its bus_id where both are MTx behind an Xbus Master");
        return;
      }
      device.line_owner = j;
      device.serial = other.serial;
    }
  }
  for (const auto& owner : devices) {
    if (owner.xsens.bus_id == 0) continue;
    std::set<int> ids;
    for (auto& device : devices) {
      if (device.xsens.bus_id == 0 || devices[device.line_owner].line_owner != owner.line_owner) continue;
      if (!ids.insert(device.xsens.bus_id).second) {
        root.fail("device", fmt::format("gives bus_id {} twice on one line", device.xsens.bus_id),
                  "the bus ids of devices behind one Xbus Master differ");
        return;
      }
    }
    for (auto& device : devices) {
      if (device.line_owner == owner.line_owner) device.xsens.bus_size = *ids.rbegin();
    }
  }
}

}  // namespace

std::string_view name_of(DeviceRole role) { return kRoleNames[static_cast<std::size_t>(role)]; }

void read_devices(TomlReader& root, TomlProblem& problem, AttachedFiles& files,
                  std::vector<DeviceConfig>& devices) {
  root.require("device", "describe every device in a [[device]] table");
  const auto* list = root.array("device");
  if (list == nullptr) return;
  std::set<std::string> names;
  for (const auto& node : *list) {
    const auto* table = node.as_table();
    if (table == nullptr) {
      root.fail("device", "must be a list of tables", "write [[device]]");
      return;
    }
    TomlReader in(table, "device", problem);
    devices.push_back(read_device(in, files));
    const auto& device = devices.back();
    if (!names.insert(device.name).second) {
      in.fail("name", fmt::format("'{}' is used twice", device.name), "names must differ");
    }
  }
  share_lines(root, devices);
  const auto count = [&](DeviceRole role) {
    return std::count_if(devices.begin(), devices.end(),
                         [&](const DeviceConfig& device) { return device.role == role; });
  };
  if (count(DeviceRole::kReference) != 1) {
    root.fail("device", fmt::format("lists {} devices with role reference", count(DeviceRole::kReference)),
              "exactly one IMU is the reference");
  } else if (count(DeviceRole::kStudy) < 1 ||
             static_cast<std::size_t>(count(DeviceRole::kStudy)) > kMaxSImus) {
    root.fail("device", fmt::format("lists {} devices with role study", count(DeviceRole::kStudy)),
              fmt::format("1 to {} IMUs can be under study", kMaxSImus));
  } else if (count(DeviceRole::kGnss) > 1) {
    root.fail("device", "lists more than one gnss device", "keep the better one");
  } else if (count(DeviceRole::kOdometry) > 1) {
    root.fail("device", "lists more than one odometry device", "put all speed_signals into one");
  } else if (count(DeviceRole::kTime) > 1) {
    root.fail("device", "lists more than one time device", "keep the better one");
  }
}

}  // namespace imuscope
