#include "study/evaluation_models.h"

#include <gtest/gtest.h>

#include <cmath>

#include "base/units.h"
#include "service/run/models_file.h"

namespace imuscope {
namespace {

using nlohmann::json;

constexpr double kModelRate_hz = 100.0;
constexpr double kFastBeta = 113.5;
constexpr double kSlowBeta = 0.0049;
constexpr std::array<double, kImuAxes> kTurnOn{1e-3, 1e-3, 1e-3, 0.02, 0.02, 0.02};

/// An entry of models.json: white noise, a fast and a slow Gauss-Markov process.
json entry_of(std::size_t axis, const std::string& regime, double white, double fast, double slow) {
  using noise::ProcessKind;
  noise::FitResult fit;
  fit.rate_hz = kModelRate_hz;
  fit.spec.processes = {ProcessKind::kWhiteNoise, ProcessKind::kGaussMarkov, ProcessKind::kGaussMarkov};
  const auto add = [&](const char* process, const char* name, double value) {
    fit.parameters.push_back({process, name, "", value, {}, {}, {}, {}});
  };
  add("WN", "sigma2", white);
  add("GM1", "beta", kFastBeta);
  add("GM1", "sigma2", fast);
  add("GM2", "beta", kSlowBeta);
  add("GM2", "sigma2", slow);
  return model_json(fit, "mtx1", axis, regime);
}

json models(bool with_static = true) {
  json fits = json::array();
  for (std::size_t axis = 0; axis < kImuAxes; ++axis) {
    if (with_static) fits.push_back(entry_of(axis, "static", 1.0, 0.1, 0.02));
    fits.push_back(entry_of(axis, "dynamic", 2.0, 0.3, 0.04));
  }
  return {{"models", fits}};
}

StudyDrive drive() {
  StudyDrive out;
  out.name = "mtx1";
  out.regimes = {{0.0, Regime::kStatic}, {60.0, Regime::kDynamic}, {90.0, Regime::kStatic}};
  return out;
}

/// Density at frequency zero of a sampled Gauss-Markov process: the sum of its autocovariance.
double summed(double variance, double beta) {
  double sum = variance;
  for (int k = 1; k < 200; ++k) sum += 2.0 * variance * std::exp(-beta * k / kModelRate_hz);
  return sum / kModelRate_hz;
}

const EvaluationModel& named(const std::vector<EvaluationModel>& all, const std::string& name) {
  for (const EvaluationModel& one : all) {
    if (one.name == name) return one;
  }
  throw std::runtime_error("no model " + name);
}

TEST(EvaluationModels, FastProcessesAreWhiteAtTheirLowFrequencyDensityAndSlowOnesAreStates) {
  const auto all = evaluation_models(drive(), {}, kTurnOn, models(), {});
  const auto& model = *named(all, "dynamic").model;
  for (std::size_t axis = 0; axis < kImuAxes; ++axis) {
    EXPECT_NEAR(model.axes[axis].white_density, 2.0 / kModelRate_hz + summed(0.3, kFastBeta), 1e-12);
    ASSERT_EQ(model.axes[axis].slow.size(), 1U);
    EXPECT_DOUBLE_EQ(model.axes[axis].slow[0].variance, 0.04);
    EXPECT_DOUBLE_EQ(model.axes[axis].slow[0].rate_per_s, kSlowBeta);
    EXPECT_DOUBLE_EQ(model.axes[axis].turn_on_variance, kTurnOn[axis] * kTurnOn[axis]);
  }
}

TEST(EvaluationModels, WithoutADependenceTheWhiteNoiseFollowsTheRegime) {
  const auto all = evaluation_models(drive(), {}, kTurnOn, models(), {});
  const auto& model = *named(all, "by dynamics").model;
  const double at_rest = 1.0 / kModelRate_hz + summed(0.1, kFastBeta);
  const double moving = 2.0 / kModelRate_hz + summed(0.3, kFastBeta);
  ASSERT_EQ(model.changes.size(), 4U);  // from the beginning of time on, then at each change
  EXPECT_NEAR(model.changes[0].white_density[0], at_rest, 1e-12);
  EXPECT_DOUBLE_EQ(model.changes[2].from_s, 60.0);
  EXPECT_NEAR(model.changes[2].white_density[0], moving, 1e-12);
  EXPECT_NEAR(model.changes[3].white_density[5], at_rest, 1e-12);
  EXPECT_DOUBLE_EQ(model.axes[0].slow[0].variance, 0.04);
}

TEST(EvaluationModels, AClearDependenceIsFollowedWindowByWindow) {
  const json dependence{
      {"dependences",
       {{{"name", "mtx1"},
         {"axis", "gyro_x"},
         {"driver", "speed"},
         {"process", "WN"},
         {"p_holm", 0.2},
         {"mean_driver", 1.0},
         {"at_mean_driver", 9.0},
         {"slope", 9.0}},
        {{"name", "mtx1"},
         {"axis", "gyro_x"},
         {"driver", "vibration"},
         {"process", "WN"},
         {"p_holm", 1e-6},
         {"mean_driver", 0.5},
         {"at_mean_driver", 2.0},
         {"slope", 0.4}}}},
      {"points",
       {{{"name", "mtx1"}, {"axis", "gyro_x"}, {"time_s", 30.0}, {"driver", {{"vibration", 1.5}}}},
        {{"name", "mtx1"}, {"axis", "gyro_x"}, {"time_s", 10.0}, {"driver", {{"vibration", 0.5}}}}}}};
  const auto all = evaluation_models(drive(), {}, kTurnOn, models(), dependence);
  const auto& model = *named(all, "by dynamics").model;
  const double beside = summed(0.3, kFastBeta);
  // Two windows about 10 s and 30 s: the second holds from halfway on.
  const auto at = [&](double time_s) {
    double density = 0.0;
    for (const auto& change : model.changes) {
      if (change.from_s <= time_s) density = change.white_density[0];
    }
    return density;
  };
  EXPECT_NEAR(at(5.0), 2.0 / kModelRate_hz + beside, 1e-12);
  EXPECT_NEAR(at(25.0), 2.0 * std::exp(0.4) / kModelRate_hz + beside, 1e-12);
  EXPECT_NE(model.source.find("1 of 6"), std::string::npos);
}

TEST(EvaluationModels, WhatIsMissingIsNamedAndNothingStandsInForIt) {
  const auto all = evaluation_models(drive(), {}, kTurnOn, models(false), {});
  EXPECT_FALSE(named(all, "static").model);
  EXPECT_NE(named(all, "static").absent_because.find("gyro_x"), std::string::npos);
  EXPECT_TRUE(named(all, "dynamic").model);
  EXPECT_FALSE(named(all, "by dynamics").model);
  EXPECT_FALSE(named(all, "data sheet").model);
  EXPECT_NE(named(all, "data sheet").absent_because.find("data_sheet"), std::string::npos);
}

TEST(EvaluationModels, ADamagedModelIsNamedAsOne) {
  json damaged = models();
  damaged["models"][0].erase("rate_hz");
  const auto all = evaluation_models(drive(), {}, kTurnOn, damaged, {});
  EXPECT_FALSE(named(all, "static").model);
  EXPECT_NE(named(all, "static").absent_because.find("rate_hz"), std::string::npos);
}

TEST(EvaluationModels, ADataSheetGivesDensitiesAndOneWanderingBias) {
  DataSheetConfig sheet;
  sheet.gyro_density_radps_per_sqrt_hz = 0.05 * kRadPerDeg;
  sheet.gyro_bias_stability_radps = 0.2;
  sheet.accel_density_mps2_per_sqrt_hz = 0.002;
  sheet.accel_bias_stability_mps2 = 0.02;
  const auto all = evaluation_models(drive(), sheet, kTurnOn, models(), {});
  const auto& model = *named(all, "data sheet").model;
  EXPECT_DOUBLE_EQ(model.axes[2].white_density, std::pow(0.05 * kRadPerDeg, 2));
  EXPECT_DOUBLE_EQ(model.axes[4].white_density, 0.002 * 0.002);
  EXPECT_DOUBLE_EQ(model.axes[4].slow[0].variance, 0.02 * 0.02);
  EXPECT_DOUBLE_EQ(model.axes[4].slow[0].rate_per_s, 1e-3);
}

}  // namespace
}  // namespace imuscope
