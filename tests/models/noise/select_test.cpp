#include "models/noise/select.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <random>

#include "models/noise/simulated_noise.h"

namespace imuscope::noise {
namespace {

using ::testing::HasSubstr;

/// White noise, and where `markov` is above zero a Gauss-Markov process of that sd and of 20 samples.
WaveletVariance record(std::size_t n, double markov, unsigned seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  std::vector<double> x(n);
  double state = markov * normal(random);
  const double phi = std::exp(-1.0 / 20.0);
  for (double& v : x) {
    state = phi * state + markov * std::sqrt(1.0 - phi * phi) * normal(random);
    v = normal(random) + state;
  }
  return haar_wavelet_variance(x).value();
}

std::vector<WaveletVariance> records(std::size_t count, double markov, unsigned seed) {
  std::vector<WaveletVariance> out;
  for (std::size_t i = 0; i < count; ++i)
    out.push_back(record(8192, markov, seed + static_cast<unsigned>(i)));
  return out;
}

TEST(RankModels, ATermThatEarnsNothingIsLeftOutWithTheReasonInWords) {
  const auto ranked = rank_models(record(40'000, 0.0, 1), parse_model("WN+GM").value(), 100.0).value();
  ASSERT_EQ(ranked.size(), 3U);
  EXPECT_EQ(ranked.front().fit.spec.name(), "WN");
  for (const auto& model : ranked) EXPECT_FALSE(model.reason.empty()) << model.fit.spec.name();
}

TEST(RankModels, ARejectedModelStandsBehindEveryOneThatIsNot) {
  const auto ranked =
      rank_models(record(40'000, 0.7, 3), parse_model("QN+WN+2*GM+RW").value(), 100.0).value();
  ASSERT_EQ(ranked.size(), 23U);
  const auto rejected = [](const RankedModel& m) { return m.fit.j_test && m.fit.j_test->p_value < 0.001; };
  EXPECT_FALSE(rejected(ranked.front()));
  EXPECT_TRUE(std::is_partitioned(ranked.begin(), ranked.end(), [&](const auto& m) { return !rejected(m); }));
  EXPECT_THAT(ranked.back().reason, HasSubstr("rejected: J-test p = "));
}

WaveletVariance made(const char* terms, const std::vector<std::pair<double, Shape>>& parameters,
                     unsigned seed) {
  Model model;
  const ModelSpec spec = parse_model(terms).value();
  for (std::size_t i = 0; i < spec.processes.size(); ++i)
    model.components.push_back({spec.processes[i], parameters[i].first, parameters[i].second});
  std::mt19937_64 random(seed);
  return haar_wavelet_variance(simulated_noise(model, 1U << 16U, random)).value();
}

// What it leaves out is what could not have won: the search of all sub-models finds nothing that is better.
TEST(GrowModel, FindsWhatTheSearchOfAllSubModelsFinds) {
  const std::array terms{ProcessKind::kQuantization, ProcessKind::kWhiteNoise, ProcessKind::kGaussMarkov,
                         ProcessKind::kRandomWalk};
  const auto all = parse_model("QN+WN+2*GM+RW").value();
  int same = 0;
  for (unsigned seed = 1; seed <= 6; ++seed) {
    const WaveletVariance wv =
        seed % 2 == 0 ? made("WN+GM+RW", {{1.0, {}}, {0.05, {0.03, 0.0}}, {1e-8, {}}}, seed)
                      : made("WN+2*GM", {{1.0, {}}, {0.3, {0.2, 0.0}}, {0.02, {0.004, 0.0}}}, seed);
    const auto grown = grow_model(wv, terms, 100.0).value();
    const auto ranked = rank_models(wv, all, 100.0).value();
    double least = std::numeric_limits<double>::infinity();
    for (const RankedModel& model : ranked) {
      if (model.fit.j_test && model.fit.j_test->p_value >= 0.001) least = std::min(least, model.criterion);
    }
    ASSERT_TRUE(grown.best.j_test);
    EXPECT_GE(grown.best.j_test->p_value, 0.001) << seed;
    EXPECT_LT(grown.best.criterion, least + 4.0) << seed << ": " << grown.best.spec.name();
    same += grown.best.spec == ranked.front().fit.spec ? 1 : 0;
  }
  EXPECT_GE(same, 4) << "of 6";
}

// No step of one term leads there: white noise alone is no help, nor is the resonance.
TEST(GrowModel, SplitsAFastGaussMarkovProcessIntoWhiteNoiseBeneathAResonance) {
  const WaveletVariance wv = made("WN+RES+RW", {{1.0, {}}, {0.5, {0.15, 0.63}}, {1e-6, {}}}, 5);
  const std::array terms{ProcessKind::kWhiteNoise, ProcessKind::kGaussMarkov, ProcessKind::kRandomWalk,
                         ProcessKind::kResonance};
  const auto grown = grow_model(wv, terms, 100.0).value();
  EXPECT_EQ(grown.best.spec.name(), "WN+RES+RW");
  EXPECT_EQ(grown.best.model_error, 0.0);
}

TEST(CrossValidation, ARightModelMissesAReplicateByOneVarianceALevel) {
  const auto replicates = records(12, 0.0, 10);
  const auto ranked = cross_validate(replicates, parse_model("WN").value(), 100.0).value();
  ASSERT_EQ(ranked.size(), 1U);
  std::size_t levels = 0;
  for (const auto& level : replicates.front().levels)
    levels += has_enough_coefficients(level, replicates.front().efficiency) ? 1 : 0;
  // Chi-square with so many degrees of freedom, twelve of them; that the model is fitted to eleven others
  // adds an eleventh of a degree.
  const auto dof = static_cast<double>(levels);
  EXPECT_NEAR(ranked.front().score, dof, 4.0 * std::sqrt(2.0 * dof / 12.0));
  EXPECT_EQ(ranked.front().worse_by, 0.0);
  EXPECT_EQ(ranked.front().reason, "predicts a replicate left out best");
}

TEST(CrossValidation, OfEquivalentModelsTheSimplestComesFirstAndSaysSo) {
  int simplest = 0;
  int said = 0;
  for (unsigned seed = 100; seed < 2000; seed += 100) {
    const auto ranked = cross_validate(records(6, 0.0, seed), parse_model("WN+GM").value(), 100.0).value();
    ASSERT_EQ(ranked.size(), 3U);
    const auto& first = ranked.front();
    if (first.pooled.spec.name() == "WN") ++simplest;
    if (first.worse_by == 0.0) continue;
    // It stands before the one that predicts best.
    ++said;
    EXPECT_LE(first.worse_by, first.worse_by_sd);
    EXPECT_THAT(first.reason, HasSubstr("equivalent: worse by "));
    EXPECT_THAT(first.reason, HasSubstr(", and simpler than " + ranked[1].pooled.spec.name()));
    EXPECT_EQ(ranked[1].reason.rfind("predicts a replicate left out best", 0), 0U);
  }
  EXPECT_GE(simplest, 15) << "of 19";
  EXPECT_GE(said, 1);
}

TEST(CrossValidation, ATermThatTheDataHoldIsKeptAndTheModelWithoutItIsWorse) {
  const auto ranked = cross_validate(records(6, 0.7, 50), parse_model("WN+GM").value(), 100.0).value();
  ASSERT_EQ(ranked.size(), 3U);
  EXPECT_EQ(ranked.front().pooled.spec.name(), "WN+GM");
  EXPECT_EQ(ranked.front().worse_by, 0.0);
  for (std::size_t i = 1; i < ranked.size(); ++i) {
    EXPECT_GT(ranked[i].worse_by, 4.0 * ranked[i].worse_by_sd);
    EXPECT_EQ(ranked[i].reason.rfind("worse by ", 0), 0U) << ranked[i].reason;
    EXPECT_GE(ranked[i].score, ranked[i - 1].score);
  }
}

TEST(CrossValidation, WhatCannotBeLeftOutIsRefused) {
  const auto spec = parse_model("WN").value();
  const auto two = cross_validate(records(2, 0.0, 1), spec, 100.0);
  ASSERT_FALSE(two);
  EXPECT_EQ(two.error().kind, ErrorKind::kUsage);
  EXPECT_THAT(two.error().text(), HasSubstr("2 replicates are too few"));
  EXPECT_THAT(two.error().remedy, HasSubstr("at least 3"));
  auto replicates = records(4, 0.0, 1);
  replicates[2] = record(5, 0.0, 9);
  const auto shortest = cross_validate(replicates, spec, 100.0);
  ASSERT_FALSE(shortest);
  EXPECT_THAT(shortest.error().text(), HasSubstr("replicate 3 is too short"));
  EXPECT_FALSE(shortest.error().remedy.empty());
}

}  // namespace
}  // namespace imuscope::noise
