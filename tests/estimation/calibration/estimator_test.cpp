#include "estimation/calibration/estimator.h"

#include <gtest/gtest.h>
#include <Eigen/Dense>
#include <cmath>
#include <cstring>
#include <limits>

#include "base/units.h"
#include "estimation/calibration/filter_core.h"
#include "estimation/navigation/so3.h"
#include "sample/eigen_arrays.h"
#include "tests/estimation/calibration/simulated_drive.h"
#include "tests/support/allocation_counter.h"

namespace imuscope {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using test::horizontal_error_m;
using test::SimulatedDrive;
using test::SimulatedStudy;
using test::worst_in_sd;

template <typename Kind>
bool has_event(const Estimator& estimator) {
  for (const EstimatorEvent& event : estimator.events()) {
    if (is<Kind>(event)) return true;
  }
  return false;
}

/// Feeds like test::run() and says whether an event came up.
template <typename Kind>
bool run_until_event(SimulatedDrive& drive, Estimator& estimator, double until_s) {
  while (!drive.done() && drive.time_s() < until_s) {
    test::run(drive, estimator, drive.time_s() + 0.5 / SimulatedDrive::kRate_hz);
    if (has_event<Kind>(estimator)) return true;
  }
  return false;
}

TEST(Estimator, FindsUnknownMountingsTimeOffsetsAndLeverArmsWithinItsOwnSd) {
  const std::vector<SimulatedStudy> truth{{exp_so3(Vector3d(0.02, -0.01, 0.03)), {0.35, -0.22, 0.12}, 0.004},
                                          {exp_so3(Vector3d(0.1, 0.2, -1.5)), {-0.30, 0.25, 0.10}, -0.35},
                                          {exp_so3(Vector3d(3.0, 0.3, 0.2)), {0.10, 0.40, -0.25}, 0.25}};
  SimulatedDrive drive(240.0, truth, 2);
  Estimator estimator(drive.config());
  test::run(drive, estimator);
  for (std::size_t i = 0; i < truth.size(); ++i) {
    const SImuOutput& out = estimator.study(i);
    ASSERT_GE(out.status, CalibrationStatus::kConverging) << "S-IMU " << i;
    EXPECT_LT(worst_in_sd(out, truth[i]), 4.0) << "S-IMU " << i;
    EXPECT_LT(kDegPerRad * test::mounting_error_rad(out, truth[i].C_b_s).norm(), 0.2);
    EXPECT_LT((truth[i].r_bs_b_m - to_eigen(out.r_bs_b_m)).norm(), 0.01);
    EXPECT_NEAR(out.t_d_s, truth[i].t_d_s, 4.0 * out.sd_t_d_s);
    EXPECT_LT(out.sd_t_d_s, 1e-3);
    for (std::size_t a = 0; a < 3; ++a) {
      EXPECT_NEAR(out.nis_gyro[a], 1.0, 0.3);
      EXPECT_NEAR(out.nis_accel[a], 1.0, 0.3);
    }
  }
  EXPECT_EQ(estimator.navigation().status, NavigationStatus::kNavigating);
  EXPECT_LT(horizontal_error_m(estimator.navigation(), drive.motion().state_at(drive.time_s() - 0.01)), 0.05);
  EXPECT_EQ(estimator.counters().covariance_repairs, 0U);
}

TEST(Estimator, AllTwentyFourAxisPermutationsAreFoundWithinSixtySecondsOfDriving) {
  std::vector<Matrix3d> permutations;
  for (int x = 0; x < 3; ++x) {
    for (int y = 0; y < 3; ++y) {
      if (x == y) continue;
      for (int signs = 0; signs < 4; ++signs) {
        Matrix3d C = Matrix3d::Zero();
        C(0, x) = (signs & 1) != 0 ? -1.0 : 1.0;
        C(1, y) = (signs & 2) != 0 ? -1.0 : 1.0;
        C.row(2) = C.row(0).cross(C.row(1));
        permutations.push_back(C);
      }
    }
  }
  ASSERT_EQ(permutations.size(), 24U);
  constexpr double kStandstill_s = 10.0;
  for (std::size_t first = 0; first < permutations.size(); first += kMaxSImus) {
    std::vector<SimulatedStudy> truth(kMaxSImus);
    for (std::size_t i = 0; i < kMaxSImus; ++i)
      truth[i].C_b_s = exp_so3(Vector3d(0.02, -0.03, 0.01)) * permutations[first + i];
    SimulatedDrive drive(150.0, truth, 30 + first);
    Estimator estimator(drive.config());
    test::run(drive, estimator, kStandstill_s + 60.0);
    for (std::size_t i = 0; i < kMaxSImus; ++i) {
      ASSERT_GE(estimator.study(i).status, CalibrationStatus::kConverging) << "permutation " << first + i;
      EXPECT_LT(kDegPerRad * test::mounting_error_rad(estimator.study(i), truth[i].C_b_s).norm(), 2.0);
      EXPECT_LT(worst_in_sd(estimator.study(i), truth[i]), 5.0) << "permutation " << first + i;
    }
  }
}

TEST(Estimator, RandomRotationsAreFoundWithinSixtySecondsOfDriving) {
  std::vector<SimulatedStudy> truth(kMaxSImus);
  for (std::size_t i = 0; i < kMaxSImus; ++i) {
    // Golden-angle turns about axes that spiral over the sphere.
    const double k = static_cast<double>(i);
    const double z = 1.0 - (2.0 * k + 1.0) / static_cast<double>(kMaxSImus);
    const double radius = std::sqrt(1.0 - z * z);
    truth[i].C_b_s =
        exp_so3((0.5 + 0.5 * k) * Vector3d(radius * std::cos(2.4 * k), radius * std::sin(2.4 * k), z));
  }
  SimulatedDrive drive(150.0, truth, 36);
  Estimator estimator(drive.config());
  test::run(drive, estimator, 10.0 + 60.0);
  for (std::size_t i = 0; i < kMaxSImus; ++i) {
    ASSERT_GE(estimator.study(i).status, CalibrationStatus::kConverging) << "rotation " << i;
    EXPECT_LT(kDegPerRad * test::mounting_error_rad(estimator.study(i), truth[i].C_b_s).norm(), 2.0);
    EXPECT_LT(worst_in_sd(estimator.study(i), truth[i]), 5.0) << "rotation " << i;
  }
}

TEST(Estimator, OnAStraightRoadItsSdSaysWhatCannotBeSeen) {
  const std::vector<SimulatedStudy> truth{{exp_so3(Vector3d(0.02, -0.01, 0.03)), {0.35, -0.22, 0.12}, 0.004}};
  double gyro_scale_z[2];
  double psi_x[2];
  for (const bool straight : {true, false}) {
    SimulatedDrive drive(240.0, truth, 16,
                         straight ? imusim::ScenarioKind::kStraightRoad : imusim::ScenarioKind::kDrive);
    EstimatorConfig config = drive.config();
    config.studies[0].prior_C_b_s = Matrix3{1, 0, 0, 0, 1, 0, 0, 0, 1};
    config.studies[0].prior_t_d_s = 0.0;
    Estimator estimator(config);
    test::run(drive, estimator);
    gyro_scale_z[straight] = estimator.study(0).sd_gyro_scale[2] / config.studies[0].prior_gyro_scale_sd[2];
    psi_x[straight] = estimator.study(0).sd_psi_rad[0];
    EXPECT_LT(worst_in_sd(estimator.study(0), truth[0]), 4.0);
  }
  // Without a turn, nothing is learned about the scale of the axis that turns would excite, and the roll
  // boresight, which yaw rate shows best, stays far less known.
  EXPECT_GT(gyro_scale_z[1], 0.95);
  EXPECT_LT(gyro_scale_z[0], 0.6);
  EXPECT_GT(psi_x[1], 1.5 * psi_x[0]);
}

TEST(Estimator, BiasesDecayExactlyAsTheirProcessSays) {
  SimulatedDrive drive(60.0, {{}}, 17);
  EstimatorConfig config = drive.config();
  SImuConfig& study = config.studies[0];
  study.prior_C_b_s = Matrix3{1, 0, 0, 0, 1, 0, 0, 0, 1};
  study.prior_t_d_s = 0.0;
  study.prior_gyro_bias_radps = {0.01, 0.01, 0.01};
  const double sd = 0.002;
  study.noise.gyro_bias.fill({sd, 0.4});  // shorter than the steps, where Euler's form fails
  Estimator estimator(config);
  double first_s = -1.0;
  double last_s = -1.0;
  while (drive.time_s() < 5.0) {
    const double t_s = drive.time_s();
    std::vector<Sample> samples = drive.next();
    samples[1].imu.flags = 0;  // tells the time and nothing else
    const bool heard = static_cast<int>(t_s * SimulatedDrive::kRate_hz) % 70 == 0;
    for (const Sample& sample : samples) {
      if (heard || sample.device != SimulatedDrive::kFirstStudy) estimator.add(sample);
    }
    estimator.advance(samples.back().arrival);
    for (const SImuEpoch& epoch : estimator.epochs()) {
      last_s = static_cast<double>(to_ns(epoch.time)) * 1e-9;
      if (first_s < 0.0) first_s = last_s;
    }
  }
  ASSERT_GT(last_s, first_s + 3.0);
  // With the turn-on in it the process is stationary from the start: C-17.
  const double variance = std::pow(study.turn_on_gyro_sd_radps[0], 2) + sd * sd;
  const double decay = std::exp(-(last_s - first_s) / (0.4 * variance / (sd * sd)));
  EXPECT_NEAR(estimator.study(0).sd_gyro_bias_radps[0], std::sqrt(variance), 1e-12);
  EXPECT_NEAR(estimator.study(0).gyro_bias_radps[0], 0.01 * decay, 1e-15);
}

TEST(Estimator, AnAccelerometerTriadOfItsOwnIsFoundWhereItIsAskedFor) {
  SimulatedStudy truth{exp_so3(Vector3d(0.1, 0.2, -1.5)), {0.35, -0.22, 0.12}, 0.004};
  truth.alpha_rad = Vector3d(0.003, -0.002, 0.004);
  truth.accel_t_d_s = 0.003;
  SimulatedDrive drive(600.0, {truth}, 18);
  EstimatorConfig config = drive.config();
  config.studies[0].blocks |= kAccelBoresightBlock | kAccelTimeOffsetBlock;
  Estimator estimator(config);
  test::run(drive, estimator);
  const SImuOutput& out = estimator.study(0);
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_NEAR(out.accel_boresight_rad[i], truth.alpha_rad(static_cast<Eigen::Index>(i)),
                4.0 * out.sd_accel_boresight_rad[i]);
  }
  EXPECT_LT(out.sd_accel_boresight_rad[2], 0.8 * config.studies[0].prior_accel_boresight_sd_rad[2]);
  EXPECT_LT(out.sd_accel_t_d_s, 0.3 * config.studies[0].prior_accel_t_d_sd_s);
  EXPECT_NEAR(out.t_d_s + out.accel_t_d_s, truth.t_d_s + truth.accel_t_d_s, 4e-4);
  EXPECT_NEAR(out.accel_t_d_s, truth.accel_t_d_s, 4.0 * out.sd_accel_t_d_s);
  EXPECT_LT(worst_in_sd(out, truth), 4.0);
}

TEST(Estimator, ANoiseModelBelowTheFloorIsNotBelieved) {
  const std::vector<SimulatedStudy> truth{{Matrix3d::Identity(), {0.35, -0.22, 0.12}, 0.004}};
  SimulatedDrive drive(150.0, truth, 19);
  EstimatorConfig config = drive.config();
  config.studies[0].prior_C_b_s = Matrix3{1, 0, 0, 0, 1, 0, 0, 0, 1};
  config.studies[0].prior_t_d_s = 0.0;
  Estimator estimator(config);
  SImuNoise bold = config.studies[0].noise;
  for (TriadNoise& gyro : bold.gyro) {
    for (double& sd : gyro.white_sd) sd *= 0.01;
  }
  estimator.set_noise(0, bold);
  test::run(drive, estimator, 50.0);
  // Half of the configured sd at least: NIS of about four, where a hundredth would give ten thousand.
  EXPECT_NEAR(estimator.study(0).nis_gyro[0], 4.0, 1.0);
}

TEST(Estimator, ANoiseModelHandedInLaterTakesForce) {
  const std::vector<SimulatedStudy> truth{{Matrix3d::Identity(), {0.35, -0.22, 0.12}, 0.004}};
  SimulatedDrive drive(150.0, truth, 15);
  EstimatorConfig config = drive.config();
  config.studies[0].prior_C_b_s = Matrix3{1, 0, 0, 0, 1, 0, 0, 0, 1};
  config.studies[0].prior_t_d_s = 0.0;
  const SImuNoise right = config.studies[0].noise;
  for (TriadNoise& gyro : config.studies[0].noise.gyro) {
    for (double& sd : gyro.white_sd) sd *= 2.0;
  }
  Estimator estimator(config);
  test::run(drive, estimator, 70.0);
  EXPECT_NEAR(estimator.study(0).nis_gyro[0], 0.25, 0.08);
  estimator.set_noise(0, right);
  test::run(drive, estimator);
  EXPECT_NEAR(estimator.study(0).nis_gyro[0], 1.0, 0.25);
  EXPECT_LT(worst_in_sd(estimator.study(0), truth[0]), 4.0);
}

TEST(Estimator, WithoutGnssTheCalibrationRunsAndNavigationIsNotOffered) {
  const std::vector<SimulatedStudy> truth{{exp_so3(Vector3d(0.1, 0.2, -1.5)), {-0.30, 0.25, 0.10}, 0.004}};
  SimulatedDrive drive(150.0, truth, 3);
  EstimatorConfig config = drive.config();
  config.gnss.enabled = false;
  Estimator estimator(config);
  test::run(drive, estimator);
  EXPECT_EQ(estimator.navigation().status, NavigationStatus::kNotOffered);
  ASSERT_GE(estimator.study(0).status, CalibrationStatus::kConverging);
  EXPECT_LT(worst_in_sd(estimator.study(0), truth[0]), 4.0);
}

TEST(Estimator, AtStandstillNothingIsLearnedAboutTheAngleAboutGravityNorAboutTheTimeOffset) {
  const std::vector<SimulatedStudy> truth{{exp_so3(Vector3d(0.02, -0.01, 0.03)), {0.35, -0.22, 0.12}, 0.004}};
  SimulatedDrive drive(240.0, truth, 4);  // stands for its first 60 s
  EstimatorConfig config = drive.config();
  config.studies[0].prior_C_b_s = Matrix3{1, 0, 0, 0, 1, 0, 0, 0, 1};
  config.studies[0].prior_t_d_s = 0.0;
  Estimator estimator(config);
  test::run(drive, estimator, 59.0);
  const SImuOutput& out = estimator.study(0);
  EXPECT_EQ(out.regime, Regime::kStatic);
  const Eigen::Map<const Eigen::Matrix<double, 6, 6>> P(out.covariance_psi_r.data());
  const Vector3d about_gravity = drive.motion().state_at(59.0).f_b_mps2.normalized();
  const double sd = std::sqrt(about_gravity.dot(P.topLeftCorner<3, 3>() * about_gravity));
  EXPECT_GT(sd, 0.99 * config.studies[0].prior_boresight_sd_rad[2]);
  EXPECT_GT(out.sd_t_d_s, 0.9 * config.studies[0].prior_t_d_sd_s);
  EXPECT_FALSE(out.t_d_observable);
  EXPECT_FALSE(out.observable[2]);
  EXPECT_GT(out.weakest_relative_sd, 0.99);
}

TEST(Estimator, AllocatesNothingOnceConstructed) {
  const std::vector<SimulatedStudy> truth{{exp_so3(Vector3d(0.1, 0.2, -1.5)), {0.35, -0.22, 0.12}, 0.004},
                                          {Matrix3d::Identity(), {0.1, 0.4, -0.2}, -0.004}};
  SimulatedDrive drive(100.0, truth, 5);
  EstimatorConfig config = drive.config();
  config.navigation.initial_rpy_rad.reset();  // so that the alignment works too
  Estimator estimator(config);
  std::uint64_t allocations = 0;
  while (!drive.done()) {
    const std::vector<Sample> samples = drive.next();
    const std::uint64_t before = test::allocation_count();
    for (const Sample& sample : samples) estimator.add(sample);
    estimator.advance(samples.back().arrival);
    allocations += test::allocation_count() - before;
  }
  EXPECT_EQ(allocations, 0U);
  EXPECT_GT(test::allocation_count(), 0U) << "the counter itself must count";
  EXPECT_GE(estimator.study(0).status, CalibrationStatus::kConverging) << "the run must reach the filter";
}

TEST(Estimator, GivesTheSameBitsForTheSameSamplesAndCuts) {
  const std::vector<SimulatedStudy> truth{{exp_so3(Vector3d(0.1, 0.2, -1.5)), {0.35, -0.22, 0.12}, 0.004}};
  const auto result = [&] {
    SimulatedDrive drive(100.0, truth, 6);
    Estimator estimator(drive.config());
    test::run(drive, estimator);
    std::pair<SImuOutput, NavigationOutput> out{estimator.study(0), estimator.navigation()};
    return out;
  };
  const auto first = result();
  const auto second = result();
  EXPECT_EQ(first.first.C_b_s, second.first.C_b_s);
  EXPECT_EQ(first.first.covariance_psi_r, second.first.covariance_psi_r);
  EXPECT_EQ(first.first.t_d_s, second.first.t_d_s);
  EXPECT_EQ(first.second.latitude_rad, second.second.latitude_rad);
  EXPECT_EQ(first.second.C_b_n, second.second.C_b_n);
}

TEST(Estimator, DelayedGnssGivesTheNavigationOfPromptGnss) {
  const auto result = [](std::size_t delay_epochs) {
    SimulatedDrive drive(120.0, {}, 7);
    Estimator estimator(drive.config());
    std::vector<std::pair<std::uint64_t, Sample>> waiting;
    std::uint64_t k = 0;
    while (!drive.done()) {
      for (const Sample& sample : drive.next()) {
        if (sample.kind == SampleKind::kGnss && k > 0) {
          waiting.emplace_back(k + delay_epochs, sample);
        } else {
          estimator.add(sample);
        }
      }
      while (!waiting.empty() && waiting.front().first <= k) {
        estimator.add(waiting.front().second);
        waiting.erase(waiting.begin());
      }
      estimator.advance(
          host_time_from_ns(static_cast<std::int64_t>((10.0 + 0.01 * static_cast<double>(k)) * 1e9)));
      ++k;
    }
    EXPECT_EQ(estimator.counters().gnss_rejected, 0U);
    return std::pair{estimator.navigation(), drive.motion().state_at(drive.time_s() - 0.01)};
  };
  const auto [prompt, truth] = result(0);
  for (const std::size_t delay : {15U, 60U}) {
    const auto [delayed, same_truth] = result(delay);
    EXPECT_LT(horizontal_error_m(delayed, truth), 0.03) << 10 * delay << " ms";
    // Both saw the same solutions but for the last `delay`, so they agree to a fraction of their sd.
    for (std::size_t i = 0; i < 3; ++i) {
      EXPECT_NEAR(delayed.v_n_mps[i], prompt.v_n_mps[i], 2.0 * prompt.sd_velocity_mps[i]);
      EXPECT_NEAR(delayed.sd_position_m[i], prompt.sd_position_m[i], 0.3 * prompt.sd_position_m[i]);
    }
  }
}

TEST(Estimator, RejectsGnssJumpsAndSaysSo) {
  SimulatedDrive drive(100.0, {}, 8);
  Estimator estimator(drive.config());
  bool told = false;
  std::uint64_t jumped = 0;
  while (!drive.done()) {
    const double t_s = drive.time_s();
    std::vector<Sample> samples = drive.next();
    for (Sample& sample : samples) {
      if (sample.kind == SampleKind::kGnss && t_s > 60.0 && t_s < 63.0) {
        sample.gnss.latitude_rad += 20.0 / 6.37e6;
        ++jumped;
      }
      estimator.add(sample);
    }
    estimator.advance(samples.back().arrival);
    told = told || has_event<event::GnssRejected>(estimator);
  }
  EXPECT_TRUE(told);
  EXPECT_EQ(estimator.counters().gnss_rejected, jumped);
  EXPECT_EQ(estimator.counters().gnss_positions_rejected, jumped);
  EXPECT_LT(horizontal_error_m(estimator.navigation(), drive.motion().state_at(drive.time_s() - 0.01)), 0.05);
}

class EstimatorGap : public testing::TestWithParam<double> {};

TEST_P(EstimatorGap, OfTheReferenceLeavesTheCalibrationConsistentAndNavigationRecovers) {
  const std::vector<SimulatedStudy> truth{{exp_so3(Vector3d(0.1, 0.2, -1.5)), {0.35, -0.22, 0.12}, 0.004}};
  SimulatedDrive drive(240.0, truth, 9);
  Estimator estimator(drive.config());
  test::run(drive, estimator, 150.0);
  const double end_s = drive.time_s() + GetParam();
  while (drive.time_s() < end_s) {
    const std::vector<Sample> samples = drive.next();
    for (const Sample& sample : samples) {
      if (sample.device != SimulatedDrive::kReference) estimator.add(sample);
    }
    estimator.advance(samples.back().arrival);
  }
  test::run(drive, estimator);
  EXPECT_EQ(estimator.counters().reference_gaps, 1U);
  EXPECT_GT(estimator.study(0).counters.no_reference + estimator.study(0).counters.late, 0U);
  EXPECT_LT(worst_in_sd(estimator.study(0), truth[0]), 4.0);
  if (GetParam() <= 1.0) {
    ASSERT_EQ(estimator.navigation().status, NavigationStatus::kNavigating);
    EXPECT_LT(horizontal_error_m(estimator.navigation(), drive.motion().state_at(drive.time_s() - 0.01)),
              0.1);
  }
}
INSTANTIATE_TEST_SUITE_P(TenMillisecondsToTenSeconds, EstimatorGap, testing::Values(0.01, 0.1, 1.0, 10.0));

TEST(Estimator, DetectsATurnedMountAndFindsTheNewOne) {
  const std::vector<SimulatedStudy> truth{{exp_so3(Vector3d(0.1, 0.2, -1.5)), {0.35, -0.22, 0.12}, 0.004}};
  SimulatedDrive drive(360.0, truth, 10);
  Estimator estimator(drive.config());
  test::run(drive, estimator, 150.0);
  ASSERT_GE(estimator.study(0).status, CalibrationStatus::kConverging);
  const Matrix3d turned = exp_so3(Vector3d(0.0, 0.0, 0.3)) * truth[0].C_b_s;
  drive.remount(0, turned);
  EXPECT_TRUE(run_until_event<event::MountingChanged>(drive, estimator, 240.0));
  test::run(drive, estimator);
  EXPECT_EQ(estimator.study(0).counters.resets, 1U);
  ASSERT_GE(estimator.study(0).status, CalibrationStatus::kConverging);
  EXPECT_LT(test::mounting_error_rad(estimator.study(0), turned).norm(), 0.5 * kRadPerDeg);
}

TEST(Estimator, BadSamplesAreCountedAndLeaveTheStateAlone) {
  const std::vector<SimulatedStudy> truth{{Matrix3d::Identity(), {0.35, -0.22, 0.12}, 0.004}};
  SimulatedDrive drive(100.0, truth, 11);
  EstimatorConfig config = drive.config();
  config.studies[0].prior_C_b_s = Matrix3{1, 0, 0, 0, 1, 0, 0, 0, 1};
  config.studies[0].prior_t_d_s = 0.0;
  Estimator estimator(config);
  test::run(drive, estimator, 50.0);
  std::vector<Sample> samples = drive.next();
  const Sample good_reference = samples[0];
  const Sample good_study = samples[1];
  for (const Sample& sample : samples) estimator.add(sample);
  Sample bad = good_study;
  bad.time += std::chrono::milliseconds{1};
  bad.imu.omega_radps[1] = std::numeric_limits<double>::quiet_NaN();
  estimator.add(bad);
  estimator.add(good_study);  // again: time does not increase
  bad = good_reference;
  bad.time += std::chrono::milliseconds{1};
  bad.imu.f_mps2[0] = std::numeric_limits<double>::infinity();
  estimator.add(bad);
  estimator.add(good_reference);
  bad = good_study;
  bad.device = 200;
  estimator.add(bad);
  Sample spike = good_study;
  spike.time += std::chrono::milliseconds{5};
  spike.imu.omega_radps[2] += 100.0;
  estimator.add(spike);
  Sample clipped = good_study;
  clipped.time += std::chrono::milliseconds{7};
  clipped.imu.flags |= kAccelClipY;
  estimator.add(clipped);
  test::run(drive, estimator);
  const SImuCounters& counters = estimator.study(0).counters;
  EXPECT_EQ(counters.not_finite, 1U);
  EXPECT_EQ(counters.not_increasing, 1U);
  EXPECT_EQ(counters.gated_gyro[2], 2U) << "the two windows that share the sample";
  EXPECT_EQ(counters.clipped_accel[1], 1U);
  EXPECT_EQ(estimator.counters().reference_not_finite, 1U);
  EXPECT_EQ(estimator.counters().reference_not_increasing, 1U);
  EXPECT_EQ(estimator.counters().unknown_device, 1U);
  EXPECT_LT(worst_in_sd(estimator.study(0), truth[0]), 4.0);
}

TEST(Estimator, SamplesWhoseReferenceNeverComesAreGivenUpAfterTheLimit) {
  SimulatedDrive drive(100.0, {{}}, 12);
  Estimator estimator(drive.config());
  const std::vector<Sample> samples = drive.next();
  estimator.add(samples[1]);
  estimator.advance(samples[1].arrival + std::chrono::milliseconds{100});
  EXPECT_EQ(estimator.study(0).counters.late, 0U);
  estimator.advance(samples[1].arrival + std::chrono::milliseconds{101});
  EXPECT_EQ(estimator.study(0).counters.late, 1U);
}

TEST(Estimator, TellsThatTheReferencePointsUpwards) {
  SimulatedDrive drive(240.0, {}, 13);
  Estimator estimator(drive.config());
  bool told = false;
  while (drive.time_s() < 20.0) {
    std::vector<Sample> samples = drive.next();
    for (Sample& sample : samples) {
      if (sample.device == SimulatedDrive::kReference) {
        for (const std::size_t axis : {1U, 2U}) {
          sample.imu.omega_radps[axis] = -sample.imu.omega_radps[axis];
          sample.imu.f_mps2[axis] = -sample.imu.f_mps2[axis];
        }
      }
      estimator.add(sample);
    }
    estimator.advance(samples.back().arrival);
    told = told || has_event<event::ReferenceGravityWrong>(estimator);
  }
  EXPECT_TRUE(told);
}

TEST(Estimator, EpochsCarryEverySampleOnceWithTheReferenceAtItsInstant) {
  const std::vector<SimulatedStudy> truth{{Matrix3d::Identity(), {0.35, -0.22, 0.12}, 0.004}};
  SimulatedDrive drive(100.0, truth, 14);
  EstimatorConfig config = drive.config();
  config.studies[0].prior_C_b_s = Matrix3{1, 0, 0, 0, 1, 0, 0, 0, 1};
  config.studies[0].prior_t_d_s = 0.004;
  config.studies[0].prior_t_d_sd_s = 1e-6;
  Estimator estimator(config);
  std::int64_t expected_counter = -1;
  double worst_rate = 0.0;
  double worst_acceleration = 0.0;
  while (!drive.done()) {
    const std::vector<Sample> samples = drive.next();
    for (const Sample& sample : samples) estimator.add(sample);
    estimator.advance(samples.back().arrival);
    for (const SImuEpoch& epoch : estimator.epochs()) {
      if (expected_counter >= 0) {
        ASSERT_EQ(epoch.sample.counter, expected_counter);
      }
      expected_counter = epoch.sample.counter + 1;
      const double t_s = static_cast<double>(to_ns(epoch.time)) * 1e-9 - 10.0 + epoch.t_d_s;
      const imusim::MotionState state = drive.motion().state_at(t_s);
      worst_rate = std::max(
          worst_rate, (to_eigen(epoch.omega_ib_b_radps) - state.omega_ib_b_radps).cwiseAbs().maxCoeff());
      worst_acceleration = std::max(
          worst_acceleration,
          (to_eigen(epoch.omega_dot_ib_b_radps2) - state.omega_dot_ib_b_radps2).cwiseAbs().maxCoeff());
    }
  }
  EXPECT_GT(expected_counter, 9990);
  // Reference noise of 4.4e-6 rad/s per sample, 95 times that in the derivative; 6 sd over 30 000 draws, and
  // the differentiator's 0.03 % at 5 Hz of at most 0.5 rad/s^2.
  EXPECT_LT(worst_rate, 6.0 * 4.4e-6 + 1e-5);
  EXPECT_LT(worst_acceleration, 6.0 * 95.0 * 4.4e-6 + 1e-3);
}

TEST(Estimator, AKnownMountingBeginsOnceTheTimeOffsetIsFound) {
  const std::vector<SimulatedStudy> truth{{exp_so3(Vector3d(0.1, 0.2, -1.5)), {0.35, -0.22, 0.12}, -0.35}};
  SimulatedDrive drive(150.0, truth, 20);
  EstimatorConfig config = drive.config();
  // Half a degree from the truth, and known to a degree.
  config.studies[0].prior_C_b_s =
      to_array(Matrix3d(truth[0].C_b_s * exp_so3(Vector3d(0.5 * kRadPerDeg, 0.0, 0.0))));
  config.studies[0].prior_boresight_sd_rad = {kRadPerDeg, kRadPerDeg, kRadPerDeg};
  Estimator estimator(config);
  bool told_coarse = false;
  while (!drive.done() && !has_estimate(estimator.study(0).status)) {
    test::run(drive, estimator, drive.time_s() + 0.5 / SimulatedDrive::kRate_hz);
    told_coarse = told_coarse || has_event<event::CoarseAlignmentDone>(estimator);
  }
  ASSERT_FALSE(drive.done());
  EXPECT_FALSE(told_coarse) << "the mounting is the configured one, not a new one";
  const SImuOutput& out = estimator.study(0);
  for (std::size_t i = 0; i < 9; ++i) EXPECT_NEAR(out.C_prior[i], (*config.studies[0].prior_C_b_s)[i], 1e-12);
  EXPECT_NEAR(out.t_d_s, truth[0].t_d_s, 4.0 * out.sd_t_d_s);
  EXPECT_NEAR(out.sd_psi_rad[2], kRadPerDeg, 0.1 * kRadPerDeg);
  test::run(drive, estimator);
  EXPECT_LT(worst_in_sd(out, truth[0]), 4.0);
  EXPECT_NEAR(out.t_d_s, truth[0].t_d_s, 4.0 * out.sd_t_d_s);
}

/// A cable that is pulled out with a jerk and put back: the S-IMU sits where it sat.
TEST(Estimator, ADisturbanceBeforeASilenceIsNoNewMounting) {
  const SimulatedStudy truth{exp_so3(Vector3d(0.1, 0.2, -1.5)), {0.35, -0.22, 0.12}, 0.004};
  constexpr double kPulled_s = 200.0;
  for (const double silence_s : {3.0, 30.0}) {
    SimulatedDrive drive(260.0, {truth}, 47);
    Estimator estimator(drive.config());
    while (!drive.done()) {
      const double t_s = drive.time_s();
      HostTime arrival{};
      for (Sample sample : drive.next()) {
        arrival = sample.arrival;
        if (sample.device == SimulatedDrive::kFirstStudy && sample.kind == SampleKind::kImu) {
          if (t_s >= kPulled_s - 0.2 && t_s < kPulled_s) sample.imu.omega_radps[0] += 1.0;
          if (t_s >= kPulled_s && t_s < kPulled_s + silence_s) continue;
        }
        estimator.add(sample);
      }
      estimator.advance(arrival);
      ASSERT_FALSE(has_event<event::MountingChanged>(estimator)) << silence_s << " s of silence, at " << t_s;
    }
    EXPECT_GT(estimator.study(0).counters.gated_gyro[0], 0U) << "it was disturbed";
    EXPECT_TRUE(has_estimate(estimator.study(0).status));
  }
}

TEST(Estimator, AFrozenMountingStaysAsGivenWhateverTheSamplesSay) {
  const std::vector<SimulatedStudy> truth{{exp_so3(Vector3d(0.1, 0.2, -1.5)), {0.35, -0.22, 0.12}, 0.004}};
  SimulatedDrive drive(200.0, truth, 21);
  EstimatorConfig config = drive.config();
  SImuConfig& study = config.studies[0];
  study.blocks = kFullSImuBlocks & ~static_cast<std::uint32_t>(kBoresightBlock);
  study.prior_C_b_s = to_array(truth[0].C_b_s);
  study.prior_t_d_s = 0.0;
  Estimator estimator(config);
  test::run(drive, estimator, 120.0);
  const SImuOutput& out = estimator.study(0);
  const Vector3d arm_error = truth[0].r_bs_b_m - to_eigen(out.r_bs_b_m);
  EXPECT_LT(arm_error.cwiseQuotient(to_eigen(out.sd_r_bs_b_m)).cwiseAbs().maxCoeff(), 4.0);
  EXPECT_LT(to_eigen(out.sd_r_bs_b_m).maxCoeff(), 0.05);
  EXPECT_NEAR(out.t_d_s, truth[0].t_d_s, 4.0 * out.sd_t_d_s);
  drive.remount(0, exp_so3(Vector3d(0.0, 0.0, 0.3)) * truth[0].C_b_s);
  EXPECT_FALSE(run_until_event<event::MountingChanged>(drive, estimator, 200.0));
  EXPECT_EQ(out.counters.resets, 0U);
  EXPECT_LT(test::mounting_error_rad(out, truth[0].C_b_s).norm(), 1e-12);
  EXPECT_EQ(out.sd_psi_rad, Vector3{});
  EXPECT_EQ(out.covariance_psi_r[0], 0.0);
  EXPECT_FALSE(out.observable[3]) << "nothing of samples that do not fit is usable";
}

TEST(Estimator, ANoiseModelThatLetsTheBiasWanderMoreMakesItLessCertain) {
  SimulatedDrive drive(100.0, {{}}, 22);
  EstimatorConfig config = drive.config();
  config.studies[0].prior_C_b_s = Matrix3{1, 0, 0, 0, 1, 0, 0, 0, 1};
  config.studies[0].prior_t_d_s = 0.0;
  Estimator estimator(config);
  test::run(drive, estimator, 80.0);
  const Vector3 gyro_before = estimator.study(0).sd_gyro_bias_radps;
  const Vector3 accel_before = estimator.study(0).sd_accel_bias_mps2;
  SImuNoise restless = config.studies[0].noise;
  restless.gyro_bias[1].sd *= 100.0;  // more than the filter's own: as much again, no more
  estimator.set_noise(0, restless);
  estimator.advance(drive.next().back().arrival);
  EXPECT_NEAR(estimator.study(0).sd_gyro_bias_radps[1], std::sqrt(2.0) * gyro_before[1],
              1e-6 * gyro_before[1]);
  EXPECT_NEAR(estimator.study(0).sd_gyro_bias_radps[0], gyro_before[0], 1e-6 * gyro_before[0]);
  EXPECT_EQ(estimator.study(0).sd_accel_bias_mps2, accel_before);
  restless.accel_bias[2].sd *= 100.0;
  estimator.set_noise(0, restless);
  estimator.advance(drive.next().back().arrival);
  EXPECT_NEAR(estimator.study(0).sd_accel_bias_mps2[2], std::sqrt(2.0) * accel_before[2],
              1e-3 * accel_before[2]);
  EXPECT_NEAR(estimator.study(0).sd_accel_bias_mps2[1], accel_before[1], 1e-3 * accel_before[1]);
}

TEST(Estimator, AtRestAGoodReferenceFindsNorthByItself) {
  SimulatedDrive drive(120.0, {}, 23, imusim::ScenarioKind::kStatic);
  EstimatorConfig config = drive.config();
  config.navigation.initial_rpy_rad.reset();
  Estimator estimator(config);
  ASSERT_TRUE(run_until_event<event::NavigationStarted>(drive, estimator, 120.0));
  EXPECT_EQ(estimator.navigation().method, InitialisationMethod::kGyrocompass);
  test::run(drive, estimator);
  const NavigationOutput& out = estimator.navigation();
  const Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>> C(out.C_b_n.data());
  const imusim::MotionState truth = drive.motion().state_at(drive.time_s() - 0.01);
  EXPECT_LT(log_so3(truth.C_b_n * C.transpose()).norm(), 0.5 * kRadPerDeg);
  EXPECT_LT(horizontal_error_m(out, truth), 0.05);
}

TEST(Estimator, OnlyAWholeAttitudeOfTheReferenceStartsTheNavigation) {
  SimulatedDrive drive(120.0, {}, 24);
  EstimatorConfig config = drive.config();
  config.navigation.initial_rpy_rad.reset();
  struct Case {
    std::uint32_t flags;
    double roll_offset_rad;
    double sd_rad;
    bool starts;
    double heading_sd_rad;
  };
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  constexpr double kSd_rad = 0.5 * kRadPerDeg;
  const double configured_rad = config.navigation.initial_rpy_sd_rad[2];
  const auto whole = static_cast<std::uint32_t>(kRollPitchValid | kHeadingValid);
  const auto with_sd = static_cast<std::uint32_t>(whole | kHasAttitudeSd);
  for (const Case& c :
       {Case{kRollPitchValid, 0.0, kSd_rad, false, 0.0}, Case{kHeadingValid, 0.0, kSd_rad, false, 0.0},
        Case{whole, kNan, kSd_rad, false, 0.0}, Case{whole, 0.0, kSd_rad, true, configured_rad},
        Case{with_sd, 0.0, kSd_rad, true, kSd_rad}, Case{with_sd, 0.0, 0.0, true, configured_rad}}) {
    SimulatedDrive same(120.0, {}, 24);
    Estimator estimator(config);
    while (same.time_s() < 5.0 && estimator.navigation().status != NavigationStatus::kNavigating) {
      const double t_s = same.time_s();
      for (const Sample& sample : same.next()) {
        estimator.add(sample);
        if (sample.device != SimulatedDrive::kReference) continue;
        const imusim::MotionState truth = same.motion().state_at(t_s);
        Sample attitude = sample;
        attitude.kind = SampleKind::kAttitude;
        attitude.attitude.roll_rad = truth.roll_rad + c.roll_offset_rad;
        attitude.attitude.pitch_rad = truth.pitch_rad;
        attitude.attitude.heading_rad = truth.heading_rad;
        attitude.attitude.sd_rpy_rad = {c.sd_rad, c.sd_rad, c.sd_rad};
        attitude.attitude.flags = c.flags;
        estimator.add(attitude);
        estimator.advance(sample.arrival);
      }
    }
    const NavigationOutput& out = estimator.navigation();
    SCOPED_TRACE(testing::Message() << "flags " << c.flags << ", sd " << c.sd_rad);
    ASSERT_EQ(out.status == NavigationStatus::kNavigating, c.starts);
    if (!c.starts) continue;
    EXPECT_EQ(out.method, InitialisationMethod::kReferenceAttitude);
    EXPECT_NEAR(out.sd_rpy_rad[2], c.heading_sd_rad, 0.05 * c.heading_sd_rad);
  }
}

TEST(FilterCore, RepairsVariancesThatAreNoneAndLeavesTheOthers) {
  EstimatorConfig config;
  config.studies.resize(1);
  FilterCore core(config);
  const FilterCore untouched(config);
  const std::size_t lever_arm = core.layout(0).r;
  const std::size_t gyro_bias = core.layout(0).gyro_bias;
  core.covariance().set(lever_arm, lever_arm, -1e-9);
  core.covariance().set(lever_arm, gyro_bias, 1e-7);
  core.covariance().set(gyro_bias, gyro_bias, std::numeric_limits<double>::quiet_NaN());
  std::size_t first = 0;
  EXPECT_EQ(core.repair(first), 2U);
  EXPECT_EQ(first, lever_arm);
  for (std::size_t i = 0; i < core.covariance().dimension(); ++i) {
    for (std::size_t j = 0; j < core.covariance().dimension(); ++j)
      EXPECT_EQ(core.covariance()(i, j), untouched.covariance()(i, j)) << i << ", " << j;
  }
  EXPECT_EQ(core.repair(first), 0U);
}

}  // namespace
}  // namespace imuscope
