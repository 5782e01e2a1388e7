/// Everything that the alignment's three parts return, over rich inputs: what is right about it, the tests beside this
/// one prove.

#include <gtest/gtest.h>
#include <Eigen/Geometry>
#include <array>
#include <cmath>
#include <memory>
#include <random>
#include <vector>

#include "estimation/alignment/coarse_mounting.h"
#include "estimation/alignment/cross_correlation.h"
#include "estimation/alignment/reference_window.h"
#include "sample/eigen_arrays.h"
#include "tests/estimation/alignment/analytic_motion.h"
#include "tests/support/answer.h"
#include "tests/support/recorded_answer.h"

namespace imuscope {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using test::Answer;

HostTime instant(double seconds) { return HostTime{from_seconds(seconds)}; }

// ---- coarse mounting

/// What one S-IMU shows of the drive.
struct MountedImu {
  Matrix3d C_b_s = Eigen::AngleAxisd(2.0, Vector3d(0.3, -0.5, 0.8).normalized()).toRotationMatrix();
  Vector3d gyro_bias_radps{0.005, -0.004, 0.006};
  Vector3d accel_bias_mps2{0.05, -0.04, 0.05};
  double gyro_noise_radps = 0.014;
  double accel_noise_mps2 = 0.15;
  double delay_s = 0.0;
  double motion = 1.0;
};

void add_drive(CoarseMountingEstimator& estimator, const MountedImu& imu, int n) {
  const test::SineSum rates = test::car_rates(17);
  const test::SineSum forces = test::car_forces(17);
  const Vector3d gravity(0.0, 0.0, -9.81);
  std::mt19937 random(3);
  std::normal_distribution<> normal;
  const auto noise = [&](double sd) {
    return Vector3d{sd * normal(random), sd * normal(random), sd * normal(random)};
  };
  for (int i = 0; i < n; ++i) {
    const double t = 0.01 * i;
    const double then = t - imu.delay_s;
    const Vector3d gyro =
        imu.C_b_s * (imu.motion * rates(then)) + imu.gyro_bias_radps + noise(imu.gyro_noise_radps);
    const Vector3d force = gravity + imu.motion * (forces(then) - gravity);
    estimator.add(imu.motion * rates(t), gravity + imu.motion * (forces(t) - gravity), gyro,
                  imu.C_b_s * force + imu.accel_bias_mps2 + noise(imu.accel_noise_mps2));
  }
}

void add_solution(Answer& lines, std::string_view name, const CoarseMountingEstimator& estimator) {
  CoarseMounting out;
  const MountingResult result = estimator.solve(out);
  lines.line(name, result, estimator.pairs(), out.rate_correlation, out.gyro_bias_s_radps);
  lines.line("mounting", out.C_b_s);
  lines.line("covariance", Matrix3d(1e4 * out.covariance_rad2));
}

TEST(AlignmentAnswers, CoarseMounting) {
  Answer lines;
  const auto solve = [&](std::string_view name, const MountedImu& imu, int n,
                         const CoarseMountingOptions& options) {
    CoarseMountingEstimator estimator(options);
    add_drive(estimator, imu, n);
    add_solution(lines, name, estimator);
  };
  solve("a minute", {}, 6000, {});
  solve("199 pairs", {}, 199, {});
  solve("200 pairs", {}, 200, {});
  solve("204 pairs", {}, 204, {});
  solve("other options", {}, 6000, {0.5, 0.02, 4.0, 100});
  solve("quiet", {.gyro_noise_radps = 1e-4, .accel_noise_mps2 = 1e-3}, 3000, {});
  solve("hardly moving", {.motion = 0.05}, 3000, {});
  solve("tenths late", {.delay_s = 0.4}, 3000, {});
  solve("seconds late", {.delay_s = 2.0}, 6000, {});
  solve("mirrored", {.C_b_s = Vector3d(1.0, -1.0, 1.0).asDiagonal()}, 3000, {});
  solve("flipped", {.C_b_s = -Matrix3d::Identity()}, 3000, {});
  // Five sd of a bias of 0.15 m/s^2 are 0.75 m/s^2.
  solve("bias of 0.7", {.accel_bias_mps2 = {0.0, 0.0, 0.7}, .accel_noise_mps2 = 1e-3}, 3000, {});
  solve("bias of 0.8", {.accel_bias_mps2 = {0.0, 0.0, 0.8}, .accel_noise_mps2 = 1e-3}, 3000, {});
  test::expect_recorded("estimation/alignment/coarse_mounting.txt", lines.text(), 1e-5, 1e-7);
}

TEST(AlignmentAnswers, CoarseMountingForgetsEverythingWhenCleared) {
  CoarseMountingEstimator fresh;
  CoarseMountingEstimator cleared;
  add_drive(cleared, {.C_b_s = Matrix3d::Identity(), .gyro_bias_radps = {0.1, 0.2, 0.3}}, 3007);
  cleared.clear();
  EXPECT_EQ(cleared.pairs(), 0);
  add_drive(fresh, {}, 3000);
  add_drive(cleared, {}, 3000);
  CoarseMounting of_fresh;
  CoarseMounting of_cleared;
  EXPECT_EQ(fresh.solve(of_fresh), cleared.solve(of_cleared));
  EXPECT_EQ(of_fresh.C_b_s, of_cleared.C_b_s);
  EXPECT_EQ(of_fresh.covariance_rad2, of_cleared.covariance_rad2);
  EXPECT_EQ(of_fresh.gyro_bias_s_radps, of_cleared.gyro_bias_s_radps);
  EXPECT_EQ(of_fresh.rate_correlation, of_cleared.rate_correlation);
}

TEST(AlignmentAnswers, AnyVectorThatIsNoNumberLeavesThePairOut) {
  const Vector3d good = Vector3d::Ones();
  const Vector3d bad(1.0, std::nan(""), 1.0);
  CoarseMountingEstimator estimator;
  estimator.add(bad, good, good, good);
  estimator.add(good, bad, good, good);
  estimator.add(good, good, bad, good);
  estimator.add(good, good, good, bad);
  EXPECT_EQ(estimator.pairs(), 0);
  estimator.add(good, good, good, good);
  EXPECT_EQ(estimator.pairs(), 1);
}

// ---- time offset

struct RateSeries {
  std::vector<double> time_s;
  std::vector<double> rate_radps;
  [[nodiscard]] RateMagnitudeSeries view() const { return {time_s, rate_radps}; }
};

struct SeriesOptions {
  double begin_s = 0.0;
  double end_s = 0.0;
  double rate_hz = 100.0;
  double noise_radps = 1e-5;
  double late_s = 0.0;       ///< taken off the stamps
  double clock_rate = 0.0;   ///< from begin_s on
  double hole_from_s = 1e9;  ///< samples of 3 s are missing
  double size = 1.0;
};

RateSeries series_of(const test::SineSum& omega, const SeriesOptions& o) {
  std::mt19937 random(11);
  std::normal_distribution<> normal(0.0, o.noise_radps);
  RateSeries out;
  for (int k = 0; o.begin_s + k / o.rate_hz < o.end_s; ++k) {
    const double t = o.begin_s + k / o.rate_hz;
    const Vector3d w = o.size * omega(t) + Vector3d{normal(random), normal(random), normal(random)};
    if (t >= o.hole_from_s && t < o.hole_from_s + 3.0) continue;
    out.time_s.push_back(o.begin_s + (t - o.begin_s) / (1.0 + o.clock_rate) - o.late_s);
    out.rate_radps.push_back(w.norm());
  }
  return out;
}

void add_offset(Answer& lines, std::string_view name, const RateSeries& reference, const RateSeries& study,
                const TimeOffsetOptions& options = {}) {
  const Result<TimeOffset> found = find_time_offset(reference.view(), study.view(), options);
  if (!found) {
    lines.line(name, found.error().text());
    return;
  }
  lines.line(name, found->offset_s, 1e3 * found->clock_rate, found->study_origin_s, found->correlation,
             found->distinctness, 1e3 * found->sd_s, found->clock_rate_estimated);
}

TEST(AlignmentAnswers, TimeOffset) {
  Answer lines;
  const test::SineSum omega = test::car_rates(40);
  const RateSeries reference = series_of(omega, {.end_s = 300.0});
  const auto study = [&](SeriesOptions o) {
    o.noise_radps = 0.014;
    return series_of(omega, o);
  };
  add_offset(lines, "plain", reference,
             study({.begin_s = 40.0, .end_s = 250.0, .rate_hz = 120.0, .late_s = -3.2}));
  add_offset(lines, "clock rate", reference,
             study({.begin_s = 20.0, .end_s = 280.0, .late_s = 1.25, .clock_rate = 2e-4}));
  add_offset(lines, "clock rate not asked for", reference,
             study({.begin_s = 20.0, .end_s = 280.0, .late_s = 1.25, .clock_rate = 2e-4}), {5.0, false});
  add_offset(lines, "hole", reference,
             study({.begin_s = 10.0, .end_s = 200.0, .late_s = 2.0, .hole_from_s = 95.0}));
  add_offset(lines, "four segments", reference, study({.begin_s = 60.0, .end_s = 180.02, .late_s = 0.3}));
  add_offset(lines, "three segments", reference, study({.begin_s = 60.0, .end_s = 179.0, .late_s = 0.3}));
  add_offset(lines, "one segment", reference, study({.begin_s = 60.0, .end_s = 95.0, .late_s = 0.3}));
  add_offset(lines, "beyond the search", reference, study({.begin_s = 60.0, .end_s = 160.0, .late_s = 4.0}),
             {3.0, true});
  add_offset(lines, "uneven rate", reference,
             study({.begin_s = 30.0, .end_s = 170.0, .rate_hz = 37.0, .late_s = -0.7}));
  add_offset(lines, "slower than the hole", reference,
             study({.begin_s = 30.0, .end_s = 170.0, .rate_hz = 9.5}));
  add_offset(lines, "another drive", reference, series_of(test::car_rates(43), {.end_s = 200.0}));
  add_offset(lines, "9.99 s", reference, study({.begin_s = 60.0, .end_s = 69.995}));
  add_offset(lines, "10 s", reference, series_of(omega, {.begin_s = 60.0, .end_s = 70.5, .late_s = 0.05}),
             {1.0, true});
  add_offset(lines, "hardly turning", reference, series_of(omega, {.end_s = 100.0, .size = 0.05}));
  add_offset(lines, "reference hardly turning", series_of(omega, {.end_s = 100.0, .size = 0.05}), reference);
  RateSeries unlike = reference;
  unlike.time_s.pop_back();
  add_offset(lines, "unlike sizes", reference, unlike);
  add_offset(lines, "nothing", {}, reference);
  test::expect_recorded("estimation/alignment/time_offset.txt", lines.text(), 1e-5, 1e-7);
}

TEST(AlignmentAnswers, LiveTimeOffset) {
  Answer lines;
  const test::SineSum omega = test::car_rates(45);
  struct Run {
    const char* name;
    double offset_s;
    double period_s = 0.01;
    double hole_from_s = 1e9;
    double size = 1.0;
    double noise_radps = 0.014;
  };
  for (const Run& run : {Run{"early", -1.7}, Run{"late", 1.9}, Run{"at the edge", 2.0}, Run{"beyond", 2.6},
                         Run{"slow", 0.25, 0.04}, Run{"hole", 0.1, 0.01, 32.0},
                         Run{"little", 0.1, 0.01, 1e9, 0.2, 0.002}, Run{"noisy", 0.1, 0.01, 1e9, 1.0, 0.04},
                         Run{"quiet", -0.013, 0.01, 1e9, 1.0, 1e-4}, Run{"fast", 0.4, 0.002}}) {
    const auto live = std::make_unique<LiveTimeOffset>();
    std::mt19937 random(3);
    std::normal_distribution<> noise(0.0, run.noise_radps);
    lines.line(run.name);
    double next_s = 20.0;
    for (int i = 0; run.period_s * i < 60.0; ++i) {
      const double t = run.period_s * i + 3.0;
      live->add_reference(instant(t), run.size * omega(t).norm());
      const Vector3d w = run.size * omega(t) + Vector3d(noise(random), noise(random), noise(random));
      const bool lost = t >= run.hole_from_s && t < run.hole_from_s + 0.2;
      if (!lost) live->add_study(instant(t - run.offset_s), w.norm());
      if (i % 50 == 0) live->add_study(instant(t - run.offset_s + 0.001), std::nan(""));
      if (t < next_s) continue;
      next_s += 4.0;
      TimeOffset out;
      const bool found = live->estimate(out);
      lines.line("at", t, found, out.offset_s, out.correlation, out.distinctness, 1e3 * out.sd_s);
    }
  }
  test::expect_recorded("estimation/alignment/live_time_offset.txt", lines.text(), 1e-5, 1e-7);
}

TEST(AlignmentAnswers, LiveTimeOffsetTakesSamplesFromEightMillisecondsApartOn) {
  // Samples that are too close count as not there: 7.9 ms leaves every second one.
  const test::SineSum omega = test::car_rates(45);
  const auto offset_with_spacing = [&](double spacing_s) {
    const auto live = std::make_unique<LiveTimeOffset>();
    for (int i = 0; spacing_s * i < 36.0; ++i) {
      const double t = spacing_s * i;
      live->add_reference(instant(t), omega(t).norm());
      live->add_study(instant(t), omega(t).norm());
    }
    TimeOffset out;
    return live->estimate(out);
  };
  // 4,096 samples of 8 ms are 32.8 s, of which 24 s are needed.
  EXPECT_TRUE(offset_with_spacing(0.008));
  EXPECT_TRUE(offset_with_spacing(0.0079));
}

TEST(AlignmentAnswers, LiveTimeOffsetTakesTheFirstSampleOfAClockThatBeginsAtZeroToo) {
  const test::SineSum omega = test::car_rates(45);
  const auto samples_needed = [&](HostTime begin) {
    const auto live = std::make_unique<LiveTimeOffset>();
    TimeOffset out;
    int i = 0;
    for (; i < 4000; ++i) {
      const double t = 0.01 * i;
      live->add_reference(begin + from_seconds(t), omega(t).norm());
      live->add_study(begin + from_seconds(t), omega(t).norm());
      if (i > 2000 && live->estimate(out)) break;
    }
    return i;
  };
  EXPECT_EQ(samples_needed(HostTime{}), samples_needed(HostTime{from_seconds(1000.0)}));
  EXPECT_LT(samples_needed(HostTime{}), 3000);
}

// ---- reference window

Sample imu_at(double t, const Vector3d& omega, const Vector3d& f, std::uint32_t flags) {
  Sample sample{};
  sample.kind = SampleKind::kImu;
  sample.time = instant(t);
  sample.imu.omega_radps = to_array(omega);
  sample.imu.f_mps2 = to_array(f);
  sample.imu.angular_acceleration_radps2 = {0.1 + t, 0.2 - 2.0 * t * t, 0.3 * t};
  sample.imu.flags = flags | kGyroValid | kAccelValid;
  return sample;
}

void add_motion(Answer& lines, const ReferenceWindow& window, double t) {
  ReferenceKinematics out;
  const ReferenceResult result = window.evaluate(instant(t), out);
  lines.line("at", t, result, window.size(), out.angular_acceleration_is_measured, out.value_noise_gain,
             out.derivative_noise_gain_per_s);
  if (result != ReferenceResult::kOk) return;
  lines.line("rates", out.omega_radps, out.omega_dot_radps2, out.omega_ddot_radps3);
  lines.line("forces", out.f_mps2, out.f_dot_mps3);
}

TEST(AlignmentAnswers, ReferenceWindow) {
  Answer lines;
  const test::SineSum omega = test::car_rates(5);
  const test::SineSum f = test::car_forces(5);
  for (const int points : {5, 7, 9, 11}) {
    for (const std::uint32_t flags : {0U, static_cast<std::uint32_t>(kIsIncrement),
                                      static_cast<std::uint32_t>(kHasAngularAcceleration)}) {
      lines.line("window", points, flags);
      ReferenceWindow window({points, 0.01});
      for (int i = 0; i <= 100; ++i) {
        if (i == 60) continue;
        const double t = 0.01 * i + 0.001 * std::sin(2.3 * i);
        const std::uint32_t of_this =
            i == 30 ? (flags & ~static_cast<std::uint32_t>(kHasAngularAcceleration)) : flags;
        window.push(imu_at(t, omega(t), f(t), of_this));
      }
      for (const double t : {0.0, 0.0249, 0.1, 0.1037, 0.301, 0.55, 0.57, 0.6, 0.655, 0.968, 0.98, 2.0})
        add_motion(lines, window, t);
    }
  }
  test::expect_recorded("estimation/alignment/reference_window.txt", lines.text(), 1e-6, 1e-9);
}

TEST(AlignmentAnswers, HalfWayBetweenTwoSamplesTheLaterOneIsTheMiddle) {
  // Of six samples, five around the third are there; around the fourth one more would be needed.
  ReferenceWindow window({5, 0.01});
  for (int i = 0; i < 5; ++i) window.push(imu_at(0.01 * i, Vector3d::Ones(), Vector3d::Ones(), 0));
  ReferenceKinematics out;
  EXPECT_EQ(window.evaluate(instant(0.015), out), ReferenceResult::kOk);
  EXPECT_EQ(window.evaluate(instant(0.015) - Duration{1}, out), ReferenceResult::kTooOld);
  EXPECT_EQ(window.evaluate(instant(0.025) - Duration{1}, out), ReferenceResult::kOk);
  EXPECT_EQ(window.evaluate(instant(0.025), out), ReferenceResult::kTooNew);
}

TEST(AlignmentAnswers, ASpacingOfOnePeriodAndAHalfIsNoGapYet) {
  for (const double spacing_s : {0.0149, 0.0151}) {
    ReferenceWindow window({5, 0.01});
    for (int i = 0; i < 10; ++i) window.push(imu_at(spacing_s * i, Vector3d::Ones(), Vector3d::Ones(), 0));
    ReferenceKinematics out;
    EXPECT_EQ(window.evaluate(instant(5.0 * spacing_s), out),
              spacing_s < 0.015 ? ReferenceResult::kOk : ReferenceResult::kGap);
  }
}

TEST(AlignmentAnswers, AnyVectorThatIsNoNumberIsRefusedByTheWindow) {
  const Vector3d good = Vector3d::Ones();
  for (Eigen::Index axis = 0; axis < 3; ++axis) {
    Vector3d bad = good;
    bad[axis] = std::nan("");
    ReferenceWindow window({5, 0.01});
    EXPECT_FALSE(window.push(imu_at(0.1, bad, good, 0)));
    EXPECT_FALSE(window.push(imu_at(0.1, good, bad, 0)));
    Sample turned = imu_at(0.1, good, good, kHasAngularAcceleration);
    turned.imu.angular_acceleration_radps2[static_cast<std::size_t>(axis)] = std::nan("");
    EXPECT_FALSE(window.push(turned));
    turned.imu.flags = kGyroValid;
    EXPECT_TRUE(window.push(turned)) << "an acceleration that the device does not claim to send";
    EXPECT_EQ(window.newest_sample(), instant(0.1));
  }
}

}  // namespace
}  // namespace imuscope
