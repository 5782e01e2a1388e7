/// What filters, tools and files are told of a fit, as it was once. The fits are made up, without a search: every
/// number follows from the model in closed form.

#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "answer.h"
#include "models/noise/export.h"
#include "models/noise/felt_noise.h"
#include "models/noise/filter_form.h"
#include "models/noise/inference.h"
#include "models/noise/json.h"
#include "models/noise/lines.h"
#include "models/noise/quantities.h"
#include "models/noise/select.h"
#include "tests/support/recorded_answer.h"

namespace imuscope::noise::filter_answers {
namespace {

using imuscope::test::expect_recorded;
using test::Answer;

constexpr double kRate_hz = 50.0;

/// Which parameters have which ends of their intervals.
enum class Told { kAll, kUpperEnds, kNothing };

/// Levels that lie about the model by a few per cent, and parameters with intervals of their own.
FitResult made_fit(const std::vector<Component>& components, Told told, double model_error = 0.0,
                   double observed_factor = 1.0) {
  FitResult fit;
  fit.model.components = components;
  for (const Component& c : components) fit.spec.processes.push_back(c.kind);
  fit.n = 40'000;
  fit.stretches = 3;
  fit.rate_hz = kRate_hz;
  fit.confidence = 0.9;
  fit.model_error = model_error;
  for (int level = 1; level <= 13; ++level) {
    FittedLevel row;
    row.observed.level = level;
    row.observed.tau_samples = std::ldexp(1.0, level);
    row.fitted = model_wv(fit.model, level);
    row.observed.value = observed_factor * row.fitted * (1.0 + 0.02 * std::sin(level));
    row.observed.n_coefficients = 40'001 - (std::uint64_t{1} << static_cast<unsigned>(level));
    row.observed.ci_low = 0.9 * row.observed.value;
    row.observed.ci_high = 1.15 * row.observed.value;
    row.model_ci_low = 0.92 * row.observed.value;
    row.model_ci_high = 1.1 * row.observed.value;
    fit.wv.push_back(row);
  }
  ParameterCovariance covariance;
  const auto n = static_cast<Eigen::Index>(parameter_places(fit.model).size());
  covariance.covariance = 0.01 * (Eigen::MatrixXd::Identity(n, n) + Eigen::MatrixXd::Constant(n, n, 0.1));
  covariance.determined.assign(static_cast<std::size_t>(n), told != Told::kNothing);
  report_parameters(fit, covariance, {.confidence = 0.9, .signal_unit = "rad/s"}, 13);
  if (told == Told::kUpperEnds) {
    for (ParameterEstimate& p : fit.parameters) p.ci_low.reset();
  }
  return fit;
}

const Component kWhite{ProcessKind::kWhiteNoise, 4e-6, {}};
const Component kCoarse{ProcessKind::kQuantization, 1e-6, {}};
const Component kFast{ProcessKind::kGaussMarkov, 2e-6, {0.5, 0.0}};     // 0.04 s
const Component kEdge{ProcessKind::kGaussMarkov, 1e-6, {0.025, 0.0}};   // 0.8 s
const Component kSlow{ProcessKind::kGaussMarkov, 5e-7, {0.001, 0.0}};   // 20 s
const Component kSlower{ProcessKind::kGaussMarkov, 3e-7, {5e-5, 0.0}};  // 400 s
const Component kWalk{ProcessKind::kRandomWalk, 1e-10, {}};
const Component kFlicker{ProcessKind::kFlicker, 2e-8, {}};
const Component kLaw{ProcessKind::kPowerLaw, 1e-8, {1.4, 0.0}};
const Component kRamp{ProcessKind::kRamp, 1e-16, {}};
const Component kRinging{ProcessKind::kResonance, 3e-6, {0.2, 1.0}};
const Component kMoving{ProcessKind::kMa1, 2e-6, {0.5, 0.0}};
const Component kMixed{ProcessKind::kArma11, 2e-6, {0.7, -0.2}};
const Component kLine{ProcessKind::kSinusoid, 1e-6, {0.3, 0.0}};
Component without(Component c) {
  c.amplitude = 0.0;
  return c;
}

const std::vector<std::vector<Component>> kModels{
    {kWhite},
    {kWhite, kWalk},
    {kWhite, without(kWalk)},
    {kWhite, kFast, kSlow},
    {kWhite, kEdge},
    {kEdge, kWalk},
    {kWhite, kSlow, kSlower},
    {kCoarse, kWhite, kFlicker},
    {kWhite, kRamp},
    {kCoarse, kWhite, kRinging, kSlow},
    {kMoving, kSlow},
    {kMixed, kRamp},
    {kWhite, kLine, kEdge, kSlow, kWalk},
    {without(kWhite), kFast},
    {kCoarse, kWhite, kMoving, kMixed, kLine, kRinging, kFast, kSlow, kFlicker, kWalk, kRamp}};

void add_felt(Answer& answer, std::string_view what, const Felt& f) {
  answer.line(what, f.value, f.upper, f.lower, knowledge_name(f.knowledge));
}

void add_with_bias(Answer& answer, const FeltWithBias& f) {
  add_felt(answer, "white beside bias", f.white_density);
  add_felt(answer, "bias", f.bias.variance);
  answer.line("time", f.bias.tau_s, f.bias.tau_log_sd, f.bias.as_fitted);
}

void add_all_felt(Answer& answer, const FitResult& fit, const FilterBand& band) {
  answer.line("band", band.from_s, band.to_s, white_density(fit.model, fit.rate_hz, band));
  add_felt(answer, "white", felt_white_density(fit, band));
  add_felt(answer, "walk", felt_walk_density(fit, band));
  add_felt(answer, "beside", felt_white_beside_bias(fit, band));
  add_with_bias(answer, felt_with_bias(fit, band));
  for (const double tau_s : {19.0, 300.0}) add_with_bias(answer, felt_with_bias(fit, band, tau_s));
  const SlowTerms slow = slow_terms(fit, band);
  answer.line("slow", slow.names, slow.kinds.size(), slow.are_just(ProcessKind::kRandomWalk),
              slow.are_just(ProcessKind::kGaussMarkov));
  answer.line("missed", missed_level(fit, band));
}

void add_terms(Answer& answer, const FitResult& fit) {
  const FilterTerms terms = filter_terms(fit);
  answer.line("terms", terms.rate_hz, terms.white_variance, terms.white_is_determined,
              terms.short_memory_density, terms.walk_density, terms.white_density());
  for (const auto& gm : terms.gauss_markov)
    answer.line(gm.variance, gm.rate_per_s, gm.is_determined, gm.tau_s(), gm.is_fast(),
                terms.low_frequency_density(gm));
  answer.line("bias", terms.bias().variance, terms.bias().rate_per_s);
  for (std::size_t i = 0; i < fit.model.components.size(); ++i)
    add_felt(answer, "amplitude", felt_amplitude(fit, i));
  answer.line("variance of a sample", white_variance_of_sample(fit));
}

TEST(FilterAnswers, WhatIsFelt) {
  Answer answer;
  for (const auto& components : kModels) {
    answer.line(component_names({components}));
    const auto fit = made_fit(components, Told::kAll);
    add_all_felt(answer, fit, {});
    add_terms(answer, fit);
  }
  expect_recorded("models/noise/felt.txt", answer.text(), 1e-6, 1e-30);
}

TEST(FilterAnswers, TermsOfAPowerLaw) {
  Answer answer;
  for (const Told told : {Told::kAll, Told::kNothing}) {
    const auto fit = made_fit({kWhite, kLaw}, told);
    add_felt(answer, "white", felt_white_density(fit, {}));
    const FilterTerms terms = filter_terms(fit);
    answer.line(terms.short_memory_density, terms.walk_density);
    for (const auto& gm : terms.gauss_markov) answer.line(gm.variance, gm.rate_per_s, gm.is_determined);
    answer.line("bias", terms.bias().variance, terms.bias().rate_per_s);
  }
  expect_recorded("models/noise/terms_of_a_power_law.txt", answer.text(), 1e-6, 1e-30);
}

TEST(FilterAnswers, WhatIsFeltOfAnotherBand) {
  Answer answer;
  for (const std::size_t i : {1, 3, 4, 5, 6, 9, 12}) {
    answer.line(component_names({kModels[i]}));
    auto fit = made_fit(kModels[i], Told::kAll, 0.2);
    for (ParameterEstimate& p : fit.parameters) p.spread_sd = 0.1;
    add_all_felt(answer, fit, {0.02, 10.0});
    add_all_felt(answer, fit, {1.0, 1000.0});
  }
  expect_recorded("models/noise/felt_of_bands.txt", answer.text(), 1e-6, 1e-30);
}

TEST(FilterAnswers, WhatIsFeltOfWhatIsHardlyTold) {
  Answer answer;
  for (const std::size_t i : {1, 2, 3, 5, 6, 7, 11, 13}) {
    for (const Told told : {Told::kUpperEnds, Told::kNothing}) {
      for (const double error : {0.0, 0.3}) {
        answer.line(component_names({kModels[i]}), static_cast<int>(told), error);
        auto fit = made_fit(kModels[i], told, error, 1.3);
        fit.intervals = Intervals::kInverted;
        add_all_felt(answer, fit, {});
        add_terms(answer, fit);
      }
    }
  }
  // Of a record of few levels, and of none.
  auto few = made_fit(kModels[3], Told::kAll);
  few.wv.resize(4);
  add_all_felt(answer, few, {});
  few.wv.clear();
  add_all_felt(answer, few, {});
  expect_recorded("models/noise/felt_hardly.txt", answer.text(), 1e-6, 1e-30);
}

TEST(FilterAnswers, LevelsThatAreMissed) {
  Answer answer;
  for (const double factor : {0.2, 0.6, 1.0, 1.5, 3.0}) {
    for (const double error : {0.0, 0.5, 0.99, 1.0, 1.7})
      answer.line(factor, error, missed_level(made_fit(kModels[3], Told::kAll, error, factor), {}));
  }
  // By one level alone, at the ends of the band, and beyond them.
  for (const std::size_t level : {3, 4, 5, 6, 10, 11, 12}) {
    auto fit = made_fit(kModels[3], Told::kAll);
    fit.wv[level].fitted *= 4.0;
    answer.line(level, missed_level(fit, {1.28, 81.92}), '|', missed_level(fit, {}));
  }
  expect_recorded("models/noise/missed_levels.txt", answer.text());
}

void add_quantities(Answer& answer, const std::vector<Quantity>& quantities) {
  for (const Quantity& q : quantities)
    answer.line(q.process, '|', q.name, '|', q.unit, '|', q.value, q.ci_low, q.ci_high,
                knowledge_name(q.knowledge));
}

TEST(FilterAnswers, Quantities) {
  Answer answer;
  for (const SignalUnit unit :
       {SignalUnit::kNone, SignalUnit::kRadps, SignalUnit::kDegps, SignalUnit::kMps2, SignalUnit::kG}) {
    answer.line(unit_name(unit), is_gyro(unit), si_factor(unit),
                unit_name(parse_unit(unit_name(unit)).value()));
    for (const std::size_t i : {1, 3, 9, 14})
      add_quantities(answer, filter_quantities(made_fit(kModels[i], Told::kAll), unit));
    add_quantities(answer, filter_quantities(made_fit(kModels[12], Told::kNothing), unit));
    add_quantities(answer, filter_quantities(made_fit(kModels[11], Told::kUpperEnds), unit));
    add_quantities(answer, over_bounding_quantities(made_fit(kModels[6], Told::kAll), unit));
    add_quantities(answer, over_bounding_quantities(made_fit(kModels[8], Told::kNothing), unit));
  }
  auto bare = made_fit(kModels[3], Told::kAll);
  bare.covariance.clear();
  bare.wv.clear();
  add_quantities(answer, filter_quantities(bare, SignalUnit::kRadps));
  answer.line(parse_unit("m/s").error().text());
  expect_recorded("models/noise/quantities.txt", answer.text(), 1e-6, 1e-30);
}

constexpr const char* kFormats[] = {"kalibr", "openvins", "vins-fusion", "lio-sam",    "gtsam",
                                    "ros",    "px4",      "kf-gins",     "state-space"};

std::vector<AxisFit> axes_of(const std::vector<std::size_t>& models, Told told) {
  std::vector<AxisFit> out;
  for (std::size_t k = 0; k < models.size(); ++k) {
    const bool gyro = k < 3;
    AxisFit axis;
    axis.axis = std::string(gyro ? "gyro_" : "accel_") + "xyz"[k % 3];
    axis.unit = gyro ? SignalUnit::kDegps : SignalUnit::kG;
    axis.fit = made_fit(kModels[models[k]], told);
    if (k % 2 == 1) axis.source = "812 s of regime static";
    out.push_back(axis);
  }
  return out;
}

void add_export(Answer& answer, const std::vector<AxisFit>& axes, const char* format,
                const ExportOptions& options) {
  const auto text = export_models(axes, parse_export_format(format).value(), options);
  answer.line("===", format, options.conservative, options.force, text.has_value());
  answer.line(text ? *text : text.error().text());
}

TEST(FilterAnswers, ExportsOfSixAxes) {
  Answer answer;
  const auto axes = axes_of({1, 3, 6, 5, 9, 10}, Told::kAll);
  for (const char* format : kFormats) {
    if (std::string_view(format) == "state-space") continue;
    add_export(answer, axes, format, {});
    add_export(answer, axes, format, {.conservative = true, .force = false});
  }
  expect_recorded("models/noise/exports.txt", answer.text(), 1e-6, 1e-30);
}

TEST(FilterAnswers, ExportsOfFewAxes) {
  Answer answer;
  const auto gyros = axes_of({3, 1}, Told::kNothing);
  auto bounded = axes_of({2, 3, 13, 2, 8}, Told::kUpperEnds);
  for (AxisFit& axis : bounded) axis.fit.wv.resize(8);
  bounded.erase(bounded.begin(), bounded.begin() + 3);
  for (const char* format : kFormats) {
    if (std::string_view(format) == "state-space") continue;
    add_export(answer, gyros, format, {});
    add_export(answer, gyros, format, {.conservative = true, .force = true});
    add_export(answer, bounded, format, {});
    add_export(answer, bounded, format, {.conservative = true, .force = true});
  }
  expect_recorded("models/noise/exports_of_few.txt", answer.text(), 1e-6, 1e-30);
}

TEST(FilterAnswers, ExportsOfMatrices) {
  Answer answer;
  add_export(answer, axes_of({1, 3, 2}, Told::kAll), "state-space", {});
  add_export(answer, axes_of({12}, Told::kAll), "state-space", {.conservative = true, .force = false});
  add_export(answer, axes_of({9}, Told::kUpperEnds), "state-space", {});
  add_export(answer, axes_of({3}, Told::kNothing), "state-space", {.conservative = true, .force = true});
  expect_recorded("models/noise/exports_of_matrices.txt", answer.text(), 1e-6, 1e-30);
}

TEST(FilterAnswers, ExportsThatAreRefused) {
  Answer answer;
  auto axes = axes_of({1, 3}, Told::kAll);
  axes[1].fit.rate_hz = 100.0;
  add_export(answer, axes, "kalibr", {});
  axes[1].fit.rate_hz = kRate_hz;
  axes[0].unit = SignalUnit::kNone;
  add_export(answer, axes, "ros", {.force = true});
  add_export(answer, {}, "ros", {});
  axes[0].unit = SignalUnit::kRadps;
  for (FittedLevel& level : axes[0].fit.wv) level.fitted *= 3.0;
  add_export(answer, axes, "px4", {});
  add_export(answer, axes, "px4", {.force = true});
  answer.line(parse_export_format("ros2").error().text());
  expect_recorded("models/noise/exports_refused.txt", answer.text(), 1e-6, 1e-30);
}

TEST(FilterAnswers, FitsAsJson) {
  Answer answer;
  auto full = made_fit(kModels[14], Told::kAll, 0.1);
  full.j_test = JTest{3.5, 4, 0.4};
  full.objective = 7.25;
  full.criterion = 11.5;
  full.simpler_model = "WN";
  full.identifiable = false;
  full.warnings = {"one", "two"};
  full.parameters[1].spread_sd = 0.2;
  full.wv[2].observed.inflation = 1.25;
  answer.line(fit_to_json(full, SignalUnit::kRadps).dump(1));
  auto sparse = made_fit(kModels[3], Told::kNothing);
  sparse.stretches = 0;
  sparse.efficiency = 0.6;
  sparse.weighting = Weighting::kCi;
  sparse.intervals = Intervals::kInverted;
  sparse.wv[0].model_ci_high = 0.0;
  sparse.objective = std::nan("");
  answer.line(fit_to_json(sparse).dump(1));
  // Read again, all of it comes back.
  for (const FitResult& fit : {full, sparse}) {
    const auto again = fit_from_json(fit_to_json(fit)).value();
    EXPECT_EQ(fit_to_json(again), fit_to_json(fit));
    EXPECT_EQ(again.model.components.size(), fit.model.components.size());
    for (std::size_t i = 0; i < fit.model.components.size(); ++i) {
      EXPECT_NEAR(again.model.components[i].amplitude, fit.model.components[i].amplitude,
                  1e-12 * fit.model.components[i].amplitude);
      for (std::size_t s = 0; s < 2; ++s)
        EXPECT_NEAR(again.model.components[i].shape[s], fit.model.components[i].shape[s], 1e-12);
    }
  }
  expect_recorded("models/noise/fits_as_json.txt", answer.text(), 1e-6, 1e-30);
}

TEST(FilterAnswers, JsonThatIsNoFit) {
  Answer answer;
  const auto whole = fit_to_json(made_fit(kModels[3], Told::kAll));
  const auto add = [&](const nlohmann::json& json) {
    const auto fit = fit_from_json(json);
    answer.line(fit ? "taken" : fit.error().text());
  };
  for (const auto& [key, value] : whole.items()) {
    auto less = whole;
    less.erase(key);
    answer.line("without", key);
    add(less);
    less[key] = nlohmann::json::object();
    add(less);
  }
  auto odd = whole;
  for (const double rate_hz : {0.0, -1.0}) {
    odd["rate_hz"] = rate_hz;
    add(odd);
  }
  odd = whole;
  for (const double confidence : {0.0, 1e-9, 1.0}) {
    odd["confidence"] = confidence;
    add(odd);
  }
  odd = whole;
  for (const double level : {0.0, 1.5, 32.0, 33.0}) {
    odd["wv"][0]["level"] = level;
    add(odd);
  }
  odd = whole;
  odd["model"] = "WN+XY";
  add(odd);
  odd["model"] = "WN+3*GM";
  add(odd);
  odd = whole;
  odd["parameters"][1]["value"] = -1.0;
  add(odd);
  add(nlohmann::json::array());
  expect_recorded("models/noise/no_fits.txt", answer.text());
}

TEST(FilterAnswers, OtherThingsAsJson) {
  Answer answer;
  WaveletVariance wv;
  wv.n_samples = 100;
  wv.n_valid = 90;
  for (const FittedLevel& level : made_fit(kModels[1], Told::kAll).wv) wv.levels.push_back(level.observed);
  wv.levels.resize(3);
  answer.line(wv_to_json(wv, kRate_hz).dump(1));
  wv.efficiency = 0.6;
  wv.levels[1].rejected_share = 0.125;
  wv.levels[2].value = HUGE_VAL;
  answer.line(wv_to_json(wv, kRate_hz).dump(1));
  std::vector<RankedModel> ranked(2);
  ranked[0].fit = made_fit(kModels[1], Told::kAll);
  ranked[0].criterion = 4.5;
  ranked[0].reason = "smallest criterion";
  ranked[1].fit = made_fit(kModels[3], Told::kNothing);
  ranked[1].fit.j_test = JTest{1.0, 2, 0.625};
  answer.line(ranking_to_json(ranked).dump(1));
  Line line;
  line.frequency_hz = 7.5;
  line.frequency_sd_hz = 0.01;
  line.amplitude = 0.002;
  line.amplitude_sd = 0.0015;
  auto fit = made_fit(kModels[1], Told::kAll);
  fit.wv.resize(3);
  answer.line(sinusoids_to_json({line, line}, fit, "rad/s").dump(1));
  expect_recorded("models/noise/things_as_json.txt", answer.text(), 1e-6, 1e-30);
}

TEST(FilterAnswers, WhatAnEntryWasFittedTo) {
  Answer answer;
  nlohmann::json entry;
  const auto add = [&] { answer.line('"' + fitted_to_words(entry) + '"'); };
  add();
  entry = {{"fitted_to", 3}};
  add();
  entry = {{"fitted_to", {{"stretches", 1}}}};
  add();
  entry = {{"fitted_to", {{"seconds", 812.25}}}};
  add();
  entry["fitted_to"]["stretches"] = 1;
  add();
  entry["fitted_to"]["stretches"] = 9;
  entry["regime"] = "static";
  add();
  entry["fitted_to"]["begin_s"] = 3.04;
  add();
  entry["fitted_to"]["end_s"] = 1805.16;
  add();
  entry["sinusoids"] = {
      {{"parameters", {{{"name", "alpha"}, {"value", 1.0}}, {{"name", "frequency"}, {"value", 21.3}}}}},
      {{"parameters", {{{"name", "frequency"}, {"value", 0.4}}, 5}}},
      7,
      {{"parameters", 8}},
      {{"parameters", {{{"name", "frequency"}, {"value", "much"}}}}}};
  add();
  entry["regime"] = "";
  add();
  entry["sinusoids"] = 5;
  entry["regime"] = 5;
  add();
  expect_recorded("models/noise/fitted_to.txt", answer.text());
}

TEST(FilterAnswers, ModelsFromValues) {
  Answer answer;
  const std::map<std::string, ProcessValues> all{
      {"QN", {{"q2", 0.5}}},
      {"WN", {{"sigma2", 2.0}}},
      {"MA1", {{"theta", 0.3}, {"sigma2", 1.5}}},
      {"ARMA11", {{"phi", 0.9}, {"theta", -0.4}, {"sigma2", 0.25}}},
      {"SIN1", {{"frequency", 5.0}, {"alpha", 0.2}}},
      {"RES1", {{"damping", 4.0}, {"frequency", 11.0}, {"sigma2", 0.75}}},
      {"GM1", {{"beta", 3.0}, {"sigma2", 0.125}}},
      {"FN", {{"B", 0.3}}},
      {"PL", {{"exponent", 1.3}, {"sigma2", 0.6}}},
      {"RW", {{"gamma2", 1e-3}}},
      {"DR", {{"omega", 1e-4}}}};
  const auto spec = parse_model("QN+WN+MA1+ARMA11+SIN+RES+GM+FN+PL+RW+DR").value();
  const auto add = [&](double rate_hz, const std::map<std::string, ProcessValues>& values) {
    const auto model = model_from_values(spec, rate_hz, values);
    if (model)
      test::add_model(answer, *model);
    else
      answer.line(model.error().text());
  };
  add(100.0, all);
  for (const double rate_hz : {0.0, -1.0, HUGE_VAL}) add(rate_hz, all);
  auto wrong = all;
  for (const auto& [process, values] : all) {
    wrong = all;
    wrong.erase(process);
    add(100.0, wrong);
    for (const auto& [name, value] : values) {
      for (const double odd : {-3.0, 0.0, HUGE_VAL}) {
        wrong = all;
        wrong[process][name] = odd;
        answer.line(process, name, odd);
        add(100.0, wrong);
      }
      wrong = all;
      wrong[process].erase(name);
      add(100.0, wrong);
    }
    wrong = all;
    wrong[process]["speed"] = 1.0;
    add(100.0, wrong);
  }
  wrong = all;
  wrong["GM2"] = {};
  add(100.0, wrong);
  expect_recorded("models/noise/models_from_values.txt", answer.text());
}

}  // namespace
}  // namespace imuscope::noise::filter_answers
