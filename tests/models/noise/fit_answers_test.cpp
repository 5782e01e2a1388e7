/// Whole fits, and what is made of several of them, as they were once. Their searches end within far less than what
/// is held here.

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <random>
#include <string>
#include <vector>

#include "answer.h"
#include "models/noise/compare.h"
#include "models/noise/conservative.h"
#include "models/noise/covariance_table.h"
#include "models/noise/dependence.h"
#include "models/noise/fixed_point.h"
#include "models/noise/homogeneity.h"
#include "models/noise/inference.h"
#include "models/noise/loose_rates.h"
#include "models/noise/nested_fit.h"
#include "models/noise/replicates.h"
#include "models/noise/select.h"
#include "models/noise/separable_fit.h"
#include "models/noise/simulated_noise.h"
#include "tests/support/recorded_answer.h"

namespace imuscope::noise::fit_answers {
namespace {

using imuscope::test::expect_recorded;
using test::Answer;

constexpr double kRate_hz = 50.0;
/// Of numbers that a search ends at.
constexpr double kSearched = 1e-5;

const Component kWhite{ProcessKind::kWhiteNoise, 1.0, {}};
const Component kFast{ProcessKind::kGaussMarkov, 0.8, {0.2, 0.0}};
const Component kSlow{ProcessKind::kGaussMarkov, 0.3, {0.004, 0.0}};
const Component kWalk{ProcessKind::kRandomWalk, 1e-4, {}};
const Component kCoarse{ProcessKind::kQuantization, 0.8, {}};
const Component kRamp{ProcessKind::kRamp, 1e-7, {}};

WaveletVariance wv_of(const std::vector<Component>& components, std::size_t n, unsigned seed,
                      const WvOptions& options = {}) {
  std::mt19937_64 random(seed);
  return haar_wavelet_variance(simulated_noise({components}, n, random), options).value();
}

/// A wavelet variance that is the model's own: no chance in it.
WaveletVariance exact_wv(const std::vector<Component>& components, std::size_t n) {
  auto wv = wv_of(components, n, 1);
  for (WvLevel& level : wv.levels) level.value = model_wv({components}, level.level);
  set_intervals(wv.levels, 1.0, 0.95);
  return wv;
}

void fit_and_add(Answer& answer, const WaveletVariance& wv, const char* model,
                 const FitOptions& options = {}) {
  const auto fitted = fit(wv, parse_model(model).value(), kRate_hz, options);
  if (fitted)
    test::add_fit(answer, *fitted);
  else
    answer.line(model, static_cast<int>(fitted.error().kind), fitted.error().text());
}

TEST(FitAnswers, ModelsOfTheirOwnRecords) {
  Answer answer;
  fit_and_add(answer, wv_of({kWhite}, 1'000, 2), "WN");
  fit_and_add(answer, wv_of({kWhite, kWalk}, 8'000, 3), "WN+RW", {.confidence = 0.8, .signal_unit = "rad/s"});
  fit_and_add(answer, wv_of({kWhite, kFast, kSlow}, 32'000, 4), "WN+2*GM", {.signal_unit = "m/s^2"});
  fit_and_add(answer, wv_of({kCoarse, kFast, kRamp}, 8'000, 5), "QN+GM+DR", {.signal_unit = "deg/s"});
  fit_and_add(answer, wv_of({kWhite, {ProcessKind::kFlicker, 0.3, {}}}, 16'000, 6), "WN+FN",
              {.signal_unit = "g"});
  fit_and_add(answer, wv_of({kWhite, {ProcessKind::kPowerLaw, 0.3, {1.4, 0.0}}}, 16'000, 7), "WN+PL");
  expect_recorded("models/noise/fits.txt", answer.text(), kSearched, 1e-9);
}

TEST(FitAnswers, ModelsOfShortMemory) {
  Answer answer;
  fit_and_add(answer, wv_of({{ProcessKind::kMa1, 1.0, {0.6, 0.0}}}, 4'000, 8), "MA1", {.signal_unit = "g"});
  fit_and_add(answer, wv_of({{ProcessKind::kArma11, 1.0, {0.7, -0.3}}}, 16'000, 9), "ARMA11");
  fit_and_add(answer, wv_of({kWhite, {ProcessKind::kSinusoid, 0.5, {0.4, 0.0}}}, 8'000, 10), "WN+SIN",
              {.signal_unit = "g"});
  fit_and_add(answer, wv_of({kWhite, {ProcessKind::kResonance, 2.0, {0.1, 0.8}}}, 16'000, 11), "WN+RES",
              {.signal_unit = "g"});
  expect_recorded("models/noise/fits_of_short_memory.txt", answer.text(), kSearched, 1e-9);
}

TEST(FitAnswers, ByIntervalWidths) {
  Answer answer;
  FitOptions options;
  options.weighting = Weighting::kCi;
  const auto wv = wv_of({kWhite, kFast, kWalk}, 8'000, 12);
  fit_and_add(answer, wv, "WN+GM+RW", options);
  options.levels = 9;
  fit_and_add(answer, wv, "WN+GM", options);
  const auto earlier = fit(wv, parse_model("WN+GM").value(), kRate_hz, options).value();
  options.warm_start = &earlier;
  fit_and_add(answer, wv_of({kWhite, kFast, kWalk}, 8'000, 13), "WN+GM", options);
  expect_recorded("models/noise/fits_by_widths.txt", answer.text(), kSearched, 1e-9);
}

TEST(FitAnswers, ModelsThatDoNotExplainTheirRecord) {
  Answer answer;
  const auto wv = wv_of({kWhite, kFast, kWalk}, 16'000, 14);
  fit_and_add(answer, wv, "WN");
  fit_and_add(answer, wv, "RW");
  fit_and_add(answer, wv, "WN+RW");
  fit_and_add(answer, wv, "QN+WN", {.weighting = Weighting::kCi});
  fit_and_add(answer, wv_of({kWhite, {ProcessKind::kSinusoid, 9.0, {0.4, 0.0}}}, 8'000, 15), "WN+GM+RW");
  expect_recorded("models/noise/fits_rejected.txt", answer.text(), kSearched, 1e-9);
}

TEST(FitAnswers, TermsThatTheRecordDoesNotTell) {
  Answer answer;
  const auto white = wv_of({kWhite}, 4'000, 16);
  fit_and_add(answer, white, "QN+WN+GM+RW");
  fit_and_add(answer, white, "2*GM");
  fit_and_add(answer, wv_of({kWhite, kWalk}, 4'000, 17), "WN+GM");
  fit_and_add(answer, wv_of({kWhite, kSlow}, 2'000, 18), "WN+GM");
  fit_and_add(answer, wv_of({{ProcessKind::kGaussMarkov, 1.0, {9.0, 0.0}}}, 4'000, 19), "GM");
  fit_and_add(answer, exact_wv({kFast}, 4'000), "2*GM");
  fit_and_add(answer, exact_wv({kRamp}, 4'000), "DR");
  expect_recorded("models/noise/fits_undetermined.txt", answer.text(), 1e-4, 1e-9);
}

TEST(FitAnswers, OfRecordsWithHolesAndRobust) {
  Answer answer;
  std::vector<std::uint8_t> mask(8'000, 1);
  for (std::size_t i = 0; i < mask.size(); ++i)
    if (i % 500 == 77 || (i >= 3'000 && i < 3'050) || (i >= 5'000 && i < 5'049) || (i > 6'000 && i < 6'400))
      mask[i] = 0;
  WvOptions options;
  options.mask = mask;
  fit_and_add(answer, wv_of({kWhite, kFast}, mask.size(), 20, options), "WN+GM");
  options.robust = RobustOptions{};
  fit_and_add(answer, wv_of({kCoarse, kWhite, kFast}, mask.size(), 21, options), "QN+WN+GM");
  options.mask = {};
  fit_and_add(answer, wv_of({kWhite, kWalk}, mask.size(), 22, options), "WN+RW");
  expect_recorded("models/noise/fits_with_holes.txt", answer.text(), kSearched, 1e-9);
}

TEST(FitAnswers, InvertedIntervals) {
  Answer answer;
  FitOptions options;
  options.intervals = Intervals::kInverted;
  CovarianceTables tables;
  for (CovarianceTables* from : {static_cast<CovarianceTables*>(nullptr), &tables}) {
    options.covariances = from;
    const auto add = [&](const WaveletVariance& wv, const char* model) {
      const auto fitted = fit(wv, parse_model(model).value(), kRate_hz, options).value();
      answer.line(model, from != nullptr);
      test::add_parameters(answer, fitted);
    };
    add(wv_of({kWhite, kSlow}, 4'000, 23), "WN+GM");
    add(wv_of({kWhite, kFast, kSlow}, 8'000, 24), "WN+2*GM");
    add(wv_of({kWhite}, 2'000, 25), "QN+WN+GM+RW");
    add(wv_of({kWhite, kWalk}, 4'000, 26), "WN+RW+DR");
    options.confidence = 0.8;
    add(wv_of({kWhite, kFast, kWalk}, 4'000, 27), "WN+GM+RW");
    options.confidence = 0.95;
    const auto of_more = wv_of({kWhite, kFast, kSlow}, 60'000, 31);
    EXPECT_GT(fit(of_more, parse_model("WN+GM").value(), kRate_hz, options)->model_error, 0.02);
    add(of_more, "WN+GM");
  }
  expect_recorded("models/noise/fits_inverted.txt", answer.text(), 1e-4, 1e-9);
}

TEST(FitAnswers, WhatIsRefused) {
  Answer answer;
  const auto wv = wv_of({kWhite}, 64, 28);
  for (const double rate_hz : {0.0, -1.0, HUGE_VAL, std::nan("")})
    answer.line(fit(wv, parse_model("WN").value(), rate_hz).error().text());
  answer.line(fit(wv, {}, kRate_hz).error().text());
  fit_and_add(answer, wv, "WN+2*GM+RW");
  fit_and_add(answer, wv, "WN+GM", {.levels = 2});
  fit_and_add(answer, wv, "WN+8*GM");
  answer.line(fit(wv, {std::vector(17, ProcessKind::kGaussMarkov)}, kRate_hz).error().text());
  auto still = wv;
  still.levels[3].value = 0.0;
  fit_and_add(answer, still, "WN");
  EXPECT_TRUE(fit(still, parse_model("WN").value(), kRate_hz, {.levels = 3}));
  EXPECT_EQ(fitted_levels(wv, {}), wv.levels.size());
  EXPECT_EQ(fitted_levels(wv, {.levels = 100}), wv.levels.size());
  EXPECT_EQ(fitted_levels(wv, {.levels = 2}), 2U);
  expect_recorded("models/noise/fits_refused.txt", answer.text());
}

void add_tested(Answer& answer, const TestedPoint& tested) {
  test::add_model(answer, tested.point.model);
  answer.line(tested.point.objective, tested.point.model_error, tested.point.settled, tested.rejected());
  test::add_j_test(answer, tested.test);
  answer.line("v", tested.point.v.diagonal(), "sampling", tested.point.sampling.diagonal());
}

TEST(FitAnswers, NestedModels) {
  Answer answer;
  const auto wv = wv_of({kWhite, kFast, kSlow, kWalk}, 8'000, 29);
  const auto spec = parse_model("WN+2*GM+RW").value();
  NestedFit models(wv, 10, nullptr);
  add_tested(answer, models.solve(spec));
  const Model other{{kWhite, {ProcessKind::kGaussMarkov, 2.0, {1.0, 0.0}}, kSlow, kWalk}};
  answer.line("better", models.improve(spec, other));
  add_tested(answer, models.solve(spec));
  for (const double error : {0.0, 0.3}) add_tested(answer, models.refine(spec, other, error));
  NestedFit known(wv, 10, nullptr, NestedFit::Starts::kKnownSubModels);
  for (const char* name : {"WN", "WN+RW", "QN+RW", "WN+GM", "GM"})
    add_tested(answer, known.solve(parse_model(name).value()));
  EXPECT_EQ(present_parameters({{kWhite, kFast, {ProcessKind::kGaussMarkov, 0.0, {1.0, 0.0}}}}),
            (std::vector<bool>{true, true, true, false, false}));
  expect_recorded("models/noise/nested_fits.txt", answer.text(), kSearched, 1e-12);
}

TEST(FitAnswers, SearchesByGivenWeights) {
  Answer answer;
  const auto wv = wv_of({kWhite, kFast, kSlow}, 8'000, 30);
  const auto add = [&](const SeparableSolution& solution) {
    answer.line("objective", solution.objective);
    test::add_model(answer, solution.model);
  };
  for (const char* name :
       {"WN", "QN+WN+RW+DR", "WN+GM", "WN+2*GM", "3*GM", "MA1", "ARMA11", "WN+SIN", "WN+PL", "WN+RES"}) {
    SeparableProblem problem = unweighted_problem(wv, parse_model(name).value(), 10);
    problem.whitener = problem.y.cwiseInverse().asDiagonal();
    answer.line(name, problem.levels, problem.y);
    const auto found = find_global_minimum(problem);
    add(found);
    answer.line("residual", residual_of(problem, found.model), parameters_in_use(found.model));
    for (const ProcessKind kind :
         {ProcessKind::kGaussMarkov, ProcessKind::kRandomWalk, ProcessKind::kSinusoid}) {
      problem.spec.processes.push_back(kind);
      std::sort(problem.spec.processes.begin(), problem.spec.processes.end());
      for (const Model& start : with_one_more(problem, found.model, kind)) {
        answer.line("start of", short_name(kind));
        test::add_model(answer, start);
      }
      problem.spec = parse_model(name).value();
    }
  }
  expect_recorded("models/noise/searches.txt", answer.text(), 1e-4, 1e-7);
}

TEST(FitAnswers, PointsWhereWeightsAndFitRest) {
  Answer answer;
  const auto wv = wv_of({kWhite, kFast, kWalk}, 8'000, 31);
  const CovarianceTable table(wv, 9);
  const auto add = [&](const FixedPoint& point) {
    add_tested(answer, {point, std::nullopt});
    answer.line("v", point.v.col(0));
  };
  for (const char* name : {"WN+GM+RW", "WN+RW", "RW"}) {
    for (const bool by_table : {false, true}) {
      WeightedProblem problem{wv, unweighted_problem(wv, parse_model(name).value(), 9),
                              by_table ? &table : nullptr};
      const Model start =
          fit(wv, problem.problem.spec, kRate_hz, {.weighting = Weighting::kCi}).value().model;
      add(settle(problem, start, false));
      add(settle(problem, start, true));
      add(settle_with_model_error(problem, start, 0.2));
      add(settle_with_model_error(problem, std::nullopt, 0.0));
    }
  }
  expect_recorded("models/noise/fixed_points.txt", answer.text(), kSearched, 1e-12);
}

TEST(FitAnswers, WhatMayBeSaidOfParameters) {
  Answer answer;
  const Model model{{kWhite, kFast, kSlow, {ProcessKind::kRandomWalk, 0.0, {}}}};
  const auto places = parameter_places(model);
  const std::vector<int> levels{1, 2, 3, 4, 5, 6, 7, 8};
  const auto wv = wv_of(model.components, 4'000, 32);
  const Eigen::MatrixXd jacobian = wv_jacobian(model, levels, places);
  answer.line("jacobian", jacobian);
  const Eigen::MatrixXd v = sampling_covariance(model, wv, 8);
  const auto present = present_parameters(model);
  const auto add = [&](const ParameterCovariance& c) {
    answer.line("covariance", c.covariance);
    std::string determined;
    for (const bool one : c.determined) determined += one ? '1' : '0';
    answer.line("determined", determined);
  };
  add(parameter_covariance(jacobian, v, v.inverse(), present));
  add(parameter_covariance(jacobian, v, Eigen::MatrixXd::Identity(8, 8), present));
  add(parameter_covariance(100.0 * jacobian, v, v.inverse(), present));
  add(parameter_covariance(jacobian, v, v.inverse(), std::vector<bool>(places.size(), false)));
  // Two that are one.
  Eigen::MatrixXd alike = jacobian;
  alike.col(3) = alike.col(1);
  add(parameter_covariance(alike, v, v.inverse(), present));
  Eigen::VectorXd residual(8);
  for (Eigen::Index i = 0; i < 8; ++i)
    residual[i] = wv.levels[static_cast<std::size_t>(i)].value - model_wv(model, static_cast<int>(i) + 1);
  for (const bool by_weights : {false, true}) {
    for (const double scale : {1.0, 40.0})
      test::add_j_test(answer, j_test(wv, scale * residual, jacobian, v, present, by_weights));
    test::add_j_test(answer, j_test(wv, residual, jacobian, -v, present, by_weights));
    test::add_j_test(answer, j_test(wv, residual, jacobian, v, std::vector<bool>(6, false), by_weights));
  }
  for (const double value : {0.2, 1.0, 3.0}) answer.line(value, near_gaussian_residual(value, 1.1, 0.4));
  expect_recorded("models/noise/inference.txt", answer.text(), 1e-5, 1e-15);
}

TEST(FitAnswers, LooseRates) {
  Answer answer;
  for (const unsigned seed : {33, 34, 35}) {
    const auto wv = wv_of({kWhite, {ProcessKind::kGaussMarkov, 0.3, {0.3, 0.0}}, kWalk}, 3'000, seed);
    for (const char* name : {"WN+GM+RW", "QN+WN+GM"}) {
      const auto fitted = fit(wv, parse_model(name).value(), kRate_hz).value();
      test::add_parameters(answer, fitted);
      const auto places = parameter_places(fitted.model);
      ParameterCovariance loose;
      const auto n = static_cast<Eigen::Index>(places.size());
      loose.covariance = Eigen::MatrixXd::Constant(n, n, 0.03) + 0.05 * Eigen::MatrixXd::Identity(n, n);
      loose.determined.assign(places.size(), true);
      FitResult changed = fitted;
      for (ParameterEstimate& p : changed.parameters) p.log_sd = p.ci_low = p.ci_high = 0.1;
      const Eigen::MatrixXd whitener = whitener_of(sampling_covariance(fitted.model, wv, 9));
      std::string leaning;
      for (const bool one : leaning_on_loose_rates(fitted.model, loose)) leaning += one ? '1' : '0';
      profile_loose_rates(changed, loose, whitener);
      answer.line("leaning", leaning);
      test::add_parameters(answer, changed);
    }
  }
  expect_recorded("models/noise/loose_rates.txt", answer.text(), 1e-4, 1e-9);
}

std::vector<WaveletVariance> replicates(double last_factor) {
  std::vector<WaveletVariance> out;
  for (const unsigned seed : {36, 37, 38, 39}) {
    Component white = kWhite;
    if (seed == 39) white.amplitude *= last_factor;
    out.push_back(wv_of({white, kFast}, 2'000 + 500 * (seed - 36), seed));
  }
  return out;
}

TEST(FitAnswers, Replicates) {
  Answer answer;
  for (const double factor : {1.0, 1.6}) {
    const auto all = replicates(factor);
    test::add_wv(answer, pool(all));
    const auto joint = fit_jointly(all, parse_model("WN+GM").value(), kRate_hz).value();
    test::add_fit(answer, joint.pooled);
    answer.line("separate", joint.separate.size());
    for (const FitResult& one : joint.separate) test::add_parameters(answer, one);
    test::add_j_test(answer, joint.spread.homogeneity);
    for (const auto& e : joint.spread.of_parameters) {
      if (e)
        answer.line(e->mean, e->sd, e->ci_low, e->ci_high, e->spread, e->spread_low, e->spread_high);
      else
        answer.line("none");
    }
    const std::array errors{0.0, 0.05, 0.1, 0.2};
    const auto allowed = test_homogeneity(all, joint.pooled.model, errors);
    test::add_j_test(answer, allowed.test);
    for (const UnitEstimate& unit : allowed.units) answer.line(unit.step, unit.covariance);
    for (const auto& window : all)
      test::add_j_test(answer, distance_from_model(window, joint.separate.back()));
    const auto poor = fit(all[3], parse_model("WN").value(), kRate_hz).value();
    test::add_j_test(answer, distance_from_model(all[0], poor));
    test::add_j_test(answer, distance_from_model(wv_of({kWhite}, 5, 40), poor));
  }
  answer.line(
      fit_jointly(std::vector{replicates(1.0).front()}, parse_model("WN").value(), kRate_hz).error().text());
  EXPECT_FALSE(test_homogeneity(replicates(1.0), {{{ProcessKind::kWhiteNoise, 0.0, {}}}}).test);
  EXPECT_FALSE(test_homogeneity(std::vector{replicates(1.0).front()}, {{kWhite}}).test);
  expect_recorded("models/noise/replicates.txt", answer.text(), kSearched, 1e-9);
}

TEST(FitAnswers, ReplicatesWithHolesPooled) {
  Answer answer;
  std::vector<std::uint8_t> mask(1'500, 1);
  for (std::size_t i = 0; i < mask.size(); ++i)
    if (i % 60 == 31 || (i > 700 && i < 720)) mask[i] = 0;
  WvOptions options;
  options.mask = mask;
  test::add_wv(answer,
               pool(std::vector{wv_of({kWhite, kWalk}, 1'500, 41, options), wv_of({kWhite, kWalk}, 400, 42),
                                wv_of({kWhite, kWalk}, 1'500, 43, options)}));
  options.robust = RobustOptions{};
  test::add_wv(answer,
               pool(std::vector{wv_of({kWhite}, 1'500, 44, options), wv_of({kWhite}, 1'500, 45, options)}));
  expect_recorded("models/noise/pooled.txt", answer.text());
}

TEST(FitAnswers, ModelsRanked) {
  Answer answer;
  for (const auto& [components, n] : std::vector<std::pair<std::vector<Component>, std::size_t>>{
           {{kWhite, kFast}, 4'000}, {{kWhite, kWalk}, 16'000}, {{kWhite}, 500}}) {
    const auto wv = wv_of(components, n, 46);
    const auto ranked = rank_models(wv, parse_model("QN+WN+2*GM+RW").value(), kRate_hz).value();
    for (const RankedModel& m : ranked)
      answer.line(m.fit.spec.name(), m.criterion, m.fit.model_error, m.fit.identifiable, '|', m.reason);
  }
  answer.line(rank_models(wv_of({kWhite}, 16, 47), parse_model("WN+2*GM").value(), kRate_hz).error().text());
  expect_recorded("models/noise/ranked.txt", answer.text(), kSearched, 1e-9);
}

TEST(FitAnswers, ModelsGrown) {
  Answer answer;
  using Kind = ProcessKind;
  constexpr std::array kTerms{Kind::kQuantization, Kind::kWhiteNoise, Kind::kGaussMarkov, Kind::kFlicker,
                              Kind::kRandomWalk,   Kind::kRamp,       Kind::kResonance};
  const std::vector<std::vector<Component>> truths{{kWhite},
                                                   {kWhite, kFast, kWalk},
                                                   {kCoarse, kSlow},
                                                   {kWhite, {Kind::kFlicker, 0.4, {}}},
                                                   {kWhite, {Kind::kResonance, 2.0, {0.1, 0.8}}},
                                                   {kFast, kSlow, kRamp}};
  unsigned seed = 50;
  for (const auto& truth : truths) {
    FitOptions options;
    if (seed % 2 == 0) options.intervals = Intervals::kInverted;
    const auto grown = grow_model(wv_of(truth, 8'000, seed++), kTerms, kRate_hz, options).value();
    test::add_fit(answer, grown.best);
    for (const FitResult& rival : grown.rivals)
      answer.line("rival", rival.spec.name(), rival.criterion, rival.identifiable, rival.model_error);
  }
  answer.line(grow_model(wv_of({kWhite}, 64, 60), std::array{Kind::kGaussMarkov}, kRate_hz, {.levels = 1})
                  .error()
                  .text());
  expect_recorded("models/noise/grown.txt", answer.text(), 1e-4, 1e-9);
}

// A model of no amplitude has nothing that a test could reject: it is no better than one that is rejected.
TEST(FitAnswers, AModelWithoutNoiseIsNeverTheBest) {
  std::vector<std::uint8_t> mask(2'000, 1);
  for (std::size_t i = 3; i < mask.size(); i += 71) mask[i] = 0;
  WvOptions options;
  options.mask = mask;
  const auto wv = wv_of({{ProcessKind::kResonance, 2e-3, {0.1, 1.4}}, kSlow}, mask.size(), 3, options);
  const auto quantized = fit(wv, parse_model("QN").value(), kRate_hz).value();
  ASSERT_EQ(quantized.model.components.front().amplitude, 0.0);
  const auto grown =
      grow_model(wv, std::array{ProcessKind::kRandomWalk, ProcessKind::kQuantization}, kRate_hz).value();
  EXPECT_EQ(grown.best.spec.name(), "WN+RW");
  const auto none = grow_model(wv, std::array{ProcessKind::kQuantization}, kRate_hz);
  ASSERT_FALSE(none);
  EXPECT_EQ(none.error().what, "the record supports no QN");
  const auto ranked = rank_models(wv, parse_model("QN+RW").value(), kRate_hz).value();
  EXPECT_EQ(ranked.back().fit.spec.name(), "QN");
}

TEST(FitAnswers, ModelsCrossValidated) {
  Answer answer;
  auto all = replicates(1.0);
  const auto validated = cross_validate(all, parse_model("WN+GM+RW").value(), kRate_hz).value();
  for (const CrossValidated& m : validated)
    answer.line(m.pooled.spec.name(), m.score, m.worse_by, m.worse_by_sd, '|', m.reason);
  all.push_back(wv_of({kWhite}, 5, 61));
  answer.line(cross_validate(all, parse_model("WN").value(), kRate_hz).error().text());
  all.resize(2);
  answer.line(cross_validate(all, parse_model("WN").value(), kRate_hz).error().text());
  expect_recorded("models/noise/cross_validated.txt", answer.text(), kSearched, 1e-9);
}

void add_comparison(Answer& answer, const FitResult& a, const FitResult& b) {
  const Comparison c = compare(a, b);
  for (const ComparedParameter& p : c.parameters)
    answer.line(p.process, p.name, '[' + p.unit + ']', p.first, p.second, p.ratio, p.ratio_ci_low,
                p.ratio_ci_high, p.p_value);
  if (c.test)
    answer.line("test", c.test->statistic, c.test->dof, c.test->p_value);
  else
    answer.line("no test");
  for (const std::string& warning : c.warnings) answer.line(warning);
}

TEST(FitAnswers, FitsCompared) {
  Answer answer;
  const auto fitted = [](const std::vector<Component>& truth, std::size_t n, unsigned seed, const char* model,
                         const FitOptions& options = {}) {
    return fit(wv_of(truth, n, seed), parse_model(model).value(), kRate_hz, options).value();
  };
  const auto first = fitted({kWhite, kFast}, 8'000, 62, "WN+GM", {.confidence = 0.8});
  add_comparison(answer, first, first);
  add_comparison(answer, first, fitted({kWhite, kFast}, 4'000, 63, "WN+GM"));
  add_comparison(answer, fitted({kWhite, kFast}, 2'000, 64, "WN+GM+RW"), first);
  add_comparison(answer, first, fitted({kWhite, kSlow}, 3'000, 65, "WN+GM"));
  add_comparison(answer, first, fitted({kWhite, kFast}, 4'000, 66, "WN+GM", {.signal_unit = "g"}));
  auto other = fitted({kWhite, kFast}, 4'000, 67, "WN+GM");
  other.rate_hz = 100.0;
  add_comparison(answer, first, other);
  other.rate_hz = kRate_hz;
  other.efficiency = 0.6;
  add_comparison(answer, first, other);
  other.efficiency = 1.0;
  other.covariance.clear();
  add_comparison(answer, first, other);
  const std::vector<Component> special{kWhite, {ProcessKind::kArma11, 1.0, {0.9, 0.2}}, kRamp};
  add_comparison(answer, fitted(special, 8'000, 68, "ARMA11+DR"), fitted(special, 16'000, 69, "ARMA11+DR"));
  expect_recorded("models/noise/compared.txt", answer.text(), kSearched, 1e-12);
}

TEST(FitAnswers, OverBoundingModels) {
  Answer answer;
  unsigned seed = 70;
  for (const char* model : {"WN", "WN+RW", "WN+2*GM", "QN+WN+FN+DR"}) {
    const auto fitted =
        fit(wv_of({kWhite, kFast, kWalk}, 4'000, seed++), parse_model(model).value(), kRate_hz).value();
    const auto bound = over_bounding(fitted);
    test::add_fit(answer, bound);
    answer.line("largest increase", largest_increase(fitted, bound), largest_increase(bound, fitted));
  }
  expect_recorded("models/noise/over_bounding.txt", answer.text(), kSearched, 1e-9);
}

std::vector<DrivenWindow> driven_windows(std::size_t n, std::size_t drivers, unsigned seed) {
  std::vector<DrivenWindow> out;
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  for (std::size_t w = 0; w < n; ++w) {
    DrivenWindow window;
    for (std::size_t k = 0; k < drivers; ++k) window.drivers.push_back(5.0 + 2.0 * normal(random));
    const double change = 0.2 * (window.drivers[0] - 5.0);
    Component white = kWhite;
    Component fast = kFast;
    white.amplitude *= std::exp(change);
    fast.amplitude *= std::exp(-change);
    auto x = simulated_noise({{white, fast}}, 1'000, random);
    if (w % 9 == 4) x[500] += 60.0;
    window.wv = haar_wavelet_variance(x).value();
    out.push_back(window);
  }
  return out;
}

void add_dependence(Answer& answer, const Result<Dependence>& d) {
  if (!d) {
    answer.line(d.error().text());
    return;
  }
  answer.line("windows", d->n_windows, d->n_far, d->mean_drivers);
  for (const ParameterSlope& s : d->slopes)
    answer.line(s.driver, s.process, s.name, '[' + s.unit + ']', s.at_mean_driver, s.slope, s.sd, s.ci_low,
                s.ci_high, s.p_value);
  for (const UndeterminedSlope& u : d->undetermined) answer.line(u.driver, u.process, u.name, u.why);
  test::add_model(answer, d->at_mean_driver);
}

TEST(FitAnswers, Dependences) {
  Answer answer;
  const auto start = fit(wv_of({kWhite, kFast}, 32'000, 80), parse_model("WN+GM").value(), kRate_hz).value();
  const auto more =
      fit(wv_of({kWhite, kFast, kWalk}, 32'000, 81), parse_model("QN+WN+GM+RW").value(), kRate_hz).value();
  auto windows = driven_windows(30, 1, 82);
  add_dependence(answer, fit_dependence(windows, start));
  add_dependence(answer, fit_dependence(windows, start, {.confidence = 0.8, .signal_unit = "g"}));
  add_dependence(answer, fit_dependence(windows, more));
  add_dependence(answer, fit_dependence(driven_windows(26, 2, 83), start));
  add_dependence(answer, fit_dependence(driven_windows(23, 2, 84), start));
  add_dependence(answer, fit_dependence(std::span(windows).first(11), start));
  add_dependence(answer, fit_dependence(std::span(windows).first(12), start));
  add_dependence(answer, fit_dependence({}, start));
  for (const DrivenWindow& window : std::span(windows).first(8)) {
    const auto white = white_noise_of(window.wv, start.model, 0.9);
    if (white)
      answer.line(white->value, white->ci_low, white->ci_high);
    else
      answer.line("none");
  }
  EXPECT_FALSE(white_noise_of({}, start.model, 0.9));
  EXPECT_FALSE(white_noise_of(windows.front().wv, {{kFast}}, 0.9));
  EXPECT_FALSE(white_noise_of(windows.front().wv, {{kWhite, {ProcessKind::kQuantization, 50.0, {}}}}, 0.9));
  auto odd = windows;
  for (DrivenWindow& window : odd) window.drivers[0] = 3.0;
  add_dependence(answer, fit_dependence(odd, start));
  odd[7].drivers[0] = std::nan("");
  add_dependence(answer, fit_dependence(odd, start));
  for (DrivenWindow& window : odd) window.wv.levels.resize(0);
  add_dependence(answer, fit_dependence(odd, start));
  expect_recorded("models/noise/dependences.txt", answer.text(), 1e-4, 1e-9);
}

}  // namespace
}  // namespace imuscope::noise::fit_answers
