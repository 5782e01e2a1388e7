#include "models/noise/fit.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <chrono>
#include <cmath>
#include <map>
#include <random>
#include <set>

#include "made_series.h"
#include "models/noise/wv_covariance.h"
#include "oracle_files.h"
#include "tests/support/shared_data.h"

namespace imuscope::noise {
namespace {

using test::read_series;
using test::read_table;
using test::white;
using testing::HasSubstr;

double value_of(const FitResult& fit, const std::string& process, const std::string& name) {
  for (const auto& p : fit.parameters) {
    if (p.process == process && p.name == name) return p.value;
  }
  ADD_FAILURE() << "no parameter " << name << " of " << process;
  return std::nan("");
}

TEST(Fit, ReachesTheGlobalMinimumOfEveryOracleRowWithIntervalWeights) {
  IMUSCOPE_NEEDS_SHARED("oracle/gmwm/gmwm_global_optimum.csv");
  std::map<std::string, WaveletVariance> wvs;
  std::set<std::string> done;
  for (auto& row : read_table("gmwm_global_optimum.csv")) {
    const std::string key = row["series"] + " " + row["model"];
    if (!done.insert(key).second) continue;
    if (!wvs.contains(row["series"])) {
      const auto x = read_series(row["series"]);
      ASSERT_FALSE(x.empty()) << "series " << row["series"] << " is missing";
      wvs[row["series"]] = haar_wavelet_variance(x).value();
    }
    const auto result =
        fit(wvs[row["series"]], parse_model(row["model"]).value(), 100.0, {.weighting = Weighting::kCi});
    ASSERT_TRUE(result) << key << ": " << result.error().text();
    EXPECT_LE(result->objective, std::stod(row["objective"]) * (1.0 + 1e-6)) << key;
  }
  EXPECT_GE(done.size(), 14U);
}

TEST(Fit, ParametersAtAWellCurvedGlobalMinimumAgreeWithTheOracle) {
  IMUSCOPE_NEEDS_SHARED("oracle/gmwm/series/f01_wn_gm_n20000.csv");
  const auto wv = haar_wavelet_variance(read_series("f01_wn_gm_n20000")).value();
  const auto result = fit(wv, parse_model("WN+GM").value(), 100.0, {.weighting = Weighting::kCi}).value();
  EXPECT_NEAR(value_of(result, "WN", "sigma2"), 1.001874159, 1e-5);
  EXPECT_NEAR(value_of(result, "GM1", "beta"), 1.44122428, 1e-3);
  EXPECT_NEAR(value_of(result, "GM1", "sigma2"), 0.40056433, 1e-4);
}

/// Wavelet variance that equals a model's exactly, with the counts of n samples.
WaveletVariance exact_wv(const Model& model, std::size_t n, int levels) {
  WaveletVariance wv;
  wv.n_samples = wv.n_valid = n;
  wv.segments = {{0, n}};
  for (int j = 1; j <= levels; ++j) {
    WvLevel level;
    level.level = j;
    level.tau_samples = std::ldexp(1.0, j);
    level.value = model_wv(model, j);
    level.n_coefficients = n - static_cast<std::size_t>(level.tau_samples) + 1;
    wv.levels.push_back(level);
  }
  set_intervals(wv.levels, 1.0, 0.95);
  return wv;
}

TEST(Fit, FindsTheModelBehindAnExactCurveWithBothWeightings) {
  const std::vector<std::pair<std::string, Model>> cases{
      {"WN+3*GM",
       {{{ProcessKind::kWhiteNoise, 1.0, {}},
         {ProcessKind::kGaussMarkov, 0.5, {0.22, 0}},
         {ProcessKind::kGaussMarkov, 0.2, {0.01, 0}},
         {ProcessKind::kGaussMarkov, 0.1, {1e-4, 0}}}}},
      {"QN+WN+RW+DR",
       {{{ProcessKind::kQuantization, 1.0, {}},
         {ProcessKind::kWhiteNoise, 0.09, {}},
         {ProcessKind::kRandomWalk, 1e-5, {}},
         {ProcessKind::kRamp, 1e-10, {}}}}},
      {"WN+SIN", {{{ProcessKind::kWhiteNoise, 0.2, {}}, {ProcessKind::kSinusoid, 0.5, {0.21, 0}}}}},
      {"MA1+RW", {{{ProcessKind::kMa1, 1.0, {-0.5, 0}}, {ProcessKind::kRandomWalk, 1e-4, {}}}}},
      {"ARMA11", {{{ProcessKind::kArma11, 1.0, {0.95, -0.4}}}}}};
  for (const auto& [name, truth] : cases) {
    const auto wv = exact_wv(truth, 200000, 17);
    for (const auto weighting : {Weighting::kCi, Weighting::kOptimal}) {
      const auto result = fit(wv, parse_model(name).value(), 100.0, {.weighting = weighting});
      ASSERT_TRUE(result) << result.error().text();
      EXPECT_LT(result->objective, 1e-6) << name;
      for (const auto& level : result->wv) {
        EXPECT_NEAR(level.fitted / level.observed.value, 1.0, 1e-3)
            << name << " level " << level.observed.level;
      }
    }
  }
}

TEST(Fit, ManyProcessesAtOnceAreFittedToTheirCurve) {
  Model truth{{{ProcessKind::kWhiteNoise, 1.0, {}}}};
  for (int i = 0; i < 6; ++i)
    truth.components.push_back({ProcessKind::kGaussMarkov, 0.5, {std::pow(0.12, i), 0}});
  const auto wv = exact_wv(truth, std::size_t{1} << 24U, 22);
  // The second is not the truth: it comes within an interval or so of all levels together.
  for (const auto& [name, limit] : {std::pair{"WN+6*GM", 0.05}, std::pair{"WN+MA1+ARMA11+3*GM+SIN", 2.0}}) {
    const auto result = fit(wv, parse_model(name).value(), 100.0, {.weighting = Weighting::kCi});
    ASSERT_TRUE(result) << result.error().text();
    const auto& last = result->wv.back();
    EXPECT_NEAR(last.fitted / last.observed.value, 1.0, 0.5) << name;
    EXPECT_LT(result->objective, limit) << name;
  }
}

TEST(Fit, WhiteNoiseAloneHasTheEfficientEstimateAndInterval) {
  // Under pure white noise the optimal weights approach the maximum-likelihood estimate, whose relative sd is
  // sqrt(2/n).
  const std::size_t n = 50000;
  const auto result =
      fit(haar_wavelet_variance(white(n, 11)).value(), parse_model("WN").value(), 100.0).value();
  ASSERT_TRUE(result.parameters[0].sd.has_value());
  EXPECT_NEAR(*result.parameters[0].log_sd / std::sqrt(2.0 / static_cast<double>(n)), 1.0, 0.02);
  EXPECT_NEAR(result.parameters[0].value, 1.0, 4.0 * std::sqrt(2.0 / static_cast<double>(n)));
  EXPECT_TRUE(result.identifiable);
}

TEST(Fit, ATermTheDataDoNotHoldIsExactlyZeroAndNamedWithTheSimplerModel) {
  // Random walk put into a white-noise series whose long levels lie below the white-noise line.
  auto wv = haar_wavelet_variance(white(4096, 12)).value();
  for (auto& level : wv.levels) level.value = 1.0 / level.tau_samples * std::pow(0.97, level.level);
  set_intervals(wv.levels, 1.0, 0.95);
  const auto result = fit(wv, parse_model("WN+RW").value(), 100.0).value();
  EXPECT_EQ(value_of(result, "RW", "gamma2"), 0.0);
  EXPECT_FALSE(result.identifiable);
  EXPECT_EQ(result.simpler_model, "WN");
  ASSERT_FALSE(result.warnings.empty());
  EXPECT_THAT(result.warnings[0], HasSubstr("RW"));
  EXPECT_FALSE(result.parameters[1].sd.has_value());
  EXPECT_TRUE(result.parameters[0].sd.has_value());
}

TEST(Fit, AGaussMarkovProcessThatIsARandomWalkIsCalledOne) {
  const Model truth{{{ProcessKind::kWhiteNoise, 1.0, {}}, {ProcessKind::kRandomWalk, 1e-4, {}}}};
  const auto result = fit(exact_wv(truth, 100000, 14), parse_model("WN+GM").value(), 100.0).value();
  EXPECT_FALSE(result.identifiable);
  EXPECT_EQ(result.simpler_model, "WN+RW");
  EXPECT_FALSE(result.parameters[1].sd.has_value());
}

TEST(Fit, TwoGaussMarkovProcessesThatAreOneAreNotGivenIntervals) {
  const Model truth{{{ProcessKind::kWhiteNoise, 1.0, {}}, {ProcessKind::kGaussMarkov, 0.5, {0.01, 0}}}};
  auto wv = exact_wv(truth, 100000, 16);
  const auto result = fit(wv, parse_model("WN+2*GM").value(), 100.0).value();
  EXPECT_FALSE(result.identifiable);
  EXPECT_FALSE(result.simpler_model.empty());
}

TEST(Fit, AModelThatCannotFollowTheDataPassesTheMiddleOfThemAndSaysByHowMuch) {
  // Band-limited vibration has no power at long tau and falls twice as fast as white noise. The shortest
  // levels are known to a permille; the fit must not buy them with factors elsewhere.
  const Model truth{{{ProcessKind::kQuantization, 1.0, {}}, {ProcessKind::kWhiteNoise, 1e-3, {}}}};
  const auto wv = exact_wv(truth, 20000, 12);
  const auto result = fit(wv, parse_model("WN+GM").value(), 100.0).value();
  ASSERT_TRUE(result.j_test.has_value());
  EXPECT_LT(result.j_test->p_value, 1e-6);
  EXPECT_GT(result.model_error, 0.1);
  double sum = 0.0;
  for (const auto& level : result.wv) sum += std::log(level.fitted / level.observed.value);
  EXPECT_NEAR(sum / static_cast<double>(result.wv.size()), 0.0, 0.7) << "neither above nor below the data";
  EXPECT_THAT(result.warnings.back(), HasSubstr("does not explain"));
  // A refit from there ends at the same place.
  FitOptions warm;
  warm.warm_start = &result;
  const auto again = fit(wv, parse_model("WN+GM").value(), 100.0, warm).value();
  EXPECT_NEAR(again.model_error / result.model_error, 1.0, 0.2);
  const auto right = fit(wv, parse_model("QN+WN").value(), 100.0).value();
  EXPECT_EQ(right.model_error, 0.0);
}

TEST(Fit, WhatIsPrintedBelongsToThePrintedModel) {
  // Two slow processes and quantization, of which the models hold one or none.
  const Model truth{{{ProcessKind::kQuantization, 0.1, {}},
                     {ProcessKind::kGaussMarkov, 1e-2, {0.05, 0}},
                     {ProcessKind::kRandomWalk, 1e-6, {}}}};
  const auto wv = exact_wv(truth, 200000, 17);
  for (const char* name : {"WN+GM", "QN+WN", "WN+RW", "2*GM"}) {
    const auto result = fit(wv, parse_model(name).value(), 100.0).value();
    ASSERT_TRUE(result.j_test && result.j_test->p_value < 0.001) << name;
    // The covariance of the model as printed, made anew.
    const Eigen::MatrixXd v = wv_covariance(result.model, wv, wv.levels.size());
    Eigen::MatrixXd with_error = v;
    Eigen::VectorXd residual(v.rows());
    int parameters = 0;
    for (const Component& c : result.model.components)
      parameters += c.amplitude > 0.0 ? 1 + shape_count(c.kind) : 0;
    for (Eigen::Index i = 0; i < v.rows(); ++i) {
      const FittedLevel& level = result.wv[static_cast<std::size_t>(i)];
      const double y = level.observed.value;
      const double m = level.fitted;
      residual[i] = y - m;
      with_error(i, i) += result.model_error * result.model_error * 2.0 * y * m * m / (y + m);
      // The interval's ends are those of a chi-square with this level's own degrees of freedom: at least one.
      EXPECT_LT(level.model_ci_high, 1100.0 * y) << name;
      EXPECT_GT(level.model_ci_low, 0.0);
    }
    const double objective = residual.dot(Eigen::VectorXd(with_error.ldlt().solve(residual)));
    EXPECT_NEAR(objective / static_cast<double>(17 - parameters), 1.0, 1e-3) << name;
    // The test knows no model error: no smaller than what the levels say one by one.
    double alone = 0.0;
    for (Eigen::Index i = 0; i < v.rows(); ++i) alone = std::max(alone, residual[i] * residual[i] / v(i, i));
    EXPECT_GT(result.j_test->statistic, 0.2 * alone) << name;
  }
}

TEST(Fit, AModelNeverHasMoreErrorThanAPartOfItself) {
  const Model truth{{{ProcessKind::kQuantization, 0.1, {}},
                     {ProcessKind::kGaussMarkov, 1e-2, {0.05, 0}},
                     {ProcessKind::kRandomWalk, 1e-6, {}}}};
  const auto wv = exact_wv(truth, 200000, 17);
  for (const auto& [whole, part] : {std::pair{"WN+GM", "WN"}, std::pair{"WN+GM", "GM"},
                                    std::pair{"WN+GM+DR", "WN+GM"}, std::pair{"WN+RW+DR", "WN+RW"}}) {
    const auto large = fit(wv, parse_model(whole).value(), 100.0).value();
    const auto small = fit(wv, parse_model(part).value(), 100.0).value();
    EXPECT_LE(large.model_error, small.model_error * (1.0 + 1e-6)) << whole << " and " << part;
  }
}

TEST(Fit, WhichLevelsAreMissedByHowMuchIsSaidAndTrueOfEveryLevel) {
  const Model truth{{{ProcessKind::kWhiteNoise, 1.0, {}}}};
  auto wv = exact_wv(truth, 1U << 20U, 18);
  wv.levels[7].value *= 3.0;
  const auto result = fit(wv, parse_model("WN").value(), 100.0).value();
  ASSERT_FALSE(result.warnings.empty());
  const double ratio = result.wv[7].observed.value / result.wv[7].fitted;
  EXPECT_THAT(result.warnings.back(),
              HasSubstr(fmt::format("{:.3g} times too low at level 8 (2.56 s)", ratio)));
  EXPECT_GT(ratio, 2.0);
}

TEST(InvertedIntervals, HoldTheTruthOfASlowProcessInEverySeriesThatIsCounted) {
  // Twelve correlation times: the estimate's own covariance is too small where chance makes the process
  // small.
  constexpr std::size_t kN = 4096;
  constexpr double kRate = 12.0 / kN;
  constexpr unsigned kSeries = 40;
  FitOptions options;
  options.intervals = Intervals::kInverted;
  int held = 0;
  for (unsigned s = 0; s < kSeries; ++s) {
    std::vector<double> x = white(kN, 300 + s);
    const auto drive = white(kN + 1, 900 + s);
    double state = drive[kN];
    for (std::size_t i = 0; i < kN; ++i) {
      x[i] += state;
      state = std::exp(-kRate) * state + std::sqrt(-std::expm1(-2.0 * kRate)) * drive[i];
    }
    const auto result =
        fit(haar_wavelet_variance(x).value(), parse_model("WN+GM").value(), 1.0, options).value();
    const auto& beta = result.parameters[1];
    held += (!beta.ci_low || *beta.ci_low <= kRate) && (!beta.ci_high || kRate <= *beta.ci_high) ? 1 : 0;
  }
  EXPECT_GE(held, 33) << "38 expected; fewer than 33 has a chance of 3e-3";
}

TEST(InvertedIntervals, OfARecordInStretchesHoldTheTruthAsOften) {
  // A drive's stops: forty stretches of 10 to 100 samples' memory, whose covariance is a factor on that of
  // one run.
  constexpr std::size_t kN = 16'384;
  constexpr double kRate = 0.02;
  constexpr unsigned kSeries = 40;
  FitOptions options;
  options.intervals = Intervals::kInverted;
  int held = 0;
  int ends = 0;
  for (unsigned s = 0; s < kSeries; ++s) {
    std::vector<double> x = white(kN, 3000 + s);
    const auto drive = white(kN + 1, 9000 + s);
    std::vector<std::uint8_t> mask(kN, 1);
    double state = drive[kN];
    for (std::size_t i = 0; i < kN; ++i) {
      x[i] += state;
      state = std::exp(-kRate) * state + std::sqrt(-std::expm1(-2.0 * kRate)) * drive[i];
      mask[i] = i % 400 < 300 ? 1 : 0;
    }
    WvOptions of_stretches;
    of_stretches.mask = mask;
    const auto wv = haar_wavelet_variance(x, of_stretches).value();
    const auto result = fit(wv, parse_model("WN+GM").value(), 1.0, options).value();
    const auto& beta = result.parameters[1];
    held += (!beta.ci_low || *beta.ci_low <= kRate) && (!beta.ci_high || kRate <= *beta.ci_high) ? 1 : 0;
    ends += (beta.ci_low ? 1 : 0) + (beta.ci_high ? 1 : 0);
  }
  EXPECT_GE(held, 33) << "38 expected; fewer than 33 has a chance of 3e-3";
  EXPECT_GE(ends, 70) << "of 80: the record tells the rate";
}

TEST(InvertedIntervals, ATermAtZeroIsKnownToBeBelowABoundThatTheQuickOnesDoNotGive) {
  auto wv = haar_wavelet_variance(white(4096, 12)).value();
  for (auto& level : wv.levels) level.value = 1.0 / level.tau_samples * std::pow(0.97, level.level);
  set_intervals(wv.levels, 1.0, 0.95);
  FitOptions options;
  EXPECT_FALSE(fit(wv, parse_model("WN+RW").value(), 100.0)->parameters[1].ci_high);
  options.intervals = Intervals::kInverted;
  const auto result = fit(wv, parse_model("WN+RW").value(), 100.0, options).value();
  const auto& walk = result.parameters[1];
  EXPECT_EQ(walk.value, 0.0);
  EXPECT_FALSE(walk.ci_low);
  ASSERT_TRUE(walk.ci_high);
  // At the bound the walk shows: as much as the white noise somewhere between the levels of 64 and 4096
  // samples.
  EXPECT_GT(*walk.ci_high, 12.0 / (4096.0 * 4096.0) / 10.0);
  EXPECT_LT(*walk.ci_high, 12.0 / (64.0 * 64.0));
  options.confidence = 0.99;
  EXPECT_GT(*fit(wv, parse_model("WN+RW").value(), 100.0, options)->parameters[1].ci_high, *walk.ci_high);
}

// Of white noise and a fast Gauss-Markov process one can take the other's place: where one of them is zero,
// the other sets of processes that the data allow bound it all the same.
TEST(InvertedIntervals, ATermAtZeroThatARivalHoldsIsBoundedFromAbove) {
  FitOptions options;
  options.intervals = Intervals::kInverted;
  int at_zero = 0;
  int below_truth = 0;
  for (unsigned seed = 1; seed <= 8; ++seed) {
    const auto wv = haar_wavelet_variance(white(20'000, seed)).value();
    const auto result = fit(wv, parse_model("QN+WN+2*GM").value(), 100.0, options).value();
    for (const auto& p : result.parameters) {
      if (p.name == "beta" || p.process.starts_with("GM") || p.value > 0.0) continue;
      ++at_zero;
      ASSERT_TRUE(p.ci_high) << p.process << ", series " << seed;
      below_truth += p.process == "WN" && *p.ci_high < 1.0 ? 1 : 0;
      EXPECT_GT(*p.ci_high, 0.0) << seed;
      EXPECT_LT(*p.ci_high, 1.1) << seed;
    }
  }
  EXPECT_LE(below_truth, 2) << "a bound of 95 %";
  EXPECT_GE(at_zero, 4);
}

TEST(Fit, AModelWithoutNoiseOfItsOwnHasIntervalsAllTheSame) {
  // A pure ramp: its wavelet variance has no sampling error, and so endless degrees of freedom.
  const Model truth{{{ProcessKind::kRamp, 1e-6, {}}}};
  const auto result = fit(exact_wv(truth, 1U << 20U, 19), parse_model("DR").value(), 100.0);
  ASSERT_TRUE(result) << result.error().text();
  EXPECT_NEAR(result->parameters[0].value, 1e-3, 1e-6);
  for (const auto& level : result->wv) EXPECT_TRUE(std::isfinite(level.model_ci_high));
}

TEST(Fit, BadInputIsRefusedWithWhatToDo) {
  const auto wv = haar_wavelet_variance(white(16, 13)).value();
  const auto few = fit(wv, parse_model("WN+2*GM").value(), 100.0);
  ASSERT_FALSE(few);
  EXPECT_THAT(few.error().text(), HasSubstr("5 parameters"));
  const auto rate = fit(wv, parse_model("WN").value(), 0.0);
  ASSERT_FALSE(rate);
  EXPECT_EQ(rate.error().kind, ErrorKind::kUsage);
  const auto constant =
      fit(haar_wavelet_variance(std::vector<double>(100, 2.0)).value(), parse_model("WN").value(), 1);
  ASSERT_FALSE(constant);
  EXPECT_THAT(constant.error().text(), HasSubstr("constant"));
}

TEST(ParseModel, ReadsTheUsualSpellingsAndOrdersTheTerms) {
  EXPECT_EQ(parse_model("WN+2*GM")->name(), "WN+2*GM");
  EXPECT_EQ(parse_model(" rw + gm+WN + GM ")->name(), "WN+2*GM+RW");
  EXPECT_EQ(parse_model("QN+WN+RW")->parameter_count(), 3);
  EXPECT_EQ(parse_model("WN+1GM")->name(), "WN+GM");
}

TEST(ParseModel, NamesTheTermThatIsUnknownRepeatedOrEmpty) {
  for (const char* text : {"WN+XY", "WN+WN", "", "WN+", "9*GM", "0*GM", "2*WN"}) {
    const auto refused = parse_model(text);
    ASSERT_FALSE(refused) << text;
    EXPECT_EQ(refused.error().kind, ErrorKind::kUsage);
    EXPECT_THAT(refused.error().text(), HasSubstr("WN+2*GM")) << text;
  }
  EXPECT_THAT(parse_model("WN+XY").error().text(), HasSubstr("'XY'"));
}

}  // namespace
}  // namespace imuscope::noise
