/// Whole certificates, data sheets beside them, populations and joint axes, as they were once.

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <limits>
#include <memory>
#include <nlohmann/json.hpp>
#include <random>
#include <string>
#include <vector>

#include "made_record.h"
#include "models/certificate/data_sheet.h"
#include "models/certificate/joint_axes.h"
#include "models/certificate/json.h"
#include "models/certificate/models_interval.h"
#include "models/certificate/record_checks.h"
#include "models/certificate/temperature.h"
#include "models/certificate/units.h"
#include "models/noise/inference.h"
#include "models/noise/simulated_noise.h"
#include "tests/support/answer.h"
#include "tests/support/recorded_answer.h"

namespace imuscope::certificate::certificate_answers {
namespace {

using imuscope::test::Answer;
using imuscope::test::expect_recorded;
using nlohmann::json;
using noise::ProcessKind;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
/// Of numbers that a search for a model ends at.
constexpr double kSearched = 1e-4;

bool is_plain(const json& value) {
  return std::ranges::none_of(value, [](const json& one) { return one.is_structured(); });
}

/// What holds plain values alone, a line each.
void add_json(Answer& answer, const std::string& name, const json& value) {
  if (!value.is_structured()) {
    answer.line(name, value.is_number_float() ? fmt::format("{:.9g}", value.get<double>()) : value.dump());
    return;
  }
  if (is_plain(value)) {
    std::string row;
    for (const auto& [key, one] : value.items())
      row += (value.is_object() ? ' ' + key + '=' : " ") +
             (one.is_number_float() ? fmt::format("{:.9g}", one.get<double>()) : one.dump());
    answer.line(name + ':' + row);
    return;
  }
  for (const auto& [key, one] : value.items()) add_json(answer, name + '/' + key, one);
}

AxisRecord made(const noise::Model& model, std::size_t n, unsigned seed, std::string name,
                noise::SignalUnit unit) {
  std::mt19937_64 random(seed);
  AxisRecord record;
  record.name = std::move(name);
  record.unit = unit;
  record.rate_hz = 100.0;
  record.values = noise::simulated_noise(model, n, random);
  for (double& v : record.values) v += 0.5;
  return record;
}

const noise::Model kGyro{{{ProcessKind::kWhiteNoise, 0.04, {}}, {ProcessKind::kRandomWalk, 1e-6, {}}}};

void add_certificate(Answer& answer, const AxisRecord& record, const AxisOptions& options = {}) {
  const auto axis = characterize_axis(record, options);
  if (!axis) {
    answer.line(static_cast<int>(axis.error().kind), axis.error().text());
    return;
  }
  const Origin origin{"a sensor", {"one.csv", "two.csv"}, "whole files", "2026-11-27T00:00:00Z", "1.0"};
  json all = to_json(origin, {*axis});
  all["axes"][0].erase("density");
  all["axes"][0]["fit"].erase("wv");
  add_json(answer, "", all);
  answer.line("densities", axis->density.size());
  if (!axis->density.empty())
    answer.line(axis->density.front().frequency_hz, axis->density.back().frequency_hz);
  if (axis->tails) answer.line("tails", axis->tails->statistic, axis->tails->level, axis->tails->dof);
}

TEST(CertificateAnswers, AGyroscopeThatShowsItsRandomWalk) {
  Answer answer;
  add_certificate(answer, made(kGyro, 20'000, 2, "gyro_x", noise::SignalUnit::kDegps), {.model = "WN+RW"});
  expect_recorded("models/certificate/gyro.txt", answer.text(), kSearched, 1e-15);
}

TEST(CertificateAnswers, AnAccelerometerWithAllThereIsToSee) {
  Answer answer;
  const noise::Model model{{{ProcessKind::kQuantization, 2e-5, {}},
                            {ProcessKind::kWhiteNoise, 1e-4, {}},
                            {ProcessKind::kResonance, 2e-3, {0.1, 1.4}},
                            {ProcessKind::kGaussMarkov, 1e-6, {1e-3, 0.0}}}};
  auto record = made(model, 8'000, 3, "accel_z", noise::SignalUnit::kG);
  auto temperature = std::make_shared<std::vector<float>>();
  for (std::size_t i = 0; i < record.values.size(); ++i) {
    const double t = static_cast<double>(i) / 100.0;
    temperature->push_back(static_cast<float>(25.0 + 3.0 * std::sin(t / 30.0)));
    record.values[i] += 0.02 * std::sin(2.0 * M_PI * 11.0 * t) + 0.001 * temperature->back();
    record.values[i] *= i > 4'000 ? 1.2 : 1.0;
    if (i % 300 == 40) record.values[i] += 0.5;
    if (i % 71 == 3) record.values[i] = kNan;
  }
  record.temperature_c = temperature;
  record.mask.assign(record.values.size(), 1);
  std::fill_n(record.mask.begin() + 5'000, 60, std::uint8_t{0});
  add_certificate(answer, record, {.confidence = 0.9, .model = "QN+WN+GM+RES"});
  expect_recorded("models/certificate/accel.txt", answer.text(), kSearched, 1e-15);
}

TEST(CertificateAnswers, ShortAndOddRecords) {
  Answer answer;
  add_certificate(answer, made(kGyro, 2'000, 4, "gyro_y", noise::SignalUnit::kRadps));
  const auto record = made(kGyro, 200, 5, "gyro_z", noise::SignalUnit::kRadps);
  add_certificate(answer, record, {.model = "WN"});
  add_certificate(answer, record, {.model = "WM"});
  auto less = record;
  less.values.pop_back();
  add_certificate(answer, less);
  auto still = record;
  std::fill(still.values.begin(), still.values.end(), 0.125);
  add_certificate(answer, still);
  less.values.clear();
  add_certificate(answer, less);
  // A lone walk, whose Allan deviation rises from the beginning.
  const noise::Model walk{{{ProcessKind::kRandomWalk, 1.0, {}}}};
  add_certificate(answer, made(walk, 3'000, 6, "accel_x", noise::SignalUnit::kMps2), {.model = "RW"});
  expect_recorded("models/certificate/short_records.txt", answer.text(), kSearched, 1e-15);
}

TEST(CertificateAnswers, AxesSideBySide) {
  const std::vector<AxisRecord> records{made(kGyro, 1'000, 7, "gyro_x", noise::SignalUnit::kRadps),
                                        made(kGyro, 100, 8, "gyro_y", noise::SignalUnit::kRadps),
                                        made(kGyro, 1'000, 9, "gyro_z", noise::SignalUnit::kRadps)};
  for (const bool fetched : {false, true}) {
    auto asked = records;
    if (fetched) {
      for (AxisRecord& record : asked) {
        record.fetch = [values = record.values] { return Result<std::vector<double>>(values); };
        record.values.clear();
      }
    }
    std::vector<std::size_t> told;
    const auto all =
        characterize_axes(asked, {.model = "WN"}, [&](std::size_t done) { told.push_back(done); });
    EXPECT_EQ(told, (std::vector<std::size_t>{1, 2, 3}));
    ASSERT_EQ(all.size(), 3U);
    EXPECT_EQ(all[0]->name, "gyro_x");
    EXPECT_FALSE(all[1]);
    EXPECT_EQ(all[2]->name, "gyro_z");
    EXPECT_EQ(all[2]->n_samples, 1'000U);
  }
}

void add_checks(Answer& answer, const AxisRecord& record) {
  std::vector<std::uint8_t> mask = record.mask;
  if (mask.empty()) mask.assign(record.values.size(), 1);
  AxisCertificate so_far;
  double mean = 0.0;
  double squares = 0.0;
  for (std::size_t i = 0; i < mask.size(); ++i) {
    if (mask[i] == 0) continue;
    const double before = record.values[i] - mean;
    mean += before / static_cast<double>(++so_far.n_samples);
    squares += before * (record.values[i] - mean);
  }
  so_far.n_missing = mask.size() - so_far.n_samples;
  so_far.mean = mean;
  so_far.sd = std::sqrt(squares / static_cast<double>(so_far.n_samples - 1));
  so_far.resolution = resolution_of(record.values, mask);
  answer.line("resolution", so_far.resolution, "sd", so_far.sd);
  for (const std::string& warning : record_warnings(record, record.values, mask, so_far))
    answer.line(warning);
}

AxisRecord rounded_to(AxisRecord record, double step) {
  for (double& v : record.values) v = step * std::round(v / step);
  return record;
}

TEST(CertificateAnswers, WhatIsWrongWithARecord) {
  Answer answer;
  const auto base = test::made_gyro(6'000, 10, 0.2);
  add_checks(answer, base);
  for (const double step : {1e-7, 1e-5, 2e-4, 0.01, 0.1, 0.3, 0.5, 2.0})
    add_checks(answer, rounded_to(base, step));
  // Shaken and turned, in one second, two, and many.
  for (const std::size_t seconds : {1, 2, 20}) {
    auto shaken = base;
    auto turned = base;
    for (std::size_t i = 1'700; i < 1'700 + 100 * seconds; ++i) {
      shaken.values[i] *= i % 2 == 0 ? 8.0 : -8.0;
      turned.values[i] += 3.0;
    }
    add_checks(answer, shaken);
    add_checks(answer, turned);
  }
  auto slow = base;
  slow.rate_hz = 4.0;
  for (std::size_t i = 100; i < 180; ++i) slow.values[i] += 5.0;
  add_checks(answer, slow);
  expect_recorded("models/certificate/checks_of_motion.txt", answer.text());
}

TEST(CertificateAnswers, ValuesThatStandOrAreCut) {
  Answer answer;
  const auto base = test::made_gyro(6'000, 11, 0.2);
  // It stands still for so many samples, on no grid and on one.
  for (const std::size_t n : {99, 100, 101, 300}) {
    for (const double step : {0.0, 0.05, 0.6}) {
      auto stuck = step > 0.0 ? rounded_to(base, step) : base;
      std::fill_n(stuck.values.begin() + 2'000, n, stuck.values[2'000]);
      add_checks(answer, stuck);
    }
  }
  // Cut at one end or the other, hard and a little.
  for (const double end : {0.55, 0.75, 0.95, 1.05}) {
    for (const double sign : {1.0, -1.0}) {
      auto cut = rounded_to(base, 0.01);
      for (double& v : cut.values) v = sign * std::min(sign * (v - 0.5), end - 0.5) + 0.5;
      add_checks(answer, cut);
      auto off_grid = base;
      for (double& v : off_grid.values) v = sign * std::min(sign * (v - 0.5), end - 0.5) + 0.5;
      add_checks(answer, off_grid);
    }
  }
  // Missing: a twentieth of them, and more.
  for (const std::size_t n : {299, 300, 301, 3'000}) {
    auto missing = base;
    missing.mask.assign(base.values.size(), 1);
    for (std::size_t i = 0; i < n; ++i) missing.mask[2 * i] = 0;
    std::fill_n(missing.values.begin() + 100, 150, 0.5);
    add_checks(answer, missing);
  }
  expect_recorded("models/certificate/checks_of_values.txt", answer.text());
}

TEST(CertificateAnswers, Resolutions) {
  Answer answer;
  const std::vector<std::uint8_t> mask(30'000, 1);
  std::vector<double> x;
  for (std::size_t i = 0; i < mask.size(); ++i) x.push_back(0.25 * static_cast<double>(i * i % 17));
  const auto add = [&](std::size_t n) {
    answer.line(resolution_of(std::span(x).first(n), std::span(mask).first(n)));
  };
  add(30'000);
  for (std::size_t i = 0; i < 150; ++i) x[7 + i] += 0.1;
  add(15'000);
  for (std::size_t i = 0; i < 100; ++i) x[307 + i] += 0.1;
  add(15'000);
  // Beyond what is looked at, nothing is.
  for (std::size_t i = 20'000; i < x.size(); ++i) x[i] += 0.01 * static_cast<double>(i % 7);
  add(30'000);
  for (const double second : {1.0, 2.0}) {
    std::fill(x.begin(), x.end(), 0.0);
    x[5] = 1.0;
    x[9] = second;
    add(30'000);
  }
  for (const double finest : {0.5e-4, 1e-4, 1.5e-4}) {
    for (std::size_t i = 0; i < x.size(); ++i) x[i] = i % 2 == 0 ? 0.0 : finest * static_cast<double>(i % 3);
    x[11] = 1.0;
    add(30'000);
  }
  std::fill(x.begin(), x.end(), 3.0);
  add(30'000);
  expect_recorded("models/certificate/resolutions.txt", answer.text());
}

void add_temperature(Answer& answer, const std::optional<Temperature>& t) {
  if (!t) {
    answer.line("none");
    return;
  }
  answer.line(t->mean_c, t->lowest_c, t->highest_c, t->bias_per_c, t->bias_per_c_sd, t->bias_p_value,
              t->noise_per_c, t->noise_per_c_sd);
}

TEST(CertificateAnswers, Temperatures) {
  Answer answer;
  noise::FitResult fit;
  fit.model = kGyro;
  fit.rate_hz = 100.0;
  auto x = made(kGyro, 24'000, 12, "gyro_x", noise::SignalUnit::kDegps).values;
  std::vector<std::uint8_t> mask(x.size(), 1);
  std::vector<float> t;
  for (std::size_t i = 0; i < x.size(); ++i) {
    t.push_back(20.0F + 0.0002F * static_cast<float>(i) + 0.3F * std::sin(0.001F * static_cast<float>(i)));
    x[i] += (0.05 + 0.02 * x[i]) * (static_cast<double>(t[i]) - 20.0);
  }
  add_temperature(answer, temperature_of(x, {}, t, fit));
  mask[7] = mask[8] = 0;
  std::fill_n(mask.begin() + 6'000, 900, std::uint8_t{0});
  x[77] = kNan;
  t[79] = std::numeric_limits<float>::quiet_NaN();
  add_temperature(answer, temperature_of(x, mask, t, fit));
  fit.model = {{{ProcessKind::kWhiteNoise, 0.04, {}}}};
  add_temperature(answer, temperature_of(x, mask, t, fit));
  // Windows of 500 samples are long enough, and those of fewer are not.
  for (const std::size_t n : {19'999, 20'000}) {
    std::vector<float> all(t.begin(), t.begin() + static_cast<std::ptrdiff_t>(n));
    add_temperature(answer, temperature_of(std::span(x).first(n), std::span(mask).first(n), all, fit));
  }
  add_temperature(answer, temperature_of(x, mask, std::span(t).first(100), fit));
  const std::vector<std::uint8_t> none(x.size(), 0);
  add_temperature(answer, temperature_of(x, none, t, fit));
  for (const float range : {0.49F, 0.5F, 0.51F}) {
    std::vector<float> narrow(x.size(), 32.0F);
    for (std::size_t i = 0; i < x.size() / 3; ++i) narrow[i] = 32.0F + range;
    add_temperature(answer, temperature_of(x, mask, narrow, fit));
  }
  // A fit without any noise weighs nothing.
  fit.model.components.front().amplitude = 0.0;
  EXPECT_FALSE(temperature_of(x, mask, t, fit));
  expect_recorded("models/certificate/temperatures.txt", answer.text(), 1e-6, 1e-300);
}

TermValue term(Term which, noise::Knowledge knowledge, double value, std::optional<double> low,
               std::optional<double> high) {
  TermValue out;
  out.term = which;
  out.unit = "unit";
  out.knowledge = knowledge;
  out.value = value;
  out.ci_low = low;
  out.ci_high = high;
  return out;
}

void add_terms(Answer& answer, const std::vector<TermValue>& terms) {
  for (const TermValue& t : terms)
    answer.line(symbol_of(t.term), '[' + t.unit + ']', t.value, t.ci_low, t.ci_high,
                knowledge_name(t.knowledge), '|', t.note);
}

/// A fit that lies on its levels, with parameters known to a tenth.
noise::FitResult fit_on(const noise::Model& model, double criterion) {
  noise::FitResult fit;
  fit.model = model;
  for (const auto& c : model.components) fit.spec.processes.push_back(c.kind);
  fit.n = 40'000;
  fit.rate_hz = 100.0;
  fit.confidence = 0.9;
  fit.criterion = criterion;
  for (int level = 1; level <= 13; ++level) {
    noise::FittedLevel row;
    row.observed.level = level;
    row.observed.tau_samples = std::ldexp(1.0, level);
    row.fitted = row.observed.value = model_wv(model, level);
    row.observed.n_coefficients = 40'001 - (std::uint64_t{1} << static_cast<unsigned>(level));
    fit.wv.push_back(row);
  }
  noise::ParameterCovariance covariance;
  const auto n = static_cast<Eigen::Index>(noise::parameter_places(model).size());
  covariance.covariance = 0.01 * (Eigen::MatrixXd::Identity(n, n) + Eigen::MatrixXd::Constant(n, n, 0.2));
  covariance.determined.assign(static_cast<std::size_t>(n), true);
  report_parameters(fit, covariance, {.confidence = 0.9}, 13);
  return fit;
}

std::vector<noise::AllanPoint> allan_of(const noise::FitResult& fit) {
  std::vector<noise::AllanPoint> points;
  for (const noise::FittedLevel& level : fit.wv) {
    noise::AllanPoint point;
    point.n = static_cast<std::uint64_t>(0.5 * level.observed.tau_samples);
    point.tau_s = static_cast<double>(point.n) / fit.rate_hz;
    point.deviation = std::sqrt(2.0 * level.fitted);
    point.ci_low = 0.95 * point.deviation;
    point.ci_high = 1.06 * point.deviation;
    points.push_back(point);
  }
  return points;
}

TEST(CertificateAnswers, TermsOfDataSheets) {
  Answer answer;
  const noise::Model full{{{ProcessKind::kQuantization, 3e-2, {}},
                           {ProcessKind::kWhiteNoise, 0.04, {}},
                           {ProcessKind::kRandomWalk, 1e-6, {}},
                           {ProcessKind::kRamp, 1e-12, {}}}};
  const noise::Model slow{
      {{ProcessKind::kWhiteNoise, 0.04, {}}, {ProcessKind::kGaussMarkov, 1e-3, {0.01, 0.0}}}};
  const noise::Model white{{{ProcessKind::kWhiteNoise, 0.04, {}}}};
  const auto fit = fit_on(full, 3.0);
  using noise::SignalUnit;
  for (const SignalUnit unit : {SignalUnit::kRadps, SignalUnit::kDegps, SignalUnit::kMps2, SignalUnit::kG}) {
    add_terms(answer, data_sheet_terms(fit, {}, allan_of(fit), unit));
    for (const double criterion : {-5.0, 2.0, 3.5, 40.0})
      add_terms(answer, data_sheet_terms(fit, std::vector{fit_on(slow, criterion), fit_on(white, criterion)},
                                         allan_of(fit), unit));
    add_terms(answer, data_sheet_terms(fit_on(white, 1.0), {}, allan_of(fit_on(white, 1.0)), unit));
  }
  // Without a covariance of the parameters, without levels, without a curve.
  auto bare = fit;
  bare.covariance.clear();
  add_terms(answer, data_sheet_terms(bare, {}, allan_of(fit), SignalUnit::kRadps));
  bare = fit;
  bare.covariance[5] = kNan;
  add_terms(answer, data_sheet_terms(bare, {}, allan_of(fit), SignalUnit::kRadps));
  add_terms(answer, data_sheet_terms(fit, {}, {}, SignalUnit::kRadps));
  // A curve that does not rise far enough, and one that does by a little.
  for (const double rise : {1.04, 1.06}) {
    auto flat = allan_of(fit);
    for (std::size_t i = 0; i < flat.size(); ++i) {
      flat[i].n = std::uint64_t{1} << i;
      flat[i].ci_low = 0.5 * flat[i].deviation;
    }
    flat.back().ci_low = 0.0;
    std::size_t lowest = 0;
    for (std::size_t i = 0; i < flat.size(); ++i)
      if (flat[i].deviation < flat[lowest].deviation) lowest = i;
    flat.back().ci_low = rise / 1.05 * flat[lowest].deviation;
    add_terms(answer, data_sheet_terms(fit, {}, flat, SignalUnit::kRadps));
  }
  for (const bool gyro : {false, true})
    for (const Term t :
         {Term::kRandomWalk, Term::kBiasInstability, Term::kRateRandomWalk, Term::kRamp, Term::kQuantization})
      answer.line(symbol_of(t), name_of(t, gyro));
  expect_recorded("models/certificate/terms.txt", answer.text(), 1e-6, 1e-300);
}

TEST(CertificateAnswers, IntervalsOverModels) {
  Answer answer;
  const ModelsValue chosen{10.0, 5.0, 4.0, 7.0};
  for (const double misfit : {8.0, 10.0, 11.0, 12.5, 13.8, 13.9, 30.0}) {
    for (const double value : {3.0, 5.0, 9.0}) {
      const std::array models{chosen, ModelsValue{misfit, value, value - 2.0, value + 1.5}};
      for (const double confidence : {0.8, 0.95}) {
        const Interval interval = models_interval(models, confidence);
        answer.line(misfit, value, confidence, interval.low, interval.high);
      }
    }
  }
  expect_recorded("models/certificate/models_intervals.txt", answer.text());
}

json stated(const char* axes, const char* symbol, double value, const char* unit) {
  return {{"axes", axes},      {"term", symbol},    {"value", value},  {"unit", unit},
          {"kind", "typical"}, {"document", "A-1"}, {"revision", "B"}, {"page", 7}};
}

json sheet_of(const json& values) {
  return {{"schema", "imuscope.data_sheets/1"}, {"parts", {{{"part", "P"}, {"values", values}}}}};
}

void add_sheet(Answer& answer, const json& document, const std::string& part = {}) {
  const auto sheet = read_data_sheet(document, part, "sheets.json");
  if (!sheet) {
    answer.line(static_cast<int>(sheet.error().kind), sheet.error().text());
    return;
  }
  answer.line("part", sheet->part);
  for (const StatedValue& v : sheet->values)
    answer.line(v.axes, symbol_of(v.term), v.value, v.is_maximum, v.document, v.revision, v.page);
}

TEST(CertificateAnswers, DataSheetsRead) {
  Answer answer;
  for (const char* axes : {"gyro", "accel", "gyro_x", "accel_z", "gyro_w", "mag"}) {
    for (const char* symbol : {"N", "B", "K", "R", "Q", "X"}) {
      for (const char* unit : {"deg/sqrt(h)", "deg/s/sqrt(Hz)", "mdeg/s/sqrt(Hz)", "rad/s/sqrt(Hz)",
                               "m/s/sqrt(h)", "m/s^2/sqrt(Hz)", "ug/sqrt(Hz)",     "mg/sqrt(Hz)",
                               "deg/h",       "deg/s",          "rad/s",           "ug",
                               "mg",          "m/s^2",          "deg/h/sqrt(h)",   "ug/sqrt(h)",
                               "deg/h/h",     "ug/h",           "arcsec",          "deg",
                               "m/s"}) {
        const auto sheet = read_data_sheet(sheet_of({stated(axes, symbol, 2.0, unit)}), "", "f");
        if (sheet) answer.line(axes, symbol, unit, sheet->values.front().value);
      }
    }
  }
  const json good = stated("gyro", "N", 2.0, "deg/sqrt(h)");
  for (const auto& [key, value] : good.items()) {
    for (const json& other : {json(nullptr), json(""), json("maximum"), json(0.0), json(-1), json(3)}) {
      json odd = good;
      odd[key] = other;
      answer.line(key, other.dump());
      add_sheet(answer, sheet_of({odd}));
    }
    json less = good;
    less.erase(key);
    add_sheet(answer, sheet_of({good, less}));
  }
  add_sheet(answer, sheet_of({5}));
  add_sheet(answer, sheet_of(json::array()));
  add_sheet(answer, sheet_of(5));
  add_sheet(answer, 5);
  add_sheet(answer, {{"schema", "imuscope.data_sheets/1"}});
  add_sheet(answer, {{"schema", "imuscope.data_sheets/2"}, {"parts", json::array()}});
  add_sheet(answer, {{"schema", "imuscope.data_sheets/1"}, {"parts", json::array()}});
  add_sheet(answer, {{"schema", "imuscope.data_sheets/1"}, {"parts", 3}});
  json two = sheet_of({good});
  two["parts"].push_back({{"part", "Q"}, {"values", {stated("accel", "B", 3.0, "ug")}}});
  add_sheet(answer, two);
  for (const char* part : {"P", "Q", "R"}) add_sheet(answer, two, part);
  two["parts"].push_back({{"values", 3}});
  add_sheet(answer, two, "P");
  expect_recorded("models/certificate/data_sheets.txt", answer.text());
}

TEST(CertificateAnswers, DataSheetsBesideARecord) {
  Answer answer;
  using noise::Knowledge;
  const auto sheet =
      read_data_sheet(
          sheet_of({stated("gyro", "N", 2.0, "deg/sqrt(h)"), stated("gyro_y", "N", 3.0, "deg/sqrt(h)"),
                    stated("gyro", "N", 9.0, "deg/sqrt(h)"), stated("gyro", "B", 5.0, "deg/h"),
                    stated("accel", "B", 40.0, "ug"), stated("gyro", "Q", 1.0, "arcsec")}),
          "", "f")
          .value();
  std::vector<AxisCertificate> axes;
  for (const char* name : {"gyro_x", "gyro_y", "accel_x"}) {
    for (const auto& [knowledge, value, low, high] :
         std::vector<std::tuple<Knowledge, double, std::optional<double>, std::optional<double>>>{
             {Knowledge::kFitted, 1.5, 1.0, 1.9},
             {Knowledge::kFitted, 1.5, 1.0, 2.0},
             {Knowledge::kFitted, 3.0, 2.0, 4.0},
             {Knowledge::kFitted, 3.5, 2.1, 4.0},
             {Knowledge::kFitted, 3.0, {}, {}},
             {Knowledge::kBound, 2.0, {}, 2.0},
             {Knowledge::kBound, 2.1, {}, 2.1},
             {Knowledge::kUnknown, 1.0, {}, {}},
             {Knowledge::kFitted, kNan, {}, {}}}) {
      AxisCertificate axis;
      axis.name = name;
      axis.terms = {term(Term::kRandomWalk, knowledge, value, low, high),
                    term(Term::kBiasInstability, knowledge, value, low, high)};
      axes.push_back(axis);
    }
  }
  add_json(answer, "", to_json(sheet, beside(sheet, axes)));
  for (const Verdict v : {Verdict::kBetter, Verdict::kAgrees, Verdict::kWorse, Verdict::kNotTold})
    answer.line(name_of(v));
  expect_recorded("models/certificate/data_sheet_beside.txt", answer.text());
}

TEST(CertificateAnswers, Populations) {
  Answer answer;
  using noise::Knowledge;
  const std::vector<double> values{1.0, 1.1, 0.95, 1.2, 3.0, 1.05};
  std::vector<std::vector<AxisCertificate>> records;
  for (std::size_t r = 0; r < values.size(); ++r) {
    AxisCertificate axis;
    axis.name = "gyro_x";
    axis.terms = {term(Term::kRandomWalk, Knowledge::kFitted, values[r], 0.9 * values[r], 1.15 * values[r]),
                  term(Term::kBiasInstability, r % 2 == 0 ? Knowledge::kFitted : Knowledge::kBound,
                       2.0 * values[r], 0.5 * values[r], 4.0 * values[r])};
    if (r < 3)
      axis.terms.push_back(
          term(Term::kRamp, Knowledge::kFitted, 1.0 + 0.1 * static_cast<double>(r), r == 1 ? 0.0 : 0.5, 2.0));
    if (r == 4) axis.terms.push_back(term(Term::kQuantization, Knowledge::kFitted, 1.0, 0.5, 2.0));
    AxisCertificate other = axis;
    other.name = "gyro_y";
    other.terms.resize(1);
    records.push_back({other, axis});
    if (r == 2) records.back().pop_back();
  }
  for (const std::size_t n : {1, 2, 3, 4, 6}) {
    for (const Population& p : population_of(std::span(records).first(n), n == 4 ? 0.8 : 0.95)) {
      answer.line(p.axis, symbol_of(p.term), '[' + p.unit + ']', p.n, "values", p.values, "p", p.p_values,
                  "upper", p.tolerance_upper);
      if (p.effects)
        answer.line(p.effects->mean, p.effects->sd, p.effects->ci_low, p.effects->ci_high, p.effects->spread,
                    p.effects->spread_low, p.effects->spread_high);
    }
  }
  for (const std::size_t n : {2, 5, 30})
    answer.line(n, tolerance_factor(n, 0.95, 0.95), tolerance_factor(n, 0.9, 0.8));
  expect_recorded("models/certificate/populations.txt", answer.text());
}

void add_joint(Answer& answer, const Result<JointAxes>& joint) {
  if (!joint) {
    answer.line(static_cast<int>(joint.error().kind), joint.error().text());
    return;
  }
  answer.line(joint->rate_hz, joint->samples, joint->from_s, joint->to_s, joint->ratio, joint->held_out,
              "weights", joint->weights);
  for (const JointScale& s : joint->scales) {
    answer.line(s.tau_s, s.squares, s.common.value, s.common.ci_low, s.common.ci_high, s.variance,
                s.mean_variance);
    for (const noise::Estimate& own : s.own) answer.line("own", own.value, own.ci_low, own.ci_high);
  }
  add_json(answer, "pairs", pairs_json(*joint, {"a", "b", "c"}));
}

TEST(CertificateAnswers, JointAxesOfAReference) {
  Answer answer;
  const auto common = made(kGyro, 6'000, 20, "", noise::SignalUnit::kRadps).values;
  std::vector<std::vector<double>> values;
  for (const unsigned k : {0U, 1U, 2U}) {
    values.push_back(made(kGyro, 6'000, 21 + k, "", noise::SignalUnit::kRadps).values);
    for (std::size_t i = 0; i < common.size(); ++i) values[k][i] = (1.0 + k) * values[k][i] + 0.7 * common[i];
  }
  values[1][500] = kNan;
  values[2][3'000] = std::numeric_limits<double>::infinity();
  const std::vector<JointSignal> signals{{"a", values[0]}, {"b", values[1]}, {"c", values[2]}};
  JointOptions options;
  options.rate_hz = 100.0;
  add_joint(answer, joint_axes(signals, options));
  options.from_s = 0.04;
  options.to_s = 0.16;
  options.confidence = 0.8;
  add_joint(answer, joint_axes(signals, options));
  options.share_a_reference = false;
  add_joint(answer, joint_axes(std::span(signals).first(2), options));
  options.share_a_reference = true;
  options.from_s = 5.0;
  options.to_s = 20.0;
  add_joint(answer, joint_axes(signals, options));
  add_joint(answer, joint_axes(std::span(signals).first(1), options));
  const std::vector<JointSignal> few{{"a", std::span(values[0]).first(1)},
                                     {"b", std::span(values[1]).first(1)}};
  add_joint(answer, joint_axes(few, options));
  const std::vector<JointSignal> uneven{{"a", values[0]}, {"b", std::span(values[1]).first(5'000)}};
  options.from_s = 0.0;
  add_joint(answer, joint_axes(uneven, options));
  expect_recorded("models/certificate/joint.txt", answer.text(), 1e-4, 1e-12);
}

TEST(CertificateAnswers, WhichPairsShow) {
  JointPair pair;
  const auto shows = [&](double p, double low, double high) {
    pair.p_holm = p;
    pair.coherence.ci_low = low;
    pair.coherence.ci_high = high;
    return pair.shows();
  };
  EXPECT_TRUE(shows(0.049, 0.11, 0.3));
  EXPECT_FALSE(shows(0.05, 0.11, 0.3));
  EXPECT_FALSE(shows(0.01, 0.1, 0.3));
  EXPECT_TRUE(shows(0.01, -0.3, -0.11));
  EXPECT_FALSE(shows(0.01, -0.3, -0.1));
}

}  // namespace
}  // namespace imuscope::certificate::certificate_answers
