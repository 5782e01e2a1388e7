#include "firmware_sim/imu/imperfections.h"

#include <gtest/gtest.h>
#include <Eigen/Geometry>
#include <Eigen/SVD>
#include <array>
#include <cmath>
#include <numbers>
#include <vector>

#include "firmware_sim/imu/sensor_classes.h"
#include "firmware_sim/motion/degrees.h"

namespace imusim {
namespace {

constexpr double kSample_s = 0.01;

Scenario two_minutes(bool engine_runs) {
  Scenario scenario;
  scenario.duration_s = 120.0;
  scenario.engine_runs = engine_runs;
  return scenario;
}

const Motion& quiet() {
  static const Motion motion(two_minutes(false));
  return motion;
}

const Motion& shaken() {
  static const Motion motion(two_minutes(true));
  return motion;
}

Mounting turned() {
  Mounting mounting;
  mounting.C_b_s = Eigen::AngleAxisd(0.7, Eigen::Vector3d(1.0, 2.0, -1.0).normalized()).toRotationMatrix();
  mounting.r_bs_b_m = {0.35, -0.22, 0.12};
  return mounting;
}

/// A sensor on the quiet drive that has read nothing so far.
ImuReading first_sample(const ImuErrors& errors, double t_s, const Motion& motion = quiet()) {
  return ImuModel(motion, turned(), errors, 1, "one").sample_at(t_s);
}

TEST(Imperfections, ATriadReadsItsMatrixTimesTheTruth) {
  ImuErrors errors;
  errors.accel.C_s_triad = Eigen::AngleAxisd(0.002, Eigen::Vector3d::UnitY()).toRotationMatrix();
  errors.accel.scale = {0.001, -0.002, 0.003};
  errors.accel.misalignment(0, 2) = errors.accel.misalignment(2, 0) = 0.0009;
  errors.gyro.misalignment(1, 2) = 0.0017;
  const IdealReading ideal = ideal_reading(quiet().state_at(71.0), turned());
  const ImuReading reading = first_sample(errors, 71.0);
  // Row x of the accelerometers by hand: (1 + s_x)(f_x cos + f_z sin) + m_xz (f_z cos - f_x sin).
  const double cosine = std::cos(0.002);
  const double sine = std::sin(0.002);
  const Eigen::Vector3d& f = ideal.f_mps2;
  EXPECT_NEAR(reading.f_mps2.x(),
              1.001 * (f.x() * cosine + f.z() * sine) + 0.0009 * (f.z() * cosine - f.x() * sine), 1e-13);
  EXPECT_LT((reading.f_mps2 - triad_matrix(errors.accel) * f).norm(), 1e-13);
  EXPECT_NEAR(reading.omega_radps.y(), ideal.omega_radps.y() + 0.0017 * ideal.omega_radps.z(), 1e-15);
}

TEST(Imperfections, EachAccelerometerFeelsTheForceAtItsOwnPlace) {
  ImuErrors errors;
  errors.accel_places_s_m << 0.02, -0.01, 0.005,  //
      -0.015, 0.03, 0.0,                          //
      0.01, 0.0, -0.025;
  for (const double t_s : {62.0, 75.0, 93.0}) {
    const MotionState state = quiet().state_at(t_s);
    const ImuReading reading = first_sample(errors, t_s);
    for (Eigen::Index axis = 0; axis < 3; ++axis) {
      const Eigen::Vector3d there =
          turned().r_bs_b_m + turned().C_b_s.transpose() * errors.accel_places_s_m.col(axis);
      EXPECT_NEAR(reading.f_mps2(axis), (turned().C_b_s * specific_force_at(state, there))(axis), 1e-12);
    }
    EXPECT_EQ(reading.gyro_error_radps.norm(), 0.0);
  }
}

TEST(Imperfections, ADelayedTriadReadsWhatWasItsDelayAgo) {
  ImuErrors errors;
  errors.accel.delay_s = 0.0017;
  for (const double t_s : {62.0, 75.0, 93.0}) {
    const ImuReading late = first_sample(errors, t_s);
    const ImuReading then = first_sample({}, t_s - 0.0017);
    EXPECT_EQ((late.f_mps2 - then.f_mps2).norm(), 0.0);
    EXPECT_EQ(late.gyro_error_radps.norm(), 0.0);
  }
  EXPECT_EQ(slow_delay_s(errors.accel), 0.0017);
}

TEST(Imperfections, ALowPassAndADelayTogetherAreBehindASlowMotionByTheirSum) {
  ImuErrors errors;
  errors.accel.delay_s = 0.001;
  errors.accel.low_pass_hz = errors.gyro.low_pass_hz = 40.0;
  EXPECT_NEAR(slow_delay_s(errors.accel), 0.001 + std::numbers::sqrt2 / (80.0 * std::numbers::pi), 1e-15);
  ImuModel model(quiet(), turned(), errors, 1, "late");
  double gyro2 = 0.0;
  double accel2 = 0.0;
  double undelayed2 = 0.0;
  for (double t_s = 60.0; t_s < 110.0; t_s += kSample_s) {
    const ImuReading reading = model.sample_at(t_s);
    if (t_s < 60.2) continue;
    const auto ideal_at = [](double then_s) { return ideal_reading(quiet().state_at(then_s), turned()); };
    gyro2 += (reading.omega_radps - ideal_at(t_s - slow_delay_s(errors.gyro)).omega_radps).squaredNorm();
    accel2 += (reading.f_mps2 - ideal_at(t_s - slow_delay_s(errors.accel)).f_mps2).squaredNorm();
    undelayed2 += reading.gyro_error_radps.squaredNorm() + reading.accel_error_mps2.squaredNorm();
  }
  // What is left is of the second order in the motion's frequency over the corner: (3 Hz / 40 Hz)^2.
  EXPECT_LT(gyro2 + accel2, 0.01 * undelayed2);
}

TEST(Engine, ItsPhaseIsTheIntegralOfAFrequencyThatFoldsToNothingSlow) {
  const Engine& engine = *shaken().engine();
  for (double t_s = -1.0; t_s < 121.0; t_s += 0.0937) {
    constexpr double kH_s = 1e-5;
    const Engine::Point now = engine.at(t_s);
    const double slope = (engine.at(t_s + kH_s).phase_rad - engine.at(t_s - kH_s).phase_rad) / (2.0 * kH_s);
    EXPECT_NEAR(now.rate_radps, slope, 1e-3);
    EXPECT_GE(now.rate_radps, 2.0 * std::numbers::pi * 22.0);
    EXPECT_LE(now.rate_radps, 2.0 * std::numbers::pi * 46.0);
  }
  // It idles while the vehicle stands, and turns faster in motion.
  EXPECT_LT(engine.at(5.0).strength, 1.1);
  EXPECT_GT(engine.at(75.0).strength, 1.1);
}

TEST(Engine, ABodysAngularAccelerationIsTheDerivativeOfItsRate) {
  for (double t_s = 60.03; t_s < 110.0; t_s += 0.617) {
    constexpr double kH_s = 1e-5;
    const Eigen::Vector3d slope =
        (shaken().state_at(t_s + kH_s).omega_ib_b_radps - shaken().state_at(t_s - kH_s).omega_ib_b_radps) /
        (2.0 * kH_s);
    EXPECT_LT((shaken().state_at(t_s).omega_dot_ib_b_radps2 - slope).norm(), 2e-4);
  }
}

TEST(Engine, LinesHaveTheirPowerInTheMeanOverDraws) {
  constexpr int kDraws = 4000;
  const VibrationClass vibration;
  const Engine::Point idle{0.4, 150.0, 1.0, 0.0};
  double f2 = 0.0;
  double omega2 = 0.0;
  for (int i = 0; i < kDraws; ++i) {
    const auto point = Vibration(vibration, Random(static_cast<std::uint64_t>(i), "lines")).at(idle);
    f2 += point.f_mps2.squaredNorm() / (3 * kDraws);
    omega2 += point.omega_radps.squaredNorm() / (3 * kDraws);
  }
  const double sd = std::sqrt(2.0 / (3 * kDraws));
  const double f_expected = 0.10 * 0.10 + 0.05 * 0.05;
  EXPECT_NEAR(f2 / f_expected, 1.0, 5.0 * sd);
  EXPECT_NEAR(omega2 / (5e-4 * 5e-4 + 2.5e-4 * 2.5e-4), 1.0, 5.0 * sd);
}

TEST(Engine, SensorsShareTheVehiclesVibrationAndAddTheirOwn) {
  const ImuReading shared = first_sample({}, 75.0, shaken());
  const ImuReading other = ImuModel(shaken(), turned(), {}, 1, "other").sample_at(75.0);
  EXPECT_EQ((shared.f_mps2 - other.f_mps2).norm(), 0.0);
  EXPECT_EQ(shared.accel_error_mps2.norm(), 0.0);  // it is motion, no error
  EXPECT_GT((shared.f_mps2 - first_sample({}, 75.0).f_mps2).norm(), 0.01);
  ImuErrors errors;
  errors.own_vibration = 0.5;
  ImuModel mounted(shaken(), turned(), errors, 1, "mounted");
  double own2 = 0.0;
  int n = 0;
  for (double t_s = 10.0; t_s < 40.0; t_s += 0.0371, ++n)
    own2 += mounted.sample_at(t_s).accel_error_mps2.squaredNorm();
  // Nine of ten sums of squares of 12 normal amplitudes lie within a factor of three.
  const double expected = 3.0 * 0.25 * (0.10 * 0.10 + 0.05 * 0.05);
  EXPECT_GT(own2 / n, expected / 4.0);
  EXPECT_LT(own2 / n, expected * 4.0);
  EXPECT_EQ(first_sample(errors, 75.0).accel_error_mps2.norm(), 0.0);  // no engine, no vibration
}

/// Mean square of what is drawn for an S-IMU, over many units.
struct MeanSquares {
  double lean = 0.0;
  double apart = 0.0;
  double place = 0.0;
  double g_sensitivity = 0.0;
  double delay = 0.0;
  double low_pass = 0.0;
};

TEST(Imperfections, HaveTheSizesOfADataSheet) {
  constexpr int kUnits = 3000;
  MeanSquares sum;
  for (int unit = 0; unit < kUnits; ++unit) {
    Random random(static_cast<std::uint64_t>(unit), "unit");
    ImuErrors errors;
    draw_imperfections(study_imperfections(WorldKind::kHarsh), random, errors);
    const Eigen::Matrix3d gyro = triad_matrix(errors.gyro);
    // Angle between two axes of the triad (rows), less 90 degrees.
    const double cosine = gyro.row(0).dot(gyro.row(1)) / gyro.row(0).norm() / gyro.row(1).norm();
    sum.lean += std::pow(std::asin(cosine), 2) / kUnits;
    sum.apart += std::pow(Eigen::AngleAxisd(errors.accel.C_s_triad).angle(), 2) / (3 * kUnits);
    sum.place += errors.accel_places_s_m.squaredNorm() / (9 * kUnits);
    sum.g_sensitivity += errors.gyro.g_sensitivity.squaredNorm() / (9 * kUnits);
    sum.delay += errors.accel.delay_s * errors.accel.delay_s / kUnits;
    // The gyros' axes s are the orthogonal ones closest to them; the accelerometers' places have s in their
    // middle.
    const Eigen::JacobiSVD<Eigen::Matrix3d> svd(gyro, Eigen::ComputeFullU | Eigen::ComputeFullV);
    EXPECT_LT((svd.matrixU() * svd.matrixV().transpose() - Eigen::Matrix3d::Identity()).norm(), 1e-12);
    EXPECT_LT(errors.accel_places_s_m.rowwise().mean().norm(), 1e-15);
    for (const double corner_hz : {errors.gyro.low_pass_hz, errors.accel.low_pass_hz})
      sum.low_pass += std::pow(corner_hz - 40.0, 2) / (2 * kUnits);
    EXPECT_NE(errors.gyro.low_pass_hz, errors.accel.low_pass_hz);
    EXPECT_GE(errors.gyro.low_pass_hz, 28.0);
    EXPECT_LE(errors.gyro.low_pass_hz, 52.0);
  }
  const auto expect_sd = [](double mean_square, double sd, int degrees) {
    EXPECT_NEAR(mean_square / (sd * sd), 1.0, 5.0 * std::sqrt(2.0 / degrees));
  };
  expect_sd(sum.lean, 0.1 * kRadPerDeg, kUnits);
  expect_sd(sum.apart, 0.1 * kRadPerDeg, 3 * kUnits);
  expect_sd(sum.place, 0.02 * std::sqrt(2.0 / 3.0), 6 * kUnits);  // centred: two of three are free
  expect_sd(sum.g_sensitivity, 0.05 * kRadPerDeg / 9.80665, 9 * kUnits);
  expect_sd(sum.delay, 1e-3, kUnits);
  expect_sd(sum.low_pass, 4.0, 2 * kUnits);
}

TEST(Imperfections, TheIdealWorldHasNone) {
  Random random(1, "unit");
  ImuErrors errors = draw_mtx(MtxClass{}, random);
  const ImuErrors before = errors;
  draw_imperfections(study_imperfections(WorldKind::kIdeal), random, errors);
  EXPECT_EQ(triad_matrix(errors.gyro), triad_matrix(before.gyro));
  EXPECT_EQ(triad_matrix(errors.accel), triad_matrix(before.accel));
  EXPECT_EQ(errors.gyro.g_sensitivity, before.gyro.g_sensitivity);
  EXPECT_TRUE(errors.accel_places_s_m.isZero(0.0));
  EXPECT_EQ(slow_delay_s(errors.accel), 0.0);
  EXPECT_FALSE(std::isfinite(errors.gyro.low_pass_hz));
  EXPECT_EQ(errors.own_vibration, 0.0);
}

TEST(Imperfections, AReferenceIsAsStraightAsItsGyrosAreQuiet) {
  constexpr int kUnits = 3000;
  constexpr std::array<double, kReferenceClasses> kAxes_mrad{0.3, 0.349, 0.873, 1.745, 1.745};
  constexpr std::array<double, kReferenceClasses> kScale_ppm{300.0, 500.0, 1000.0, 5000.0, 5000.0};
  constexpr std::array<double, kReferenceClasses> kCorner_hz{80.0, 80.0, 80.0, 40.0, 40.0};
  for (std::size_t i = 0; i < kReferenceClasses; ++i) {
    const ReferenceClass of = reference_class(static_cast<int>(i) + 1);
    double scale2 = 0.0;
    double lean2 = 0.0;
    double corner_hz = 0.0;
    double delay2_s2 = 0.0;
    for (int unit = 0; unit < kUnits; ++unit) {
      Random random(static_cast<std::uint64_t>(unit), "reference");
      ImuErrors errors;
      draw_imperfections(reference_imperfections(WorldKind::kHarsh, of), random, errors);
      scale2 += (errors.gyro.scale.squaredNorm() + errors.accel.scale.squaredNorm()) / (6 * kUnits);
      lean2 += std::pow(2.0 * errors.accel.misalignment(0, 1), 2) / kUnits;
      corner_hz += errors.gyro.low_pass_hz / kUnits;
      delay2_s2 += std::pow(slow_delay_s(errors.accel), 2) / kUnits;
      EXPECT_TRUE(errors.accel_places_s_m.isZero(0.0));
    }
    EXPECT_NEAR(corner_hz / kCorner_hz[i], 1.0, 0.01);
    // What its stamps leave of the low-pass's delay: a tenth, as much as corners scatter by.
    const double of_low_pass_s = std::numbers::sqrt2 / (2.0 * std::numbers::pi * kCorner_hz[i]);
    EXPECT_NEAR(std::sqrt(delay2_s2) / of_low_pass_s, 0.1, 0.01);
    EXPECT_NEAR(std::sqrt(scale2) * 1e6, kScale_ppm[i], 0.017 * kScale_ppm[i]);
    EXPECT_NEAR(std::sqrt(lean2) * 1e3, kAxes_mrad[i], 0.067 * kAxes_mrad[i]);
  }
}

TEST(ReferenceClasses, HaveTheirAngularRandomWalksAndEndAtTheMtx) {
  const std::array walks_deg_per_sqrt_h = {0.0015, 0.03, 0.125, 0.3, 4.8};
  for (int number = 1; number <= kReferenceClasses; ++number)
    EXPECT_NEAR(reference_class(number).gyro_white_radps_per_sqrt_hz / kRadPerDeg * 60.0,
                walks_deg_per_sqrt_h.at(static_cast<std::size_t>(number - 1)), 1e-12);
  // 4.8 deg/sqrt(h) at 100 Hz is the MTx's white noise of a sample, 0.8 deg/s.
  Random random(1, "mtx");
  const ImuErrors like_mtx = draw_reference(reference_class(kReferenceClasses), 100.0, random);
  const double sd = std::sqrt(like_mtx.gyro.noise[0].in_motion.white_variance) / kRadPerDeg;
  EXPECT_NEAR(sd, std::sqrt(0.65382), 0.02);
  EXPECT_NEAR(std::sqrt(like_mtx.accel.noise[0].in_motion.white_variance), MtxClass{}.accel_white_sd_mps2,
              1e-3);
}

}  // namespace
}  // namespace imusim
