/// Everything that the estimator shows of wheels with every kind of trouble: what is right about it, the tests beside
/// this one prove.

#include <gtest/gtest.h>
#include <cmath>
#include <limits>
#include <set>

#include "estimator_text.h"
#include "tests/support/recorded_answer.h"
#include "tools/trials/wheeled_drive.h"

namespace imuscope {
namespace {

using study::ReferenceClass;
using study::WheeledDrive;

bool lies_within(double t_s, double from_s, double to_s) { return t_s > from_s - 1e-6 && t_s < to_s - 1e-6; }

/// Wheels that spin, say nothing, say no number, creep, jump back in time and lose their sign.
bool trouble_wheels(double t_s, Sample& sample) {
  double& speed_mps = sample.odometry.speed_mps;
  if (lies_within(t_s, 40.0, 44.0)) speed_mps += 5.0;
  if (lies_within(t_s, 50.0, 50.1)) speed_mps = std::numeric_limits<double>::quiet_NaN();
  if (lies_within(t_s, 52.0, 52.02)) sample.time -= std::chrono::milliseconds{50};
  if (lies_within(t_s, 55.0, 58.0)) speed_mps *= 0.02;
  if (t_s > 70.0) {
    sample.odometry.flags |= kSpeedHasNoSign;
    speed_mps = std::abs(speed_mps);
  }
  return !lies_within(t_s, 60.0, 61.0);
}

void tell_wheels(test::Answer& lines, WheeledDrive& drive, Estimator& estimator, const std::set<int>& at_s) {
  while (!drive.done()) {
    const double t_s = drive.time_s();
    std::vector<Sample> samples = drive.next();
    for (Sample& sample : samples) {
      if (sample.kind == SampleKind::kOdometry && !trouble_wheels(t_s, sample)) continue;
      if (sample.kind == SampleKind::kGnss && lies_within(t_s, 75.0, 95.0)) continue;
      estimator.add(sample);
    }
    estimator.advance(samples.front().arrival);
    for (const EstimatorEvent& event : estimator.events()) test::add_event(lines, event);
    const auto epoch = std::lround(t_s * WheeledDrive::kRate_hz);
    if (epoch % 100 != 99 || !at_s.contains(static_cast<int>((epoch + 1) / 100))) continue;
    lines.line("after", (epoch + 1) / 100);
    test::add_estimator(lines, estimator);
  }
}

TEST(OdometryAnswers, WheelsWithEveryKindOfTrouble) {
  test::Answer lines;
  for (const ReferenceClass reference : {ReferenceClass::kNavigationGrade, ReferenceClass::kIndustrial}) {
    study::WheeledDriveOptions options;
    options.duration_s = 110.0;
    options.seed = 5;
    options.road_seed = 5;
    options.reference = reference;
    options.wheels.scale = 0.012;
    WheeledDrive drive(options);
    EstimatorConfig config = drive.config(drive.r_bv_b_m() - Eigen::Vector3d(0.06, -0.05, 0.08));
    config.instruction_set = InstructionSet::kBaseline;
    config.odometry.slip_rad_per_mps2 = 0.01;
    if (reference == ReferenceClass::kIndustrial) config.odometry.correlation_time_s = 0.0;
    Estimator estimator(config);
    tell_wheels(lines, drive, estimator, {4, 30, 45, 59, 62, 90, 110});
  }
  test::expect_recorded("estimation/calibration/wheels.txt", lines.text(), 1e-6, 1e-8);
}

TEST(OdometryAnswers, WheelsThatStandWhileTheNavigationMoves) {
  test::Answer lines;
  study::WheeledDriveOptions options;
  options.duration_s = 30.0;
  options.seed = 6;
  options.road_seed = 6;
  WheeledDrive drive(options);
  EstimatorConfig config = drive.config(drive.r_bv_b_m());
  config.instruction_set = InstructionSet::kBaseline;
  config.odometry.use_speed = false;
  Estimator estimator(config);
  while (!drive.done()) {
    const double t_s = drive.time_s();
    std::vector<Sample> samples = drive.next();
    for (Sample& sample : samples) {
      // The receiver runs away at first, and what rest says is refused until it has said so for long.
      if (sample.kind == SampleKind::kGnss) {
        if (t_s > 4.0) continue;
        sample.gnss.latitude_rad += 3e-8 * t_s * t_s;
      }
      if (sample.kind == SampleKind::kImu && t_s > 1.0 && t_s < 3.0) sample.imu.f_mps2[0] += 0.3;
      if (sample.kind == SampleKind::kOdometry) sample.odometry.speed_mps = 0.0;
      estimator.add(sample);
    }
    estimator.advance(samples.front().arrival);
    for (const EstimatorEvent& event : estimator.events()) test::add_event(lines, event);
    if (std::lround(t_s * 100.0) % 200 == 150) {
      test::add_odometry(lines, estimator.odometry());
      lines.line("velocity", estimator.navigation().v_n_mps, estimator.navigation().sd_velocity_mps);
      test::add_counters(lines, estimator.counters());
    }
  }
  test::expect_recorded("estimation/calibration/standing_wheels.txt", lines.text(), 1e-6, 1e-8);
}

}  // namespace
}  // namespace imuscope
