#include "models/noise/compare.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <random>

#include "models/noise/conservative.h"
#include "models/noise/json.h"
#include "models/noise/quantities.h"
#include "models/noise/select.h"

namespace imuscope::noise {
namespace {

using testing::HasSubstr;

std::vector<double> white_and_walk(std::size_t n, double sd, double walk_sd, unsigned seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  std::vector<double> x(n);
  double walk = 0.0;
  for (double& v : x) v = sd * normal(random) + (walk += walk_sd * normal(random));
  return x;
}

FitResult fit_of(const std::vector<double>& x, const char* model) {
  FitOptions options;
  options.signal_unit = "rad/s";
  return fit(haar_wavelet_variance(x).value(), parse_model(model).value(), 100.0, options).value();
}

struct Sensor {
  const char* model;
  double walk_sd;
  double markov_sd;  ///< of a process with a correlation time of 1 s
};

class ComparedSensor : public testing::TestWithParam<Sensor> {};

// Records of unequal length, as a drive's stops and its motion are.
TEST_P(ComparedSensor, TwoStretchesDifferAsRarelyAsTheTestPromises) {
  const Sensor& sensor = GetParam();
  const auto record = [&](std::size_t n, unsigned seed) {
    auto x = white_and_walk(n, 1.0, sensor.walk_sd, seed);
    std::mt19937_64 random(seed + 10'000);
    std::normal_distribution<double> normal;
    const double phi = std::exp(-0.01);
    double state = sensor.markov_sd * normal(random);
    for (double& v : x) {
      v += state;
      state = phi * state + sensor.markov_sd * std::sqrt(1.0 - phi * phi) * normal(random);
    }
    return fit_of(x, sensor.model);
  };
  int rejected = 0;
  constexpr int kPairs = 200;
  for (unsigned i = 0; i < kPairs; ++i) {
    const auto result = compare(record(4096, 2 * i), record(8192, 2 * i + 1));
    ASSERT_TRUE(result.test.has_value());
    EXPECT_LE(result.test->dof, result.parameters.size());
    rejected += result.test->p_value < 0.05 ? 1 : 0;
  }
  // 10 expected; beyond 22, and below 2, has a chance of 2e-4 and 4e-4.
  EXPECT_LE(rejected, 22);
  EXPECT_GE(rejected, 2);
}

INSTANTIATE_TEST_SUITE_P(Models, ComparedSensor,
                         testing::Values(Sensor{"WN+RW", 0.06, 0.0}, Sensor{"WN+GM", 0.0, 0.7}));

// A record of 10 correlation times shows a rate where chance made it large, and that alone would differ.
TEST(Compare, AProcessIsNotComparedWithARecordThatIsTooShortForIt) {
  const auto with = [](double beta, std::uint64_t n) {
    FitResult fit;
    fit.n = n;
    fit.rate_hz = 100.0;
    fit.spec = parse_model("WN+GM").value();
    for (const auto& [process, name, value] :
         {std::tuple{"WN", "sigma2", 1.0}, std::tuple{"GM1", "beta", beta},
          std::tuple{"GM1", "sigma2", 0.1}}) {
      ParameterEstimate p;
      p.process = process;
      p.name = name;
      p.value = value;
      fit.parameters.push_back(p);
    }
    fit.covariance = {1e-4, 0.0, 0.0, 0.0, 0.04, 0.0, 0.0, 0.0, 0.04};
    return fit;
  };
  const FitResult of_two_hours = with(0.005, 720'000);  // 36 correlation times
  const auto too_short = compare(of_two_hours, with(0.012, 213'900));
  EXPECT_TRUE(too_short.parameters[0].p_value);
  EXPECT_FALSE(too_short.parameters[1].p_value);
  EXPECT_FALSE(too_short.parameters[2].p_value);
  EXPECT_THAT(too_short.warnings, testing::ElementsAre(HasSubstr("GM1: one record is shorter than 20")));
  const auto long_enough = compare(of_two_hours, with(0.012, 500'000));
  EXPECT_TRUE(long_enough.parameters[1].p_value);
  EXPECT_TRUE(long_enough.warnings.empty());
}

TEST(Compare, TenPercentMoreWhiteNoiseIsFoundAndBelongsToTheRightParameter) {
  const auto a = fit_of(white_and_walk(30000, 1.0, 0.01, 1), "WN+RW");
  const auto b = fit_of(white_and_walk(30000, 1.1, 0.01, 2), "WN+RW");
  const auto result = compare(a, b);
  ASSERT_TRUE(result.test.has_value());
  EXPECT_LT(result.test->p_value, 1e-6);
  ASSERT_EQ(result.parameters.size(), 2U);
  EXPECT_NEAR(*result.parameters[0].ratio, 1.21, 0.05);
  EXPECT_LT(*result.parameters[0].p_value, 1e-6);
  EXPECT_GT(*result.parameters[1].p_value, 1e-3);
}

TEST(Compare, ModelsWithDifferentTermsAreListedSideBySideWithAWarning) {
  const auto x = white_and_walk(4096, 1.0, 0.02, 3);
  const auto result = compare(fit_of(x, "WN+RW"), fit_of(x, "WN+GM"));
  ASSERT_EQ(result.parameters.size(), 4U);
  EXPECT_FALSE(result.parameters[1].second.has_value());
  EXPECT_FALSE(result.parameters[2].first.has_value());
  ASSERT_EQ(result.warnings.size(), 1U);
  EXPECT_THAT(result.warnings[0], HasSubstr("WN+GM"));
}

TEST(Compare, WhatIsInAnotherUnitOrAtAnotherRateIsNotTakenForADifference) {
  const auto a = fit_of(white_and_walk(4096, 1.0, 0.02, 5), "WN+RW");
  FitResult b = a;
  ParameterEstimate& white = b.parameters[0];
  white.unit = "another";
  white.value *= 100.0;
  const auto other_unit = compare(a, b);
  EXPECT_FALSE(other_unit.parameters[0].p_value);
  EXPECT_FALSE(other_unit.test) << "signals in two units have no common model";
  EXPECT_THAT(other_unit.warnings, testing::ElementsAre(HasSubstr("'another': not compared")));
  b = a;
  b.rate_hz = 2.0 * a.rate_hz;
  const auto other_rate = compare(a, b);
  EXPECT_THAT(other_rate.warnings, testing::ElementsAre(HasSubstr("the rates differ (100 and 200 Hz)")));
  EXPECT_FALSE(other_rate.test);
}

TEST(Compare, WithoutATermInCommonThereIsNoTest) {
  const auto x = white_and_walk(4096, 1.0, 0.02, 6);
  const auto result = compare(fit_of(x, "WN"), fit_of(x, "RW"));
  EXPECT_FALSE(result.test.has_value());
  EXPECT_EQ(result.parameters.size(), 2U);
}

TEST(NoiseJson, AFitSurvivesTheTripThroughText) {
  const auto x = white_and_walk(4096, 1.0, 0.02, 4);
  for (const char* model : {"WN+RW", "WN+2*GM", "QN+WN+DR", "WN+SIN", "ARMA11"}) {
    const auto before = fit_of(x, model);
    const auto text = fit_to_json(before).dump();
    const auto after = fit_from_json(nlohmann::json::parse(text));
    ASSERT_TRUE(after) << after.error().text();
    EXPECT_EQ(fit_to_json(*after).dump(), text) << model;
    for (int level = 1; level <= 12; ++level) {
      EXPECT_NEAR(model_wv(after->model, level) / model_wv(before.model, level), 1.0, 1e-12) << model;
    }
  }
}

TEST(NoiseJson, WhatIsNoFitIsRefusedWithTheFieldThatIsMissing) {
  const auto refused = fit_from_json(nlohmann::json::parse(R"({"n": 5})"));
  ASSERT_FALSE(refused);
  EXPECT_THAT(refused.error().text(), HasSubstr("rate_hz"));
}

double quantity(const std::vector<Quantity>& list, const std::string& name) {
  for (const auto& q : list) {
    if (q.name == name) return q.value;
  }
  ADD_FAILURE() << "no quantity " << name;
  return std::nan("");
}

TEST(Quantities, AreTheOnesThatADataSheetGivesForTheSameSensor) {
  // A gyro with ARW 0.5 deg/sqrt(h) sampled at 100 Hz: N = 0.5/60 deg/s/sqrt(Hz), sigma2 = N^2 f.
  FitResult fit;
  fit.rate_hz = 100.0;
  const double n_degps = 0.5 / 60.0;
  fit.parameters.push_back({"WN", "sigma2", "", n_degps * n_degps * 100.0, {}, {}, {}, {}});
  fit.parameters.push_back({"GM1", "beta", "", 0.01, {}, {}, {}, {}});
  fit.parameters.push_back({"GM1", "sigma2", "", 4e-6, {}, {}, {}, {}});
  fit.parameters.push_back({"RW", "gamma2", "", 1e-10, {}, {}, {}, {}});
  fit.model = {{{ProcessKind::kWhiteNoise, n_degps * n_degps * 100.0, {}},
                {ProcessKind::kGaussMarkov, 4e-6, {1e-4, 0.0}},
                {ProcessKind::kRandomWalk, 1e-10, {}}}};
  const auto list = filter_quantities(fit, SignalUnit::kDegps);
  EXPECT_NEAR(quantity(list, "angle random walk"), 0.5, 1e-12);
  EXPECT_NEAR(quantity(list, "correlation time"), 100.0, 1e-9);
  EXPECT_NEAR(quantity(list, "sd"), 2e-3, 1e-15);
  EXPECT_NEAR(quantity(list, "rate random walk"), std::sqrt(1e-10 * 100.0) * 60.0, 1e-15);
  for (const auto& q : list) {
    if (q.process == "GM1" && q.name == "driving density") {
      EXPECT_NEAR(q.value, 8e-8, 1e-20);
    }
  }
}

TEST(Quantities, SayWhatARecordDoesNotTellOrOnlyBounds) {
  // A walk where there is none, and a Gauss-Markov process of four records' length.
  std::mt19937_64 random(31);
  std::normal_distribution<double> normal;
  std::vector<double> x(1U << 14U);
  const double phi = std::exp(-1.0 / static_cast<double>(4 * x.size()));
  double slow = normal(random);
  for (double& v : x) {
    v = slow + normal(random);
    slow = phi * slow + std::sqrt(1.0 - phi * phi) * normal(random);
  }
  const auto fitted = fit(haar_wavelet_variance(x).value(), parse_model("WN+GM+RW").value(), 100.0).value();
  const auto list = filter_quantities(fitted, SignalUnit::kDegps);
  for (const auto& q : list) {
    if (q.name == "correlation time") {
      EXPECT_EQ(q.knowledge, Knowledge::kUnknown);
    }
    if (q.name == "angle random walk") {
      EXPECT_EQ(q.knowledge, Knowledge::kFitted);
      EXPECT_NEAR(q.value, 6.0, 0.15);  // 1 deg/s a sample of 10 ms: 0.1 deg/s/sqrt(Hz)
    }
    if (q.name == "rate random walk" && fitted.model.components[2].amplitude <= 0.0) {
      EXPECT_EQ(q.knowledge, Knowledge::kBound);
      EXPECT_GT(q.value, 0.0);
    }
  }
}

TEST(Quantities, OfAnOverBoundingModelAreWhatItsAmplitudesMake) {
  const auto fitted = fit_of(white_and_walk(20'000, 1.0, 0.02, 4), "WN+RW");
  const auto bound = over_bounding(fitted);
  const auto before = filter_quantities(fitted, SignalUnit::kDegps);
  const auto list = over_bounding_quantities(bound, SignalUnit::kDegps);
  ASSERT_EQ(list.size(), before.size());
  for (std::size_t i = 0; i < list.size(); ++i) {
    EXPECT_EQ(list[i].knowledge, Knowledge::kBound) << list[i].name;
    EXPECT_GT(list[i].value, before[i].value) << list[i].name;
    EXPECT_EQ(list[i].ci_high, list[i].value) << list[i].name;
  }
  EXPECT_NEAR(list[0].value, bound.model.components[0].amplitude / 100.0, 1e-12);
  const auto white =
      std::find_if(list.begin(), list.end(), [](const Quantity& q) { return q.name == "angle random walk"; });
  ASSERT_NE(white, list.end());
  EXPECT_NEAR(white->value, 60.0 * std::sqrt(list[0].value), 1e-9) << "the same white noise in another unit";
}

TEST(NoiseJson, SaysInWordsWhatAnEntryWasFittedTo) {
  auto entry = nlohmann::json::parse(R"({"regime": "static",
      "fitted_to": {"seconds": 812, "stretches": 9},
      "sinusoids": [{"parameters": [{"name": "alpha", "value": 1}, {"name": "frequency", "value": 21.3}]},
                    {"parameters": [{"name": "frequency", "value": 0.565}]}]})");
  EXPECT_EQ(fitted_to_words(entry), "812 s of regime static in 9 stretches, without lines at 21.3, 0.565 Hz");
  // Anybody may have written the file.
  entry["sinusoids"] = {1, {{"parameters", 2}}, {{"parameters", {3, {{"name", 4}}}}}};
  entry["regime"] = 5;
  entry["fitted_to"]["stretches"] = "many";
  EXPECT_EQ(fitted_to_words(entry), "812 s");
  entry["fitted_to"]["seconds"] = "x";
  EXPECT_EQ(fitted_to_words(entry), "");
}

TEST(RankModels, PrefersTheTrueModelOverLargerAndSmallerOnes) {
  const auto wv = haar_wavelet_variance(white_and_walk(60000, 1.0, 0.02, 6)).value();
  const auto ranked = rank_models(wv, parse_model("QN+WN+GM+RW").value(), 100.0);
  ASSERT_TRUE(ranked) << ranked.error().text();
  EXPECT_EQ(ranked->size(), 15U);
  EXPECT_EQ(ranked->front().fit.spec.name(), "WN+RW");
  for (const auto& model : *ranked) EXPECT_FALSE(model.reason.empty()) << model.fit.spec.name();
}

TEST(FitJson, WhatCannotBeAFitIsRefusedBeforeItIsComputedWith) {
  const auto refused_with = [](const char* key, const nlohmann::json& value) {
    nlohmann::json fit{{"n", 1000},
                       {"rate_hz", 100.0},
                       {"model", "GM"},
                       {"weights", "ci"},
                       {"wv",
                        {{{"level", 1},
                          {"value", 1.0},
                          {"ci_low", 0.5},
                          {"ci_high", 2.0},
                          {"n_coefficients", 10},
                          {"fitted", 1.0}}}},
                       {"parameters",
                        {{{"process", "GM"}, {"name", "beta"}, {"unit", "1/s"}, {"value", 0.5}},
                         {{"process", "GM"}, {"name", "sigma2"}, {"unit", "x"}, {"value", 1.0}}}},
                       {"objective", 1.0},
                       {"j_test", nullptr},
                       {"criterion", 1.0},
                       {"identifiable", true},
                       {"warnings", nlohmann::json::array()}};
    if (std::string_view(key).empty()) return !fit_from_json(fit).has_value();
    (fit.contains(key)                  ? fit[key]
     : key == std::string_view("level") ? fit["wv"][0]["level"]
                                        : fit["parameters"][0]["value"]) = value;
    return !fit_from_json(fit).has_value();
  };
  EXPECT_FALSE(refused_with("", nullptr)) << "it is a fit as it stands";
  for (const double level : {2e9, 0.0, -1.0, 33.0, 1.5, 1e300})
    EXPECT_TRUE(refused_with("level", level)) << level;
  for (const double beta : {0.0, -1.0}) EXPECT_TRUE(refused_with("beta", beta)) << beta;
  for (const double rate : {0.0, -1.0}) EXPECT_TRUE(refused_with("rate_hz", rate)) << rate;
}

}  // namespace
}  // namespace imuscope::noise
