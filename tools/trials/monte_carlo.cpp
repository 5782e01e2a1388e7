/// How well the estimator does what it claims: sample-level Monte-Carlo of a 15 min drive with three S-IMUs.
/// Prints errors beside the filter's own sd, NEES of (psi, r) and NIS per axis, with the goals.

#include <fmt/format.h>
#include <CLI/CLI.hpp>
#include <Eigen/Dense>
#include <cmath>
#include <map>
#include <string>
#include <vector>

#include "base/units.h"
#include "estimation/calibration/combine.h"
#include "estimation/navigation/so3.h"
#include "firmware_sim/imu/sensor_classes.h"
#include "tools/benchmarks/bench_report.h"
#include "tools/trials/all_threads.h"
#include "tools/trials/six_states.h"
#include "tools/trials/standard_drive.h"

namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using imuscope::kDegPerRad;
using imuscope::kRadPerDeg;
using imuscope::to_array;
using standard_drive::kRate_hz;
using standard_drive::kStudies;
using standard_drive::kTimeOffset_s;
using standard_drive::lever_arm_of;
using standard_drive::mounting_of;
using standard_drive::normal3;

constexpr double kBoresightSd_rad = 2.0 * kRadPerDeg;
constexpr double kLeverArmSd_m = 0.05;
constexpr double kScaleSd = 0.003;
const Vector3d kAttitudeSd_rad(0.01 * kRadPerDeg, 0.01 * kRadPerDeg, 0.03 * kRadPerDeg);
constexpr double kMdeg = 1e3 * kDegPerRad;

struct Goal {
  Vector3d psi_mdeg = Vector3d::Zero();
  Vector3d r_mm = Vector3d::Zero();
  double t_d_us = 0.0;
};

struct Scenario {
  char name;
  const char* what;
  Goal goal;  ///< zero: none
  double duration_s = 900.0;
  double accel_white_mps2 = 0.03;
  imusim::ScenarioKind kind = imusim::ScenarioKind::kDrive;
  bool prior = true;  ///< false: nothing is known of the mounting and the time offset
  /// The paper's 6 states on sensors with biases alone: no scale error, the time offset known. Every run on a
  /// road of its own: what a slow bias does to the angle about the vertical is decided by the road's slopes.
  bool paper = false;
};

std::vector<Scenario> scenarios() {
  const Goal full{{9.5, 8.5, 7.5}, {0.65, 0.55, 0.45}, 30.0};
  Scenario no_prior{'N', "no prior: coarse alignment first", full};
  no_prior.prior = false;
  Scenario vibration{'V', "vibration, 0.15 m/s^2", {{30, 26, 27}, {3.3, 3.3, 3.3}, 120.0}};
  vibration.accel_white_mps2 = 0.15;
  Scenario five_minutes{'L', "first 5 min", {{17, 17, 17}, {}, 0.0}};
  five_minutes.duration_s = 300.0;
  Scenario standstill{'S', "standstill, 59 s", {}};
  standstill.duration_s = 59.0;
  Scenario straight{'G', "straight road", {{16, 9, 10}, {}, 0.0}};
  straight.kind = imusim::ScenarioKind::kStraightRoad;
  Scenario paper{
      'D', "the paper's 6 states, biased sensors, every run on its own road (314 / 303 / 32 expected)", {}};
  paper.paper = true;
  return {{'K', "all states", full}, vibration, paper, standstill, straight, no_prior, five_minutes};
}

/// Sums of one scenario.
struct Totals {
  int n = 0;
  Vector3d psi2 = Vector3d::Zero();
  Vector3d psi_var = Vector3d::Zero();
  Vector3d r2 = Vector3d::Zero();
  Vector3d r_var = Vector3d::Zero();
  Vector3d weighted_mean2 = Vector3d::Zero();
  Vector3d closed_form_psi2 = Vector3d::Zero();
  Vector3d closed_form_r2 = Vector3d::Zero();
  double t_d2 = 0.0;
  double t_d_var = 0.0;
  double about_gravity_min = 1.0;  ///< least sd of the angle about gravity over its prior
  double lever_arm_min = 1.0;      ///< least sd of the lever arm over its prior
  double weakest = 0.0;            ///< relative sd of the weakest direction
  double gyro_scale2 = 0.0;
  std::array<Vector3d, 2> nis{Vector3d::Zero(), Vector3d::Zero()};
  double nis_n = 0.0;
  double attitude2 = 0.0;
  int not_started = 0;
  s_imu_score::SImuScore score;
  double estimator_s = 0.0;
  double epochs = 0.0;

  void add(const Totals& t);
};

void Totals::add(const Totals& t) {
  n += t.n;
  psi2 += t.psi2;
  psi_var += t.psi_var;
  r2 += t.r2;
  r_var += t.r_var;
  weighted_mean2 += t.weighted_mean2;
  closed_form_psi2 += t.closed_form_psi2;
  closed_form_r2 += t.closed_form_r2;
  t_d2 += t.t_d2;
  t_d_var += t.t_d_var;
  about_gravity_min = std::min(about_gravity_min, t.about_gravity_min);
  lever_arm_min = std::min(lever_arm_min, t.lever_arm_min);
  weakest += t.weakest;
  gyro_scale2 += t.gyro_scale2;
  for (std::size_t i = 0; i < nis.size(); ++i) nis[i] += t.nis[i];
  nis_n += t.nis_n;
  attitude2 += t.attitude2;
  not_started += t.not_started;
  score.add(t.score);
  estimator_s += t.estimator_s;
  epochs += t.epochs;
}

struct Options {
  std::size_t seeds = 20;
  std::size_t threads = 1;
  std::uint64_t first = 1;
  std::uint64_t drive = 1;
  std::string names = "KVDSGNL";
  imusim::WorldKind world = imusim::WorldKind::kHarsh;
  int reference_class = 1;
  bool untold = false;      ///< nobody says what noise the reference has
  int average_samples = 0;  ///< 0: chosen by the filter
  int points = 5;
  bool straight_axes = false;  ///< 19 states, also in the harsh world

  /// Whether errors are held against what the filter reaches where it models all there is.
  [[nodiscard]] bool has_accuracy_goals() const {
    return world == imusim::WorldKind::kIdeal && reference_class == 1 && straight_axes;
  }
};

imuscope::EstimatorConfig configure(const Scenario& scenario, const imusim::Motion& motion,
                                    const Options& options, imusim::Random& random) {
  imuscope::EstimatorConfig config = standard_drive::configuration(motion, options.reference_class);
  config.reference.differentiator_points = options.points;
  if (options.world == imusim::WorldKind::kHarsh)  // as the program takes it from the noise that it is told
    config.reference.grade = imuscope::reference_grade(config.reference.gyro_white_radps_per_sqrt_hz);
  if (options.untold) {
    config.reference = imuscope::ReferenceConfig{.device = config.reference.device, .is_known = false};
    config.reference.grade = imuscope::reference_grade(imuscope::kIndustrialGyroWhite_radps_per_sqrt_hz);
  }
  // True = estimate (+) error, with the error drawn about NED.
  const Vector3d phi = normal3(random).cwiseProduct(kAttitudeSd_rad);
  const Matrix3d C_b_n = motion.state_at(0.0).C_b_n;
  const imuscope::EulerAngles rpy = imuscope::euler_from_rotation(imuscope::exp_so3(-phi) * C_b_n);
  config.navigation.initial_rpy_rad = imuscope::Vector3{rpy.roll_rad, rpy.pitch_rad, rpy.heading_rad};
  for (std::size_t i = 0; i < kStudies; ++i) {
    imuscope::SImuConfig& study = config.studies[i];
    study.average_samples = options.average_samples;
    study.blocks = options.straight_axes ? imuscope::kFullSImuBlocks : imuscope::kCompleteSImuBlocks;
    if (scenario.paper) study.blocks = imuscope::kPaperSImuBlocks;
    for (imuscope::TriadNoise& accel : study.noise.accel) accel.white_sd.fill(scenario.accel_white_mps2);
    study.prior_boresight_sd_rad.fill(kBoresightSd_rad);
    study.prior_r_bs_b_sd_m.fill(kLeverArmSd_m);
    study.prior_gyro_scale_sd.fill(kScaleSd);
    study.prior_accel_scale_sd.fill(kScaleSd);
    const Vector3d psi = kBoresightSd_rad * normal3(random);
    const Vector3d dr = kLeverArmSd_m * normal3(random);
    study.prior_r_bs_b_m = to_array(Vector3d(lever_arm_of(i) - dr));
    if (!scenario.prior) continue;
    study.prior_C_b_s = to_array(Matrix3d(mounting_of(i) * imuscope::exp_so3(psi)));
    study.prior_t_d_s = scenario.paper ? kTimeOffset_s : 0.0;
  }
  return config;
}

standard_drive::Draw draw(const Scenario& scenario, const Options& options, imusim::Random& random,
                          std::uint64_t seed) {
  standard_drive::DrawOptions drawn;
  drawn.world = options.world;
  drawn.reference_class = options.reference_class;
  drawn.mtx.gyro_noise = imusim::GyroNoiseChoice::kAllDynamic;
  drawn.mtx.accel_white_sd_mps2 = scenario.accel_white_mps2;
  drawn.mtx.gyro_scale_sd = drawn.mtx.accel_scale_sd = scenario.paper ? 0.0 : kScaleSd;
  return standard_drive::draw(drawn, random, seed);
}

Vector3d psi_error(const imuscope::SImuOutput& out, std::size_t study) {
  const Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>> C(out.C_b_s.data());
  return -imuscope::log_so3(C.transpose() * mounting_of(study));
}

/// The paper's final values: error of the mean over the run weighted by 1/sd^2.
class WeightedErrors {
 public:
  void add(const imuscope::Estimator& estimator) {
    for (std::size_t i = 0; i < kStudies; ++i) {
      const imuscope::SImuOutput& out = estimator.study(i);
      if (!has_estimate(out.status)) continue;
      const Vector3d error = psi_error(out, i);
      for (std::size_t a = 0; a < 3; ++a)
        means_[i][a].add(error(static_cast<Eigen::Index>(a)), out.sd_psi_rad[a]);
    }
  }
  [[nodiscard]] Vector3d mean(std::size_t i) const {
    return {means_[i][0].mean(), means_[i][1].mean(), means_[i][2].mean()};
  }

 private:
  std::array<std::array<imuscope::WeightedMean, 3>, kStudies> means_;
};

void account(const Scenario& scenario, const imuscope::Estimator& estimator,
             const standard_drive::Draw& errors, const WeightedErrors& weighted,
             const imusim::MotionState& end, Totals& totals) {
  for (std::size_t i = 0; i < kStudies; ++i) {
    const imuscope::SImuOutput& out = estimator.study(i);
    if (!has_estimate(out.status)) {
      ++totals.not_started;
      continue;
    }
    const s_imu_score::SImuTruth truth = standard_drive::truth_of(errors, i);
    totals.score.add(out, truth);
    const Eigen::Matrix<double, 6, 1> error = s_imu_score::mounting_error(out, truth);
    const Eigen::Map<const Eigen::Matrix<double, 6, 6>> P(out.covariance_psi_r.data());
    totals.psi2 += error.head<3>().cwiseAbs2();
    totals.r2 += error.tail<3>().cwiseAbs2();
    totals.psi_var += P.diagonal().head<3>();
    totals.r_var += P.diagonal().tail<3>();
    totals.weighted_mean2 += weighted.mean(i).cwiseAbs2();
    const Vector3d about_gravity = end.f_b_mps2.normalized();
    const double sd = std::sqrt(about_gravity.dot(P.topLeftCorner<3, 3>() * about_gravity));
    totals.about_gravity_min = std::min(totals.about_gravity_min, sd / kBoresightSd_rad);
    totals.lever_arm_min =
        std::min(totals.lever_arm_min, std::sqrt(P.diagonal().tail<3>().minCoeff()) / kLeverArmSd_m);
    totals.weakest += out.weakest_relative_sd;
    const double t_d_error = truth.t_d_s - out.t_d_s;
    totals.t_d2 += t_d_error * t_d_error;
    totals.t_d_var += out.sd_t_d_s * out.sd_t_d_s;
    const double scale_error = errors.studies[i].gyro.scale.z() - out.gyro_scale[2];
    totals.gyro_scale2 += scenario.paper ? 0.0 : scale_error * scale_error;
    ++totals.n;
  }
}

void account_nis(const imuscope::Estimator& estimator, Totals& totals) {
  for (const imuscope::SImuEpoch& epoch : estimator.epochs()) {
    if (!epoch.calibrating) continue;
    for (std::size_t a = 0; a < 3; ++a) {
      const auto axis = static_cast<Eigen::Index>(a);
      totals.nis[0](axis) +=
          epoch.innovation_gyro_radps[a] * epoch.innovation_gyro_radps[a] / epoch.variance_gyro[a];
      totals.nis[1](axis) +=
          epoch.innovation_accel_mps2[a] * epoch.innovation_accel_mps2[a] / epoch.variance_accel[a];
    }
    totals.nis_n += 1.0;
  }
}

Totals run(const Scenario& scenario, const Options& options, const standard_drive::Truth& truth,
           std::uint64_t seed) {
  Totals totals;
  imusim::Random random(seed, "study");
  imuscope::Estimator estimator(configure(scenario, truth.motion(), options, random));
  const standard_drive::Draw errors = draw(scenario, options, random, seed);
  standard_drive::Instruments instruments(truth, errors, seed);
  WeightedErrors weighted;
  constexpr std::size_t kWeightEvery = 10;
  for (std::size_t k = 0; k < truth.ticks(); ++k) {
    const standard_drive::Tick& tick = instruments.next();
    const double begin_s = bench::processor_time_s();
    for (const imuscope::Sample& sample : tick) estimator.add(sample);
    estimator.advance(tick.front().arrival);
    totals.estimator_s += bench::processor_time_s() - begin_s;
    account_nis(estimator, totals);
    if (scenario.paper && k % kWeightEvery == 0) weighted.add(estimator);
  }
  totals.epochs = static_cast<double>(truth.ticks());
  const imusim::MotionState end = truth.end();
  account(scenario, estimator, errors, weighted, end, totals);
  const Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>> C_b_n(
      estimator.navigation().C_b_n.data());
  totals.attitude2 = imuscope::log_so3(end.C_b_n * C_b_n.transpose()).squaredNorm();
  return totals;
}

/// What six states must make of a drive, without any filter.
void account_closed_form(const Scenario& scenario, const imusim::Motion& motion, Totals& totals) {
  const imuscope::SImuConfig study = standard_drive::configuration(motion).studies.front();
  for (std::size_t i = 0; i < kStudies; ++i) {
    const auto errors = standard_drive::six_state_errors(motion, scenario.duration_s, lever_arm_of(i), study);
    totals.closed_form_psi2 += errors.psi_rad.cwiseAbs2();
    totals.closed_form_r2 += errors.r_m.cwiseAbs2();
  }
}

/// Every seed on its own; summed in their order, so that the number of threads changes nothing.
Totals run_all(const Scenario& scenario, const Options& options) {
  const std::size_t seeds = options.seeds;
  imusim::Scenario drive;
  drive.kind = scenario.kind;
  drive.seed = options.drive;
  const standard_drive::Truth common(drive, scenario.paper ? 1.0 : scenario.duration_s, options.world);
  std::vector<Totals> each(seeds);
  imuscope::on_all_threads(seeds, options.threads, [&](std::size_t i) {
    const std::uint64_t seed = options.first + i;
    if (!scenario.paper) {
      each[i] = run(scenario, options, common, seed);
      return;
    }
    imusim::Scenario own = drive;
    own.seed = options.drive + seed;
    const standard_drive::Truth truth(own, scenario.duration_s, options.world);
    each[i] = run(scenario, options, truth, seed);
    account_closed_form(scenario, truth.motion(), each[i]);
  });
  Totals sum;
  for (const Totals& totals : each) sum.add(totals);
  return sum;
}

Vector3d rms(const Vector3d& sum, int n) { return (sum / n).cwiseSqrt(); }

std::string three(const Vector3d& v, int digits) {
  return fmt::format("{:.{}f} / {:.{}f} / {:.{}f}", v.x(), digits, v.y(), digits, v.z(), digits);
}

/// Whether goals are met, said one by one and remembered together.
class Judge {
 public:
  const char* operator()(bool met) {
    all_met_ = all_met_ && met;
    return met ? "met" : "MISSED";
  }
  [[nodiscard]] bool all_met() const { return all_met_; }

 private:
  bool all_met_ = true;
};

void print_line(const char* what, const Vector3d& error, const Vector3d& sd, const Vector3d& goal, int digits,
                Judge& judge) {
  fmt::print("   {:10} rms {:24} sd {:24}", what, three(error, digits), three(sd, digits));
  if (goal.isZero()) {
    fmt::print("\n");
  } else {
    fmt::print(" goal {:20} {}\n", three(goal, 2), judge((error.array() <= goal.array()).all()));
  }
}

void print(const Scenario& scenario, const Totals& t, const Options& options, Judge& judge) {
  const std::size_t seeds = options.seeds;
  const Goal goal = options.has_accuracy_goals() ? scenario.goal : Goal{};
  fmt::print("{}  {} ({} seeds, {} results, {} not started)\n", scenario.name, scenario.what, seeds, t.n,
             t.not_started);
  if (t.n == 0) {
    fmt::print("   nothing estimated: {}\n", judge(false));
    return;
  }
  print_line("psi  mdeg", kMdeg * rms(t.psi2, t.n), kMdeg * rms(t.psi_var, t.n), goal.psi_mdeg, 2, judge);
  if (scenario.paper)
    fmt::print(
        "   psi  mdeg  rms {} of the paper's weighted mean\n"
        "   psi  mdeg  rms {}, r mm rms {} by the closed form of least squares without biases\n",
        three(kMdeg * rms(t.weighted_mean2, t.n), 2), three(kMdeg * rms(t.closed_form_psi2, t.n), 1),
        three(1e3 * rms(t.closed_form_r2, t.n), 2));
  print_line("r    mm", 1e3 * rms(t.r2, t.n), 1e3 * rms(t.r_var, t.n), goal.r_mm, 3, judge);
  const double t_d_us = 1e6 * std::sqrt(t.t_d2 / t.n);
  fmt::print("   t_d  us    rms {:<24.1f} sd {:<24.1f}", t_d_us, 1e6 * std::sqrt(t.t_d_var / t.n));
  if (goal.t_d_us > 0.0) fmt::print(" goal {:<20.0f} {}", goal.t_d_us, judge(t_d_us <= goal.t_d_us));
  const double nees = t.score.nees6();
  const double band = 1.96 * std::sqrt(12.0 / t.n);
  fmt::print("\n   NEES (6)   mean {:.2f}, 95 % band of the mean {:.2f} to {:.2f}", nees, 6.0 - band,
             6.0 + band);
  const Vector3d gyro = t.nis[0] / t.nis_n;
  const Vector3d accel = t.nis[1] / t.nis_n;
  fmt::print("\n   NIS        gyro {}   accel {}", three(gyro, 3), three(accel, 3));
  if (!scenario.paper && options.world == imusim::WorldKind::kIdeal) {
    const double worst =
        std::max((gyro.array() - 1.0).abs().maxCoeff(), (accel.array() - 1.0).abs().maxCoeff());
    fmt::print(", goal 0.95 to 1.05: {}", judge(worst <= 0.05));
  }
  fmt::print("\n{}", t.score.table());
  if (!scenario.paper)
    fmt::print(
        "   every kind of state within its 95 % interval in 93 to 97 % of all cases, NEES in 5.4 to 6.6, within 3.3 of their own sd: {}\n",
        judge(t.score.honest()));
  fmt::print(
      "   least sd of the lever arm {:.2f} %, about gravity {:.2f} % of its prior, weakest direction {:.4f}",
      1e2 * t.lever_arm_min, 1e2 * t.about_gravity_min, t.weakest / t.n);
  if (scenario.name == 'S')
    fmt::print(", goal 99 %: {}", judge(t.lever_arm_min >= 0.99 && t.about_gravity_min >= 0.99));
  fmt::print(
      "\n   gyro scale z rms {:.4f} %, R attitude rms {:.2f} mdeg, {:.1f} us of processor an epoch\n\n",
      1e2 * std::sqrt(t.gyro_scale2 / t.n), kMdeg * std::sqrt(t.attitude2 / static_cast<double>(seeds)),
      1e6 * t.estimator_s / t.epochs);
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{"Monte-Carlo of the estimator: errors, sd, NEES and NIS beside the goals"};
  Options options;
  bool straight = false;
  app.add_option("--seeds", options.seeds, "runs per scenario")->check(CLI::Range(1, 100000));
  app.add_option("--first", options.first, "first seed");
  app.add_option("--threads", options.threads, "runs at a time")->check(CLI::Range(1, 256));
  app.add_option("--drive", options.drive, "seed of the drive itself: road, turns and stops");
  app.add_option("--scenarios", options.names,
                 "letters: K all states, V vibration, D paper's states, S standstill, G "
                 "straight road, N no prior, L 5 min");
  app.add_option("--world", options.world,
                 "harsh: sensors with all that data sheets allow and the filter is not told; "
                 "ideal: bias, scale and noise alone")
      ->transform(CLI::CheckedTransformer(std::map<std::string, imusim::WorldKind>{
          {"ideal", imusim::WorldKind::kIdeal}, {"harsh", imusim::WorldKind::kHarsh}}))
      ->default_str("harsh");
  app.add_option(
         "--reference-class", options.reference_class,
         "noise of the reference, which the filter is told unless --untold: 1 (0.0015 deg/sqrt(h)) to 5 (4.8)")
      ->check(CLI::Range(1, imusim::kReferenceClasses));
  app.add_flag("--untold", options.untold, "the filter is not told the reference's noise");
  app.add_option("--average-samples", options.average_samples, "as the configuration's key");
  app.add_option("--points", options.points, "of the differentiator, as the configuration's key");
  const auto* states =
      app.add_option("--states", straight, "full: with crooked axes, places, g-sensitivity; rigid: without")
          ->transform(CLI::CheckedTransformer(std::map<std::string, bool>{{"full", false}, {"rigid", true}}))
          ->default_str("full in the harsh world, rigid in the ideal one");
  CLI11_PARSE(app, argc, argv);
  options.straight_axes = states->count() > 0 ? straight : options.world == imusim::WorldKind::kIdeal;
  fmt::print("{} world, reference of class {}, {} states an S-IMU\n\n",
             options.world == imusim::WorldKind::kHarsh ? "harsh" : "ideal", options.reference_class,
             options.straight_axes ? 19 : 45);
  Judge judge;
  for (const Scenario& scenario : scenarios()) {
    if (options.names.find(scenario.name) == std::string::npos) continue;
    if (scenario.paper && options.world == imusim::WorldKind::kHarsh) continue;  // biases alone
    print(scenario, run_all(scenario, options), options, judge);
    std::fflush(stdout);
  }
  fmt::print("{}\n", judge.all_met() ? "every goal is met" : "NOT every goal is met");
  return judge.all_met() ? 0 : 1;
}
