/// Time against the simulator's truth, drive by drive: whether the quartz of the PC shows in any result,
/// whether what navigation claims holds by UTC, how well rows and the PC's clock know UTC.
///
///   imuscope_time_goals [--cell quartz|nees|pps|pps-ntp|gnss]... [--drives 100] [--minutes 8] [--first 1]
///                       [--results FILE] [--folder DIR]
///
/// Sensors are those of the ideal world, which the filter models; the clock of the PC is not: it is wrong by
/// up to 50 ppm, warms up, and is corrected by NTP. With --results what was done is kept, drive by drive, and
/// not done again. A mean over drives misses its band where it lies beyond it by more than 3.3 of its own sd,
/// and from five drives on. Exits 0 only where every goal is met.

#include <fmt/format.h>
#include <CLI/CLI.hpp>
#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <functional>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "base/units.h"
#include "estimation/calibration/filter_core.h"
#include "firmware_sim/imusim/record.h"
#include "firmware_sim/imusim/world.h"
#include "firmware_sim/random/random.h"
#include "service/pipeline/estimator_setup.h"
#include "service/recording/recording.h"
#include "service/recording/replay.h"
#include "tools/benchmarks/own_folder.h"
#include "tools/trials/navigation_score.h"
#include "tools/trials/own_sd.h"
#include "tools/trials/s_imu_score.h"

namespace {

using imuscope::kOwnSd;
using nlohmann::json;

constexpr double kEqualInSd = 0.1;
constexpr double kNeesLow = 0.7;
constexpr double kNeesHigh = 1.4;
constexpr double kRowUtc_s = 60e-6;
constexpr double kHostUtc_s = 10e-6;
constexpr double kFoundUtc_s = 1e-3;  ///< of a row, where motion shows the receiver's latency
constexpr double kShare = 0.95;
constexpr double kKfGinsHeading_mdeg = 0.33;  ///< of KF-GINS on one drive of such a reference, rms
/// Between a receiver's idea of an instant and the R-IMU's.
constexpr double kEpochErrorSd_s = 1e-3;
constexpr std::size_t kDrivesToJudge = 5;

/// The vehicle of config/demo.toml.
constexpr std::string_view kVehicle = R"([run]
name = "time"
[[device]]
name = "airins"
role = "reference"
protocol = "ixblue_stdbin"
axes = "+x -y -z"
transport = { kind = "serial", port = "airins", baud = 460800 }
[device.noise]
gyro_white_deg_per_sqrt_h = 0.0015
accel_white_ug_per_sqrt_hz = 10.0
gyro_bias_sd_deg_per_h = 0.005
accel_bias_sd_mps2 = 5e-4
[[device]]
name = "mtx1"
role = "study"
protocol = "xsens_mt"
transport = { kind = "serial", port = "mtx1", baud = 115200 }
[[device]]
name = "mtx2"
role = "study"
protocol = "xsens_mt"
transport = { kind = "serial", port = "mtx2", baud = 115200 }
[[device]]
name = "gnss"
role = "gnss"
protocol = "greis"
antenna_lever_arm_b_m = [-0.50, 0.20, -1.30]
transport = { kind = "serial", port = "gnss", baud = 115200 }
[simulation.line]
reads = "usb_frames"
)";
constexpr std::string_view kPulses = R"(
[[device]]
name = "pps"
role = "time"
protocol = "pps"
transport = { kind = "pps", port = "pps" }
)";
/// A reference that tells no UTC: a receiver's messages are all there is.
constexpr std::string_view kWithoutUtc = R"([run]
name = "gnss"
[[device]]
name = "reference"
role = "reference"
protocol = "xsens_mt"
transport = { kind = "serial", port = "reference", baud = 115200 }
[[device]]
name = "mtx1"
role = "study"
protocol = "xsens_mt"
transport = { kind = "serial", port = "mtx1", baud = 115200 }
[[device]]
name = "gnss"
role = "gnss"
protocol = "greis"
transport = { kind = "serial", port = "gnss", baud = 115200 }
)";

struct Options {
  std::vector<std::string> cells{"quartz", "nees", "pps", "pps-ntp", "gnss"};
  int drives = 100;
  std::uint64_t first = 1;
  double minutes = 8.0;
  std::string results;
  std::string folder;
};

double shown_s(imuscope::HostTime host) {
  return imuscope::to_seconds(host - imuscope::host_time_from_ns(imusim::kHostBegin_ns));
}

/// The true second, since the scenario's beginning, at which the PC's clock showed a time.
double true_second_of(const imusim::PcClock& clock, imuscope::HostTime host) {
  double t_s = shown_s(host);
  for (int i = 0; i < 6; ++i) t_s += shown_s(host) - clock.seconds_at(t_s);
  return t_s;
}

/// What is kept of a drive while it is read back.
class Watch final : public imuscope::CoreSink {
 public:
  Watch(const s_imu_score::NavigationTruth& truth, const imusim::World& world)
      : truth_(truth), world_(world) {}
  void on_error(const imuscope::ErrorRecord&) noexcept override {}
  void on_event(const imuscope::EstimatorEvent&) noexcept override {}
  void on_late_sample(const imuscope::LateSample&) noexcept override {}
  void on_snapshot(const imuscope::Snapshot& snapshot) noexcept override {
    last = snapshot;
    follow_sample(snapshot.navigation.time);
    if (snapshot.tick < kSettled_ticks || snapshot.tick % kEvery_ticks != 0) return;
    navigation.add(snapshot.navigation, snapshot.time_scale, truth_);
    const double t_s = true_second_of(world_.pc_clock(), snapshot.cut);
    const imuscope::TimeScale& scale = snapshot.time_scale;
    const auto off_s = [&](imuscope::UtcTime utc) {
      return imuscope::to_seconds(utc - world_.configuration().utc_begin) - t_s;
    };
    if (scale.pulses.is_known) {
      const imuscope::Duration since = snapshot.cut - scale.pulses.time;
      host_errors_s.push_back(
          std::abs(off_s(scale.pulses.utc + since +
                         imuscope::from_seconds(scale.pulses.rate * imuscope::to_seconds(since)))));
      instants_.push_back({shown_s(snapshot.cut), t_s});
      const Instant pulse{shown_s(scale.pulses.time),
                          imuscope::to_seconds(scale.pulses.utc - world_.configuration().utc_begin)};
      if (pulses_.empty() || pulse.host_s > pulses_.back().host_s) pulses_.push_back(pulse);
    }
    row_errors_s.push_back(
        imuscope::to_seconds(scale.at(snapshot.navigation.time).utc - world_.configuration().utc_begin) -
        sample_instant_s());
    row_sds_s.push_back(scale.sd_utc_s);
  }

  /// The instant at which the newest row's sample was taken.
  [[nodiscard]] double sample_instant_s() const {
    return world_.reference().first_sample_s + sample_ * world_.reference().period_s;
  }

  /// The same instants on the line from one pulse to the next, as files tell them once a run is over.
  [[nodiscard]] std::vector<double> track_errors_s() const {
    std::vector<double> errors_s;
    for (const Instant& instant : instants_) {
      const auto after =
          std::upper_bound(pulses_.begin(), pulses_.end(), instant.host_s,
                           [](double host_s, const Instant& pulse) { return host_s < pulse.host_s; });
      if (after == pulses_.begin() || after == pulses_.end()) continue;
      const Instant& a = *(after - 1);
      const double share = (instant.host_s - a.host_s) / (after->host_s - a.host_s);
      errors_s.push_back(std::abs(a.utc_s + share * (after->utc_s - a.utc_s) - instant.utc_s));
    }
    return errors_s;
  }

  imuscope::Snapshot last{};
  s_imu_score::NavigationScore navigation;
  std::vector<double> host_errors_s;
  std::vector<double> row_errors_s;
  std::vector<double> row_sds_s;

 private:
  // From two minutes on, every second.
  static constexpr std::int64_t kSettled_ticks = 12'000;
  static constexpr std::int64_t kEvery_ticks = 100;
  /// A row is of a sample, whatever time the R-IMU's clock map has given it: a map that follows a slewed
  /// clock is off by up to a period, but never by so much from one row to the next.
  void follow_sample(imuscope::HostTime time) {
    const double seen_s = true_second_of(world_.pc_clock(), time);
    const imusim::ReferenceTruth& grid = world_.reference();
    const double from_s = has_sample_ ? sample_seen_s_ : grid.first_sample_s + world_.reference_latency_s();
    sample_ += std::round((seen_s - from_s) / grid.period_s);
    sample_seen_s_ = seen_s;
    has_sample_ = true;
  }
  struct Instant {
    double host_s;  ///< by the PC's clock, since the scenario's beginning
    double utc_s;   ///< true, or as pulses tell it
  };
  const s_imu_score::NavigationTruth& truth_;
  const imusim::World& world_;
  bool has_sample_ = false;
  double sample_ = 0.0;  ///< since the grid's first
  double sample_seen_s_ = 0.0;
  std::vector<Instant> instants_;
  std::vector<Instant> pulses_;
};

json of(const s_imu_score::StateScore& score) {
  return {{"rms", score.rms()}, {"sd", score.rms_sd()}, {"z2", score.mean_z2()}};
}

double quantile(std::vector<double> values, double share) {
  if (values.empty()) return std::nan("");
  const auto place = static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), values.begin() + place, values.end());
  return values[static_cast<std::size_t>(place)];
}

json psi_of(const imuscope::Snapshot& last, const std::vector<imusim::SImuTruth>& truths) {
  json psi = json::array();
  for (std::size_t i = 0; i < truths.size(); ++i) {
    s_imu_score::SImuTruth truth;
    truth.C_b_s = truths[i].mounting.C_b_s;
    truth.r_bs_b_m = truths[i].mounting.r_bs_b_m;
    const auto error = s_imu_score::mounting_error(last.studies[i], truth);
    for (Eigen::Index axis = 0; axis < 3; ++axis) {
      psi.push_back(
          {{"error", error(axis)}, {"sd", last.studies[i].sd_psi_rad[static_cast<std::size_t>(axis)]}});
    }
  }
  return psi;
}

/// What the data allow: the covariance of a filter that knows the noise that was drawn, that the R-IMU's
/// biases do not wander, where the antenna is and what instant an epoch is of. For a linear model that is the
/// posterior Cramer-Rao bound, here along the estimated drive; the error beside it shows that it holds.
json bound(const imuscope::OpenedRecording& opened, imuscope::EstimatorConfig estimator,
           const s_imu_score::NavigationTruth& truth, const imusim::World& world) {
  estimator.reference.gyro_bias.time_constant_s = std::numeric_limits<double>::infinity();
  estimator.reference.accel_bias.time_constant_s = std::numeric_limits<double>::infinity();
  for (const imusim::PlayedDevice& device : world.configuration().devices) {
    if (device.role == imusim::Role::kGnss)
      estimator.gnss.antenna_lever_arm_b_m = {device.antenna_b_m.x(), device.antenna_b_m.y(),
                                              device.antenna_b_m.z()};
  }
  estimator.gnss.antenna_lever_arm_sd_m = {};
  Watch watch(truth, world);
  const auto replayed = imuscope::replay(opened.configuration, estimator, opened.recording, watch);
  if (!replayed) throw std::runtime_error(replayed.error().text());
  return of(watch.navigation.heading());
}

/// One drive: recorded, read back, held against the truth.
/// @param with_bound  the drive is also read by a filter that knows what was drawn
json drive(const imusim::Configuration& configuration, const std::filesystem::path& parent,
           bool with_bound = false) {
  const bench::OwnFolder own(parent);
  imusim::RecordOptions options;
  options.folder = own.path() / "drive";
  options.truth_rows_hz = 100.0;
  if (const auto recorded = imusim::record(configuration, options); !recorded)
    throw std::runtime_error(recorded.error().text);
  const imusim::World world(configuration, imusim::World::Beginning::kStreaming);
  const auto truth = s_imu_score::NavigationTruth::read(options.folder);
  if (!truth) throw std::runtime_error(truth.error().text());
  const auto opened = imuscope::open_recording({(options.folder / "capture.lcm").string()}, {});
  if (!opened) throw std::runtime_error(opened.error().text());
  Watch watch(*truth, world);
  const imuscope::EstimatorConfig estimator = imuscope::estimator_config(opened->configuration);
  const auto replayed = imuscope::replay(opened->configuration, estimator, opened->recording, watch);
  if (!replayed) throw std::runtime_error(replayed.error().text());
  double inside = 0.0;
  std::vector<double> rows_s;
  for (std::size_t i = 0; i < watch.row_errors_s.size(); ++i) {
    rows_s.push_back(std::abs(watch.row_errors_s[i]));
    if (rows_s.back() <= 1.96 * watch.row_sds_s[i]) inside += 1.0;
  }
  json result{{"rows_95_s", quantile(rows_s, kShare)},
              {"rows_inside", inside / static_cast<double>(std::max<std::size_t>(rows_s.size(), 1))},
              {"tagged_rows_95_s", quantile(watch.navigation.utc_errors_s(), kShare)},
              {"host_95_s", quantile(watch.host_errors_s, kShare)},
              {"host_worst_s", quantile(watch.host_errors_s, 1.0)},
              {"track_95_s", quantile(watch.track_errors_s(), kShare)},
              {"psi", psi_of(watch.last, world.studies())}};
  for (const auto& [name, score] : watch.navigation.scores()) result[name] = of(*score);
  if (with_bound) result["bound"] = bound(*opened, estimator, *truth, world);
  return result;
}

imusim::Configuration scenario(std::string_view text, const Options& options, std::uint64_t seed) {
  auto configuration = imusim::parse_configuration(std::string(text), "time_goals.toml");
  if (!configuration) throw std::runtime_error(configuration.error().text);
  configuration->scenario.seed = seed;
  configuration->scenario.duration_s = 60.0 * options.minutes;
  // What the filter is told of antenna and receiver is wrong by what its priors allow.
  imusim::Random wrong(seed, "antenna");
  for (imusim::PlayedDevice& device : configuration->devices) {
    if (device.role != imusim::Role::kGnss) continue;
    device.antenna_b_m += imuscope::GnssOptions{}.antenna_lever_arm_sd_m *
                          Eigen::Vector3d(wrong.normal(), wrong.normal(), wrong.normal());
  }
  configuration->gnss.epoch_error_s = kEpochErrorSd_s * wrong.normal();
  configuration->line.clock =
      imusim::PcClock::drawn(imusim::Random(seed, "pc clock"), configuration->scenario.duration_s);
  return *configuration;
}

/// The drives of a cell by their seeds: those that were done before are read from the file.
class Drives {
 public:
  Drives(const Options& options, std::string cell) : options_(options), cell_(std::move(cell)) {
    std::ifstream in(options.results);
    for (std::string line; std::getline(in, line);) {
      const json kept = json::parse(line, nullptr, false);
      if (!kept.is_object() || kept.value("cell", "") != cell_ ||
          kept.value("minutes", 0.0) != options.minutes)
        continue;
      done_[kept.at("seed").get<std::uint64_t>()] = kept.at("result");
    }
  }
  [[nodiscard]] std::vector<json> results(const std::function<json(std::uint64_t)>& run) {
    std::vector<json> all;
    for (std::uint64_t seed = options_.first;
         seed < options_.first + static_cast<std::uint64_t>(options_.drives); ++seed) {
      auto found = done_.find(seed);
      if (found == done_.end()) {
        found = done_.emplace(seed, run(seed)).first;
        if (!options_.results.empty()) {
          std::ofstream(options_.results, std::ios::app) << json{{"cell", cell_},
                                                                 {"minutes", options_.minutes},
                                                                 {"seed", seed},
                                                                 {"result", found->second}}
                                                                .dump()
                                                         << '\n';
        }
      }
      all.push_back(found->second);
    }
    return all;
  }

 private:
  const Options& options_;
  std::string cell_;
  std::map<std::uint64_t, json> done_;
};

struct Mean {
  double value = 0.0;
  double sd = 0.0;  ///< of the mean, from what drives differ by
  std::size_t n = 0;
};

Mean mean_of(const std::vector<double>& values) {
  Mean mean;
  mean.n = values.size();
  const auto n = static_cast<double>(mean.n);
  for (const double value : values) mean.value += value / n;
  double square = 0.0;
  for (const double value : values) square += (value - mean.value) * (value - mean.value);
  mean.sd = mean.n > 1 ? std::sqrt(square / (n - 1.0) / n) : std::nan("");
  return mean;
}

std::vector<double> column(const std::vector<json>& results, const std::function<double(const json&)>& take) {
  std::vector<double> values;
  for (const json& result : results) values.push_back(take(result));
  return values;
}

bool told(const std::string& what, bool is_met) {
  fmt::print("  {:<66} {}\n", what, is_met ? "met" : "MISSED");
  return is_met;
}

constexpr std::array<const char*, 4> kKinds{"heading", "level", "velocity", "position"};

bool quartz(const Options& options) {
  Drives drives(options, "quartz");
  constexpr std::array<double, 3> kPpm{0.0, -50.0, 50.0};
  const auto results = drives.results([&](std::uint64_t seed) {
    json all = json::array();
    for (const double ppm : kPpm) {
      imusim::Configuration configuration = scenario(kVehicle, options, seed);
      configuration.line.clock = imusim::PcClock();
      configuration.line.clock.rate_ppm = ppm;
      all.push_back(drive(configuration, options.folder));
    }
    return all;
  });
  fmt::print("quartz at 0, -50, +50 ppm, the same draws: {} drives of {} min\n", results.size(),
             options.minutes);
  bool good = true;
  for (const char* kind : kKinds) {
    double squares = 0.0;
    for (const json& result : results) {
      for (const std::size_t i : {1U, 2U}) {
        const double apart = (result[i][kind]["rms"].get<double>() - result[0][kind]["rms"].get<double>()) /
                             result[0][kind]["sd"].get<double>();
        squares += apart * apart;
      }
    }
    const double rms = std::sqrt(squares / (2.0 * static_cast<double>(results.size())));
    std::string means;
    for (std::size_t i = 0; i < kPpm.size(); ++i) {
      means += fmt::format(
          " {:.4g}",
          mean_of(column(results, [&](const json& r) { return r[i][kind]["rms"].get<double>(); })).value);
    }
    good &=
        told(fmt::format("{}: rms{} (rad, m/s, m), apart by {:.3f} sd", kind, means, rms), rms <= kEqualInSd);
  }
  double squares = 0.0;
  double n = 0.0;
  for (const json& result : results) {
    for (std::size_t axis = 0; axis < result[0]["psi"].size(); ++axis) {
      for (const std::size_t i : {1U, 2U}) {
        const double apart =
            (result[i]["psi"][axis]["error"].get<double>() - result[0]["psi"][axis]["error"].get<double>()) /
            result[0]["psi"][axis]["sd"].get<double>();
        squares += apart * apart;
        n += 1.0;
      }
    }
  }
  return told(fmt::format("boresight: apart by {:.3f} sd, {} axes", std::sqrt(squares / n), n),
              std::sqrt(squares / n) <= kEqualInSd) &&
         good;
}

bool nees(const Options& options) {
  Drives drives(options, "nees");
  const auto results = drives.results(
      [&](std::uint64_t seed) { return drive(scenario(kVehicle, options, seed), options.folder, true); });
  fmt::print("NEES by UTC, a PC whose clock is drawn: {} drives of {} min\n", results.size(),
             options.minutes);
  bool good = true;
  for (const char* kind : kKinds) {
    const Mean z2 = mean_of(column(results, [&](const json& r) { return r[kind]["z2"].get<double>(); }));
    const double slack = z2.n >= kDrivesToJudge ? kOwnSd * z2.sd : 1e9;
    good &= told(fmt::format("{}: NEES an axis {:.2f} +- {:.2f}", kind, z2.value, z2.sd),
                 z2.value > kNeesLow - slack && z2.value < kNeesHigh + slack);
  }
  const Mean heading =
      mean_of(column(results, [](const json& r) { return std::pow(r["heading"]["rms"].get<double>(), 2); }));
  const Mean claimed =
      mean_of(column(results, [](const json& r) { return std::pow(r["heading"]["sd"].get<double>(), 2); }));
  constexpr double kMdeg = 1e3 * imuscope::kDegPerRad;
  fmt::print("  heading: {:.3f} mdeg rms, {:.3f} claimed\n", kMdeg * std::sqrt(heading.value),
             kMdeg * std::sqrt(claimed.value));
  const auto of_bound = [&](const char* key) {
    return kMdeg * std::sqrt(mean_of(column(results, [&](const json& r) {
                               return std::pow(r["bound"][key].get<double>(), 2);
                             })).value);
  };
  const auto alone = column(results, [](const json& r) { return r["heading"]["rms"].get<double>(); });
  fmt::print(
      "  what the data allow: {:.3f} mdeg, and {:.3f} rms of a filter that knows all that was drawn\n"
      "  single drives: {:.2f} to {:.2f} mdeg rms (5 to 95 %); {} of {} are below {}, KF-GINS's on one\n",
      of_bound("sd"), of_bound("rms"), kMdeg * quantile(alone, 0.05), kMdeg * quantile(alone, 0.95),
      std::count_if(alone.begin(), alone.end(),
                    [&](double rms) { return kMdeg * rms <= kKfGinsHeading_mdeg; }),
      alone.size(), kKfGinsHeading_mdeg);
  const Mean rows =
      mean_of(column(results, [](const json& r) { return r["tagged_rows_95_s"].get<double>(); }));
  return told(fmt::format("UTC of a row, the R-IMU tells it in ticks of 100 us: 95 % within {:.1f} us",
                          1e6 * rows.value),
              rows.value <= kRowUtc_s) &&
         good;
}

/// @param by_ntp  the PC's clock is slewed by NTP as well, at 100 and 500 ppm: a pulse a second later tells
/// of it
bool pps(const Options& options, bool by_ntp) {
  Drives drives(options, by_ntp ? "pps-ntp" : "pps");
  const std::string text = std::string(kVehicle).insert(kVehicle.find("[simulation.line]"), kPulses);
  const auto results = drives.results([&](std::uint64_t seed) {
    imusim::Configuration configuration = scenario(text, options, seed);
    if (!by_ntp) configuration.line.clock.slews.clear();
    return drive(configuration, options.folder);
  });
  fmt::print("the PC's clock by pulses{}: {} drives of {} min\n",
             by_ntp ? ", while NTP slews it by 100 to 500 ppm" : "", results.size(), options.minutes);
  const Mean live = mean_of(column(results, [](const json& r) { return r["host_95_s"].get<double>(); }));
  const Mean track = mean_of(column(results, [](const json& r) { return r["track_95_s"].get<double>(); }));
  const auto worst = column(results, [](const json& r) { return r["host_worst_s"].get<double>(); });
  const bool is_live =
      told(fmt::format("at the moment: 95 % within {:.2f} us, all within {:.1f} us", 1e6 * live.value,
                       1e6 * *std::max_element(worst.begin(), worst.end())),
           live.value <= kHostUtc_s);
  const bool is_later =
      told(fmt::format("afterwards: 95 % within {:.2f} us", 1e6 * track.value), track.value <= kHostUtc_s);
  return is_live && is_later;
}

bool gnss(const Options& options) {
  Drives drives(options, "gnss");
  const auto results = drives.results([&](std::uint64_t seed) {
    imusim::Configuration configuration = scenario(kWithoutUtc, options, seed);
    // From the epoch to the first bit: what receivers take.
    configuration.gnss.epoch_error_s = 0.0;
    configuration.gnss.latency_s = imusim::Random(seed, "receiver").uniform(0.02, 0.2);
    return drive(configuration, options.folder);
  });
  fmt::print("UTC from a receiver's messages alone: {} drives of {} min\n", results.size(), options.minutes);
  const Mean inside = mean_of(column(results, [](const json& r) { return r["rows_inside"].get<double>(); }));
  const Mean rows = mean_of(column(results, [](const json& r) { return r["rows_95_s"].get<double>(); }));
  const bool is_honest =
      told(fmt::format("rows within 1.96 of the stated sd: {:.1f} %", 1e2 * inside.value),
           inside.value >= kShare - (inside.n >= kDrivesToJudge ? kOwnSd * inside.sd : 0.0));
  return told(fmt::format("with RTK and motion: 95 % within {:.2f} ms", 1e3 * rows.value),
              rows.value <= kFoundUtc_s) &&
         is_honest;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{
      "Time against the simulator's truth: quartz, consistency by UTC, UTC of rows and of the PC's clock"};
  Options options;
  options.folder = std::filesystem::temp_directory_path().string();
  app.add_option("--cell", options.cells, "what is looked at")
      ->check(CLI::IsMember({"quartz", "nees", "pps", "pps-ntp", "gnss"}));
  app.add_option("--drives", options.drives, "of each cell");
  app.add_option("--first", options.first, "first seed");
  app.add_option("--minutes", options.minutes, "length of each drive, above two, which settle");
  app.add_option("--results", options.results, "what was done is kept there, and the rest goes on");
  app.add_option("--folder", options.folder,
                 "where a folder for one drive at a time is made, and removed again");
  CLI11_PARSE(app, argc, argv);
  try {
    bool good = true;
    for (const std::string& cell : options.cells) {
      good &= cell == "quartz"    ? quartz(options)
              : cell == "nees"    ? nees(options)
              : cell == "pps"     ? pps(options, false)
              : cell == "pps-ntp" ? pps(options, true)
                                  : gnss(options);
    }
    fmt::print("{}\n", good ? "every goal is met" : "A GOAL IS MISSED");
    return good ? 0 : 1;
  } catch (const std::exception& error) {
    fmt::print(stderr, "imuscope_time_goals: {}\n", error.what());
    return 1;
  }
}
