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

TEST(NoiseFeedback, TheCapturesRecordGivesEveryNumberBackToTheBit) {
  AppliedNoise applied{2, 12345, {60000, {}}};
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
  static_assert(std::has_unique_object_representations_v<std::int64_t>);
  EXPECT_EQ(std::memcmp(&back.model.noise, &applied.model.noise, sizeof back.model.noise), 0);
}

}  // namespace
}  // namespace imuscope
