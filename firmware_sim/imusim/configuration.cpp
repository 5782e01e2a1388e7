#include "firmware_sim/imusim/configuration.h"

#include <fmt/format.h>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cctype>
#include <fstream>
#include <limits>
#include <map>
#include <set>
#include <sstream>

#include "firmware_sim/imusim/table_reader.h"
#include "firmware_sim/motion/degrees.h"

namespace imusim {
namespace {

constexpr double kSecondsPerHour = 3600.0;
constexpr double kMps2PerG = 9.80665;
constexpr double kPercent = 0.01;
constexpr double kMilli = 1e-3;
constexpr double kMicro = 1e-6;
constexpr double kAnyHigh = 1e9;
/// Of a line over a network, bit/s: messages go out as they are made.
constexpr int kNetworkBaud = 100'000'000;
constexpr int kBusIdMax = 10;

/// "+x -y -z" or three rows of three numbers.
void read_axes(TableReader& in, Eigen::Matrix3d& axes) {
  const toml::node* node = in.node("axes");
  if (node == nullptr) return;
  Eigen::Matrix3d read = Eigen::Matrix3d::Zero();
  if (const auto text = node->value_exact<std::string>()) {
    std::istringstream words(*text);
    std::string word;
    Eigen::Index row = 0;
    for (; words >> word && row < 3; ++row) {
      if (word.size() != 2 || (word[0] != '+' && word[0] != '-') || word[1] < 'x' || word[1] > 'z') break;
      read(row, word[1] - 'x') = word[0] == '+' ? 1.0 : -1.0;
    }
  } else {
    in.matrix("axes", read, 1.0);
  }
  constexpr double kOrthonormal = 1e-6;
  const double departure = (read * read.transpose() - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff();
  if (departure > kOrthonormal || read.determinant() < 0.0)
    return in.fail("axes", "is not a rotation: write for example \"+x -y -z\"");
  axes = read;
}

double default_rate_hz(Role role) {
  switch (role) {
    case Role::kGnss:
      return 10.0;
    case Role::kOdometry:
      return 50.0;
    case Role::kTime:
      return 1.0;
    case Role::kReference:
    case Role::kStudy:
      break;
  }
  return 100.0;
}

bool fits(Protocol protocol, Role role) {
  switch (protocol) {
    case Protocol::kXsensMt:
    case Protocol::kIxblueStdbin:
    case Protocol::kXsensCan:
      return role == Role::kReference || role == Role::kStudy;
    case Protocol::kCanOdometry:
      return role == Role::kOdometry;
    case Protocol::kPps:
      return role == Role::kTime;
    case Protocol::kGreis:
    case Protocol::kNmea:
    case Protocol::kUbx:
    case Protocol::kRtklibPos:
      break;
  }
  return role == Role::kGnss;
}

PlayedDevice read_device(TableReader& in) {
  PlayedDevice device;
  in.text("name", device.name);
  if (device.name.empty()) in.fail("name", "needs a name");
  const bool plain = std::all_of(device.name.begin(), device.name.end(), [](unsigned char letter) {
    return std::isalnum(letter) != 0 || letter == '_' || letter == '-';
  });
  if (!plain) in.fail("name", "must consist of letters, digits, '_' and '-': it becomes a file name");
  device.role = static_cast<Role>(in.choice("role", {"reference", "study", "gnss", "odometry", "time"}, 1));
  device.protocol = static_cast<Protocol>(in.choice(
      "protocol",
      {"xsens_mt", "ixblue_stdbin", "greis", "nmea", "ubx", "rtklib_pos", "xsens_can", "can_odometry", "pps"},
      0));
  if (!fits(device.protocol, device.role))
    in.fail("protocol",
            "does not fit the role: xsens_mt, ixblue_stdbin and xsens_can are IMUs, can_odometry "
            "odometry, pps time, the others gnss");
  if (device.protocol == Protocol::kXsensCan && device.role == Role::kReference)
    in.fail("protocol", "is played for an S-IMU only");
  device.rate_hz = default_rate_hz(device.role);
  // An MT's period has at least 225 ticks of 1/115200 s; a telegram of the StdBin protocol has no such limit.
  const double fastest_hz = device.protocol == Protocol::kIxblueStdbin ? 2000.0 : 512.0;
  in.number("rate_hz", device.rate_hz, 1.0, 1.0, fastest_hz);
  if (device.protocol == Protocol::kIxblueStdbin)
    device.C_device_frame = Eigen::Vector3d(1.0, -1.0, -1.0).asDiagonal();
  read_axes(in, device.C_device_frame);
  in.vector("antenna_lever_arm_b_m", device.antenna_b_m, 1.0);
  TableReader transport = in.table("transport");
  const std::size_t kind = transport.choice("kind", {"serial", "tcp", "udp", "can", "pps"}, 0);
  if (kind == 1 || kind == 2) {
    std::int64_t port = 0;
    transport.whole("port", port, 1, std::numeric_limits<std::uint16_t>::max());
    (kind == 1 ? device.tcp_port : device.udp_port) = static_cast<std::uint16_t>(port);
    transport.text("host", device.address);
    device.baud = kNetworkBaud;
  } else {
    transport.text("port", device.port);
  }
  double baud = device.baud;
  transport.number("baud", baud, 1.0, 4800.0, 4e6);
  device.baud = static_cast<int>(baud);
  transport.text("interface", device.can_interface);
  (void)transport.choice("edge", {"assert"}, 0);
  in.table("odometry").text("dbc", device.dbc);
  std::int64_t bus_id = 0;
  in.whole("bus_id", bus_id, 1, kBusIdMax);
  device.bus_id = static_cast<int>(bus_id);
  if (device.bus_id > 0 && (device.role != Role::kStudy || device.protocol != Protocol::kXsensMt))
    in.fail("xsens", "has a bus_id: only an S-IMU with protocol = \"xsens_mt\" behind an Xbus Master");
  return device;
}

/// The devices with a bus id on one port are behind one Xbus Master; the first one's settings hold for the
/// line.
void share_lines(TableReader& root, std::vector<PlayedDevice>& devices) {
  std::map<std::string, std::vector<PlayedDevice*>> lines;
  for (PlayedDevice& device : devices) {
    if (device.bus_id > 0) lines[device.port].push_back(&device);
  }
  for (auto& [port, members] : lines) {
    std::set<int> ids;
    for (PlayedDevice* member : members) {
      ids.insert(member->bus_id);
      member->line_owner = members.front()->name;
      member->baud = members.front()->baud;
      member->rate_hz = members.front()->rate_hz;
    }
    if (ids.size() != members.size() || *ids.rbegin() != static_cast<int>(members.size()))
      root.fail("device",
                fmt::format("needs the bus ids 1 to {} on the line {}, each once", members.size(), port));
  }
}

void read_devices(TableReader& root, Configuration& configuration) {
  std::set<std::string> names;
  int references = 0;
  for (TableReader& in : root.tables("device")) {
    configuration.devices.push_back(read_device(in));
    const PlayedDevice& device = configuration.devices.back();
    if (!names.insert(device.name).second) in.fail("name", "is used by two devices");
    references += device.role == Role::kReference ? 1 : 0;
    if (references > 1) in.fail("role", "says reference, as another device's does: one IMU is the reference");
  }
  share_lines(root, configuration.devices);
  if (references == 0) root.fail("device", "must hold one device with role = \"reference\"");
}

void read_triad(TableReader& in, const std::string& kind, double unit, const std::string& unit_name,
                TriadErrors& errors) {
  in.matrix(kind + "_misalignment_deg", errors.misalignment, kRadPerDeg);
  in.number(kind + "_range_" + unit_name, errors.range, unit, 1e-6, kAnyHigh);
  in.number(kind + "_step_" + unit_name, errors.quantisation, unit, 0.0, kAnyHigh);
  in.number(kind + "_low_pass_hz", errors.low_pass_hz, 1.0, 0.1, 1e5);
}

void read_optional_vector(TableReader& in, std::string_view key, double unit,
                          std::optional<Eigen::Vector3d>& target) {
  Eigen::Vector3d value = Eigen::Vector3d::Zero();
  in.vector(key, value, unit);
  if (in.has(key)) target = value;
}

/// What the noise follows.
void read_dependence(TableReader& in, SImuSimulation& study) {
  constexpr double kAny = 10.0;
  constexpr double kColdest_degC = -55.0;
  constexpr double kWarmest_degC = 125.0;
  in.number("gyro_white_log_per_degC", study.gyro_white.per_degC, 1.0, -kAny, kAny);
  in.number("gyro_white_log_per_deg_per_s", study.gyro_white.per_radps, 1.0 / kRadPerDeg, -kAny, kAny);
  if (!in.has("begin_temperature_degC")) return;
  Temperature& temperature = study.temperature.emplace();
  in.number("begin_temperature_degC", temperature.begin_degC, 1.0, kColdest_degC, kWarmest_degC);
  temperature.end_degC = temperature.begin_degC;
  in.number("end_temperature_degC", temperature.end_degC, 1.0, kColdest_degC, kWarmest_degC);
  in.number("warm_up_s", temperature.time_constant_s, 1.0, 1.0, 1e5);
}

SImuSimulation read_study(TableReader& in, const MtxClass& common) {
  SImuSimulation study;
  study.draw = common;
  in.text("name", study.name);
  study.model = static_cast<XsensModel>(in.choice("model", {"mtx", "mti"}, 0));
  study.can_output =
      static_cast<MtiOutput>(in.choice("can_output", {"increments", "high_rate", "high_rate_swapped"}, 0));
  read_optional_vector(in, "rotation_vector_b_s_deg", kRadPerDeg, study.rotation_vector_b_s_rad);
  read_optional_vector(in, "lever_arm_b_m", 1.0, study.r_bs_b_m);
  in.number("latency_ms", study.latency_s, kMilli, 0.0, 1e3);
  if (in.has("clock_skew_ppm")) in.number("clock_skew_ppm", study.clock_skew_ppm.emplace(), 1.0, -1e4, 1e4);
  if (in.has("first_counter")) {
    std::int64_t counter = 0;
    in.whole("first_counter", counter, 0, std::numeric_limits<std::uint16_t>::max());
    study.first_counter = static_cast<std::uint16_t>(counter);
  }
  in.number("accel_white_mps2", study.draw.accel_white_sd_mps2, 1.0, 0.0, 100.0);
  in.number("gyro_bias_sd_deg_per_s", study.draw.gyro_bias_sd_radps, kRadPerDeg, 0.0, 100.0);
  in.number("accel_bias_sd_mps2", study.draw.accel_bias_sd_mps2, 1.0, 0.0, 100.0);
  in.number("gyro_scale_sd_percent", study.draw.gyro_scale_sd, kPercent, 0.0, 50.0);
  in.number("accel_scale_sd_percent", study.draw.accel_scale_sd, kPercent, 0.0, 50.0);
  read_optional_vector(in, "gyro_bias_deg_per_s", kRadPerDeg, study.gyro_bias_radps);
  read_optional_vector(in, "accel_bias_mps2", 1.0, study.accel_bias_mps2);
  read_optional_vector(in, "gyro_scale_percent", kPercent, study.gyro_scale);
  read_optional_vector(in, "accel_scale_percent", kPercent, study.accel_scale);
  in.matrix("g_sensitivity_deg_per_s_per_g", study.gyro.g_sensitivity, kRadPerDeg / kMps2PerG);
  read_triad(in, "gyro", kRadPerDeg, "deg_per_s", study.gyro);
  read_triad(in, "accel", 1.0, "mps2", study.accel);
  read_dependence(in, study);
  in.refuse_unknown_keys();
  return study;
}

/// Brings the [[simulation.imu]] tables into the order of the S-IMUs.
void read_studies(TableReader& in, const MtxClass& common, Configuration& configuration) {
  std::vector<SImuSimulation> found;
  for (TableReader& table : in.tables("imu")) {
    found.push_back(read_study(table, common));
    const std::string& name = found.back().name;
    const bool known = std::any_of(
        configuration.devices.begin(), configuration.devices.end(),
        [&](const PlayedDevice& device) { return device.role == Role::kStudy && device.name == name; });
    if (!known) table.fail("name", "must be that of a device with role = \"study\"");
    const auto same = [&](const SImuSimulation& other) { return other.name == name; };
    if (std::count_if(found.begin(), found.end(), same) > 1) table.fail("name", "is used twice");
  }
  for (const PlayedDevice& device : configuration.devices) {
    if (device.role != Role::kStudy) continue;
    const auto place = std::find_if(found.begin(), found.end(),
                                    [&](const SImuSimulation& study) { return study.name == device.name; });
    SImuSimulation drawn;
    drawn.name = device.name;
    drawn.draw = common;
    configuration.studies.push_back(place == found.end() ? drawn : *place);
  }
}

void read_reference(TableReader in, ReferenceSimulation& reference) {
  std::int64_t number = 1;
  in.whole("class", number, 1, kReferenceClasses);
  reference.noise = reference_class(static_cast<int>(number));
  in.number("gyro_white_deg_per_sqrt_h", reference.noise.gyro_white_radps_per_sqrt_hz, kRadPerDeg / 60.0, 0.0,
            100.0);
  in.number("accel_white_ug_per_sqrt_hz", reference.noise.accel_white_mps2_per_sqrt_hz, kMicro * kMps2PerG,
            0.0, 1e6);
  in.number("gyro_bias_sd_deg_per_h", reference.noise.gyro_bias_sd_radps, kRadPerDeg / kSecondsPerHour, 0.0,
            1e5);
  in.number("accel_bias_sd_mps2", reference.noise.accel_bias_sd_mps2, 1.0, 0.0, 100.0);
  reference.attitude_sd_rad = Eigen::Vector3d(0.01, 0.01, 0.03) * kRadPerDeg;
  in.vector("attitude_sd_deg", reference.attitude_sd_rad, kRadPerDeg);
  in.number("latency_ms", reference.latency_s, kMilli, 0.0, 1e3);
  in.number("alignment_s", reference.alignment_s, 1.0, 0.0, 1e5);
  in.refuse_unknown_keys();
}

void read_gnss(TableReader in, GnssSimulation& gnss) {
  in.vector("position_sd_m", gnss.position_sd_m, 1.0);
  in.vector("velocity_sd_mps", gnss.velocity_sd_mps, 1.0);
  in.number("latency_ms", gnss.latency_s, kMilli, 0.0, 1e4);
  in.number("epoch_error_ms", gnss.epoch_error_s, kMilli, -100.0, 100.0);
  in.refuse_unknown_keys();
}

void read_wheels(TableReader in, WheelSimulation& wheels) {
  in.number("scale_error_percent", wheels.errors.scale, kPercent, -50.0, 50.0);
  in.number("slow_sd_mps", wheels.errors.slow_sd_mps, 1.0, 0.0, 10.0);
  in.number("white_sd_mps", wheels.errors.white_sd_mps, 1.0, 0.0, 10.0);
  in.number("step_kmph", wheels.errors.step_mps, 1.0 / 3.6, 0.0, 10.0);
  in.number("dead_band_mps", wheels.errors.dead_band_mps, 1.0, 0.0, 5.0);
  in.number("latency_ms", wheels.latency_s, kMilli, 0.0, 1e3);
  in.refuse_unknown_keys();
}

void read_can(TableReader in, CanLineOptions& can) {
  in.number("bit_rate", can.bit_rate, 1.0, 1e4, 1e6);
  in.number("bus_load_percent", can.bus_load, kPercent, 0.0, 95.0);
  in.number("stamp_jitter_us", can.jitter_mean_s, kMicro, 0.0, 1e5);
  in.refuse_unknown_keys();
}

void read_line(TableReader in, Configuration& configuration) {
  LineOptions& line = configuration.line;
  constexpr std::array kModels = {ReadModel::kUsbFrames, ReadModel::kFtdi, ReadModel::kMessages};
  line.reads = kModels[in.choice("reads", {"usb_frames", "ftdi", "messages"}, 0)];
  in.number("read_jitter_us", line.jitter_mean_s, kMicro, 0.0, 1e5);
  configuration.has_pc_rate = in.has("host_skew_ppm");
  in.number("host_skew_ppm", line.clock.rate_ppm, 1.0, -1e4, 1e4);
  double suspend_at_s = 0.0;
  double suspend_for_s = 0.0;
  in.number("suspend_at_s", suspend_at_s, 1.0, 0.0, 86400.0);
  in.number("suspend_for_s", suspend_for_s, 1.0, 0.0, 86400.0);
  if (suspend_for_s > 0.0) line.clock.suspends.push_back({suspend_at_s, suspend_at_s + suspend_for_s});
  in.refuse_unknown_keys();
}

Utc read_start(TableReader& in) {
  using namespace std::chrono;
  const Utc otherwise = sys_days(year(2026) / 3 / 14) + hours(9) + minutes(30);
  const toml::node* node = in.node("start_utc");
  if (node == nullptr) return otherwise;
  const auto value = node->value_exact<toml::date_time>();
  if (!value) {
    in.fail("start_utc", "must be a date and time, such as 2026-03-14T09:30:00Z");
    return otherwise;
  }
  const year_month_day date(year(value->date.year), month(value->date.month), day(value->date.day));
  const minutes zone(value->offset ? value->offset->minutes : 0);
  return sys_days(date) + hours(value->time.hour) + minutes(value->time.minute) +
         seconds(value->time.second) + nanoseconds(value->time.nanosecond) - zone;
}

void read_simulation(TableReader in, Configuration& configuration) {
  Scenario& scenario = configuration.scenario;
  configuration.world = static_cast<WorldKind>(in.choice("world", {"ideal", "harsh"}, 0));
  in.number("duration_s", scenario.duration_s, 1.0, 2.0, 86400.0);
  if (in.has("initial_standstill_s"))
    in.number("initial_standstill_s", scenario.initial_standstill_s.emplace(), 1.0, 0.0, scenario.duration_s);
  auto seed = static_cast<std::int64_t>(scenario.seed);
  in.whole("seed", seed, 0, std::numeric_limits<std::int64_t>::max());
  scenario.seed = static_cast<std::uint64_t>(seed);
  scenario.kind = static_cast<ScenarioKind>(in.choice("scenario", {"drive", "static", "straight_road"}, 0));
  in.number("start_latitude_deg", scenario.start.latitude_rad, kRadPerDeg, -80.0, 80.0);
  in.number("start_longitude_deg", scenario.start.longitude_rad, kRadPerDeg, -180.0, 180.0);
  in.number("start_height_m", scenario.start.height_m, 1.0, -1e3, 1e4);
  configuration.utc_begin = read_start(in);
  MtxClass common;
  common.gyro_noise =
      static_cast<GyroNoiseChoice>(in.choice("gyro_noise", {"by_regime", "static", "dynamic"}, 0));
  common.regime_switch =
      static_cast<RegimeSwitch>(in.choice("regime_switch", {"continuous", "independent"}, 0));
  read_reference(in.table("reference"), configuration.reference);
  read_gnss(in.table("gnss"), configuration.gnss);
  read_wheels(in.table("wheels"), configuration.wheels);
  read_can(in.table("can"), configuration.can);
  read_line(in.table("line"), configuration);
  read_studies(in, common, configuration);
  in.refuse_unknown_keys();
}

}  // namespace

std::vector<Fault> Configuration::faults_of(const std::string& device) const {
  std::vector<Fault> found;
  std::copy_if(faults.begin(), faults.end(), std::back_inserter(found),
               [&](const Fault& fault) { return fault.device == device; });
  return found;
}

Outcome<Configuration> parse_configuration(const std::string& text, const std::filesystem::path& file) {
  Configuration configuration;
  configuration.file = file;
  configuration.text = text;
  toml::table root;
  try {
    root = toml::parse(text, file.string());
  } catch (const toml::parse_error& error) {
    return wrong_usage(fmt::format("{}:{}: not TOML: {}; config/ holds examples", file.string(),
                                   error.source().begin.line, error.description()));
  }
  Problem problem{file.string(), {}};
  TableReader in(&root, "", problem);
  if (!root.contains("device"))
    return wrong_usage(
        fmt::format("{} names no devices; describe each in a [[device]] table", file.string()));
  configuration.run_name = file.stem().string();
  in.table("run").text("name", configuration.run_name);
  in.table("lcm").text("channel_prefix", configuration.channel_prefix);
  read_devices(in, configuration);
  read_simulation(in.table("simulation"), configuration);
  if (!problem.text.empty()) return wrong_usage(problem.text);
  return configuration;
}

Outcome<Configuration> load_configuration(const std::filesystem::path& file) {
  std::error_code error;
  const auto status = std::filesystem::status(file, error);
  if (!std::filesystem::exists(status))
    return wrong_usage(fmt::format("configuration {} does not exist; config/ holds examples", file.string()));
  if (std::filesystem::is_directory(status))
    return wrong_usage(
        fmt::format("configuration {} is a folder; give the path of a TOML file", file.string()));
  std::ifstream in(file, std::ios::binary);
  std::ostringstream text;
  text << in.rdbuf();
  if (!in)
    return wrong_usage(fmt::format("configuration {} cannot be read; check its permissions", file.string()));
  if (text.str().empty())
    return wrong_usage(fmt::format("configuration {} is empty; config/ holds examples", file.string()));
  return parse_configuration(text.str(), file);
}

}  // namespace imusim
