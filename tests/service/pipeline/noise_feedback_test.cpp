#include "service/pipeline/noise_feedback.h"

#include <gtest/gtest.h>
#include <cmath>
#include <cstring>

#include "fitted_axis.h"
#include "publish/message_codec.h"

namespace imuscope {
namespace {

using test::refit_of;

constexpr auto kStatic = static_cast<std::size_t>(Regime::kStatic);
constexpr auto kDynamic = static_cast<std::size_t>(Regime::kDynamic);

TEST(NoiseFeedback, WhiteFastAndSlowPartsGoToTheirPlaces) {
  const auto current = mtx_class_noise();
  const double white = 1.5 * current.gyro[kDynamic].white_sd[1];
  const double slow = 1.2 * current.gyro_bias[1].sd;
  const auto updated =
      updated_noise(current, {refit_of(1, Regime::kDynamic, white, 0.5 * white, 0.05, slow, 80.0)});
  EXPECT_NEAR(updated.gyro[kDynamic].white_sd[1], white, 1e-15);
  EXPECT_NEAR(updated.gyro[kDynamic].fast_sd[1], 0.5 * white, 1e-15);
  EXPECT_NEAR(updated.gyro[kDynamic].fast_time_constant_s[1], 0.05, 1e-15);
  EXPECT_NEAR(updated.gyro_bias[1].sd, slow, 1e-15);
  EXPECT_NEAR(updated.gyro_bias[1].time_constant_s, 80.0, 1e-12);
  // Nothing else was spoken of.
  EXPECT_DOUBLE_EQ(updated.gyro[kDynamic].white_sd[0], current.gyro[kDynamic].white_sd[0]);
  EXPECT_DOUBLE_EQ(updated.gyro[kStatic].white_sd[1], current.gyro[kStatic].white_sd[1]);
  EXPECT_DOUBLE_EQ(updated.accel[kDynamic].white_sd[1], current.accel[kDynamic].white_sd[1]);
}

TEST(NoiseFeedback, WhatIsNotIdentifiableNotPositiveOrBeyondBeliefIsLeftAside) {
  const auto current = mtx_class_noise();
  const double white = current.gyro[kDynamic].white_sd[0];
  const double slow = current.gyro_bias[0].sd;
  const auto same = [&](const AxisRefit& refit) {
    const auto updated = updated_noise(current, {refit});
    return updated.gyro[kDynamic].white_sd[0] == white && updated.gyro_bias[0].sd == slow;
  };
  auto refit = refit_of(0, Regime::kDynamic, 1.1 * white, 0.1 * white, 0.05, 1.1 * slow, 80.0);
  EXPECT_FALSE(same(refit));
  refit.fit->identifiable = false;
  EXPECT_TRUE(same(refit));
  EXPECT_TRUE(same(refit_of(0, Regime::kDynamic, 20.0 * white, white, 0.05, 20.0 * slow, 80.0)));
  EXPECT_TRUE(same(refit_of(0, Regime::kDynamic, white / 20.0, white / 20.0, 0.05, slow / 20.0, 80.0)));
  refit = refit_of(0, Regime::kDynamic, 1.1 * white, white, 0.05, slow, 80.0);
  refit.fit->parameters[0].value = std::nan("");
  EXPECT_TRUE(same(refit));
}

TEST(NoiseFeedback, WhereNoNoiseWasConfiguredTheFirstOneIsBelieved) {
  auto current = mtx_class_noise();
  current.gyro[kDynamic].white_sd[0] = current.gyro[kDynamic].fast_sd[0] = 0.0;
  const auto updated = updated_noise(
      current, {refit_of(0, Regime::kDynamic, 1e-3, 5e-4, 0.05, current.gyro_bias[0].sd, 80.0)});
  EXPECT_NEAR(updated.gyro[kDynamic].white_sd[0], 1e-3, 1e-15);
}

TEST(NoiseFeedback, ARecordTooShortForTheSlowProcessesStillTellsTheWhiteNoise) {
  const auto current = mtx_class_noise();
  const double white = 1.5 * current.gyro[kDynamic].white_sd[0];
  auto refit = refit_of(0, Regime::kDynamic, white, 2.0 * white, 0.05, 3.0 * current.gyro_bias[0].sd, 80.0);
  refit.fit->identifiable = false;
  refit.fit->parameters[0].ci_low = 0.9 * white * white;
  refit.fit->parameters[0].ci_high = 1.1 * white * white;
  auto expected = current;
  expected.gyro[kDynamic].white_sd[0] = white;
  EXPECT_TRUE(updated_noise(current, {refit}) == expected);
}

/// A refit that says `factor` times the present sd of every axis of the gyroscope in motion.
Refit louder(const SImuNoise& base, std::int64_t samples, double factor, double slow_factor = 1.0) {
  Refit refit;
  refit.samples = samples;
  for (std::size_t i = 0; i < 3; ++i) {
    const double white = factor * base.gyro[kDynamic].white_sd[i];
    refit.axes.push_back(
        refit_of(i, Regime::kDynamic, white, 0.01 * white, 0.05, slow_factor * base.gyro_bias[i].sd, 80.0));
  }
  return refit;
}

TEST(NoiseFeedback, TheFirstModelReplacesTheConfiguredAndLaterOnesOnlyWhereSomethingMoved) {
  const auto configured = mtx_class_noise();
  NoiseFeedback feedback(configured, 0.5);
  EXPECT_EQ(feedback.version(), 0);
  const auto first = feedback.consider(louder(configured, 6000, 1.02));
  ASSERT_TRUE(first);
  EXPECT_EQ(first->version, 1);
  EXPECT_EQ(first->samples, 6000);
  // The scatter of the fits: 4 % in sd up and down.
  for (const double scatter : {1.06, 0.98, 1.05, 1.00}) {
    EXPECT_FALSE(feedback.consider(louder(configured, 12000, scatter))) << scatter;
    EXPECT_TRUE(feedback.in_force() == first->noise);
  }
  // A slow creep counts from what is in force, not from the refit before.
  std::optional<NewNoise> second;
  double factor = 1.02;
  for (; !second && factor < 1.5; factor += 0.02)
    second = feedback.consider(louder(configured, 18000, factor));
  ASSERT_TRUE(second);
  EXPECT_EQ(second->version, 2);
  EXPECT_NEAR(factor - 0.02, 1.02 * std::sqrt(NoiseFeedback::kVarianceStep), 0.021);
  // The bias process alone.
  const auto third = feedback.consider(louder(configured, 24000, factor - 0.02, 1.6));
  ASSERT_TRUE(third);
  EXPECT_EQ(third->version, 3);
}

TEST(NoiseFeedback, ResidualsThatGrowEverSmallerStopAtTheFloor) {
  // What a filter does that confirms itself: every refit finds less noise than the model in force.
  const auto configured = mtx_class_noise();
  NoiseFeedback feedback(configured, 0.5);
  for (int refit = 1; refit <= 40; ++refit)
    (void)feedback.consider(louder(feedback.in_force(), 6000 * refit, 0.7, 0.5));
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_DOUBLE_EQ(feedback.in_force().gyro[kDynamic].white_sd[i],
                     0.5 * configured.gyro[kDynamic].white_sd[i]);
    EXPECT_DOUBLE_EQ(feedback.in_force().gyro_bias[i].sd, 0.5 * configured.gyro_bias[i].sd);
  }
}

TEST(NoiseFeedback, ARefitThatSaysNothingUsableGoesNowhere) {
  const auto configured = mtx_class_noise();
  NoiseFeedback feedback(configured, 0.5);
  EXPECT_FALSE(feedback.consider(Refit{}));
  auto vague = louder(configured, 6000, 1.5);
  for (auto& axis : vague.axes) axis.fit->identifiable = false;
  EXPECT_FALSE(feedback.consider(vague));
  EXPECT_EQ(feedback.version(), 0);
  EXPECT_TRUE(feedback.in_force() == configured);
}

TEST(NoiseFeedback, TheCapturesRecordGivesEveryNumberBackToTheBit) {
  AppliedNoise applied{2, 12345, {60000, {}, 7}};
  double next = 0.1;
  for (auto* triads : {&applied.model.noise.gyro, &applied.model.noise.accel}) {
    for (auto& triad : *triads) {
      for (std::size_t i = 0; i < 3; ++i) {
        triad.white_sd[i] = next += 1.0 / 3.0;
        triad.fast_sd[i] = next += 1.0 / 3.0;
        triad.fast_time_constant_s[i] = next += 1.0 / 3.0;
      }
    }
  }
  for (auto* biases : {&applied.model.noise.gyro_bias, &applied.model.noise.accel_bias}) {
    for (auto& bias : *biases) bias = {next += 1.0 / 3.0, next += 1.0 / 3.0};
  }
  applied.model.noise.gyro_bias[0].time_constant_s = std::numeric_limits<double>::infinity();
  const auto record = decode_message<applied_model_t>(encode_message(applied_model_record(applied, "mtx3")));
  ASSERT_TRUE(record);
  EXPECT_EQ(record->device, "mtx3");
  const auto back = applied_noise_of(*record, 2);
  EXPECT_EQ(back.study, 2U);
  EXPECT_EQ(back.tick, 12345);
  EXPECT_EQ(back.model.samples, 60000);
  EXPECT_EQ(back.model.version, 7);
  static_assert(std::has_unique_object_representations_v<std::int64_t>);
  EXPECT_EQ(std::memcmp(&back.model.noise, &applied.model.noise, sizeof back.model.noise), 0);
}

}  // namespace
}  // namespace imuscope
