/// From raw bytes to a mounting, many times: simulated devices write their byte streams, with their clocks,
/// wires and batches of bytes; the study's first pass reads them back; errors are held against the
/// simulator's truth.
///
///   imuscope_through_bytes --seeds 20 [--first 1] [--minutes 15] [--config config/demo.toml]
///                          [--world harsh|ideal] [--reference-class 1..5]
///
/// t_d holds the stream's latency, which is the same in every run of one device: the table shows t_d as it
/// is, and with each device's mean over the runs taken off. Exits 0 only where every goal is met.

#include <fmt/format.h>
#include <CLI/CLI.hpp>
#include <Eigen/Dense>
#include <algorithm>
#include <cstdlib>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "base/units.h"
#include "estimation/calibration/filter_core.h"
#include "estimation/navigation/so3.h"
#include "firmware_sim/imu/sensor_classes.h"
#include "service/pipeline/estimator_setup.h"
#include "service/recording/recording.h"
#include "service/recording/replay.h"
#include "tools/benchmarks/own_folder.h"
#include "tools/trials/navigation_score.h"
#include "tools/trials/s_imu_score.h"

namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using nlohmann::json;

/// Sample-level goals; through bytes they may be missed by a fifth.
const Vector3d kGoalPsi_mdeg(9.5, 8.5, 7.5);
const Vector3d kGoalR_mm(0.65, 0.55, 0.45);
constexpr double kThroughBytes = 1.2;
constexpr double kGoalTimeOffset_us = 200.0;

/// Keeps the last snapshot, and holds the navigation against the truth.
class Last final : public imuscope::CoreSink {
 public:
  explicit Last(const s_imu_score::NavigationTruth& truth) : truth_(truth) {}
  void on_error(const imuscope::ErrorRecord&) noexcept override {}
  void on_event(const imuscope::EstimatorEvent&) noexcept override {}
  void on_snapshot(const imuscope::Snapshot& snapshot) noexcept override {
    last = snapshot;
    if (snapshot.tick >= kSettled_ticks && snapshot.tick % kEvery_ticks == 0)
      navigation.add(snapshot.navigation, snapshot.time_scale, truth_);
  }
  void on_late_sample(const imuscope::LateSample&) noexcept override {}
  imuscope::Snapshot last{};
  s_imu_score::NavigationScore navigation;

 private:
  // From two minutes on, every ten seconds.
  static constexpr std::int64_t kSettled_ticks = 12'000;
  static constexpr std::int64_t kEvery_ticks = 1'000;
  const s_imu_score::NavigationTruth& truth_;
};

struct Options {
  int seeds = 20;
  std::uint64_t first = 1;
  double minutes = 15.0;
  std::string config = "config/demo.toml";
  std::string simulator;
  std::string folder;
  std::string world = "harsh";
  int reference_class = 1;
  std::optional<double> pc_ppm;

  /// Whether errors are held against what the filter reaches where it models all there is.
  [[nodiscard]] bool has_accuracy_goals() const { return world == "ideal" && reference_class == 1; }
};

using Vector6d = Eigen::Matrix<double, 6, 1>;

/// One device over all drives: what is the same in each of them shows here.
struct Device {
  std::vector<double> t_d_error_s;
  Vector6d error_in_sd = Vector6d::Zero();  ///< sum of (psi, r) errors, each in its own sd
  double nees = 0.0;
};

struct Totals {
  int n = 0;
  int not_started = 0;
  Vector3d psi2 = Vector3d::Zero();
  Vector3d psi_var = Vector3d::Zero();
  Vector3d r2 = Vector3d::Zero();
  Vector3d r_var = Vector3d::Zero();
  s_imu_score::SImuScore score;
  s_imu_score::NavigationScore navigation;
  double t_d_var = 0.0;
  std::vector<double> processor_s;  ///< from the files' bytes to the calibration, per drive
  std::map<std::string, Device> devices;
};

s_imu_score::SImuTruth truth_of(const json& imu) {
  const auto vector = [&](const char* key) {
    return imuscope::to_eigen(imu.at(key).get<imuscope::Vector3>());
  };
  s_imu_score::SImuTruth truth;
  truth.C_b_s = imuscope::to_eigen(imu.at("C_b_s").get<imuscope::Matrix3>());
  truth.r_bs_b_m = vector("r_bs_b_m");
  truth.t_d_s = imu.at("t_d_s").get<double>();
  truth.gyro_scale = vector("gyro_scale");
  truth.accel_scale = vector("accel_scale");
  truth.C_s_accel = imuscope::to_eigen(imu.at("C_s_accel").get<imuscope::Matrix3>());
  truth.accel_t_d_s = imu.at("accel_t_d_s").get<double>();
  return truth;
}

void account(const imuscope::SImuOutput& out, double clock_shift_s, const json& truth, Totals& totals) {
  if (!has_estimate(out.status)) {
    ++totals.not_started;
    return;
  }
  const s_imu_score::SImuTruth known = truth_of(truth);
  const Vector6d error = s_imu_score::mounting_error(out, known);
  const Eigen::Map<const Eigen::Matrix<double, 6, 6>> P(out.covariance_psi_r.data());
  Device& device = totals.devices[truth.at("name")];
  device.nees += s_imu_score::mounting_nees(out, known);
  device.error_in_sd += error.cwiseQuotient(P.diagonal().cwiseSqrt());
  device.t_d_error_s.push_back(out.t_d_s + clock_shift_s - known.t_d_s);
  imuscope::SImuOutput as_recorded = out;
  as_recorded.t_d_s += clock_shift_s;
  totals.score.add(as_recorded, known);
  totals.psi2 += error.head<3>().cwiseAbs2();
  totals.r2 += error.tail<3>().cwiseAbs2();
  totals.psi_var += P.diagonal().head<3>();
  totals.r_var += P.diagonal().tail<3>();
  totals.t_d_var += out.sd_t_d_s * out.sd_t_d_s;
  ++totals.n;
}

/// Of every thread of this process.
double processor_time_s() {
  timespec now{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

/// What a configuration says of a reference of that class.
void tell_noise_of(int reference_class, imuscope::ReferenceConfig& reference) {
  const imusim::ReferenceClass noise = imusim::reference_class(reference_class);
  reference.gyro_white_radps_per_sqrt_hz = noise.gyro_white_radps_per_sqrt_hz;
  reference.accel_white_mps2_per_sqrt_hz = noise.accel_white_mps2_per_sqrt_hz;
  reference.gyro_bias.sd = noise.gyro_bias_sd_radps;
  reference.accel_bias.sd = noise.accel_bias_sd_mps2;
  reference.grade = imuscope::reference_grade(noise.gyro_white_radps_per_sqrt_hz);
}

/// One drive: recorded, read back, accounted for.
imuscope::Result<void> run(const Options& options, std::uint64_t seed, Totals& totals) {
  const bench::OwnFolder own(options.folder);
  const auto& recording = own.path();
  const std::string pc_clock = options.pc_ppm ? fmt::format("--pc-ppm {}", *options.pc_ppm) : "";
  const std::string command = fmt::format(
      "'{}' record '{}' --minutes {} --seed {} --world {} --reference-class {} "
      "--truth-hz 100 {} --out '{}' >/dev/null",
      options.simulator, options.config, options.minutes, seed, options.world, options.reference_class,
      pc_clock, recording.string());
  if (std::system(command.c_str()) != 0) return imuscope::work_error("this failed: " + command);
  const auto config = recording / "config.toml";
  const auto configuration = imuscope::load_configuration(config);
  if (!configuration) return tl::unexpected<imuscope::Error>(configuration.error());
  std::vector<std::string> inputs;
  for (const auto& device : configuration->devices) {
    const auto file = recording / (device.name + ".bin");
    if (std::filesystem::exists(file)) inputs.push_back(fmt::format("{}={}", device.name, file.string()));
  }
  const auto known = s_imu_score::NavigationTruth::read(recording);
  if (!known) return tl::unexpected<imuscope::Error>(known.error());
  const double begin_s = processor_time_s();
  const auto opened = imuscope::open_recording(inputs, config);
  if (!opened) return tl::unexpected<imuscope::Error>(opened.error());
  Last sink(*known);
  imuscope::EstimatorConfig estimator = imuscope::estimator_config(opened->configuration);
  tell_noise_of(options.reference_class, estimator.reference);
  // What can be reached where axes are straight and known to be.
  if (options.world == "ideal") {
    for (imuscope::SImuConfig& study : estimator.studies) study.blocks = imuscope::kFullSImuBlocks;
    estimator.reference.grade = {};
  }
  const auto replayed = imuscope::replay(opened->configuration, estimator, opened->recording, sink);
  if (!replayed) return tl::unexpected<imuscope::Error>(replayed.error());
  totals.navigation.add(sink.navigation);
  totals.processor_s.push_back(processor_time_s() - begin_s);
  std::ifstream in(recording / "truth.json");
  const json truth = json::parse(in);
  const auto studies = opened->configuration.study_indices();
  for (std::size_t i = 0; i < studies.size(); ++i) {
    const auto& name = opened->configuration.devices[studies[i]].name;
    for (const auto& imu : truth.at("imus")) {
      if (imu.at("name") != name) continue;
      account(sink.last.studies[i], opened->recording.clocks[studies[i]].shift_s, imu, totals);
    }
  }
  std::filesystem::remove_all(recording);
  return {};
}

std::string three(const Vector3d& v, int digits) {
  return fmt::format("{:.{}f} / {:.{}f} / {:.{}f}", v.x(), digits, v.y(), digits, v.z(), digits);
}

Vector3d rms(const Vector3d& sum, int n) { return (sum / n).cwiseSqrt(); }

void print(const std::string& name, const Device& device) {
  const auto n = static_cast<double>(device.t_d_error_s.size());
  // The mean of n errors of one sd each has an sd of 1/sqrt(n): times sqrt(n) is a normal variable.
  const Vector6d mean = device.error_in_sd / std::sqrt(n);
  fmt::print("  {:8} NEES {:5.2f}, mean error in its own sd: psi {:18} r {:18}\n", name, device.nees / n,
             three(mean.head<3>(), 1), three(mean.tail<3>(), 1));
}

/// @return  whether every goal is met: a NEES that a consistent filter shows in 999 of 1000 runs, and in
/// the ideal world the mounting within the samples' goals and a fifth, and the time offset from drive to
/// drive; and a navigation that is not too sure of itself
bool print(const Options& options, const Totals& t) {
  constexpr double kMdeg = 1e3 * imuscope::kDegPerRad;
  constexpr double kMm = 1e3;
  constexpr double kUs = 1e6;
  fmt::print(
      "{} drives of {} min from raw bytes, {} world, reference of class {}, {} S-IMUs, {} not started\n",
      options.seeds, options.minutes, options.world, options.reference_class, t.n, t.not_started);
  if (t.n == 0 || t.not_started > 0) return false;
  const bool judged = options.has_accuracy_goals();
  const auto goal = [&](const Vector3d& of, int digits) {
    return judged ? "goal " + three(kThroughBytes * of, digits) : std::string();
  };
  fmt::print("  psi  mdeg  rms {:24} sd {:24} {}\n", three(kMdeg * rms(t.psi2, t.n), 2),
             three(kMdeg * rms(t.psi_var, t.n), 2), goal(kGoalPsi_mdeg, 1));
  fmt::print("  r    mm    rms {:24} sd {:24} {}\n", three(kMm * rms(t.r2, t.n), 3),
             three(kMm * rms(t.r_var, t.n), 3), goal(kGoalR_mm, 2));
  double raw = 0.0;
  double centred = 0.0;
  int freedom = 0;
  std::string latencies;
  for (const auto& [name, device] : t.devices) {
    const std::vector<double>& errors = device.t_d_error_s;
    double mean = 0.0;
    for (const double error : errors) mean += error / static_cast<double>(errors.size());
    for (const double error : errors) {
      raw += error * error;
      centred += (error - mean) * (error - mean);
    }
    freedom += static_cast<int>(errors.size()) - 1;
    latencies += fmt::format(" {} {:+.0f}", name, kUs * mean);
  }
  fmt::print("  t_d  us    rms {:<24.1f} sd {:<24.1f} goal {:.0f}\n", kUs * std::sqrt(raw / t.n),
             kUs * std::sqrt(t.t_d_var / t.n), kGoalTimeOffset_us);
  const double from_drive_to_drive_us = freedom > 0 ? kUs * std::sqrt(centred / freedom) : 0.0;
  if (freedom > 0) {
    fmt::print("             rms {:.1f} with each device's mean taken off ({} us)\n", from_drive_to_drive_us,
               latencies.substr(1));
  }
  const double nees_sd = std::sqrt(12.0 / t.n);
  fmt::print("  NEES (6) mean {:.2f}, 95 % band of the mean {:.2f} to {:.2f}\n", t.score.nees6(),
             6.0 - 1.96 * nees_sd, 6.0 + 1.96 * nees_sd);
  fmt::print("{}{}", t.score.table(), t.navigation.table());
  for (const auto& [name, device] : t.devices) print(name, device);
  std::vector<double> times = t.processor_s;
  std::sort(times.begin(), times.end());
  fmt::print("  bytes to calibration: {:.2f} s of processor a drive in the median, {:.2f} s at the least\n",
             times[times.size() / 2], times.front());

  constexpr double kOnceInAThousand = 3.29;  // of a normal variable, both sides
  const bool accurate = (kMdeg * rms(t.psi2, t.n) - kThroughBytes * kGoalPsi_mdeg).maxCoeff() <= 0.0 &&
                        (kMm * rms(t.r2, t.n) - kThroughBytes * kGoalR_mm).maxCoeff() <= 0.0 &&
                        from_drive_to_drive_us <= kGoalTimeOffset_us;
  const bool consistent = std::abs(t.score.nees6() - 6.0) <= kOnceInAThousand * nees_sd;
  const bool navigates = t.navigation.is_honest();
  const bool met = consistent && navigates && (accurate || !judged);
  fmt::print("{}\n", met ? "every goal is met" : "A GOAL IS MISSED");
  return met;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{"From raw bytes to a mounting, many times, against the simulator's truth"};
  Options options;
  options.simulator = (std::filesystem::read_symlink("/proc/self/exe").parent_path() / "imusim").string();
  options.folder = std::filesystem::temp_directory_path().string();
  app.add_option("--seeds", options.seeds, "drives");
  app.add_option("--first", options.first, "first seed");
  app.add_option("--minutes", options.minutes, "length of each drive");
  app.add_option("--config", options.config, "what is simulated")->check(CLI::ExistingFile);
  app.add_option("--folder", options.folder,
                 "where a folder for one recording at a time (80 MB) is made, and removed again");
  app.add_option("--world", options.world,
                 "harsh: sensors with all that data sheets allow and the filter is not told; "
                 "ideal: bias, scale and noise alone")
      ->check(CLI::IsMember({"ideal", "harsh"}));
  app.add_option("--pc-ppm", options.pc_ppm, "rate of the PC's clock; 0 in the ideal world, else drawn");
  app.add_option("--reference-class", options.reference_class,
                 "noise of the reference, which the filter is told: 1 (0.0015 deg/sqrt(h)) to 5 (4.8)")
      ->check(CLI::Range(1, imusim::kReferenceClasses));
  CLI11_PARSE(app, argc, argv);
  try {
    Totals totals;
    for (int i = 0; i < options.seeds; ++i) {
      if (const auto done = run(options, options.first + static_cast<std::uint64_t>(i), totals); !done) {
        fmt::print(stderr, "{}\n", done.error().text());
        return 1;
      }
    }
    return print(options, totals) ? 0 : 1;
  } catch (const std::exception& error) {
    fmt::print(stderr, "imuscope_through_bytes: {}\n", error.what());
    return 1;
  }
}
