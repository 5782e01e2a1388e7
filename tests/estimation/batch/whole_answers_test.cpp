/// Whole results of the batch estimate, and the words with which it refuses: what is right about them, the tests beside
/// this one prove.

#include <gtest/gtest.h>
#include <cmath>
#include <string>

#include "estimation/batch/batch_mounting.h"
#include "estimation/navigation/so3.h"
#include "synthetic_pair.h"
#include "tests/support/answer.h"
#include "tests/support/recorded_answer.h"

namespace {

using namespace imuscope::batch;
using imuscope::test::Answer;
using synthetic::Pair;
using synthetic::PairOptions;

/// The estimate ends at steps of a tenth of its sd: what rounding makes of that.
constexpr double kShare = 1e-4;
constexpr double kNothing = 1e-12;

PairOptions bent_sensor() {
  PairOptions options;
  options.duration_s = 100.0;
  options.study_rate_hz = 120.0;
  options.C_b_s = imuscope::exp_so3(Eigen::Vector3d(0.02, -0.03, 1.6));
  options.gyro_matrix << 1.004, 0, 0, 0.0015, 0.997, 0, -0.0020, 0.0012, 1.002;
  options.accel_matrix << 0.998, 0, 0, -0.0011, 1.003, 0, 0.0008, 0.0017, 0.996;
  options.accel_delay_s = 0.0008;
  options.clock_rate = 8e-6;
  options.lost_share = 0.01;
  options.road_rate = 1e-3;
  return options;
}

void add_estimate(Answer& lines, const BatchMounting& found) {
  lines.line("mounting", found.sensor.C_b_s, found.sensor.above);
  lines.line("parameters", found.sensor.x);
  lines.line("sd", found.covariance.diagonal().cwiseSqrt());
  lines.line("correlations", Eigen::MatrixXd(1e6 * found.covariance.topLeftCorner<8, 8>()));
  lines.line("biases and shapes", Eigen::VectorXd(1e6 * found.covariance.rowwise().sum()));
  lines.line("named sd", found.sd(kPsi, 2), found.sd(kTimeOffset));
  lines.line("numbers", found.rate_correlation, found.middle_s, found.used_s, found.windows,
             found.degrees_of_freedom, found.inconsistency, found.one_chip, found.iterations, found.settled);
  lines.line("limits", found.limits.sensor, found.limits.reference, found.limits.drive());
  lines.line("change", found.change.window, found.change.statistic, found.change_s, found.change.difference,
             found.change.reach);
  lines.line("shared", Eigen::MatrixXd(1e6 * found.shared * found.shared.transpose()));
  for (const BandReport& band : found.bands)
    lines.line("band", band.from_hz, band.to_hz, 1e3 * band.gyro_density, 1e3 * band.accel_density,
               band.gyro_deviation_sd, band.accel_deviation_sd);
}

void add_answer(Answer& lines, std::string_view name, const Pair& pair, const BatchOptions& options = {}) {
  lines.line(name);
  const auto found = estimate_mounting(pair.reference, pair.study, options);
  if (found) {
    add_estimate(lines, *found);
  } else {
    lines.line("error", found.error().kind, found.error().text());
  }
}

TEST(BatchAnswers, BentSensor) {
  Answer lines;
  add_answer(lines, "bent", synthetic::make_pair(bent_sensor(), 1));
  imuscope::test::expect_recorded("estimation/batch/bent_sensor.txt", lines.text(), kShare, kNothing);
}

TEST(BatchAnswers, NoisyReferenceOfAGivenClass) {
  Answer lines;
  PairOptions options = bent_sensor();
  options.reference_gyro_white = 4e-4;
  options.reference_accel_white = 5e-3;
  options.compliance_b << -8e-5, 3e-5, 4e-5, -2e-5, 9e-5, -4e-5, -1e-5, 2e-5, 4e-5;
  options.places_s_m << 0.012, 0.0, 0.004, -0.012, 0.008, 0.0, 0.0, -0.008, -0.004;
  BatchOptions batch;
  batch.search_s = 1.0;
  batch.sensor.lever_arm_sd_m = 0.4;
  batch.reference_gyro_white_radps_per_sqrt_hz = 3e-4;
  add_answer(lines, "noisy", synthetic::make_pair(options, 2), batch);
  imuscope::test::expect_recorded("estimation/batch/noisy_reference.txt", lines.text(), kShare, kNothing);
}

/// The S-IMU's samples from `from_s` on, changed one by one.
template <typename Change>
Pair changed_from(Pair pair, double from_s, const Change& change) {
  for (std::size_t i = 0; i < pair.study.size(); ++i)
    if (pair.study.time_s[i] >= from_s) change(pair.study, i);
  return pair;
}

TEST(BatchAnswers, DriveOnWhichTheSensorTurns) {
  Answer lines;
  const Pair pair = synthetic::make_pair(bent_sensor(), 4);
  const auto turned_by = [&](double angle_rad) {
    const Eigen::Matrix3f turn = imuscope::exp_so3(Eigen::Vector3d(0.0, angle_rad, 0.0)).cast<float>();
    return changed_from(pair, 60.0, [&](ImuRecord& record, std::size_t i) {
      record.omega_radps[i] = (turn * record.omega_radps[i]).eval();
      record.f_mps2[i] = (turn * record.f_mps2[i]).eval();
    });
  };
  add_answer(lines, "by half a degree", turned_by(0.009));
  imuscope::test::expect_recorded("estimation/batch/sensor_turns.txt", lines.text(), kShare, kNothing);
}

TEST(BatchAnswers, Refusals) {
  Answer lines;
  PairOptions options = bent_sensor();
  options.duration_s = 70.0;
  options.road_rate = 0.0;
  const Pair pair = synthetic::make_pair(options, 4);
  const auto words = [&](std::string_view name, const Pair& one) {
    const auto found = estimate_mounting(one.reference, one.study);
    lines.line(name, found ? std::string("none") : found.error().text());
  };
  for (const double jump_s : {0.002, 0.03})
    words("clock jumps",
          changed_from(pair, 40.0, [&](ImuRecord& record, std::size_t i) { record.time_s[i] += jump_s; }));
  for (const double rate : {5e-5, -3e-4})
    words("clock gains", changed_from(pair, 0.0, [&](ImuRecord& record, std::size_t i) {
            record.time_s[i] += rate * (record.time_s[i] - 35.0);
          }));
  words("mounting changes", changed_from(pair, 40.0, [](ImuRecord& record, std::size_t i) {
          const Eigen::Matrix3f turn = imuscope::exp_so3(Eigen::Vector3d(0.0, 0.0, 0.8)).cast<float>();
          record.omega_radps[i] = (turn * record.omega_radps[i]).eval();
          record.f_mps2[i] = (turn * record.f_mps2[i]).eval();
        }));
  words("gyro axis",
        changed_from(pair, 0.0, [](ImuRecord& record, std::size_t i) { record.omega_radps[i][1] *= 1.3F; }));
  words("accelerometer axis",
        changed_from(pair, 0.0, [](ImuRecord& record, std::size_t i) { record.f_mps2[i][0] *= 0.7F; }));
  Pair holed;
  holed.reference = pair.reference;
  for (std::size_t i = 0; i < pair.study.size(); ++i)
    if (std::fmod(pair.study.time_s[i], 5.0) > 0.1)
      holed.study.add(pair.study.time_s[i], pair.study.omega_radps[i], pair.study.f_mps2[i]);
  words("gaps everywhere", holed);
  imuscope::test::expect_recorded("estimation/batch/refusals.txt", lines.text(), 0.01);
}

}  // namespace
