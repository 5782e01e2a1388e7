#include "configuration/config.h"

#include <arpa/inet.h>
#include <fmt/format.h>
#include <netinet/in.h>
#include <openssl/evp.h>
#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include "base/limits.h"
#include "base/text.h"
#include "configuration/config_devices.h"
#include "configuration/config_vehicle.h"
#include "configuration/toml_depth.h"
#include "configuration/toml_reader.h"

namespace imuscope {

namespace {

void read_estimator(TomlReader in, EstimatorOptions& options) {
  options.states = static_cast<FilterStates>(in.choice("states", {"full", "rigid", "paper"}, 0));
  // Six states beside the published method's: the filter's, unless the batch is asked for.
  options.batch_mounting =
      in.choice("mounting", {"batch", "filter"}, options.states == FilterStates::kPaper ? 1 : 0) == 0;
  in.boolean("navigation", options.navigation);
  in.integer("differentiator_points", options.differentiator_points, 5, 11);
  if (options.differentiator_points % 2 == 0) in.fail("differentiator_points", "must be 5, 7, 9 or 11");
  in.finish();
}

void read_noise_options(TomlReader in, NoiseOptions& options) {
  in.text("model", options.model);
  in.number("refit_interval_s", options.refit_interval_s, 1.0, 1.0, 1e5);
  in.boolean("remove_scale_error", options.remove_scale_error);
  in.boolean("apply_to_filter", options.apply_to_filter);
  in.finish();
}

void read_regimes(TomlReader in, RegimeOptions& options) {
  // Limits for rest are half of those for motion.
  constexpr double kRestShare = 0.5;
  options.by = static_cast<RegimesBy>(in.choice("by", {"motion", "intensity", "labels"}, 0));
  MotionLimits& limits = options.limits;
  const auto both = [&](const char* key, double& motion, double& rest, double unit, double most) {
    in.number(key, motion, unit, 1e-6, most);
    rest = kRestShare * motion;
  };
  both("motion_speed_mps", limits.motion_speed_mps, limits.rest_speed_mps, 1.0, 100.0);
  both("motion_rate_deg_per_s", limits.motion_rate_spread_radps, limits.rest_rate_spread_radps, kRadPerDeg,
       1e3);
  both("motion_force_mps2", limits.motion_force_spread_mps2, limits.rest_force_spread_mps2, 1.0, 1e3);
  both("motion_vibration_mps2", limits.motion_vibration_mps2, limits.rest_vibration_mps2, 1.0, 1e3);
  in.number("shortest_static_s", limits.shortest_static_s, 1.0, 0.0, 1e5);
  in.number("guard_s", limits.guard_s, 1.0, 0.0, 10.0);
  options.intensity = static_cast<Intensity>(in.choice("intensity", {"rate", "vibration", "speed"}, 0));
  constexpr int kMaxBins = 10;
  in.integer("bins", options.bins, 2, kMaxBins);
  in.number("block_s", options.block_s, 1.0, 1.0, 1e4);
  in.number("window_s", options.window_s, 1.0, 2.0, 1e4);
  in.finish();
}

void read_error_process(TomlReader in, double slowest_rate_hz, ErrorProcessOptions& options) {
  constexpr double kHighestShare = 0.4;  // of the rate: below half of it the filter still is what it says
  in.number("low_pass_hz", options.low_pass_hz, 1.0, 0.0, kHighestShare * slowest_rate_hz);
  in.finish();
}

/// The weights of one axis, their sum made one exactly: people round them.
std::vector<double> read_weights(TomlReader& in, std::string_view key, std::size_t members) {
  constexpr double kRounding = 0.01;
  std::vector<double> weights;
  in.numbers(key, weights);
  if (weights.empty()) return std::vector<double>(members, 1.0 / static_cast<double>(members));
  if (weights.size() != members) {
    in.fail(key, fmt::format("has {} weights for {} IMUs", weights.size(), members),
            "give one for each of imus, in their order");
    return {};
  }
  const double sum = std::accumulate(weights.begin(), weights.end(), 0.0);
  if (!(std::abs(sum - 1.0) <= kRounding)) {
    in.fail(key, fmt::format("has weights whose sum is {:.4g}", sum),
            "they make a mean: their sum is 1; imuscope correlate writes them");
    return {};
  }
  for (double& weight : weights) weight /= sum;
  return weights;
}

void read_virtual_imu(TomlReader in, const std::vector<DeviceConfig>& devices,
                      std::vector<VirtualImuMember>& virtual_imu) {
  std::vector<std::string> names;
  in.texts("imus", names);
  if (in.present()) in.require("imus", "name the S-IMUs that it is made of");
  std::vector<VirtualImuMember> members;
  for (const auto& name : names) {
    const auto found = std::find_if(devices.begin(), devices.end(), [&](const DeviceConfig& device) {
      return device.name == name && device.role == DeviceRole::kStudy;
    });
    if (found == devices.end()) {
      in.fail("imus", fmt::format("names '{}', which is no device of role study", name));
      continue;
    }
    const auto index = static_cast<std::size_t>(found - devices.begin());
    if (std::any_of(members.begin(), members.end(), [&](const auto& other) { return other.device == index; }))
      in.fail("imus", fmt::format("names '{}' twice", name));
    members.push_back({index, {}, {}});
  }
  if (!names.empty() && names.size() < 2) in.fail("imus", "names one IMU", "a mean takes two or more");
  constexpr std::array kKeys{"gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z"};
  for (std::size_t axis = 0; axis < kKeys.size(); ++axis) {
    const auto weights = read_weights(in, kKeys[axis], members.size());
    if (in.failed()) continue;
    for (std::size_t i = 0; i < members.size(); ++i)
      (axis < 3 ? members[i].gyro : members[i].accel)[axis % 3] = weights[i];
  }
  in.finish();
  virtual_imu = std::move(members);
}

/// A list of processor cores.
void read_cores(TomlReader& in, std::string_view key, std::vector<int>& cores) {
  constexpr double kMostCores = 1024.0;
  std::vector<double> numbers;
  in.numbers(key, numbers);
  cores.clear();
  for (const double number : numbers) {
    if (number < 0.0 || number >= kMostCores || number != std::floor(number)) {
      in.fail(key, fmt::format("names a core {:g}", number),
              "cores are counted 0, 1, 2, ...; nproc says how many");
      return;
    }
    cores.push_back(static_cast<int>(number));
  }
}

void read_threads(TomlReader in, ThreadOptions& options) {
  read_cores(in, "io_cores", options.io_cores);
  read_cores(in, "estimator_cores", options.estimator_cores);
  in.finish();
}

void read_record(TomlReader in, RecordOptions& options) {
  constexpr double kShortestSync_s = 0.1;
  constexpr double kLongest_s = 3600.0;
  constexpr double kSPerHour = 3600.0;
  constexpr double kSPerDay = 86400.0;
  constexpr double kBytesPerGb = 1e9;
  constexpr double kSmallest_gb = 1e-3;
  constexpr double kLargest_gb = 1e6;
  constexpr double kShortest_days = 0.01;
  constexpr double kLongest_days = 36500.0;
  constexpr double kShortest_hours = 0.01;
  constexpr double kLongest_hours = 1000.0;
  in.text("folder", options.folder);
  in.boolean("mcap", options.mcap);
  in.number("sync_s", options.sync_s, 1.0, kShortestSync_s, kLongest_s);
  in.number("file_gb", options.file_bytes, kBytesPerGb, kSmallest_gb, kLargest_gb);
  in.number("file_hours", options.file_s, kSPerHour, kShortest_hours, kLongest_hours);
  in.number("remove_older_than_days", options.remove_older_than_s, kSPerDay, kShortest_days, kLongest_days);
  in.number("remove_beyond_gb", options.remove_beyond_bytes, kBytesPerGb, kSmallest_gb, kLargest_gb);
  in.number("remove_below_free_gb", options.remove_below_free_bytes, kBytesPerGb, kSmallest_gb, kLargest_gb);
  in.finish();
}

void read_metrics(TomlReader in, MetricsOptions& options) {
  constexpr int kHighestPort = 65535;
  int port = options.port;
  in.integer("port", port, 0, kHighestPort);
  options.port = static_cast<std::uint16_t>(port);
  in.text("address", options.address);
  const bool is_address = [&] {
    std::array<unsigned char, sizeof(in6_addr)> bytes{};
    return inet_pton(AF_INET, options.address.c_str(), bytes.data()) == 1 ||
           inet_pton(AF_INET6, options.address.c_str(), bytes.data()) == 1;
  }();
  if (!is_address)
    in.fail("address", fmt::format("'{}' is no address", options.address),
            "give 127.0.0.1, ::1 or an address of this PC in numbers; 0.0.0.0 is all of them");
  in.finish();
}

/// A text as TOML writes it, whatever it holds.
std::string quoted(const std::string& text) {
  std::string out = "\"";
  for (const char c : text) {
    const auto code = static_cast<unsigned char>(c);
    if (c == '"' || c == '\\') {
      out += '\\';
      out += c;
    } else if (code < ' ' || code == 0x7F) {
      out += fmt::format("\\u{:04X}", code);
    } else {
      out += c;
    }
  }
  return out + '"';
}

/// The files that a configuration names, as a table at its end: with it, it is whole wherever it goes.
std::string attached_text(const AttachedFiles& files) {
  if (files.texts.empty()) return {};
  std::string text = "\n[attached]\n";
  for (const auto& [name, content] : files.texts)
    text += fmt::format("{} = {}\n", quoted(name), quoted(content));
  return text;
}

std::string sha256_of(const std::string& text) {
  std::array<unsigned char, EVP_MAX_MD_SIZE> digest{};
  unsigned int size = 0;
  EVP_Digest(text.data(), text.size(), digest.data(), &size, EVP_sha256(), nullptr);
  std::string hex;
  for (unsigned int i = 0; i < size; ++i) hex += fmt::format("{:02x}", digest[i]);
  return hex;
}

Result<Configuration> parse(const std::string& text, const std::filesystem::path& name, AttachedFiles files,
                            std::vector<AskedKey>* asked) {
  if (text.find_first_not_of(" \t\r\n") == std::string::npos) {
    return usage_error(fmt::format("configuration {} is empty", name.string()), "config/ holds examples");
  }
  if (has_key_too_deep(text)) {
    return usage_error(fmt::format("{}: a key has more than {} words", name.string(), kTomlDepthMax),
                       "see config/ for examples");
  }
  toml::table document;
  try {
    document = toml::parse(text, name.string());
  } catch (const toml::parse_error& error) {
    return usage_error(
        fmt::format("{}:{}: not TOML: {}", name.string(), error.source().begin.line, error.description()),
        "see config/ for examples");
  }
  Configuration configuration;
  configuration.file = name;
  configuration.run_name = name.stem().string();

  TomlProblem problem{name.string(), std::nullopt, asked};
  TomlReader root(&document, "", problem);
  auto run = root.table("run");
  run.text("name", configuration.run_name);
  run.finish();
  read_estimator(root.table("estimator"), configuration.estimator);
  read_noise_options(root.table("noise"), configuration.noise);
  auto lcm = root.table("lcm");
  lcm.text("url", configuration.lcm.url);
  lcm.text("channel_prefix", configuration.lcm.channel_prefix);
  lcm.boolean("bridge", configuration.lcm.bridge);
  lcm.finish();
  read_record(root.table("record"), configuration.record);
  read_metrics(root.table("metrics"), configuration.metrics);
  read_threads(root.table("threads"), configuration.threads);
  root.ignore("simulation");  // belongs to imusim, which checks it
  auto attached = root.table("attached");
  attached.every_text(files.texts);
  const bool is_whole = attached.present();
  read_devices(root, problem, files, configuration.devices);
  read_regimes(root.table("regimes"), configuration.regimes);
  double slowest_rate_hz = kMaxRate_hz;
  for (const auto index : configuration.study_indices())
    slowest_rate_hz = std::min(slowest_rate_hz, configuration.devices[index].rate_hz);
  read_error_process(root.table("error_process"), slowest_rate_hz, configuration.error_process);
  read_virtual_imu(root.table("virtual_imu"), configuration.devices, configuration.virtual_imu);
  root.finish();
  if (problem.error) return tl::unexpected<Error>(*problem.error);
  configuration.text = is_whole ? text : text + attached_text(files);
  configuration.sha256 = sha256_of(configuration.text);
  return configuration;
}

}  // namespace

const DeviceConfig* Configuration::find(std::string_view name) const {
  const auto found = std::find_if(devices.begin(), devices.end(),
                                  [&](const DeviceConfig& device) { return device.name == name; });
  return found == devices.end() ? nullptr : &*found;
}

std::size_t Configuration::reference_index() const {
  const auto found = std::find_if(devices.begin(), devices.end(), [](const DeviceConfig& device) {
    return device.role == DeviceRole::kReference;
  });
  return static_cast<std::size_t>(found - devices.begin());
}

std::vector<std::size_t> Configuration::study_indices() const {
  std::vector<std::size_t> indices;
  for (std::size_t i = 0; i < devices.size(); ++i) {
    if (devices[i].role == DeviceRole::kStudy) indices.push_back(i);
  }
  return indices;
}

std::optional<std::size_t> Configuration::gnss_index() const {
  for (std::size_t i = 0; i < devices.size(); ++i) {
    if (devices[i].role == DeviceRole::kGnss) return i;
  }
  return std::nullopt;
}

std::optional<std::size_t> Configuration::odometry_index() const {
  for (std::size_t i = 0; i < devices.size(); ++i) {
    if (devices[i].role == DeviceRole::kOdometry) return i;
  }
  return std::nullopt;
}

Result<Configuration> load_configuration(const std::filesystem::path& file) {
  const auto text =
      read_text_file(file, "configuration", "give the path of a TOML file; config/ holds examples");
  if (!text) return tl::unexpected<Error>(text.error());
  AttachedFiles files;
  files.folder = file.parent_path();
  return parse(*text, file, std::move(files), nullptr);
}

Result<Configuration> parse_configuration(const std::string& text, const std::filesystem::path& name,
                                          std::vector<AskedKey>* asked) {
  return parse(text, name, {}, asked);
}

}  // namespace imuscope
