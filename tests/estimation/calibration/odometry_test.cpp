// Wheel speeds in the filter, on the simulated vehicle.
#include <gtest/gtest.h>
#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <numbers>

#include "estimation/calibration/regime_detector.h"
#include "estimation/navigation/so3.h"
#include "sample/eigen_arrays.h"
#include "tests/support/allocation_counter.h"
#include "tools/trials/wheeled_drive.h"

namespace imuscope {
namespace {

using Eigen::Vector3d;
using study::ReferenceClass;
using study::WheeledDrive;
using study::WheeledDriveOptions;

/// What the wheels of the test do with a sample; false takes it away.
using Tamper = std::function<bool(double t_s, Sample& sample)>;
bool leave(double /*t_s*/, Sample& /*sample*/) { return true; }

struct Told {
  std::vector<EstimatorEvent> events;
  template <typename Kind>
  [[nodiscard]] long count() const {
    return std::count_if(events.begin(), events.end(), is<Kind>);
  }
};

Told run(WheeledDrive& drive, Estimator& estimator, double until_s, const Tamper& tamper = leave) {
  Told told;
  while (!drive.done() && drive.time_s() < until_s) {
    const double t_s = drive.time_s();
    std::vector<Sample> samples = drive.next();
    for (Sample& sample : samples) {
      if (tamper(t_s, sample)) estimator.add(sample);
    }
    estimator.advance(samples.front().arrival);
    told.events.insert(told.events.end(), estimator.events().begin(), estimator.events().end());
  }
  return told;
}

bool without_gnss(double /*t_s*/, Sample& sample) { return sample.kind != SampleKind::kGnss; }

double horizontal_error_m(const WheeledDrive& drive, const Estimator& estimator) {
  const double t_s = drive.time_s() - 1.0 / WheeledDrive::kRate_hz;
  return study::position_error_n_m(estimator.navigation(), drive.truth_at(t_s)).head<2>().norm();
}

WheeledDriveOptions options_of(ReferenceClass reference, std::uint64_t seed) {
  WheeledDriveOptions options;
  options.duration_s = 300.0;
  options.seed = seed;
  options.road_seed = seed;
  options.reference = reference;
  options.wheels.scale = 0.012;
  return options;
}

const Vector3d kGuessError(0.06, -0.05, 0.08);

TEST(Odometry, FindsScaleMountingAndLeverArmWithinItsOwnSd) {
  double nees = 0.0;
  constexpr int kRuns = 4;
  for (std::uint64_t seed = 1; seed <= kRuns; ++seed) {
    const WheeledDriveOptions options = options_of(ReferenceClass::kNavigationGrade, seed);
    WheeledDrive drive(options);
    Estimator estimator(drive.config(drive.r_bv_b_m() - kGuessError));
    run(drive, estimator, 1e9);
    const OdometryOutput& out = estimator.odometry();
    const double scale = (options.wheels.scale - out.scale) / out.sd_scale;
    const Vector3d mount = options.mount_rad - to_eigen(out.mount_rad);
    const Vector3d arm = (drive.r_bv_b_m() - to_eigen(out.r_bv_b_m)).cwiseQuotient(to_eigen(out.sd_r_bv_b_m));
    EXPECT_LT(std::abs(scale), 4.0);
    EXPECT_LT(std::abs(mount.y()), 4.0 * out.sd_mount_rad[1]);
    EXPECT_LT(std::abs(mount.z()), 4.0 * out.sd_mount_rad[2]);
    EXPECT_LT(arm.cwiseAbs().maxCoeff(), 4.0);
    // Something was learned of each but the arm's height, which no slow turn shows.
    EXPECT_LT(out.sd_scale, 0.003);
    EXPECT_LT(out.sd_mount_rad[1], 0.2 * kRadPerDeg);
    EXPECT_LT(out.sd_mount_rad[2], 0.2 * kRadPerDeg);
    EXPECT_LT(out.sd_r_bv_b_m[0], 0.06);
    nees += scale * scale + arm.squaredNorm() + std::pow(mount.y() / out.sd_mount_rad[1], 2) +
            std::pow(mount.z() / out.sd_mount_rad[2], 2);
    EXPECT_EQ(estimator.counters().odometry_speed_rejected, 0U);
    EXPECT_EQ(estimator.counters().covariance_repairs, 0U);
  }
  // 6 states, 4 runs: 99.9 % point of chi-square with 24 degrees of freedom. Correlations are left out.
  EXPECT_LT(nees, 51.2);
}

TEST(Odometry, AMinuteWithoutGnssDriftsFarLessThanInertiallyAlone) {
  const auto drift_of = [](std::uint64_t seed, bool speed, bool non_holonomic, bool zero_velocity) {
    WheeledDrive drive(options_of(ReferenceClass::kIndustrial, seed));
    EstimatorConfig config = drive.config(drive.r_bv_b_m() - kGuessError);
    config.odometry.use_speed = speed;
    config.odometry.use_non_holonomic = non_holonomic;
    config.odometry.use_zero_velocity = zero_velocity;
    Estimator estimator(config);
    run(drive, estimator, 180.0);
    run(drive, estimator, 240.0, without_gnss);
    const EstimatorCounters& counters = estimator.counters();
    EXPECT_EQ(counters.odometry_speed_used > 0, speed);
    EXPECT_EQ(counters.odometry_slip_used > 0, non_holonomic);
    EXPECT_EQ(counters.zero_velocity_used > 0, zero_velocity);
    // The filter knows how far off it may be.
    const Vector3d sd = to_eigen(estimator.navigation().sd_position_m);
    EXPECT_LT(horizontal_error_m(drive, estimator), 4.0 * sd.head<2>().norm());
    return horizontal_error_m(drive, estimator);
  };
  // What one minute costs is a matter of luck.
  const auto drift_m = [&](bool speed, bool non_holonomic, bool zero_velocity) {
    constexpr std::uint64_t kDrives = 4;
    double sum_m2 = 0.0;
    for (std::uint64_t seed = 1; seed <= kDrives; ++seed)
      sum_m2 += std::pow(drift_of(seed, speed, non_holonomic, zero_velocity), 2);
    return std::sqrt(sum_m2 / static_cast<double>(kDrives));
  };
  const double inertial_m = drift_m(false, false, false);
  EXPECT_GT(inertial_m, 2.0);
  EXPECT_LT(drift_m(false, true, false), 0.5 * inertial_m);
  EXPECT_LT(drift_m(true, false, false), 0.5 * inertial_m);
  EXPECT_LT(drift_m(true, true, true), 0.2 * inertial_m);
}

TEST(Odometry, SpinningWheelsAreRejectedAndToldOnce) {
  WheeledDrive drive(options_of(ReferenceClass::kNavigationGrade, 4));
  Estimator estimator(drive.config(drive.r_bv_b_m()));
  run(drive, estimator, 120.0);
  const Told told = run(drive, estimator, 240.0, [](double t_s, Sample& sample) {
    if (sample.kind == SampleKind::kOdometry && std::fmod(t_s, 20.0) < 4.0) sample.odometry.speed_mps += 5.0;
    return true;
  });
  EXPECT_GT(estimator.counters().odometry_speed_rejected, 200U);
  EXPECT_GE(told.count<event::OdometryRejected>(), 1);
  EXPECT_EQ(told.count<event::OdometryRejected>(), told.count<event::OdometryAccepted>());
  EXPECT_LT(horizontal_error_m(drive, estimator), 0.05);
  EXPECT_NEAR(estimator.odometry().scale, 0.012, 5.0 * estimator.odometry().sd_scale);
}

TEST(Odometry, WheelsThatShowZeroOnTheMoveAreNotTakenForARest) {
  WheeledDrive drive(options_of(ReferenceClass::kNavigationGrade, 5));
  Estimator estimator(drive.config(drive.r_bv_b_m()));
  run(drive, estimator, 70.0);
  std::uint64_t in_motion = 0;
  const WheeledDrive truth(options_of(ReferenceClass::kNavigationGrade, 5));
  while (!drive.done()) {
    const std::uint64_t before = estimator.counters().zero_velocity_used;
    const double t_s = drive.time_s();
    run(drive, estimator, t_s + 0.005, [](double /*t_s*/, Sample& sample) {
      if (sample.kind == SampleKind::kOdometry) sample.odometry.speed_mps = 0.0;
      return true;
    });
    if (truth.truth_at(t_s - 0.5).v_n_mps.norm() > 0.1)
      in_motion += estimator.counters().zero_velocity_used - before;
  }
  EXPECT_EQ(in_motion, 0U);
  EXPECT_GT(estimator.counters().zero_velocity_used, 100U) << "at the stops";
  EXPECT_LT(horizontal_error_m(drive, estimator), 0.05);
}

TEST(Odometry, SilenceIsToldAndTheLastSpeedIsNotHeld) {
  WheeledDrive drive(options_of(ReferenceClass::kNavigationGrade, 6));
  Estimator estimator(drive.config(drive.r_bv_b_m()));
  run(drive, estimator, 100.0);
  const auto silent = [](double /*t_s*/, Sample& sample) { return sample.kind != SampleKind::kOdometry; };
  Told told = run(drive, estimator, 110.0, silent);
  ASSERT_EQ(told.count<event::OdometryLost>(), 1);
  const std::uint64_t used = estimator.counters().odometry_slip_used;
  told = run(drive, estimator, 111.0, silent);
  EXPECT_EQ(estimator.counters().odometry_slip_used, used);
  EXPECT_EQ(told.count<event::OdometryLost>(), 0);
  told = run(drive, estimator, 112.0);
  EXPECT_EQ(told.count<event::OdometryReturned>(), 1);
  EXPECT_GT(estimator.counters().odometry_slip_used, used);
}

TEST(Odometry, DelayedSpeedsGiveTheNavigationOfPromptOnes) {
  const auto result = [](std::size_t delay) {
    WheeledDrive drive(options_of(ReferenceClass::kIndustrial, 7));
    Estimator estimator(drive.config(drive.r_bv_b_m()));
    std::vector<std::pair<std::size_t, Sample>> waiting;
    std::size_t k = 0;
    for (; drive.time_s() < 200.0; ++k) {
      const bool cut = drive.time_s() > 170.0;
      const std::vector<Sample> samples = drive.next();
      for (const Sample& sample : samples) {
        if (cut && sample.kind == SampleKind::kGnss) continue;
        if (sample.kind == SampleKind::kOdometry) {
          waiting.emplace_back(k + delay, sample);
        } else {
          estimator.add(sample);
        }
      }
      while (!waiting.empty() && waiting.front().first <= k) {
        estimator.add(waiting.front().second);
        waiting.erase(waiting.begin());
      }
      estimator.advance(samples.front().arrival);
    }
    return estimator.navigation();
  };
  const NavigationOutput prompt = result(0);
  const NavigationOutput delayed = result(15);
  for (std::size_t i = 0; i < 3; ++i)
    EXPECT_NEAR(delayed.v_n_mps[i], prompt.v_n_mps[i], 2.0 * prompt.sd_velocity_mps[i]);
  EXPECT_NEAR(delayed.latitude_rad, prompt.latitude_rad, 2.0 * prompt.sd_position_m[0] / 6.37e6);
}

TEST(Odometry, SpeedsThatRunAheadWaitForTheReference) {
  const auto result = [](std::size_t reference_delay, EstimatorCounters& counters) {
    WheeledDrive drive(options_of(ReferenceClass::kIndustrial, 11));
    Estimator estimator(drive.config(drive.r_bv_b_m()));
    std::vector<std::pair<std::size_t, Sample>> waiting;
    std::size_t k = 0;
    for (; drive.time_s() < 120.0; ++k) {
      const std::vector<Sample> samples = drive.next();
      for (const Sample& sample : samples) {
        if (sample.kind == SampleKind::kOdometry) {
          estimator.add(sample);
        } else {
          waiting.emplace_back(k + reference_delay, sample);
        }
      }
      while (!waiting.empty() && waiting.front().first <= k) {
        estimator.add(waiting.front().second);
        waiting.erase(waiting.begin());
      }
      estimator.advance(samples.front().arrival);
    }
    for (const auto& [due, sample] : waiting) estimator.add(sample);
    estimator.advance(waiting.back().second.arrival);
    counters = estimator.counters();
    return estimator.navigation();
  };
  EstimatorCounters prompt_counters;
  EstimatorCounters late_counters;
  const NavigationOutput prompt = result(1, prompt_counters);
  const NavigationOutput late = result(10, late_counters);
  EXPECT_GT(prompt_counters.odometry_slip_used, 1000U);
  EXPECT_NEAR(static_cast<double>(late_counters.odometry_slip_used),
              static_cast<double>(prompt_counters.odometry_slip_used), 10.0);
  EXPECT_EQ(late_counters.odometry_too_old, prompt_counters.odometry_too_old);
  for (std::size_t i = 0; i < 3; ++i)
    EXPECT_NEAR(late.v_n_mps[i], prompt.v_n_mps[i], 0.5 * prompt.sd_velocity_mps[i]);
}

TEST(Odometry, MoreSpeedsThanCanWaitCostTheOldest) {
  WheeledDrive drive(options_of(ReferenceClass::kNavigationGrade, 12));
  Estimator estimator(drive.config(drive.r_bv_b_m()));
  run(drive, estimator, 100.0);
  ASSERT_EQ(estimator.counters().odometry_too_old, 0U);
  constexpr double kOnlyWheels_s = 2.0;
  run(drive, estimator, 100.0 + kOnlyWheels_s,
      [](double /*t_s*/, Sample& sample) { return sample.kind == SampleKind::kOdometry; });
  constexpr auto kHeld = 64U;
  EXPECT_EQ(estimator.counters().odometry_too_old,
            static_cast<std::uint64_t>(kOnlyWheels_s * WheeledDrive::kWheelRate_hz) - kHeld);
}

// A pull at the R-IMU that is not motion leaves a velocity behind that the filter is sure of.
TEST(Odometry, AVelocityThatALongRestContradictsIsGivenUp) {
  WheeledDrive drive(options_of(ReferenceClass::kNavigationGrade, 13));
  Estimator estimator(drive.config(drive.r_bv_b_m()));
  run(drive, estimator, 20.0);
  double wrong_mps = 0.0;
  while (drive.time_s() < 50.0) {
    run(drive, estimator, drive.time_s() + 0.005, [](double t_s, Sample& sample) {
      if (sample.kind == SampleKind::kImu && t_s > 20.0 && t_s < 21.0) sample.imu.f_mps2[0] += 3.0;
      return sample.kind != SampleKind::kGnss;
    });
    wrong_mps = std::max(wrong_mps, to_eigen(estimator.navigation().v_n_mps).norm());
  }
  EXPECT_GT(wrong_mps, 2.0);
  EXPECT_GT(estimator.counters().zero_velocity_rejected, 0U);
  EXPECT_LT(to_eigen(estimator.navigation().v_n_mps).norm(), 0.02);
}

// The R-IMU looks forward and the vehicle reverses all the way; the wheels know no sign.
TEST(Odometry, AMagnitudeTakesTheSignOfTheMotion) {
  WheeledDriveOptions options = options_of(ReferenceClass::kNavigationGrade, 8);
  options.mount_rad = Vector3d(0.0, 0.0, std::numbers::pi);
  WheeledDrive drive(options);
  Estimator estimator(drive.config(drive.r_bv_b_m()));
  run(drive, estimator, 200.0, [](double /*t_s*/, Sample& sample) {
    if (sample.kind == SampleKind::kOdometry) sample.odometry.flags |= kSpeedHasNoSign;
    return true;
  });
  EXPECT_GT(estimator.counters().odometry_speed_used, 1000U);
  EXPECT_EQ(estimator.counters().odometry_speed_rejected, 0U);
  EXPECT_NEAR(estimator.odometry().scale, options.wheels.scale, 4.0 * estimator.odometry().sd_scale);
}

TEST(Odometry, BadSpeedsAreCountedAndLeaveTheStateAlone) {
  WheeledDrive drive(options_of(ReferenceClass::kNavigationGrade, 9));
  Estimator estimator(drive.config(drive.r_bv_b_m()));
  run(drive, estimator, 90.0, [](double t_s, Sample& sample) {
    if (sample.kind != SampleKind::kOdometry) return true;
    if (t_s > 60.0 && t_s < 61.0) sample.odometry.speed_mps = std::numeric_limits<double>::quiet_NaN();
    if (t_s > 62.0 && t_s < 63.0) sample.time -= std::chrono::seconds{5};
    if (t_s > 64.0 && t_s < 65.0) sample.device = 7;
    return true;
  });
  EXPECT_EQ(estimator.counters().odometry_not_finite, 49U);
  EXPECT_EQ(estimator.counters().odometry_too_old, 49U);
  EXPECT_EQ(estimator.counters().unknown_device, 49U);
  EXPECT_LT(horizontal_error_m(drive, estimator), 0.05);
}

TEST(Odometry, NothingIsAllocatedAfterConstruction) {
  WheeledDrive drive(options_of(ReferenceClass::kNavigationGrade, 10));
  Estimator estimator(drive.config(drive.r_bv_b_m()));
  std::vector<Sample> samples;
  HostTime last{};
  while (drive.time_s() < 70.0) {
    for (const Sample& sample : drive.next()) samples.push_back(sample);
    last = samples.back().arrival;
  }
  const std::uint64_t before = test::allocation_count();
  for (const Sample& sample : samples) estimator.add(sample);
  estimator.advance(last);
  EXPECT_EQ(test::allocation_count(), before);
  EXPECT_GT(estimator.counters().odometry_slip_used, 0U);
  EXPECT_GT(estimator.counters().zero_velocity_used, 0U);
}

class WheelsAndRegime : public testing::Test {
 protected:
  /// A second of the given spread of rate and force at 100 Hz, with wheels where there are some.
  Regime second(double rate_radps, double force_mps2, std::optional<double> wheels_mps) {
    for (int k = 0; k < 100; ++k) {
      const double phase = 2.0 * std::numbers::pi * 0.7 * (time_s_ += 0.01);
      const Vector3d omega(rate_radps * std::sin(phase), 0.0, 0.0);
      const Vector3d f(force_mps2 * std::cos(phase), 0.0, -9.81);
      if (wheels_mps) detector_.add_wheel_speed(*wheels_mps);
      detector_.add(omega, f, 0.01);
    }
    return detector_.regime();
  }
  Regime seconds(int n, double rate_radps, double force_mps2, std::optional<double> wheels_mps) {
    for (int i = 0; i < n - 1; ++i) second(rate_radps, force_mps2, wheels_mps);
    return second(rate_radps, force_mps2, wheels_mps);
  }
  RegimeDetector detector_;
  double time_s_ = 0.0;
};

TEST_F(WheelsAndRegime, TurningWheelsAreMotionHoweverSmoothTheRoad) {
  EXPECT_EQ(seconds(10, 0.0, 0.0, std::nullopt), Regime::kStatic);
  EXPECT_EQ(seconds(1, 0.0, 0.0, 20.0), Regime::kDynamic);
  EXPECT_EQ(seconds(10, 0.0, 0.0, 20.0), Regime::kDynamic);
  EXPECT_EQ(seconds(3, 0.0, 0.0, 0.0), Regime::kStatic);
}

TEST_F(WheelsAndRegime, WithStandingWheelsPeopleMayShakeTheVehicle) {
  EXPECT_EQ(seconds(10, 0.0, 0.2, std::nullopt), Regime::kDynamic);
  EXPECT_EQ(seconds(10, 0.0, 0.2, 0.0), Regime::kStatic);
}

TEST_F(WheelsAndRegime, WheelsAtZeroAreNoProofOfRest) {
  EXPECT_EQ(seconds(10, 0.1, 1.0, 0.0), Regime::kDynamic);
}

TEST_F(WheelsAndRegime, OldSpeedsCountNoLonger) {
  EXPECT_EQ(seconds(5, 0.0, 0.0, 20.0), Regime::kDynamic);
  EXPECT_EQ(seconds(5, 0.0, 0.0, std::nullopt), Regime::kStatic);
}

}  // namespace
}  // namespace imuscope
