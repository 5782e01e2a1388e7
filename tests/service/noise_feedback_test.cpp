#include "service/noise_feedback.h"

#include <gtest/gtest.h>
#include <cmath>
#include <cstring>

#include "publish/message_codec.h"

namespace imuscope {
namespace {

constexpr auto kStatic = static_cast<std::size_t>(Regime::kStatic);
constexpr auto kDynamic = static_cast<std::size_t>(Regime::kDynamic);

/// White noise, a fast and a slow GM about the present values of `noise`.
AxisNoiseModel model_of(const std::string& axis, const std::string& regime, double white_sd, double fast_sd,
                        double fast_tau_s, double slow_sd, double slow_tau_s) {
  AxisNoiseModel model;
  model.axis = axis;
  model.regime = regime;
  model.identifiable = true;
  const auto add = [&](const std::string& process, const std::string& name, double value) {
    model.parameters.push_back({process, name, "", value, kUnknown, kUnknown, kUnknown});
  };
  add("WN", "sigma2", white_sd * white_sd);
  add("GM1", "beta", 1.0 / fast_tau_s);
  add("GM1", "sigma2", fast_sd * fast_sd);
  add("GM2", "beta", 1.0 / slow_tau_s);
  add("GM2", "sigma2", slow_sd * slow_sd);
  return model;
}

TEST(NoiseFeedback, WhiteFastAndSlowPartsGoToTheirPlaces) {
  const auto current = mtx_class_noise();
  NoiseModelReport fitted;
  const double white = 1.5 * current.gyro[kDynamic].white_sd[1];
  const double slow = 1.2 * current.gyro_bias[1].sd;
  fitted.models = {model_of("gyro_y", "dynamic", white, 0.5 * white, 0.05, slow, 80.0)};
  const auto updated = updated_noise(current, fitted);
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
  const auto same = [&](const AxisNoiseModel& model) {
    NoiseModelReport fitted;
    fitted.models = {model};
    const auto updated = updated_noise(current, fitted);
    return updated.gyro[kDynamic].white_sd[0] == white && updated.gyro_bias[0].sd == slow;
  };
  auto model = model_of("gyro_x", "dynamic", 1.1 * white, 0.1 * white, 0.05, 1.1 * slow, 80.0);
  EXPECT_FALSE(same(model));
  model.identifiable = false;
  EXPECT_TRUE(same(model));
  EXPECT_TRUE(same(model_of("gyro_x", "dynamic", 20.0 * white, white, 0.05, 20.0 * slow, 80.0)));
  EXPECT_TRUE(same(model_of("gyro_x", "dynamic", white / 20.0, white / 20.0, 0.05, slow / 20.0, 80.0)));
  model = model_of("gyro_x", "dynamic", 1.1 * white, white, 0.05, slow, 80.0);
  model.parameters[0].value = std::nan("");
  EXPECT_TRUE(same(model));
}

TEST(NoiseFeedback, ARecordTooShortForTheSlowProcessesStillTellsTheWhiteNoise) {
  const auto current = mtx_class_noise();
  const double white = 1.5 * current.gyro[kDynamic].white_sd[0];
  auto model = model_of("gyro_x", "dynamic", white, 2.0 * white, 0.05, 3.0 * current.gyro_bias[0].sd, 80.0);
  model.identifiable = false;
  model.parameters[0].ci_low = 0.9 * white * white;
  model.parameters[0].ci_high = 1.1 * white * white;
  NoiseModelReport fitted;
  fitted.models = {model};
  auto expected = current;
  expected.gyro[kDynamic].white_sd[0] = white;
  EXPECT_TRUE(updated_noise(current, fitted) == expected);
}

/// A refit that says `factor` times the present sd of every axis of the gyroscope in motion.
NoiseModelReport louder(const StudyNoise& base, double factor, double slow_factor = 1.0) {
  NoiseModelReport fitted;
  const char* axes[] = {"gyro_x", "gyro_y", "gyro_z"};
  for (std::size_t i = 0; i < 3; ++i) {
    const double white = factor * base.gyro[kDynamic].white_sd[i];
    fitted.models.push_back(
        model_of(axes[i], "dynamic", white, 0.01 * white, 0.05, slow_factor * base.gyro_bias[i].sd, 80.0));
  }
  return fitted;
}

TEST(NoiseFeedback, TheFirstModelReplacesTheConfiguredAndLaterOnesOnlyWhereSomethingMoved) {
  const auto configured = mtx_class_noise();
  NoiseFeedback feedback(configured, 0.5);
  EXPECT_EQ(feedback.version(), 0);
  const auto first = feedback.consider(louder(configured, 1.02), 6000);
  ASSERT_TRUE(first);
  EXPECT_EQ(first->version, 1);
  EXPECT_EQ(first->samples, 6000);
  // The scatter of the fits: 4 % in sd up and down.
  for (const double scatter : {1.06, 0.98, 1.05, 1.00}) {
    EXPECT_FALSE(feedback.consider(louder(configured, scatter), 12000)) << scatter;
    EXPECT_TRUE(feedback.in_force() == first->noise);
  }
  // A slow creep counts from what is in force, not from the refit before.
  std::optional<NewNoise> second;
  double factor = 1.02;
  for (; !second && factor < 1.5; factor += 0.02)
    second = feedback.consider(louder(configured, factor), 18000);
  ASSERT_TRUE(second);
  EXPECT_EQ(second->version, 2);
  EXPECT_NEAR(factor - 0.02, 1.02 * std::sqrt(NoiseFeedback::kVarianceStep), 0.021);
  // The bias process alone.
  const auto third = feedback.consider(louder(configured, factor - 0.02, 1.6), 24000);
  ASSERT_TRUE(third);
  EXPECT_EQ(third->version, 3);
}

TEST(NoiseFeedback, ResidualsThatGrowEverSmallerStopAtTheFloor) {
  // What a filter does that confirms itself: every refit finds less noise than the model in force.
  const auto configured = mtx_class_noise();
  NoiseFeedback feedback(configured, 0.5);
  for (int refit = 1; refit <= 40; ++refit)
    (void)feedback.consider(louder(feedback.in_force(), 0.7, 0.5), 6000 * refit);
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_DOUBLE_EQ(feedback.in_force().gyro[kDynamic].white_sd[i],
                     0.5 * configured.gyro[kDynamic].white_sd[i]);
    EXPECT_DOUBLE_EQ(feedback.in_force().gyro_bias[i].sd, 0.5 * configured.gyro_bias[i].sd);
  }
}

TEST(NoiseFeedback, ARefitThatSaysNothingUsableGoesNowhere) {
  const auto configured = mtx_class_noise();
  NoiseFeedback feedback(configured, 0.5);
  EXPECT_FALSE(feedback.consider({}, 6000));
  auto vague = louder(configured, 1.5);
  for (auto& model : vague.models) model.identifiable = false;
  EXPECT_FALSE(feedback.consider(vague, 6000));
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
