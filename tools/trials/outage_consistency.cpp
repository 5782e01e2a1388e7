/// Does the filter of `imuscope evaluate` predict its own errors? Many simulated drives, sample by sample: an
/// S-IMU of MTx class with the errors of its own model, GNSS in RTK, one outage a drive, so that no two of
/// them share an error. The filter holds the true noise model: what is left is the filter's own doing.
///
///   outage_consistency [--drives 100] [--settle 300]
///
/// A single drive tells less than its number of outages makes believe: the slow bias processes, whose
/// correlation time is minutes, are the same in all of them.

#include <fmt/format.h>
#include <CLI/CLI.hpp>
#include <cmath>
#include <string>
#include <vector>

#include "firmware_sim/imu/imu_model.h"
#include "firmware_sim/imu/sensor_classes.h"
#include "firmware_sim/motion/motion.h"
#include "firmware_sim/random/random.h"
#include "study/evaluation/outages.h"

namespace {

using Eigen::Vector3d;
using imuscope::CoastingModel;
using imuscope::Drive;
using imuscope::OutageResult;

constexpr double kRate_hz = 100.0;
constexpr std::size_t kSamplesPerFix = 10;
const Vector3d kFixSd_m(0.01, 0.01, 0.02);
const Vector3d kAntenna_b_m(-0.50, 0.20, -1.30);
/// A Gauss-Markov process faster than this is white to a coasting filter, as in the evaluation of a run.
constexpr double kSlowest_s = 1.0;
constexpr double kReferenceSd = 1e-4;

imusim::ImuErrors drawn_errors(std::uint64_t seed) {
  imusim::MtxClass mtx;
  mtx.gyro_noise = imusim::GyroNoiseChoice::kAllDynamic;
  mtx.gyro_scale_sd = mtx.accel_scale_sd = 0.0;  // taken out before a drive is evaluated
  imusim::Random random(seed, "unit");
  return imusim::draw_mtx(mtx, random);
}

/// The truth as a filter holds it.
CoastingModel true_model() {
  const imusim::MtxClass mtx;
  const auto gyro = imusim::mtx_gyro_noise(imusim::GyroNoiseChoice::kAllDynamic).in_motion;
  const auto accel = imusim::mtx_accel_noise(mtx.accel_white_sd_mps2).in_motion;
  CoastingModel model;
  model.name = "true";
  for (std::size_t axis = 0; axis < imuscope::kImuAxes; ++axis) {
    const imusim::AxisNoise& truth = axis < 3 ? gyro : accel;
    const double turn_on = axis < 3 ? mtx.gyro_bias_sd_radps : mtx.accel_bias_sd_mps2;
    imuscope::AxisNoise& noise = model.axes[axis];
    noise.white_density = truth.white_variance / kRate_hz;
    noise.turn_on_variance = turn_on * turn_on;
    for (const auto& process : truth.processes) {
      if (process.beta_per_s * kSlowest_s < 1.0) {
        noise.slow.push_back({process.variance, process.beta_per_s});
      } else {
        noise.white_density += 2.0 * process.variance / process.beta_per_s;
      }
    }
  }
  return model;
}

imuscope::NavigationState state_of(const imusim::MotionState& motion) {
  imuscope::NavigationState state;
  state.position = {motion.position.latitude_rad, motion.position.longitude_rad, motion.position.height_m};
  state.v_n_mps = motion.v_n_mps;
  state.C_b_n = motion.C_b_n;
  return state;
}

/// Of a drive of its own, the errors drawn from the seed.
Drive simulated(std::uint64_t seed, double duration_s) {
  imusim::Scenario scenario;
  scenario.duration_s = duration_s;
  scenario.initial_standstill_s = 5.0;
  scenario.seed = seed;
  const imusim::Motion motion(scenario);
  imusim::ImuModel imu(motion, imusim::Mounting{}, drawn_errors(seed), seed, "study");
  imusim::Random fixes(seed, "gnss");
  Drive drive;
  drive.r_sa_s_m = kAntenna_b_m;
  const auto n = static_cast<std::size_t>(duration_s * kRate_hz);
  for (std::size_t k = 0; k < n; ++k) {
    const double t_s = static_cast<double>(k) / kRate_hz;
    const auto reading = imu.sample_at(t_s);
    drive.samples.push_back({t_s, {reading.omega_radps, reading.f_mps2}});
    if (k % kSamplesPerFix != 0) continue;
    const imuscope::NavigationState truth = state_of(motion.state_at(t_s));
    drive.reference.push_back({t_s, truth, imuscope::KinematicVector::Constant(kReferenceSd)});
    imuscope::DriveFix fix;
    fix.time_s = t_s;
    const Vector3d noise(fixes.normal(), fixes.normal(), fixes.normal());
    fix.antenna =
        imuscope::displaced(truth.position, truth.C_b_n * kAntenna_b_m + kFixSd_m.cwiseProduct(noise));
    fix.sd_position_m = kFixSd_m;
    drive.fixes.push_back(fix);
  }
  return drive;
}

void print(const std::vector<OutageResult>& results, double duration_s) {
  imuscope::KinematicVector mean = imuscope::KinematicVector::Zero();
  imuscope::KinematicVector squares = mean;
  imuscope::KinematicVector predicted = mean;
  double n = 0.0;
  for (const OutageResult& result : results) {
    if (result.duration_s != duration_s) continue;
    n += 1.0;
    mean += result.error;
    squares += result.error.cwiseAbs2();
    predicted += result.covariance.diagonal();
  }
  constexpr std::array<const char*, 9> kNames{"north, m",       "east, m",       "down, m",
                                              "v north, m/s",   "v east, m/s",   "v down, m/s",
                                              "phi north, rad", "phi east, rad", "phi down, rad"};
  for (Eigen::Index i = 0; i < mean.size(); ++i) {
    fmt::print("    {:<16} mean {:>9.4f} +- {:<8.4f} rms {:>9.4f}  predicted sd {:>9.4f}\n",
               kNames[static_cast<std::size_t>(i)], mean[i] / n, std::sqrt(squares[i]) / n,
               std::sqrt(squares[i] / n), std::sqrt(predicted[i] / n));
  }
}

}  // namespace

int main(int argc, char** argv) {
  int drives = 100;
  imuscope::OutageOptions options;
  options.settle_s = 300.0;
  options.spacing_s = 1e9;  // one outage a drive
  CLI::App app{"NEES of the coasting filter with the true noise model, over independent drives"};
  app.add_option("--drives", drives, "simulated drives")->check(CLI::PositiveNumber)->capture_default_str();
  app.add_option("--settle", options.settle_s, "seconds in motion with GNSS before the outage")
      ->capture_default_str();
  CLI11_PARSE(app, argc, argv);

  const CoastingModel model = true_model();
  constexpr double kStops = 1.6;  // a drive stands at times
  const double duration_s = 60.0 + kStops * options.settle_s + options.durations_s.back();
  std::vector<OutageResult> results;
  for (int i = 1; i <= drives; ++i) {
    auto of_drive =
        imuscope::play_outages(simulated(static_cast<std::uint64_t>(i), duration_s), model, options);
    for (OutageResult& result : of_drive) result.start_s += 1e6 * i;  // drives do not overlap
    results.insert(results.end(), of_drive.begin(), of_drive.end());
  }
  fmt::print("{} drives, one outage each after {:g} s in motion, the filter holds the true model\n", drives,
             options.settle_s);
  bool good = true;
  for (const auto& row : imuscope::consistency_of(results, options.durations_s)) {
    fmt::print(
        "  after {:g} s ({} outages): NEES position {:.2f}, velocity {:.2f}, attitude {:.2f}; 95 % of "
        "right models in {:.2f} to {:.2f}\n",
        row.duration_s, row.n, row.nees_position, row.nees_velocity, row.nees_attitude, row.nees_low,
        row.nees_high);
    print(results, row.duration_s);
    for (const double nees : {row.nees_position, row.nees_velocity, row.nees_attitude})
      good = good && nees < row.nees_high;
  }
  return good ? 0 : 1;
}
