/// What goes wrong on vehicles, fed to the estimator: it stays sane and says what happened.

#include <gtest/gtest.h>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <random>
#include <set>
#include <utility>
#include <vector>

#include "base/limits.h"
#include "base/units.h"
#include "estimation/calibration/estimator.h"
#include "estimation/calibration/event_log.h"
#include "estimation/calibration/gnss_trust.h"
#include "estimation/navigation/so3.h"
#include "tests/estimation/calibration/simulated_drive.h"

namespace imuscope {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using test::horizontal_error_m;
using test::SimulatedDrive;
using test::SimulatedStudy;
using test::worst_in_sd;

constexpr double kEarthRadius_m = 6.37e6;

Matrix3 row_major(const Matrix3d& m) {
  return {m(0, 0), m(0, 1), m(0, 2), m(1, 0), m(1, 1), m(1, 2), m(2, 0), m(2, 1), m(2, 2)};
}

SimulatedStudy tilted() { return {exp_so3(Vector3d(0.1, 0.2, -1.5)), {0.35, -0.22, 0.12}, 0.004}; }

/// What a spoiler makes of a sample at a time of the drive; false: it is lost on the way.
using Spoiler = std::function<bool(Sample&, double)>;

/// One of every kind that came.
struct Told {
  std::vector<EstimatorEvent> events;
  template <typename Kind>
  [[nodiscard]] bool has() const {
    return std::any_of(events.begin(), events.end(), is<Kind>);
  }
  /// Precondition: has<Kind>()
  template <typename Kind>
  [[nodiscard]] const Kind& first() const {
    return std::get<Kind>(std::find_if(events.begin(), events.end(), is<Kind>)->what);
  }
  void take(std::span<const EstimatorEvent> more) { events.insert(events.end(), more.begin(), more.end()); }
};

Told told_by(SimulatedDrive& drive, Estimator& estimator, const Spoiler& spoil = {}, double until_s = 1e9) {
  Told told;
  while (!drive.done() && drive.time_s() < until_s) {
    const double t_s = drive.time_s();
    std::vector<Sample> samples = drive.next();
    for (Sample& sample : samples) {
      if (!spoil || spoil(sample, t_s)) estimator.add(sample);
    }
    estimator.advance(samples.back().arrival);
    told.take(estimator.events());
  }
  return told;
}

bool finite(const SImuOutput& out) {
  double sum = out.t_d_s + out.sd_t_d_s;
  for (const double value : out.C_b_s) sum += value;
  for (const double value : out.covariance_psi_r) sum += value;
  for (std::size_t i = 0; i < 3; ++i)
    sum += out.r_bs_b_m[i] + out.gyro_bias_radps[i] + out.accel_bias_mps2[i];
  return std::isfinite(sum);
}

std::vector<SimulatedStudy> left_and_right() {
  return {{Matrix3d::Identity(), {0.35, -0.22, 0.12}, 0.0},
          {exp_so3(Vector3d(0, 0, 1.5)), {-0.30, 0.25, 0.10}, 0.0}};
}

/// Configures a mounting as somebody measured it.
void believe(const SimulatedStudy& mounting, SImuConfig& config) {
  config.prior_C_b_s = row_major(mounting.C_b_s);
  config.prior_r_bs_b_m = {mounting.r_bs_b_m.x(), mounting.r_bs_b_m.y(), mounting.r_bs_b_m.z()};
  config.prior_r_bs_b_sd_m = {0.05, 0.05, 0.05};
  config.prior_t_d_s = 0.0;
}

TEST(BadInput, TwoSwappedStudiesAreToldByName) {
  const std::vector<SimulatedStudy> truth = left_and_right();
  for (const bool swapped : {true, false}) {
    SimulatedDrive drive(240.0, truth, 41);
    EstimatorConfig config = drive.config();
    for (std::size_t i = 0; i < 2; ++i) believe(truth[swapped ? 1 - i : i], config.studies[i]);
    Estimator estimator(config);
    const Told told = told_by(drive, estimator);
    EXPECT_EQ(told.has<event::SImusSwapped>(), swapped);
    EXPECT_EQ(told.has<event::BoresightPriorWrong>(), swapped);
    EXPECT_EQ(told.has<event::LeverArmPriorWrong>(), swapped);
    for (std::size_t i = 0; i < 2; ++i)
      EXPECT_LT(test::mounting_error_rad(estimator.study(i), truth[i].C_b_s).norm(), 0.5 * kRadPerDeg);
  }
}

TEST(BadInput, TwoStudiesOfWhichOneSitsWhereTheOtherShouldAreNotSwapped) {
  const std::vector<SimulatedStudy> truth = left_and_right();
  const SimulatedStudy elsewhere{exp_so3(Vector3d(0, 0, -1.2)), {1.2, 0.9, -0.7}, 0.0};
  for (const std::size_t which : {0U, 1U}) {
    SimulatedDrive drive(240.0, truth, 41);
    EstimatorConfig config = drive.config();
    for (std::size_t i = 0; i < 2; ++i) believe(i == which ? elsewhere : truth[which], config.studies[i]);
    Estimator estimator(config);
    const Told told = told_by(drive, estimator);
    EXPECT_TRUE(told.has<event::BoresightPriorWrong>());
    EXPECT_FALSE(told.has<event::SImusSwapped>()) << which;
  }
}

TEST(BadInput, APositionThatIsNowhereIsRefusedFromTheFirstOnAndCounted) {
  const std::vector<std::array<double, 3>> nowhere{
      {0.0, 0.0, -6378137.0}, {5.0, 0.1, 400.0}, {0.8, 0.1, 1e300}, {0.8, -7.0, 400.0}};
  for (const bool attitude_is_given : {true, false}) {
    SimulatedDrive drive(120.0, {tilted()}, 47);
    EstimatorConfig config = drive.config();
    if (!attitude_is_given) config.navigation.initial_rpy_rad.reset();
    Estimator estimator(config);
    std::size_t spoilt = 0;
    const Told told = told_by(drive, estimator, [&](Sample& sample, double t_s) {
      // Before anything else is heard of the receiver, and in the midst of the drive.
      if (sample.device != SimulatedDrive::kGnss || (t_s > 3.0 && t_s < 100.0) || t_s > 102.0) return true;
      const auto& [latitude_rad, longitude_rad, height_m] = nowhere[spoilt++ % nowhere.size()];
      sample.gnss.latitude_rad = latitude_rad;
      sample.gnss.longitude_rad = longitude_rad;
      sample.gnss.height_m = height_m;
      return true;
    });
    ASSERT_GT(spoilt, 2 * nowhere.size());
    EXPECT_EQ(estimator.counters().gnss_positions_rejected, spoilt);
    EXPECT_EQ(estimator.counters().gnss_rejected, spoilt);
    EXPECT_TRUE(told.has<event::GnssRejected>());
    EXPECT_TRUE(told.has<event::GnssReacquired>());
    EXPECT_LT(horizontal_error_m(estimator.navigation(), drive.motion().state_at(drive.time_s() - 0.01)),
              0.2);
    EXPECT_LT(worst_in_sd(estimator.study(0), tilted()), 4.0);
  }
}

/// C-25: axes that lean by thirty times what the class allows. The sd hang on that class.
TEST(BadInput, ASensorFarMoreCrookedThanItsClassIsNotCalledCalibratedAndItsSdAreWider) {
  Vector3 straight_sd_rad{};
  for (const bool crooked : {false, true}) {
    SimulatedDrive drive(400.0, {tilted()}, 48);
    EstimatorConfig config = drive.config();
    config.studies[0].blocks = kCompleteSImuBlocks;
    Estimator estimator(config);
    told_by(drive, estimator, [&](Sample& sample, double) {
      // The z gyro leans towards x: along x and in the plane of x and y, the frame stays what it is.
      if (crooked && sample.device == SimulatedDrive::kFirstStudy)
        sample.imu.omega_radps[2] += 0.05 * sample.imu.omega_radps[0];
      return true;
    });
    const SImuOutput& out = estimator.study(0);
    if (!crooked) {
      straight_sd_rad = out.sd_psi_rad;
      continue;
    }
    EXPECT_NE(out.status, CalibrationStatus::kCalibrated);
    EXPECT_TRUE(has_estimate(out.status));
    EXPECT_GT(out.sd_psi_rad[1], 1.5 * straight_sd_rad[1]);
    EXPECT_LT(worst_in_sd(out, tilted()), 4.0);
  }
}

class SilentStudy : public testing::TestWithParam<bool> {};

TEST_P(SilentStudy, ThatReturnsIsToldAndItsBiasesAreComparedWithThoseBefore) {
  const bool changed = GetParam();
  SimulatedDrive drive(300.0, {tilted()}, 42);
  Estimator estimator(drive.config());
  const Told told = told_by(drive, estimator, [&](Sample& sample, double t_s) {
    if (sample.device != SimulatedDrive::kFirstStudy) return true;
    if (t_s > 170.0 && changed) {
      sample.imu.omega_radps[1] += 0.5 * kRadPerDeg;
      sample.imu.f_mps2[0] += 0.12;
    }
    return t_s < 160.0 || t_s > 170.0;
  });
  EXPECT_TRUE(told.has<event::SImuReturned>());
  EXPECT_EQ(told.has<event::GyroBiasChanged>(), changed);
  EXPECT_EQ(told.has<event::AccelBiasChanged>(), changed);
  EXPECT_FALSE(told.has<event::MountingChanged>());
  EXPECT_LT(worst_in_sd(estimator.study(0), tilted()), 4.0);
}
INSTANTIATE_TEST_SUITE_P(WithOtherBiasesOrTheSame, SilentStudy, testing::Bool());

TEST(BadInput, AStudyThatReturnsTurnedIsFoundAnew) {
  SimulatedDrive drive(360.0, {tilted()}, 43);
  Estimator estimator(drive.config());
  told_by(drive, estimator, {}, 160.0);
  ASSERT_GE(estimator.study(0).status, CalibrationStatus::kConverging);
  const Matrix3d turned = exp_so3(Vector3d(0.2, -0.3, 0.8)) * tilted().C_b_s;
  drive.remount(0, turned);
  const Told told = told_by(drive, estimator, [](Sample& sample, double t_s) {
    return sample.device != SimulatedDrive::kFirstStudy || t_s > 170.0;
  });
  EXPECT_TRUE(told.has<event::SImuReturned>());
  EXPECT_TRUE(told.has<event::MountingChanged>());
  ASSERT_GE(estimator.study(0).status, CalibrationStatus::kConverging);
  EXPECT_LT(test::mounting_error_rad(estimator.study(0), turned).norm(), 0.5 * kRadPerDeg);
}

class AntennaLeverArm : public testing::TestWithParam<double> {};

TEST_P(AntennaLeverArm, IsToldWhenItIsWrongAndLeavesTheCalibrationAlone) {
  SimulatedDrive drive(300.0, {tilted()}, 44);
  EstimatorConfig config = drive.config();
  config.gnss.antenna_lever_arm_b_m = {GetParam(), 0.5 * GetParam(), 0.0};
  Estimator estimator(config);
  const Told told = told_by(drive, estimator);
  EXPECT_EQ(told.has<event::GnssInconsistent>(), GetParam() != 0.0);
  EXPECT_LT(worst_in_sd(estimator.study(0), tilted()), 4.0);
  const imusim::MotionState truth = drive.motion().state_at(drive.time_s() - 0.01);
  EXPECT_LT(horizontal_error_m(estimator.navigation(), truth), 2.0 * std::hypot(GetParam(), 0.1));
  const Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>> C(estimator.navigation().C_b_n.data());
  EXPECT_LT(log_so3(truth.C_b_n * C.transpose()).norm(), 2.0 * kRadPerDeg);
}
INSTANTIATE_TEST_SUITE_P(RightAndWrong, AntennaLeverArm, testing::Values(0.0, 1.0));

TEST(BadInput, AFixThatFallsBackToFloatIsTrustedLess) {
  SimulatedDrive drive(200.0, {}, 45);
  Estimator estimator(drive.config());
  double worst_m = 0.0;
  while (!drive.done()) {
    const double t_s = drive.time_s();
    std::vector<Sample> samples = drive.next();
    for (Sample& sample : samples) {
      if (sample.kind == SampleKind::kGnss && t_s > 100.0 && t_s < 130.0) {
        sample.gnss.solution = GnssSolution::kFloat;
        sample.gnss.flags = kPositionValid;  // and no sd
        sample.gnss.latitude_rad += 0.4 / kEarthRadius_m;
      }
      estimator.add(sample);
    }
    estimator.advance(samples.back().arrival);
    if (t_s > 61.0)
      worst_m = std::max(worst_m, horizontal_error_m(estimator.navigation(), drive.motion().state_at(t_s)));
  }
  // The one fix that follows the last float may stand out; a streak may not.
  EXPECT_LE(estimator.counters().gnss_rejected, 1U);
  EXPECT_LT(worst_m, 0.4);
  EXPECT_LT(horizontal_error_m(estimator.navigation(), drive.motion().state_at(drive.time_s() - 0.01)), 0.05);
}

TEST(BadInput, ForcesInAnotherUnitAreToldAtStandstill) {
  for (const DeviceIndex device : {SimulatedDrive::kReference, SimulatedDrive::kFirstStudy}) {
    SimulatedDrive drive(200.0, {tilted()}, 46);
    Estimator estimator(drive.config());
    const Told told = told_by(
        drive, estimator,
        [&](Sample& sample, double /*t_s*/) {
          if (sample.device == device) {
            for (double& f : sample.imu.f_mps2) f /= kMps2PerG;
          }
          return true;
        },
        30.0);
    EXPECT_TRUE(told.has<event::GravityMagnitudeWrong>()) << "device " << device;
  }
}

struct WrongSigns {
  const char* name;
  std::array<double, 3> gyro;
  std::array<double, 3> accel;
};

class Mirrored : public testing::TestWithParam<WrongSigns> {};

TEST_P(Mirrored, StudyIsToldAndNoneOfItsNumbersIsEverCalledUsable) {
  SimulatedDrive drive(400.0, {tilted()}, 47);
  Estimator estimator(drive.config());
  Told told;
  while (!drive.done()) {
    std::vector<Sample> samples = drive.next();
    for (Sample& sample : samples) {
      if (sample.device == SimulatedDrive::kFirstStudy) {
        for (std::size_t i = 0; i < 3; ++i) {
          sample.imu.omega_radps[i] *= GetParam().gyro[i];
          sample.imu.f_mps2[i] *= GetParam().accel[i];
        }
      }
      estimator.add(sample);
    }
    estimator.advance(samples.back().arrival);
    told.take(estimator.events());
    const SImuOutput& out = estimator.study(0);
    ASSERT_NE(out.status, CalibrationStatus::kCalibrated) << "at " << drive.time_s() << " s";
    ASSERT_FALSE(out.t_d_observable) << "at " << drive.time_s() << " s";
    for (const bool observable : out.observable) ASSERT_FALSE(observable) << "at " << drive.time_s() << " s";
  }
  EXPECT_TRUE(told.has<event::CoarseAlignmentPoor>() || told.has<event::SImuInconsistent>());
}
INSTANTIATE_TEST_SUITE_P(WrongSigns, Mirrored,
                         testing::Values(WrongSigns{"XOfBoth", {-1, 1, 1}, {-1, 1, 1}},
                                         WrongSigns{"YOfBoth", {1, -1, 1}, {1, -1, 1}},
                                         WrongSigns{"ZOfBoth", {1, 1, -1}, {1, 1, -1}},
                                         WrongSigns{"XOfTheGyros", {-1, 1, 1}, {1, 1, 1}},
                                         WrongSigns{"ZOfTheGyros", {1, 1, -1}, {1, 1, 1}},
                                         WrongSigns{"AllForces", {1, 1, 1}, {-1, -1, -1}}),
                         [](const testing::TestParamInfo<WrongSigns>& param) { return param.param.name; });

TEST(BadInput, AStudyThatFitsIsCalledUsable) {
  SimulatedDrive drive(300.0, {tilted()}, 47);
  Estimator estimator(drive.config());
  const Told told = told_by(drive, estimator);
  EXPECT_FALSE(told.has<event::SImuInconsistent>());
  EXPECT_FALSE(told.has<event::NoiseTooSmall>());
  for (const bool observable : estimator.study(0).observable) EXPECT_TRUE(observable);
}

/// Told a third of the noise that there is, the filter is sure of itself for no reason.
TEST(BadInput, ANoiseThatIsConfiguredTooSmallIsToldWithTheOneThatFitsAndNothingIsCalledCalibrated) {
  for (const bool gyro : {true, false}) {
    SCOPED_TRACE(gyro ? "gyro" : "accel");
    SimulatedDrive drive(400.0, {tilted()}, 47);
    EstimatorConfig config = drive.config();
    SImuNoise& noise = config.studies[0].noise;
    const double simulated = (gyro ? noise.gyro : noise.accel)[1].white_sd[0];
    for (TriadNoise& regime : gyro ? noise.gyro : noise.accel)
      for (std::size_t i = 0; i < 3; ++i) {
        regime.white_sd[i] /= 3.0;
        regime.fast_sd[i] /= 3.0;
      }
    Estimator estimator(config);
    const Told told = told_by(drive, estimator);
    ASSERT_TRUE(told.has<event::NoiseTooSmall>());
    const auto& e = told.first<event::NoiseTooSmall>();
    EXPECT_EQ(e.gyro, gyro);
    EXPECT_NEAR(e.factor, 3.0, 0.9);
    EXPECT_NEAR(e.white_sd, simulated, 0.3 * simulated);
    EXPECT_EQ(estimator.study(0).status, CalibrationStatus::kConverging);
    for (const bool observable : estimator.study(0).observable) EXPECT_FALSE(observable);
  }
}

TEST(BadInput, ATurnedMountIsNoticedWhereSamplesAreAveraged) {
  SimulatedDrive drive(300.0, {tilted()}, 49);
  EstimatorConfig config = drive.config();
  config.studies[0].average_samples = 10;
  Estimator estimator(config);
  told_by(drive, estimator, {}, 160.0);
  ASSERT_GE(estimator.study(0).status, CalibrationStatus::kConverging);
  const Matrix3d turned = exp_so3(Vector3d(0.2, -0.3, 0.8)) * tilted().C_b_s;
  drive.remount(0, turned);
  const Told told = told_by(drive, estimator);
  EXPECT_TRUE(told.has<event::MountingChanged>());
  ASSERT_GE(estimator.study(0).status, CalibrationStatus::kConverging);
  EXPECT_LT(test::mounting_error_rad(estimator.study(0), turned).norm(), 0.5 * kRadPerDeg);
}

class LateStamps : public testing::TestWithParam<double> {};

/// Solutions that are stamped on arrival, 0.3 s after their validity, and carry no UTC.
TEST_P(LateStamps, OfGnssAreTakenBackToValidityByALatencyThatIsConfiguredOrFound) {
  SimulatedDrive drive(120.0, {}, 50);
  EstimatorConfig config = drive.config();
  config.gnss.latency_s = GetParam();
  Estimator estimator(config);
  double sum_m2 = 0.0;
  int n = 0;
  while (!drive.done()) {
    const double t_s = drive.time_s();
    std::vector<Sample> samples = drive.next();
    for (Sample& sample : samples) {
      if (sample.kind == SampleKind::kGnss) {
        sample.time += std::chrono::milliseconds{300};
        sample.has_utc = false;
      }
      estimator.add(sample);
    }
    estimator.advance(samples.back().arrival);
    if (t_s < 70.0) continue;
    const double error_m = horizontal_error_m(estimator.navigation(), drive.motion().state_at(t_s));
    sum_m2 += error_m * error_m;
    ++n;
  }
  EXPECT_LT(std::sqrt(sum_m2 / n), 0.03);
  const NavigationOutput& found = estimator.navigation();
  EXPECT_LT(found.sd_receiver_latency_s, 1e-3);
  EXPECT_NEAR(found.receiver_latency_s, 0.3, 4.0 * found.sd_receiver_latency_s);
}
INSTANTIATE_TEST_SUITE_P(ConfiguredOrNot, LateStamps, testing::Values(0.0, 0.3));

TEST(BadInput, TimeRunningBackwardsAndNanForAWholeSecondChangeNothingButCounters) {
  SimulatedDrive drive(200.0, {tilted()}, 48);
  Estimator estimator(drive.config());
  const Told told = told_by(drive, estimator, [](Sample& sample, double t_s) {
    if (t_s > 120.0 && t_s < 121.0 && sample.kind == SampleKind::kImu)
      sample.imu.f_mps2[1] = std::numeric_limits<double>::quiet_NaN();
    if (t_s > 140.0 && t_s < 141.0 && sample.kind == SampleKind::kImu)
      sample.time -= std::chrono::seconds{30};
    return true;
  });
  EXPECT_TRUE(told.has<event::ReferenceGap>());
  EXPECT_GT(estimator.counters().reference_not_finite, 90U);
  EXPECT_GT(estimator.counters().reference_not_increasing, 90U);
  EXPECT_GT(estimator.study(0).counters.not_finite, 90U);
  EXPECT_GT(estimator.study(0).counters.not_increasing, 90U);
  EXPECT_TRUE(finite(estimator.study(0)));
  EXPECT_LT(worst_in_sd(estimator.study(0), tilted()), 4.0);
}

/// A date and a time of day for the drive's clock.
UtcTime utc_at(UtcTime start, double t_s) { return start + from_seconds(t_s); }

struct Tags {
  const char* name;
  double reference_from_s;  ///< the R-IMU knows UTC from then on
  double latency_s;         ///< what is configured for the time before
};
class TaggedSolutions : public testing::TestWithParam<Tags> {};

/// Solutions that are stamped 0.3 s after their validity and come 0.2 s after it.
TEST_P(TaggedSolutions, AreTakenBackToValidityByTheirTags) {
  constexpr UtcTime kNoon{std::chrono::hours{12}};
  constexpr std::size_t kDelay = 20;
  SimulatedDrive drive(120.0, {}, 51);
  EstimatorConfig config = drive.config();
  config.gnss.latency_s = GetParam().latency_s;
  Estimator estimator(config);
  std::vector<std::pair<std::size_t, Sample>> on_the_way;
  double sum_m2 = 0.0;
  int n = 0;
  std::uint64_t rejected_before = 0;
  for (std::size_t k = 0; !drive.done(); ++k) {
    const double t_s = drive.time_s();
    const std::vector<Sample> samples = drive.next();
    for (Sample sample : samples) {
      sample.utc = utc_at(kNoon, t_s);
      if (sample.kind == SampleKind::kGnss) {
        sample.has_utc = true;
        sample.time += std::chrono::milliseconds{300};
        on_the_way.emplace_back(k + kDelay, sample);
        continue;
      }
      sample.has_utc = t_s >= GetParam().reference_from_s;
      if (!sample.has_utc) sample.utc = {};
      estimator.add(sample);
    }
    while (!on_the_way.empty() && on_the_way.front().first <= k) {
      estimator.add(on_the_way.front().second);
      on_the_way.erase(on_the_way.begin());
    }
    estimator.advance(samples.back().arrival);
    EXPECT_EQ(estimator.navigation().has_utc, t_s >= GetParam().reference_from_s) << t_s;
    if (t_s < 70.0) {
      rejected_before = estimator.counters().gnss_rejected;
      continue;
    }
    const double error_m = horizontal_error_m(estimator.navigation(), drive.motion().state_at(t_s));
    sum_m2 += error_m * error_m;
    ++n;
  }
  EXPECT_LT(std::sqrt(sum_m2 / n), 0.03);
  // One good solution in a thousand stands out, and the first is from before the start.
  EXPECT_LE(estimator.counters().gnss_rejected, rejected_before + 2);
  EXPECT_LE(estimator.counters().gnss_too_old, 1U);
}
INSTANTIATE_TEST_SUITE_P(Reference, TaggedSolutions,
                         testing::Values(Tags{"TaggedThroughout", 0.0, 0.0},
                                         Tags{"TaggedFromSomewhereOn", 80.1, 0.3}),
                         [](const testing::TestParamInfo<Tags>& param) { return param.param.name; });

/// From then on its solutions are tagged as if they were solved after they arrive. They are stamped 0.3 s late,
/// which was seen while the tags were right.
TEST(BadInput, AReceiverWhoseUtcJumpsAheadIsTimedByItsOwnClock) {
  constexpr UtcTime kNoon{std::chrono::hours{12}};
  constexpr std::size_t kDelay = 35;
  constexpr double kJump_s = 80.0;
  SimulatedDrive drive(120.0, {}, 55);
  Estimator estimator(drive.config());
  std::vector<std::pair<std::size_t, Sample>> on_the_way;
  double worst_m = 0.0;
  double fastest_mps = 0.0;
  std::uint64_t rejected_before = 0;
  for (std::size_t k = 0; !drive.done(); ++k) {
    const double t_s = drive.time_s();
    const std::vector<Sample> samples = drive.next();
    for (Sample sample : samples) {
      sample.has_utc = true;
      sample.utc = utc_at(kNoon, t_s);
      if (sample.kind != SampleKind::kGnss) {
        estimator.add(sample);
        continue;
      }
      if (t_s >= kJump_s) sample.utc += std::chrono::seconds{5};
      sample.time += std::chrono::milliseconds{300};
      sample.arrival += std::chrono::milliseconds{350};
      on_the_way.emplace_back(k + kDelay, sample);
    }
    while (!on_the_way.empty() && on_the_way.front().first <= k) {
      estimator.add(on_the_way.front().second);
      on_the_way.erase(on_the_way.begin());
    }
    estimator.advance(samples.back().arrival);
    if (t_s < kJump_s) {
      rejected_before = estimator.counters().gnss_rejected;
      continue;
    }
    const imusim::MotionState truth = drive.motion().state_at(t_s);
    worst_m = std::max(worst_m, horizontal_error_m(estimator.navigation(), truth));
    fastest_mps = std::max(fastest_mps, truth.v_n_mps.norm());
  }
  ASSERT_GT(fastest_mps, 1.0) << "a third of a second must matter";
  EXPECT_LE(estimator.counters().gnss_rejected, rejected_before + 1);
  EXPECT_LT(worst_m, 0.1);
}

/// UTC that cannot write 23:59:60 repeats a second: some devices the last of the day, others the first of the
/// next.
enum class Repeats : std::uint8_t { kLastSecond, kFirstSecond };
struct LeapSecond {
  const char* name;
  Repeats reference;
  Repeats gnss;
};
class Leap : public testing::TestWithParam<LeapSecond> {};

TEST_P(Leap, SecondIsNoticedByNothing) {
  static constexpr UtcTime kMidnight{std::chrono::days{17'167}};  // 2017-01-01
  constexpr double kLeap_s = 90.0;
  const auto tag = [](Repeats repeats, double t_s) {
    const double jumps_at_s = repeats == Repeats::kLastSecond ? kLeap_s : kLeap_s + 1.0;
    return utc_at(kMidnight, t_s - kLeap_s - (t_s >= jumps_at_s ? 1.0 : 0.0));
  };
  SimulatedDrive drive(120.0, {}, 52);
  Estimator estimator(drive.config());
  double worst_m = 0.0;
  double fastest_mps = 0.0;
  std::uint64_t rejected_before = 0;
  while (!drive.done()) {
    const double t_s = drive.time_s();
    std::vector<Sample> samples = drive.next();
    for (Sample& sample : samples) {
      sample.has_utc = true;
      sample.utc = tag(sample.kind == SampleKind::kGnss ? GetParam().gnss : GetParam().reference, t_s);
      estimator.add(sample);
    }
    estimator.advance(samples.back().arrival);
    if (t_s < 70.0) {
      rejected_before = estimator.counters().gnss_rejected;
      continue;
    }
    const imusim::MotionState truth = drive.motion().state_at(t_s);
    worst_m = std::max(worst_m, horizontal_error_m(estimator.navigation(), truth));
    if (std::abs(t_s - kLeap_s) < 2.0) fastest_mps = std::max(fastest_mps, truth.v_n_mps.norm());
  }
  ASSERT_GT(fastest_mps, 1.0) << "a second must matter";
  EXPECT_EQ(estimator.counters().gnss_rejected, rejected_before);
  EXPECT_EQ(estimator.counters().gnss_too_old, 0U);
  EXPECT_LT(worst_m, 0.05);
}
INSTANTIATE_TEST_SUITE_P(
    Repeating, Leap,
    testing::Values(LeapSecond{"LastByBoth", Repeats::kLastSecond, Repeats::kLastSecond},
                    LeapSecond{"LastByReference", Repeats::kLastSecond, Repeats::kFirstSecond},
                    LeapSecond{"LastByGnss", Repeats::kFirstSecond, Repeats::kLastSecond}),
    [](const testing::TestParamInfo<LeapSecond>& param) { return param.param.name; });

TEST(BadInput, SolutionsThatSayNothingAreCountedAndLeaveTheNavigationAlone) {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  const auto navigation_after = [&](bool with_bad_ones, EstimatorCounters& counters) {
    SimulatedDrive drive(90.0, {}, 53);
    Estimator estimator(drive.config());
    while (!drive.done()) {
      const double t_s = drive.time_s();
      std::vector<Sample> samples = drive.next();
      for (const Sample& sample : samples) {
        estimator.add(sample);
        if (sample.kind != SampleKind::kGnss || t_s < 70.0 || !with_bad_ones) continue;
        Sample bad = sample;
        bad.gnss.latitude_rad = kNan;
        estimator.add(bad);
        bad = sample;
        bad.gnss.v_n_mps[2] = kNan;
        estimator.add(bad);
        bad = sample;
        bad.gnss.height_m += 50.0;
        bad.gnss.solution = GnssSolution::kNone;
        estimator.add(bad);
        bad.gnss.solution = GnssSolution::kFixed;
        bad.gnss.flags = 0;
        estimator.add(bad);
      }
      estimator.advance(samples.back().arrival);
    }
    counters = estimator.counters();
    return estimator.navigation();
  };
  EstimatorCounters counters;
  const NavigationOutput plain = navigation_after(false, counters);
  const std::uint64_t used = counters.gnss_used;
  const NavigationOutput spoilt = navigation_after(true, counters);
  EXPECT_EQ(counters.gnss_not_finite, 200U);
  EXPECT_EQ(counters.gnss_used, used);
  EXPECT_EQ(counters.gnss_rejected, 0U);
  EXPECT_EQ(spoilt.latitude_rad, plain.latitude_rad);
  EXPECT_EQ(spoilt.height_m, plain.height_m);
  EXPECT_EQ(spoilt.sd_position_m, plain.sd_position_m);
}

TEST(BadInput, VelocitiesAloneHoldTheNavigationAndAWrongOneIsTold) {
  SimulatedDrive drive(130.0, {}, 54);
  Estimator estimator(drive.config());
  Told told;
  double worst_mps = 0.0;
  std::uint64_t positions_rejected = 0;
  while (!drive.done()) {
    const double t_s = drive.time_s();
    std::vector<Sample> samples = drive.next();
    const imusim::MotionState truth = drive.motion().state_at(t_s);
    for (Sample& sample : samples) {
      if (sample.kind == SampleKind::kGnss && t_s > 70.0) {
        sample.gnss.flags = kVelocityValid | kHasVelocitySd;
        sample.gnss.v_n_mps = {truth.v_n_mps.x(), truth.v_n_mps.y(), truth.v_n_mps.z()};
        sample.gnss.sd_velocity_mps = {0.02, 0.02, 0.02};
        if (t_s > 110.0 && t_s < 111.0) sample.gnss.v_n_mps[0] += 5.0;
      }
      estimator.add(sample);
    }
    estimator.advance(samples.back().arrival);
    for (const EstimatorEvent& event : estimator.events()) {
      if (const auto* rejected = std::get_if<event::GnssRejected>(&event.what)) {
        EXPECT_GT(rejected->nis, 100.0) << "NIS of the velocity";
      }
    }
    told.take(estimator.events());
    if (t_s < 71.0) continue;
    positions_rejected = estimator.counters().gnss_positions_rejected;
    for (Eigen::Index i = 0; i < 3; ++i) {
      worst_mps = std::max(worst_mps, std::abs(estimator.navigation().v_n_mps[static_cast<std::size_t>(i)] -
                                               truth.v_n_mps(i)));
    }
  }
  EXPECT_TRUE(told.has<event::GnssRejected>());
  EXPECT_TRUE(told.has<event::GnssReacquired>());
  EXPECT_EQ(estimator.counters().gnss_rejected, 4U);
  EXPECT_EQ(positions_rejected, 0U);
  EXPECT_LT(worst_mps, 0.1);
}

TEST(GnssTrust, WithoutAnSdASolutionIsTrustedByItsKind) {
  GnssConfig config;
  GnssData gnss{};
  gnss.flags = kPositionValid | kVelocityValid;
  double before_m = 0.0;
  double before_mps = 0.0;
  for (const GnssSolution solution :
       {GnssSolution::kFixed, GnssSolution::kFloat, GnssSolution::kDifferential, GnssSolution::kSingle}) {
    gnss.solution = solution;
    const double sd_m = trusted_position_sd(gnss, config).x();
    const double sd_mps = trusted_velocity_sd(gnss, config).x();
    EXPECT_GT(sd_m, 2.0 * before_m);
    EXPECT_GT(sd_mps, 2.0 * before_mps);
    before_m = sd_m;
    before_mps = sd_mps;
  }
  gnss.flags |= kHasPositionSd;
  gnss.sd_position_m = {0.7, 0.7, 0.7};
  EXPECT_DOUBLE_EQ(trusted_position_sd(gnss, config).x(), 0.7);
  EXPECT_DOUBLE_EQ(trusted_velocity_sd(gnss, config).x(), before_mps);
  for (const double none :
       {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
    gnss.sd_position_m[1] = none;
    EXPECT_DOUBLE_EQ(trusted_position_sd(gnss, config).y(),
                     before_m / config.default_sd_position_m[0] * config.default_sd_position_m[1]);
  }
}

TEST(GnssTrust, FloatsThatFollowEachOtherQuicklySayLittleThatIsNew) {
  EXPECT_DOUBLE_EQ(correlated_sd_factor(GnssSolution::kFixed, 0.2), 1.0);
  // 60 s hold as much as one independent value each 30 s on either side.
  EXPECT_DOUBLE_EQ(correlated_sd_factor(GnssSolution::kFloat, 0.6), 10.0);
  EXPECT_DOUBLE_EQ(correlated_sd_factor(GnssSolution::kFloat, 1000.0), 1.0);
  // Code solutions stay wrong by the same amount for longer.
  EXPECT_DOUBLE_EQ(correlated_sd_factor(GnssSolution::kDifferential, 1.2), 10.0);
  EXPECT_DOUBLE_EQ(correlated_sd_factor(GnssSolution::kSingle, 2.4), 10.0);
}

/// Positions whose error wanders, as reflections and the atmosphere have it: Gauss-Markov, drawn here.
struct WanderingError {
  GnssSolution solution;
  double sd_m;
  double tau_s;
};

class Wandering : public testing::TestWithParam<WanderingError> {};

TEST_P(Wandering, PositionsAreNotBelievedToBeBetterThanTheyAre) {
  const WanderingError& wandering = GetParam();
  constexpr double kGnssPeriod_s = 0.2;
  constexpr int kDrives = 6;
  double z2 = 0.0;
  double n = 0.0;
  for (int drive_number = 0; drive_number < kDrives; ++drive_number) {
    const auto seed = static_cast<std::uint64_t>(70 + drive_number);
    SimulatedDrive drive(240.0, {tilted()}, seed);
    EstimatorConfig config = drive.config();
    config.studies.clear();
    Estimator estimator(config);
    std::mt19937_64 random(seed);
    std::normal_distribution<double> normal;
    const double kept = std::exp(-kGnssPeriod_s / wandering.tau_s);
    std::array<double, 3> error_m{};
    for (double& error : error_m) error = wandering.sd_m * normal(random);
    const auto wander = [&](Sample& sample, double) {
      if (sample.kind == SampleKind::kImu && sample.device != SimulatedDrive::kReference) return false;
      if (sample.device != SimulatedDrive::kGnss) return true;
      for (double& error : error_m)
        error = kept * error + std::sqrt(1.0 - kept * kept) * wandering.sd_m * normal(random);
      sample.gnss.latitude_rad += error_m[0] / kEarthRadius_m;
      sample.gnss.longitude_rad += error_m[1] / (kEarthRadius_m * std::cos(sample.gnss.latitude_rad));
      sample.gnss.height_m += error_m[2];
      sample.gnss.flags = kPositionValid | kHasPositionSd;
      sample.gnss.sd_position_m = {wandering.sd_m, wandering.sd_m, wandering.sd_m};
      sample.gnss.solution = wandering.solution;
      return true;
    };
    for (const double until_s : {80.0, 160.0, 239.0}) {
      told_by(drive, estimator, wander, until_s);
      const NavigationOutput& out = estimator.navigation();
      ASSERT_EQ(out.status, NavigationStatus::kNavigating);
      const auto truth = drive.motion().state_at(drive.time_s() - 0.01).position;
      const std::array<double, 2> apart_m{
          kEarthRadius_m * (out.latitude_rad - truth.latitude_rad),
          kEarthRadius_m * std::cos(truth.latitude_rad) * (out.longitude_rad - truth.longitude_rad)};
      for (std::size_t i = 0; i < 2; ++i) {
        z2 += std::pow(apart_m[i] / out.sd_position_m[i], 2);
        n += 1.0;
      }
    }
  }
  // Of one drive the three looks are much alike: twelve values of a chi-squared, 3.3 sd.
  EXPECT_LT(z2 / n, 1.0 + 3.3 * std::sqrt(2.0 / 12.0));
  EXPECT_GT(z2 / n, 0.1);
}

INSTANTIATE_TEST_SUITE_P(GnssTrust, Wandering,
                         testing::Values(WanderingError{GnssSolution::kSingle, 1.5, 60.0},
                                         WanderingError{GnssSolution::kDifferential, 0.5, 60.0},
                                         WanderingError{GnssSolution::kFloat, 0.3, 30.0}));

/// A MEMS unit as the reference, of which nobody told the filter: a navigation-grade one would have a
/// thousandth of its noise.
TEST(BadInput, AReferenceThatIsNoisierThanConfiguredCostsNoMountingAndIsTold) {
  SimulatedDrive drive(400.0, {tilted()}, 47);
  Estimator estimator(drive.config());
  std::mt19937_64 random(48);
  std::normal_distribution<double> normal;
  constexpr double kGyroNoise_radps = 0.03;
  constexpr double kAccelNoise_mps2 = 0.1;
  const Told told = told_by(drive, estimator, [&](Sample& sample, double /*t_s*/) {
    if (sample.device != SimulatedDrive::kReference || sample.kind != SampleKind::kImu) return true;
    for (double& w : sample.imu.omega_radps) w += kGyroNoise_radps * normal(random);
    for (double& f : sample.imu.f_mps2) f += kAccelNoise_mps2 * normal(random);
    return true;
  });
  const SImuOutput& out = estimator.study(0);
  EXPECT_EQ(out.counters.resets, 0U);
  EXPECT_TRUE(told.has<event::NoiseTooSmall>());
  EXPECT_EQ(out.status, CalibrationStatus::kConverging) << "never calibrated on a noise that does not fit";
  for (const bool observable : out.observable) EXPECT_FALSE(observable);
  EXPECT_LT(test::mounting_error_rad(out, tilted().C_b_s).norm(), 0.5 * kRadPerDeg);
  EXPECT_NEAR(out.t_d_s, tilted().t_d_s, 2e-3);
}

/// A reference as noisy as the S-IMU, and the filter is told: it finds the mounting, and says that the lever
/// arm cannot be had.
TEST(BadInput, OfALeverArmThatTheReferencesNoiseTakesPartOfNothingIsCalledObservable) {
  SimulatedDrive drive(400.0, {tilted()}, 47);
  EstimatorConfig config = drive.config();
  constexpr double kGyroNoise_radps = 0.014;
  config.reference.gyro_white_radps_per_sqrt_hz = kGyroNoise_radps / std::sqrt(config.reference.rate_hz);
  Estimator estimator(config);
  std::mt19937_64 random(48);
  std::normal_distribution<double> normal;
  const Told told = told_by(drive, estimator, [&](Sample& sample, double /*t_s*/) {
    if (sample.device != SimulatedDrive::kReference || sample.kind != SampleKind::kImu) return true;
    for (double& w : sample.imu.omega_radps) w += kGyroNoise_radps * normal(random);
    return true;
  });
  const SImuOutput& out = estimator.study(0);
  EXPECT_FALSE(told.has<event::NoiseTooSmall>());
  EXPECT_LT(worst_in_sd(out, tilted()), 4.0);
  EXPECT_NE(out.status, CalibrationStatus::kCalibrated);
  // Known far better than before the drive, and yet: the share of noise is known to a tenth only.
  EXPECT_LT(out.sd_r_bs_b_m[0], 0.5 * config.studies[0].prior_r_bs_b_sd_m[0]);
  EXPECT_FALSE(out.observable[3]);
  EXPECT_TRUE(out.observable[0]);
}

TEST(BadInput, ATickThatComesLateShowsWhatItCanAndCountsTheRest) {
  const std::vector<SimulatedStudy> truth(kMaxSImus, tilted());
  SimulatedDrive drive(120.0, truth, 55);
  EstimatorConfig config = drive.config();
  for (SImuConfig& study : config.studies) {
    study.prior_C_b_s = row_major(tilted().C_b_s);
    study.prior_t_d_s = tilted().t_d_s;
  }
  Estimator estimator(config);
  test::run(drive, estimator, 70.0);
  ASSERT_EQ(estimator.counters().epochs_lost, 0U);
  const std::uint64_t used_before = estimator.study(0).counters.used;
  // Within what is held of the reference, but more samples than one tick can show: S-IMUs of 1 kHz.
  std::vector<Sample> samples;
  while (drive.time_s() < 72.4) {
    samples = drive.next();
    for (const Sample& sample : samples) {
      estimator.add(sample);
      if (sample.kind != SampleKind::kImu || sample.device == config.reference.device) continue;
      for (int i = 1; i < 10; ++i) {
        Sample between = sample;
        between.time += i * std::chrono::milliseconds(1);
        estimator.add(between);
      }
    }
  }
  estimator.advance(samples.back().arrival);
  std::uint64_t used = 0;
  for (std::size_t i = 0; i < truth.size(); ++i) used += estimator.study(i).counters.used - used_before;
  EXPECT_GT(estimator.counters().epochs_lost, 0U);
  // Copies of a sample are no measurements of their own: how good the estimate is, the next test asks.
  EXPECT_EQ(estimator.epochs().size() + estimator.counters().epochs_lost, used);
}

TEST(BadInput, ATickThatComesMuchLaterGivesUpNothing) {
  const std::vector<SimulatedStudy> truth(kMaxSImus, tilted());
  SimulatedDrive drive(120.0, truth, 55);
  EstimatorConfig config = drive.config();
  for (SImuConfig& study : config.studies) {
    study.prior_C_b_s = row_major(tilted().C_b_s);
    study.prior_t_d_s = tilted().t_d_s;
  }
  Estimator estimator(config);
  test::run(drive, estimator, 72.4);
  const SImuCounters before = estimator.study(0).counters;
  std::vector<Sample> samples;
  std::uint64_t added = 0;
  while (drive.time_s() < 116.0) {
    samples = drive.next();
    for (const Sample& sample : samples) estimator.add(sample);
    ++added;
  }
  estimator.advance(samples.back().arrival);
  const SImuCounters& after = estimator.study(0).counters;
  EXPECT_EQ(after.refused_full, 0U);
  EXPECT_EQ(after.no_reference, before.no_reference);
  EXPECT_EQ(after.samples - before.samples, added);
  EXPECT_LE(after.waiting, 10U);
  test::run(drive, estimator);
  for (std::size_t i = 0; i < truth.size(); ++i) EXPECT_LT(worst_in_sd(estimator.study(i), truth[i]), 4.0);
}

TEST(BadInput, MoreSamplesThanMayWaitForAReferenceAreCounted) {
  const std::vector<SimulatedStudy> truth(1, tilted());
  SimulatedDrive drive(120.0, truth, 55);
  EstimatorConfig config = drive.config();
  config.studies[0].rate_hz = 20.0;  // it sends five times as much
  Estimator estimator(config);
  std::uint64_t added = 0;
  std::vector<Sample> samples;
  while (drive.time_s() < 116.0) {
    samples = drive.next();
    for (const Sample& sample : samples) {
      if (sample.device != config.studies[0].device) continue;
      estimator.add(sample);
      ++added;
    }
  }
  estimator.advance(samples.back().arrival);
  const SImuCounters& counters = estimator.study(0).counters;
  EXPECT_EQ(counters.samples, added);
  EXPECT_EQ(counters.refused_full, added - waiting_samples_capacity(20.0));
}

TEST(EventLog, CountsWhatItHasNoRoomForAndIsEmptyOnceTaken) {
  EventLog log;
  EventLog shown;
  for (std::size_t i = 0; i < EventLog::kCapacity + 3; ++i)
    log.add(event::ReferenceGap{static_cast<double>(i)}, 0, HostTime{});
  EXPECT_EQ(log.lost(), 3U);
  shown.take(log);
  ASSERT_EQ(shown.events().size(), EventLog::kCapacity);
  EXPECT_EQ(std::get<event::ReferenceGap>(shown.events().back().what).length_s,
            static_cast<double>(EventLog::kCapacity - 1));
  EXPECT_TRUE(log.events().empty());
  log.add(event::ReferenceGap{0.0}, 0, HostTime{});
  EXPECT_EQ(log.lost(), 3U);
}

}  // namespace
}  // namespace imuscope
