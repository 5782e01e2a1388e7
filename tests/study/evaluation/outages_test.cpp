/// Outages played on simulated drives whose S-IMU errors are drawn from a known model: the filter that holds
/// that model must predict its own errors, a filter that holds another must be found out.

#include "study/evaluation/outages.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "base/units.h"
#include "estimation/navigation/gravity.h"
#include "estimation/navigation/so3.h"
#include "estimation/navigation/strapdown.h"
#include "models/noise/chi_squared.h"

namespace imuscope {
namespace {

using Eigen::Vector3d;

constexpr double kPeriod_s = 0.01;
constexpr double kFixPeriod_s = 0.2;
constexpr double kFixSd_m = 0.05;
constexpr double kSettle_s = 40.0;
constexpr double kOutage_s = 20.0;

/// MTx class: white noise, one slow Gauss-Markov process, a turn-on bias.
CoastingModel mtx_like() {
  CoastingModel model;
  model.name = "true";
  for (std::size_t axis = 0; axis < kImuAxes; ++axis) {
    const double unit = axis < 3 ? kRadPerDeg : 0.04;
    AxisNoise& noise = model.axes[axis];
    noise.white_density = std::pow(0.07 * unit, 2);
    noise.turn_on_variance = std::pow(0.3 * unit, 2);
    noise.slow.push_back({std::pow(0.1 * unit, 2), 1.0 / 50.0});
  }
  return model;
}

/// The noise of one axis, sample by sample.
class AxisError {
 public:
  AxisError(const AxisNoise& noise, std::mt19937_64& random) : noise_(noise), random_(random) {
    constant_ = std::sqrt(noise.turn_on_variance) * normal_(random_);
    for (const SlowProcess& process : noise.slow)
      slow_.push_back(std::sqrt(process.variance) * normal_(random_));
  }
  double next(double white_density) {
    double sum = constant_ + std::sqrt(white_density / kPeriod_s) * normal_(random_);
    for (std::size_t i = 0; i < slow_.size(); ++i) {
      const double phi = std::exp(-noise_.slow[i].rate_per_s * kPeriod_s);
      sum += slow_[i];
      slow_[i] = phi * slow_[i] + std::sqrt(noise_.slow[i].variance * (1.0 - phi * phi)) * normal_(random_);
    }
    return sum;
  }

 private:
  const AxisNoise& noise_;
  std::mt19937_64& random_;
  std::normal_distribution<double> normal_;
  double constant_ = 0.0;
  std::vector<double> slow_;
};

/// Winding road at some 12 m/s. The truth is what the strapdown makes of noise-free rates.
struct Road {
  static Vector3d omega(double t) {
    return {0.05 * std::sin(1.1 * t), 0.04 * std::cos(0.9 * t), 0.25 * std::sin(0.3 * t)};
  }
  /// Keeps the speed near 12 m/s along the heading.
  static Vector3d force(double t, const NavigationState& at) {
    const Vector3d along = at.C_b_n.col(0);
    const Vector3d wanted = (12.0 + 3.0 * std::sin(0.2 * t)) * Vector3d(along.x(), along.y(), 0.0);
    const double g = normal_gravity(at.position.latitude_rad, at.position.height_m).g_mps2;
    return at.C_b_n.transpose() * (1.5 * (wanted - at.v_n_mps) - Vector3d(0.0, 0.0, g));
  }
};

/// @param density_of  white density in force at a time, per axis
template <typename Density>
Drive simulated(const CoastingModel& truth, std::uint64_t seed, double duration_s, Density density_of) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  std::vector<AxisError> errors;
  for (const AxisNoise& axis : truth.axes) errors.emplace_back(axis, random);
  Drive drive;
  drive.r_sa_s_m = {0.4, -0.2, -1.1};
  NavigationState state;
  state.position = {46.5 * kRadPerDeg, 6.6 * kRadPerDeg, 400.0};
  state.v_n_mps = {12.0, 0.0, 0.0};
  InertialRates rates{Road::omega(0.0), Road::force(0.0, state)};
  const auto n = static_cast<int>(duration_s / kPeriod_s);
  for (int k = 0; k < n; ++k) {
    const double t = k * kPeriod_s;
    const auto density = density_of(t);
    DriveSample sample{t, rates};
    for (std::size_t axis = 0; axis < kImuAxes; ++axis) {
      auto& triad = axis < 3 ? sample.measured.omega_ib_b_radps : sample.measured.f_b_mps2;
      triad[static_cast<Eigen::Index>(axis % 3)] += errors[axis].next(density[axis]);
    }
    drive.samples.push_back(sample);
    if (k % 20 == 0) {
      DriveReference reference{t, state, KinematicVector::Constant(1e-4)};
      drive.reference.push_back(reference);
      DriveFix fix;
      fix.time_s = t;
      fix.antenna =
          displaced(state.position, state.C_b_n * drive.r_sa_s_m +
                                        kFixSd_m * Vector3d{normal(random), normal(random), normal(random)});
      fix.sd_position_m = Vector3d::Constant(kFixSd_m);
      drive.fixes.push_back(fix);
    }
    NavigationState ahead = state;
    propagate(ahead, increment_from_samples(rates, rates, kPeriod_s));
    const InertialRates next{Road::omega(t + kPeriod_s), Road::force(t + kPeriod_s, ahead)};
    propagate(state, increment_from_samples(rates, next, kPeriod_s));
    rates = next;
  }
  static_assert(kFixPeriod_s == 20 * kPeriod_s);
  return drive;
}

Drive simulated(const CoastingModel& truth, std::uint64_t seed, double duration_s) {
  std::array<double, kImuAxes> density{};
  for (std::size_t axis = 0; axis < kImuAxes; ++axis) density[axis] = truth.axes[axis].white_density;
  return simulated(truth, seed, duration_s, [&](double) { return density; });
}

OutageOptions one_outage() {
  OutageOptions options;
  options.durations_s = {5.0, kOutage_s};
  options.settle_s = kSettle_s;
  options.spacing_s = 1e6;
  return options;
}

/// NEES of many drives with one outage each, per duration.
template <typename MakeDrive>
std::vector<Consistency> over_drives(const CoastingModel& held, MakeDrive make_drive) {
  constexpr std::uint64_t kDrives = 80;
  std::vector<OutageResult> results;
  for (std::uint64_t seed = 1; seed <= kDrives; ++seed) {
    auto of_drive = play_outages(make_drive(seed), held, one_outage());
    // Drives are independent of one another: their outages do not overlap.
    for (OutageResult& result : of_drive) result.start_s += 1e4 * static_cast<double>(seed);
    results.insert(results.end(), of_drive.begin(), of_drive.end());
  }
  return consistency_of(results, one_outage().durations_s);
}

/// Where the mean NEES of 80 outages of a right model lies, but for one in a thousand.
bool lies_where_a_right_model_does(double nees, std::size_t n) {
  const double dof = 3.0 * static_cast<double>(n);
  return nees > noise::chi_squared_quantile(dof, 5e-4) / dof &&
         nees < noise::chi_squared_quantile(dof, 1.0 - 5e-4) / dof;
}

TEST(Outages, EveryNumberOfTheTableIsThatOfItsErrorsAndVariances) {
  std::vector<OutageResult> results;
  for (int i = 0; i < 2; ++i) {
    OutageResult result;
    result.start_s = 5.0 * i;  // the second begins within the first
    result.duration_s = 10.0;
    for (Eigen::Index k = 0; k < kNavigationKinematicSize; ++k)
      result.error[k] = (i == 0 ? 1.0 : -2.0) * static_cast<double>(k + 1);
    result.reference_sd.setConstant(i == 0 ? 0.0 : 2.0);
    KinematicVector variance;
    for (Eigen::Index k = 0; k < kNavigationKinematicSize; ++k) variance[k] = 1.0 + static_cast<double>(k);
    result.covariance = variance.asDiagonal();
    results.push_back(result);
  }
  const auto table = consistency_of(results, {10.0});
  ASSERT_EQ(table.size(), 1U);
  const Consistency& row = table[0];
  EXPECT_EQ(row.n, 2U);
  EXPECT_EQ(row.n_independent, 1U);
  // Errors k + 1 and -2 (k + 1): the mean of their squares is 2.5 (k + 1)^2. Variances 1 + k and 5 + k: 3 + k.
  EXPECT_DOUBLE_EQ(row.horizontal_rms_m, std::sqrt(2.5 * (1 + 4)));
  EXPECT_DOUBLE_EQ(row.horizontal_sd_m, std::sqrt(3.0 + 4.0));
  EXPECT_DOUBLE_EQ(row.vertical_rms_m, std::sqrt(2.5 * 9));
  EXPECT_DOUBLE_EQ(row.vertical_sd_m, std::sqrt(5.0));
  EXPECT_DOUBLE_EQ(row.velocity_rms_mps, std::sqrt(2.5 * (16 + 25 + 36)));
  EXPECT_DOUBLE_EQ(row.velocity_sd_mps, std::sqrt(6.0 + 7.0 + 8.0));
  EXPECT_DOUBLE_EQ(row.attitude_rms_rad, std::sqrt(2.5 * (49 + 64 + 81)));
  EXPECT_DOUBLE_EQ(row.attitude_sd_rad, std::sqrt(9.0 + 10.0 + 11.0));
  const auto nees = [](double first) {
    double sum = 0.0;
    for (int k = 0; k < 3; ++k) {
      const double e2 = (first + k) * (first + k);
      sum += e2 / (first + k) + 4.0 * e2 / (4.0 + first + k);
    }
    return sum / 6.0;
  };
  EXPECT_DOUBLE_EQ(row.nees_position, nees(1.0));
  EXPECT_DOUBLE_EQ(row.nees_velocity, nees(4.0));
  EXPECT_DOUBLE_EQ(row.nees_attitude, nees(7.0));
  EXPECT_NEAR(row.surprise,
              0.5 * (3.0 * nees(1.0) + 0.5 * std::log(1.0 * 2.0 * 3.0 * 5.0 * 6.0 * 7.0) +
                     3.0 * std::log(2.0 * 3.14159265358979324)),
              1e-12);
}

TEST(Outages, AFilterThatHoldsTheTrueModelPredictsItsErrors) {
  const CoastingModel model = mtx_like();
  const auto table = over_drives(
      model, [&](std::uint64_t seed) { return simulated(model, seed, kSettle_s + kOutage_s + 2.0); });
  ASSERT_EQ(table.size(), 2U);
  for (const Consistency& row : table) {
    EXPECT_EQ(row.n, 80U);
    EXPECT_EQ(row.n_independent, 80U);
    EXPECT_TRUE(lies_where_a_right_model_does(row.nees_position, row.n)) << row.nees_position;
    EXPECT_TRUE(lies_where_a_right_model_does(row.nees_velocity, row.n)) << row.nees_velocity;
    EXPECT_TRUE(lies_where_a_right_model_does(row.nees_attitude, row.n)) << row.nees_attitude;
    EXPECT_LT(row.nees_low, 1.0);
    EXPECT_GT(row.nees_high, 1.0);
  }
}

/// A minute of standing still on ideal sensors with an attitude that is only roughly known: the tilt's
/// squares make the way down, which no first-order covariance sees. Held against drawn tilts.
TEST(CoastingFilter, KnowsWhatATiltDoesToTheVerticalInSecondOrder) {
  constexpr double kTilt_rad = 0.03;
  constexpr double kCoast_s = 60.0;
  constexpr int kDraws = 300;
  NavigationState truth;
  truth.position = {46.5 * kRadPerDeg, 6.6 * kRadPerDeg, 400.0};
  const double g = normal_gravity(truth.position.latitude_rad, truth.position.height_m).g_mps2;
  // Rates of an Earth that does not turn would tilt the truth: the Earth's own keep it level.
  const Vector3d earth(7.292115e-5 * std::cos(46.5 * kRadPerDeg), 0.0,
                       -7.292115e-5 * std::sin(46.5 * kRadPerDeg));
  const InertialRates still{earth, {0.0, 0.0, -g}};
  KinematicVector sd = KinematicVector::Constant(1e-6);
  sd.segment<2>(kAttitudeError).setConstant(kTilt_rad);
  CoastingModel ideal;
  std::mt19937_64 random(9);
  std::normal_distribution<double> normal;
  const std::array<double, kImuAxes> no_noise{};
  double v_squares = 0.0;
  double r_squares = 0.0;
  KinematicCovariance predicted;
  for (int draw = 0; draw < kDraws; ++draw) {
    NavigationState start = truth;
    start.C_b_n = exp_so3(kTilt_rad * Vector3d{normal(random), normal(random), 0.0});
    CoastingFilter filter(ideal, start, sd);
    constexpr double kStep_s = 0.05;
    for (int k = 0; k < static_cast<int>(kCoast_s / kStep_s); ++k)
      filter.propagate(still, still, kStep_s, no_noise);
    predicted = filter.covariance();
    const auto error = error_between(truth, filter.state());
    v_squares += error[kVelocityError + 2] * error[kVelocityError + 2] / kDraws;
    r_squares += error[kPositionError + 2] * error[kPositionError + 2] / kDraws;
  }
  // The square of a chi-square variable of two degrees of freedom scatters by more than its mean: 300 draws
  // know the rms to 7 %.
  const double v_sd_mps = std::sqrt(predicted(kVelocityError + 2, kVelocityError + 2));
  EXPECT_NEAR(v_sd_mps, std::sqrt(v_squares), 0.25 * v_sd_mps);
  EXPECT_NEAR(std::sqrt(predicted(kPositionError + 2, kPositionError + 2)), std::sqrt(r_squares),
              0.25 * std::sqrt(r_squares));
  // In closed form: g / 2 sqrt(8) tilt^2 t.
  EXPECT_NEAR(v_sd_mps, 0.5 * g * std::sqrt(8.0) * kTilt_rad * kTilt_rad * kCoast_s, 0.03 * v_sd_mps);
}

TEST(Outages, AFilterThatTrustsTheSensorTooMuchIsFoundOutAndSurprisedMore) {
  const CoastingModel truth = mtx_like();
  CoastingModel proud = truth;
  for (AxisNoise& axis : proud.axes) {
    axis.white_density /= 9.0;
    axis.slow.front().variance /= 9.0;
  }
  const auto make = [&](std::uint64_t seed) { return simulated(truth, seed, kSettle_s + kOutage_s + 2.0); };
  const auto wrong = over_drives(proud, make);
  const auto right = over_drives(truth, make);
  for (std::size_t i = 0; i < wrong.size(); ++i) {
    EXPECT_GT(wrong[i].nees_position, wrong[i].nees_high);
    EXPECT_GT(wrong[i].surprise, right[i].surprise);
  }
}

TEST(Outages, WhiteNoiseThatFollowsTheMotionIsHeldAsSuch) {
  // Every four seconds of eight the white noise is sixteen times as strong.
  const CoastingModel calm = mtx_like();
  CoastingModel following = calm;
  const auto density = [&](double t) {
    std::array<double, kImuAxes> out{};
    const double factor = std::fmod(t, 8.0) < 4.0 ? 1.0 : 16.0;
    for (std::size_t axis = 0; axis < kImuAxes; ++axis) out[axis] = factor * calm.axes[axis].white_density;
    return out;
  };
  for (double t = 0.0; t < kSettle_s + kOutage_s + 4.0; t += 4.0)
    following.changes.push_back({t, density(t)});
  const auto make = [&](std::uint64_t seed) {
    return simulated(calm, seed, kSettle_s + kOutage_s + 2.0, density);
  };
  const auto right = over_drives(following, make);
  const auto wrong = over_drives(calm, make);
  for (std::size_t i = 0; i < right.size(); ++i) {
    EXPECT_TRUE(lies_where_a_right_model_does(right[i].nees_position, right[i].n)) << right[i].nees_position;
    EXPECT_TRUE(lies_where_a_right_model_does(right[i].nees_attitude, right[i].n)) << right[i].nees_attitude;
    EXPECT_GT(wrong[i].nees_attitude, wrong[i].nees_high);
  }
}

TEST(Outages, NoneReachesOverAGapOfTheSamplesAndAfterItTheFilterSettlesAnew) {
  const CoastingModel model = mtx_like();
  Drive drive = simulated(model, 7, 160.0);
  constexpr double kGapBegin_s = 70.0;
  constexpr double kGapEnd_s = 75.0;
  std::erase_if(drive.samples,
                [](const DriveSample& s) { return s.time_s > kGapBegin_s && s.time_s < kGapEnd_s; });
  OutageOptions options = one_outage();
  options.spacing_s = 2.0;
  const auto results = play_outages(drive, model, options);
  ASSERT_FALSE(results.empty());
  bool before = false;
  bool after = false;
  for (const OutageResult& result : results) {
    const double end_s = result.start_s + result.duration_s;
    before = before || end_s <= kGapBegin_s;
    after = after || result.start_s > kGapEnd_s;
    EXPECT_TRUE(end_s <= kGapBegin_s + 0.5 || result.start_s >= kGapEnd_s + kSettle_s - 1.0)
        << result.start_s << " to " << end_s;
  }
  EXPECT_TRUE(before && after);
}

TEST(Outages, ADriveThatIsTooShortYieldsNone) {
  const CoastingModel model = mtx_like();
  EXPECT_TRUE(play_outages(simulated(model, 3, kSettle_s - 5.0), model, one_outage()).empty());
  EXPECT_TRUE(play_outages(Drive{}, model, one_outage()).empty());
  EXPECT_TRUE(consistency_of({}, {10.0}).empty());
}

TEST(Outages, AJumpOfTheReceiverIsRefused) {
  const CoastingModel model = mtx_like();
  Drive drive = simulated(model, 11, kSettle_s + kOutage_s + 2.0);
  const auto clean = play_outages(drive, model, one_outage());
  for (DriveFix& fix : drive.fixes) {
    if (fix.time_s > 30.0 && fix.time_s < 31.0) fix.antenna = displaced(fix.antenna, {8.0, 0.0, 0.0});
  }
  const auto jumped = play_outages(drive, model, one_outage());
  ASSERT_EQ(clean.size(), jumped.size());
  ASSERT_FALSE(clean.empty());
  // Five fixes of fifty a window are lost, no more.
  EXPECT_LT((clean.front().error - jumped.front().error).head<3>().norm(), 0.2);
}

/// Outages every five seconds, so that they overlap.
OutageOptions many_outages() {
  OutageOptions options = one_outage();
  options.spacing_s = 5.0;
  return options;
}

TEST(Outages, ASampleThatComesTwiceChangesNothing) {
  const CoastingModel model = mtx_like();
  Drive drive = simulated(model, 13, kSettle_s + kOutage_s + 2.0);
  const auto clean = play_outages(drive, model, one_outage());
  drive.samples.insert(drive.samples.begin(), drive.samples.front());
  drive.samples.insert(drive.samples.begin() + 3000, drive.samples[3000]);
  const auto doubled = play_outages(drive, model, one_outage());
  ASSERT_EQ(clean.size(), 2U);
  ASSERT_EQ(doubled.size(), clean.size());
  for (std::size_t i = 0; i < clean.size(); ++i) {
    EXPECT_EQ(doubled[i].error, clean[i].error);
    EXPECT_EQ(doubled[i].covariance, clean[i].covariance);
  }
}

TEST(Outages, NoneBeginsBeforeTheVehicleHasDrivenAndWhereItOnlyStandsThereIsNone) {
  const CoastingModel model = mtx_like();
  Drive drive = simulated(model, 17, 100.0);
  constexpr double kStart_s = 20.0;
  for (DriveReference& at : drive.reference) {
    if (at.time_s < kStart_s) at.state.v_n_mps.setZero();
  }
  const auto results = play_outages(drive, model, many_outages());
  ASSERT_FALSE(results.empty());
  EXPECT_NEAR(results.front().start_s, kStart_s + kSettle_s, 1.0);
  for (DriveReference& at : drive.reference) at.state.v_n_mps.setZero();
  EXPECT_TRUE(play_outages(drive, model, many_outages()).empty());
}

TEST(Outages, NoneBeginsWithoutAFixShortlyBeforeIt) {
  const CoastingModel model = mtx_like();
  Drive drive = simulated(model, 19, 120.0);
  constexpr double kHoleBegin_s = 51.0;
  constexpr double kHoleEnd_s = 64.0;
  std::erase_if(drive.fixes,
                [](const DriveFix& f) { return f.time_s > kHoleBegin_s && f.time_s < kHoleEnd_s; });
  OutageOptions options = many_outages();
  options.spacing_s = 0.2;
  bool before = false;
  bool after = false;
  for (const OutageResult& result : play_outages(drive, model, options)) {
    before = before || result.start_s < kHoleBegin_s;
    after = after || result.start_s > kHoleEnd_s;
    EXPECT_TRUE(result.start_s <= kHoleBegin_s || result.start_s > kHoleEnd_s + 0.1) << result.start_s;
  }
  EXPECT_TRUE(before && after);
}

TEST(Outages, WhereTheReferenceIsMissingNothingIsComparedAndNothingCountsAsDriven) {
  const CoastingModel model = mtx_like();
  const Drive whole = simulated(model, 23, 100.0);
  const auto without = [&](double begin_s, double end_s) {
    Drive drive = whole;
    std::erase_if(drive.reference,
                  [=](const DriveReference& r) { return r.time_s > begin_s && r.time_s < end_s; });
    return play_outages(drive, model, one_outage());
  };
  const auto all = play_outages(whole, model, one_outage());
  ASSERT_EQ(all.size(), 2U);
  const double start_s = all.front().start_s;
  // Missing at the end of the longer duration: the shorter one is still there.
  const auto cut = without(start_s + kOutage_s - 3.0, start_s + kOutage_s + 3.0);
  ASSERT_EQ(cut.size(), 1U);
  EXPECT_EQ(cut.front().duration_s, 5.0);
  EXPECT_EQ(cut.front().error, all.front().error);
  // Missing for fifteen seconds while the filter settles: so much later.
  const auto late = without(10.0, 25.0);
  ASSERT_FALSE(late.empty());
  EXPECT_NEAR(late.front().start_s - start_s, 15.0, 1.5);
}

TEST(Outages, VelocityFixesAreTakenAndTheFilterKnowsWhatTheyGave) {
  const CoastingModel model = mtx_like();
  constexpr double kVelocitySd_mps = 0.02;
  const auto make = [&](std::uint64_t seed) {
    Drive drive = simulated(model, seed, kSettle_s + kOutage_s + 2.0);
    std::mt19937_64 random(1000 + seed);
    std::normal_distribution<double> normal;
    for (std::size_t i = 0; i < drive.fixes.size(); ++i) {
      const NavigationState& at = drive.reference[i].state;
      DriveFix& fix = drive.fixes[i];
      fix.has_velocity = true;
      // Of the antenna, which turns about the sensor; the Earth's own rotation is some 0.1 mm/s of it.
      fix.v_n_mps = at.v_n_mps + at.C_b_n * Road::omega(fix.time_s).cross(drive.r_sa_s_m) +
                    kVelocitySd_mps * Vector3d{normal(random), normal(random), normal(random)};
      fix.sd_velocity_mps.setConstant(kVelocitySd_mps);
    }
    return drive;
  };
  const auto with = over_drives(model, make);
  const auto without = over_drives(
      model, [&](std::uint64_t seed) { return simulated(model, seed, kSettle_s + kOutage_s + 2.0); });
  ASSERT_EQ(with.size(), 2U);
  for (std::size_t i = 0; i < with.size(); ++i) {
    EXPECT_TRUE(lies_where_a_right_model_does(with[i].nees_position, with[i].n)) << with[i].nees_position;
    EXPECT_TRUE(lies_where_a_right_model_does(with[i].nees_velocity, with[i].n)) << with[i].nees_velocity;
    EXPECT_TRUE(lies_where_a_right_model_does(with[i].nees_attitude, with[i].n)) << with[i].nees_attitude;
    EXPECT_LT(with[i].velocity_sd_mps, without[i].velocity_sd_mps);
  }
  EXPECT_LT(with[0].velocity_rms_mps, without[0].velocity_rms_mps);
}

TEST(Outages, ThoseThatOverlapDoNotCountAsIndependent) {
  const CoastingModel model = mtx_like();
  const auto results = play_outages(simulated(model, 29, 100.0), model, many_outages());
  const auto table = consistency_of(results, {5.0, 15.0, kOutage_s});
  ASSERT_EQ(table.size(), 2U) << "no outage was looked at after 15 s";
  for (const Consistency& row : table) {
    EXPECT_GT(row.n, 5U);
    // Starts are five seconds apart, or at the next fix.
    const double apart_s = row.duration_s > 5.0 ? 5.2 * std::ceil(row.duration_s / 5.2) : 5.2;
    EXPECT_NEAR(static_cast<double>(row.n_independent), std::ceil(5.2 * static_cast<double>(row.n) / apart_s),
                1.0);
  }
  EXPECT_LT(table[1].n_independent, table[1].n);
  // Fewer that are independent leave more room for chance.
  EXPECT_LT(table[1].nees_low, table[0].nees_low);
  EXPECT_GT(table[1].nees_high, table[0].nees_high);
}

TEST(Outages, ProgressRisesToTheEndOfTheDrive) {
  const CoastingModel model = mtx_like();
  OutageOptions options = many_outages();
  std::vector<double> shares;
  options.progress = [&](double share) { shares.push_back(share); };
  (void)play_outages(simulated(model, 31, 90.0), model, options);
  ASSERT_GE(shares.size(), 5U);
  EXPECT_TRUE(std::is_sorted(shares.begin(), shares.end()));
  EXPECT_GT(shares.front(), 0.3);
  EXPECT_GT(shares.back(), 0.9);
  EXPECT_LE(shares.back(), 1.0);
}

}  // namespace
}  // namespace imuscope
