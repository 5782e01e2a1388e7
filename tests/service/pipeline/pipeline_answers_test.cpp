/// What becomes of rows, refits and estimates on their way to people, whole.

#include <gtest/gtest.h>

#include <cmath>

#include "base/units.h"
#include "fitted_axis.h"
#include "service/pipeline/motion_book.h"
#include "service/pipeline/noise_feedback.h"
#include "service/pipeline/noise_series.h"
#include "service/pipeline/observability.h"
#include "service/pipeline/validity.h"
#include "service/pipeline/vehicle_speed.h"
#include "tests/support/answer.h"
#include "tests/support/lcm_text.h"
#include "tests/support/recorded_answer.h"

namespace imuscope {
namespace {

using test::Answer;

/// Signals that no two axes share.
ErrorRow waving_row(int i) {
  ErrorRow row{};
  row.time = HostTime{std::chrono::milliseconds(10 * i)};
  row.counter = 1000 + i;
  row.gyro_valid = i % 11 != 3;
  row.accel_valid = i % 13 != 5;
  double phase = 0.0;
  for (Vector3* v : {&row.predicted_omega_s_radps, &row.predicted_f_s_mps2, &row.omega_dot_s_radps2,
                     &row.omega_ddot_s_radps3, &row.f_dot_s_mps3}) {
    for (double& value : *v) {
      phase += 0.7;
      value = std::sin(0.013 * i * (1.0 + phase) + phase);
    }
  }
  for (std::size_t k = 0; k < 3; ++k) {
    row.e_gyro_radps[k] =
        0.01 * row.predicted_omega_s_radps[k] + 1e-3 * std::sin(0.9 * i + static_cast<double>(k));
    row.e_accel_mps2[k] =
        -0.02 * row.predicted_f_s_mps2[k] + 2e-3 * std::cos(0.7 * i + static_cast<double>(k));
  }
  return row;
}

void add_fit(Answer& answer, std::string_view name, const MotionFit& fit) {
  answer.line(name, fit.mean, fit.rms, fit.largest, fit.slope, fit.slope_sd, fit.correlation, fit.r2, fit.f,
              fit.p_value);
}

TEST(PipelineWhole, MotionAndHowErrorsFollowIt) {
  Answer answer;
  MotionBook book;
  int i = 0;
  for (const int until : {0, 1, 2, 3, 40, 600}) {
    for (; i < until; ++i) book.add(waving_row(i), i % 4 == 1 ? Regime::kStatic : Regime::kDynamic);
    const MotionSummary summary = book.summary();
    answer.line("-", until, summary.n_static, summary.n_dynamic);
    for (std::size_t axis = 0; axis < kAxisCount; ++axis)
      add_fit(answer, axis_name(axis), summary.axes[axis]);
    for (std::size_t k = 0; k < kCovariates; ++k) add_fit(answer, covariate_name(k), summary.covariates[k]);
  }
  test::expect_recorded("service/pipeline/motion.txt", answer.text());
}

TEST(PipelineWhole, RowsAsASeries) {
  Answer answer;
  NoiseSeries series;
  for (const int counter : {5, 6, 6, 4, 9, 10, 15, 16}) {
    series.add(waving_row(counter),
               counter == 9 ? std::nullopt : std::optional<std::size_t>(counter < 10 ? 0 : kMaxRegimes - 1));
  }
  answer.line(series.size(), series.missing());
  for (std::size_t k = 0; k < series.size(); ++k) answer.line("time", to_ns(series.time(k)));
  for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
    answer.line(axis_name(axis), axis_unit(axis), series.values(axis));
    answer.line("any", series.mask(axis), "static", series.mask(axis, Regime::kStatic), "dynamic",
                series.mask(axis, Regime::kDynamic), "last", series.mask(axis, kMaxRegimes - 1));
  }
  test::expect_recorded("service/pipeline/series.txt", answer.text());
}

TEST(PipelineWhole, AHoleIsPaddedUpToAnHourAndATwofoldOfTheSamples) {
  NoiseSeries series;
  series.add(waving_row(0));
  series.add(waving_row(360'001));
  EXPECT_EQ(series.missing(), 360'000U);
  EXPECT_EQ(series.size(), 360'002U);
  series.add(waving_row(360'010));
  EXPECT_EQ(series.missing(), 360'004U) << "two of each that is there";
  series.add(waving_row(360'100));
  EXPECT_EQ(series.missing(), 360'006U);
}

SImuOutput estimated() {
  SImuOutput study;
  study.status = CalibrationStatus::kConverging;
  study.sd_psi_rad = {0.03 * kRadPerDeg, 0.02 * kRadPerDeg, 0.05 * kRadPerDeg};
  study.sd_r_bs_b_m = {0.003, 0.004, 0.006};
  study.sd_t_d_s = 3e-4;
  study.observable.fill(true);
  study.t_d_observable = true;
  study.weakest_direction = {0.1, 0.2, 0.3, 0.5, 0.6, 0.4};
  study.weakest_relative_sd = 0.4;
  return study;
}

TEST(PipelineWhole, WhatIsKnownOfAMountingInWords) {
  Answer answer;
  const auto tell = [&](const SImuOutput& study) {
    const Observability seen = observability_of(study);
    answer.line(seen.weakest, "|", seen.advice, "|", seen.weakest_relative_sd);
  };
  SImuOutput study = estimated();
  answer.line(observability_json(observability_of(study)).dump(1));
  for (std::size_t i = 0; i < kObservedStates; ++i) {
    SImuOutput unseen = estimated();
    if (i < 6) unseen.observable[i] = false;
    if (i == 6) unseen.t_d_observable = false;
    tell(unseen);
    answer.line(observability_json(observability_of(unseen)).at("states").at(i).dump());
    SImuOutput weak = estimated();
    if (i < 3) weak.sd_psi_rad[i] = 1.0;
    if (i >= 3 && i < 6) weak.sd_r_bs_b_m[i - 3] = 1.0;
    if (i == 6) weak.sd_t_d_s = 1.0;
    tell(weak);
  }
  for (int turn = 0; turn < 24; ++turn) {
    const double a = (turn * 15.0 + 7.0) * kRadPerDeg;
    study.weakest_direction = {std::cos(a), 0.0, std::sin(a), 0.0, 0.0, 0.0};
    tell(study);
    study.weakest_direction = {0.0, 0.0, 0.0, std::sin(a), std::cos(a), 0.1};
    tell(study);
    study.weakest_direction = {0.0, std::cos(a), 0.0, 0.0, std::sin(a), 0.0};
    tell(study);
  }
  study.weakest_relative_sd = 0.5;
  answer.line(observability_json(observability_of(study)).at("weakest").dump());
  study.sd_psi_rad.fill(study.goal.boresight_sd_rad);
  study.sd_r_bs_b_m.fill(study.goal.lever_arm_sd_m);
  study.sd_t_d_s = study.goal.time_offset_sd_s;
  answer.line(observability_json(observability_of(study)).dump(1));
  test::expect_recorded("service/pipeline/observability.txt", answer.text());
}

TEST(PipelineWhole, WhatIsSaidOfAMountingWhileItIsLearned) {
  Answer answer;
  ObservabilityWatch watch;
  SImuOutput study = estimated();
  study.observable = {true, false, false, true, false, false};
  study.t_d_observable = false;
  const auto look = [&](double time_s) {
    study.time = HostTime{from_seconds(time_s)};
    answer.line("at", time_s);
    for (const auto& sentence : watch.update(study)) answer.line(sentence);
  };
  study.status = CalibrationStatus::kCoarse;
  look(1.0);
  study.status = CalibrationStatus::kConverging;
  for (const double time_s : {2.0, 3.0, 61.9, 62.0, 63.0, 121.9, 122.0}) look(time_s);
  study.observable[5] = true;  // another advice
  for (const double time_s : {123.0, 131.9, 132.0, 133.0}) look(time_s);
  study.observable = {};
  look(150.0);
  look(200.0);
  study.observable.fill(true);
  study.t_d_observable = true;
  look(201.0);
  look(300.0);
  study.status = CalibrationStatus::kCoarse;
  look(301.0);
  study.status = CalibrationStatus::kCalibrated;
  look(302.0);
  test::expect_recorded("service/pipeline/observability_told.txt", answer.text());
}

TEST(PipelineWhole, ModelsThatGoBackToTheFilter) {
  const test::LcmText reader;
  const SImuNoise configured = mtx_class_noise();
  std::string text;
  NoiseFeedback feedback(configured, 0.25);
  std::int64_t samples = 0;
  const auto consider = [&](double share, double bias_share, double tau_share) {
    Refit refit;
    refit.samples = samples += 6000;
    for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
      const double more = 1.0 + 0.01 * static_cast<double>(axis);
      for (const Regime regime : {Regime::kStatic, Regime::kDynamic}) {
        const auto r = static_cast<std::size_t>(regime);
        const double white = (axis < 3 ? configured.gyro : configured.accel)[r].white_sd[axis % 3];
        const GaussMarkovConfig& bias = (axis < 3 ? configured.gyro_bias : configured.accel_bias)[axis % 3];
        refit.axes.push_back(test::refit_of(axis, regime, share * more * white, 0.5 * share * white, 0.05,
                                            bias_share * more * bias.sd,
                                            tau_share * more * bias.time_constant_s));
      }
    }
    const auto given = feedback.consider(refit);
    text += fmt::format("{} {} {}: ", share, bias_share, tau_share);
    if (!given) {
      text += "stays\n";
      return;
    }
    EXPECT_EQ(given->noise, feedback.in_force());
    const AppliedNoise applied{1, 77, *given};
    const applied_model_t record = applied_model_record(applied, "left");
    text += test::lcm_text(reader, record);
    const AppliedNoise back = applied_noise_of(record, 1);
    EXPECT_EQ(back.model.noise, given->noise);
    EXPECT_EQ(back.model.samples, samples);
    EXPECT_EQ(back.model.version, feedback.version());
    EXPECT_EQ(back.tick, 77);
    EXPECT_EQ(back.study, 1U);
  };
  consider(1.1, 1.1, 1.0);
  consider(1.1, 1.1, 1.0);
  consider(1.15, 1.2, 1.1);  // within the step
  consider(1.3, 1.2, 1.1);
  consider(1.3, 2.0, 1.1);
  consider(1.3, 2.0, 2.5);
  consider(0.2, 0.22, 3.9);  // below the floor
  consider(0.2, 0.22, 6.0);
  consider(9.0, 9.0, 1.0);
  test::expect_recorded("service/pipeline/feedback.txt", text);
}

TEST(PipelineWhole, AResultIsUsableUpToItsLimits) {
  const double just_over = 1.0 + 1e-9;
  NavigationOutput navigation;
  EXPECT_EQ(validity_of(navigation, {kStaleReference_s, kCoasting_s}), Validity::kUsable);
  EXPECT_EQ(validity_of(navigation, {kStaleReference_s * just_over, 0.0}), Validity::kStale);
  EXPECT_EQ(validity_of(navigation, {0.0, kCoasting_s * just_over}), Validity::kCoasting);
  EXPECT_EQ(validity_of(navigation, {std::nan(""), 0.0}), Validity::kStale);
  SImuOutput study = estimated();
  EXPECT_EQ(validity_of(study, {kStaleReference_s, 0.0}), Validity::kUsable);
  EXPECT_EQ(validity_of(study, {kStaleReference_s * just_over, 0.0}), Validity::kStale);
  study.status = CalibrationStatus::kCoarse;
  EXPECT_EQ(validity_of(study, {0.0, 0.0}), Validity::kConverging);
  NavigationOutput moving;
  moving.time = HostTime{Duration{5}};
  moving.v_n_mps = {2.0, 3.0, 6.0};
  moving.sd_velocity_mps = {0.1, 0.4, 0.8};
  OdometryOutput wheels;
  wheels.enabled = true;
  wheels.time = HostTime{Duration{7}};
  wheels.speed_mps = 4.5;
  EstimatorCounters counters;
  EXPECT_FALSE(vehicle_speed(moving, wheels, counters));
  counters.odometry_samples = 1;
  const auto by_wheels = vehicle_speed(moving, wheels, counters);
  ASSERT_TRUE(by_wheels);
  EXPECT_EQ(by_wheels->time, wheels.time);
  EXPECT_EQ(by_wheels->speed_mps, 4.5);
  EXPECT_EQ(by_wheels->sd_mps, 0.0);
  wheels.enabled = false;
  EXPECT_FALSE(vehicle_speed(moving, wheels, counters));
  moving.status = NavigationStatus::kNavigating;
  const auto by_navigation = vehicle_speed(moving, wheels, counters);
  ASSERT_TRUE(by_navigation);
  EXPECT_EQ(by_navigation->time, moving.time);
  EXPECT_DOUBLE_EQ(by_navigation->speed_mps, 7.0);
  EXPECT_DOUBLE_EQ(by_navigation->sd_mps, 0.9);
}

}  // namespace
}  // namespace imuscope
