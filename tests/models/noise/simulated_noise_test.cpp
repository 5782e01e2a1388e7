#include "models/noise/simulated_noise.h"

#include <gtest/gtest.h>

#include <map>
#include <string>

#include "models/noise/fit.h"
#include "models/noise/json.h"

namespace imuscope::noise {
namespace {

using Values = std::map<std::string, ProcessValues>;

Values values_of(const FitResult& fit) {
  Values values;
  for (const auto& parameter : fit.parameters) values[parameter.process][parameter.name] = parameter.value;
  return values;
}

/// Of every process there is: a model from the values that a fit prints is the fit's model, so that names and
/// scales agree.
TEST(ModelFromValues, IsTheModelWhoseValuesTheyAre) {
  std::mt19937_64 random(1);
  const auto x = simulated_noise({{{ProcessKind::kWhiteNoise, 1.0, {}}}}, 1U << 14U, random);
  const auto wv = haar_wavelet_variance(x).value();
  for (const char* model : {"WN", "QN", "RW", "DR", "2*GM+WN", "MA1", "ARMA11", "SIN", "RES", "FN", "PL"}) {
    const auto spec = parse_model(model).value();
    const auto fitted = fit(wv, spec, 100.0);
    ASSERT_TRUE(fitted) << model << ": " << fitted.error().text();
    const auto again = model_from_values(fitted->spec, 100.0, values_of(*fitted));
    ASSERT_TRUE(again) << model << ": " << again.error().text();
    for (int level = 1; level < 14; ++level)
      EXPECT_NEAR(model_wv(*again, level), model_wv(fitted->model, level),
                  1e-9 * model_wv(fitted->model, level))
          << model << " " << level;
  }
}

TEST(ModelFromValues, RefusesWhatIsNoModel) {
  const auto spec = parse_model("WN+GM").value();
  const Values right{{"WN", {{"sigma2", 1.0}}}, {"GM1", {{"beta", 1.0}, {"sigma2", 1.0}}}};
  EXPECT_TRUE(model_from_values(spec, 100.0, right));
  EXPECT_FALSE(model_from_values(spec, 0.0, right));
  Values wrong = right;
  wrong.erase("WN");
  EXPECT_FALSE(model_from_values(spec, 100.0, wrong));
  wrong = right;
  wrong["GM1"]["tau"] = 1.0;
  EXPECT_FALSE(model_from_values(spec, 100.0, wrong));
  wrong = right;
  wrong["GM2"] = {{"beta", 1.0}, {"sigma2", 1.0}};
  EXPECT_FALSE(model_from_values(spec, 100.0, wrong));
  wrong = right;
  wrong["GM1"]["beta"] = -1.0;
  EXPECT_FALSE(model_from_values(spec, 100.0, wrong));
}

/// The theory of process.h, level by level, of every process that is stationary in its differences.
TEST(SimulatedNoise, HasTheWaveletVarianceOfItsModel) {
  const std::map<std::string, Component> truths{
      {"WN", {ProcessKind::kWhiteNoise, 1.0, {}}},
      {"QN", {ProcessKind::kQuantization, 1.0, {}}},
      {"MA1", {ProcessKind::kMa1, 1.0, {-0.4}}},
      {"ARMA11", {ProcessKind::kArma11, 1.0, {0.8, -0.3}}},
      {"SIN", {ProcessKind::kSinusoid, 1.0, {0.7}}},
      {"RES", {ProcessKind::kResonance, 1.0, {0.2, 0.9}}},
      {"GM", {ProcessKind::kGaussMarkov, 1.0, {0.1}}},
      {"FN", {ProcessKind::kFlicker, 1.0, {}}},
      {"PL", {ProcessKind::kPowerLaw, 1.0, {1.4, 0.0}}},
      {"RW", {ProcessKind::kRandomWalk, 1.0, {}}},
      {"DR", {ProcessKind::kRamp, 1e-6, {}}},
  };
  for (const auto& [name, truth] : truths) {
    const Model model{{truth}};
    std::mt19937_64 random(2);
    const auto wv = haar_wavelet_variance(simulated_noise(model, 1U << 19U, random)).value();
    for (const auto& level : wv.levels) {
      if (level.level > 6) break;
      const double expected = model_wv(model, level.level);
      EXPECT_NEAR(level.value, expected, 0.03 * expected) << name << " level " << level.level;
    }
  }
}

}  // namespace
}  // namespace imuscope::noise
