/// Curves of all processes, what follows from a model without a record, and non-negative least squares, as they
/// were once.

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <random>
#include <utility>
#include <vector>

#include "answer.h"
#include "models/noise/chi_squared.h"
#include "models/noise/continuous_form.h"
#include "models/noise/filter_form.h"
#include "models/noise/holm.h"
#include "models/noise/nnls.h"
#include "models/noise/parameter_scale.h"
#include "models/noise/power_law.h"
#include "models/noise/process.h"
#include "models/noise/separable_fit.h"
#include "models/noise/simulated_noise.h"
#include "models/noise/state_space.h"
#include "models/noise/whitener.h"
#include "tests/support/recorded_answer.h"

namespace imuscope::noise::process_answers {
namespace {

using imuscope::test::expect_recorded;
using test::Answer;

constexpr std::array kKinds{ProcessKind::kQuantization, ProcessKind::kWhiteNoise, ProcessKind::kMa1,
                            ProcessKind::kArma11,       ProcessKind::kSinusoid,   ProcessKind::kResonance,
                            ProcessKind::kGaussMarkov,  ProcessKind::kFlicker,    ProcessKind::kPowerLaw,
                            ProcessKind::kRandomWalk,   ProcessKind::kRamp};

/// Both sides of every change of formula: of the series, of phi one half, of an exponent of one.
const std::vector<std::pair<ProcessKind, Shape>> kShapes{{ProcessKind::kQuantization, {}},
                                                         {ProcessKind::kWhiteNoise, {}},
                                                         {ProcessKind::kRandomWalk, {}},
                                                         {ProcessKind::kRamp, {}},
                                                         {ProcessKind::kFlicker, {}},
                                                         {ProcessKind::kMa1, {0.6, 0.0}},
                                                         {ProcessKind::kMa1, {-0.9, 0.0}},
                                                         {ProcessKind::kArma11, {0.3, 0.5}},
                                                         {ProcessKind::kArma11, {0.5, -0.4}},
                                                         {ProcessKind::kArma11, {0.51, -0.4}},
                                                         {ProcessKind::kArma11, {-0.7, 0.2}},
                                                         {ProcessKind::kArma11, {0.98, 0.3}},
                                                         {ProcessKind::kSinusoid, {0.01, 0.0}},
                                                         {ProcessKind::kSinusoid, {2.7, 0.0}},
                                                         {ProcessKind::kGaussMarkov, {1e-7, 0.0}},
                                                         {ProcessKind::kGaussMarkov, {3e-3, 0.0}},
                                                         {ProcessKind::kGaussMarkov, {0.49, 0.0}},
                                                         {ProcessKind::kGaussMarkov, {0.51, 0.0}},
                                                         {ProcessKind::kGaussMarkov, {7.0, 0.0}},
                                                         {ProcessKind::kResonance, {1e-3, 0.02}},
                                                         {ProcessKind::kResonance, {0.2, 0.45}},
                                                         {ProcessKind::kResonance, {0.2, 0.47}},
                                                         {ProcessKind::kResonance, {0.9, 3.0}},
                                                         {ProcessKind::kPowerLaw, {0.2, 0.0}},
                                                         {ProcessKind::kPowerLaw, {1.0, 0.0}},
                                                         {ProcessKind::kPowerLaw, {1.00001, 0.0}},
                                                         {ProcessKind::kPowerLaw, {1.9, 0.0}},
                                                         {ProcessKind::kPowerLaw, {1e-5, 0.0}},
                                                         {ProcessKind::kPowerLaw, {1.99999, 0.0}}};

TEST(ProcessAnswers, CurvesOfAllKinds) {
  Answer answer;
  for (const auto& [kind, shape] : kShapes) {
    answer.line(short_name(kind), shape_count(kind), shape, is_in_range(kind, shape));
    for (const int level : {1, 2, 3, 4, 5, 6, 7, 9, 12, 16, 20, 25, 32}) {
      const CurvePoint point = unit_wv(kind, shape, level);
      answer.line(level, point.value, point.derivative);
    }
  }
  expect_recorded("models/noise/curves.txt", answer.text(), 1e-6, 1e-30);
}

TEST(ProcessAnswers, CurvesOfAllLevelsAtOnce) {
  for (const auto& [kind, shape] : kShapes) {
    std::vector<CurvePoint> curve(14);
    unit_curve(kind, shape, curve);
    for (std::size_t i = 0; i < curve.size(); ++i) {
      const CurvePoint one = unit_wv(kind, shape, static_cast<int>(i) + 1);
      EXPECT_NEAR(curve[i].value, one.value, 1e-12 * one.value) << short_name(kind) << ' ' << i;
      for (std::size_t k = 0; k < 2; ++k)
        EXPECT_NEAR(curve[i].derivative[k], one.derivative[k],
                    1e-9 * (std::abs(one.derivative[k]) + one.value));
    }
  }
}

TEST(ProcessAnswers, NamesAndRanges) {
  Answer answer;
  const double beyond = 1.0 + 1e-12;
  for (const ProcessKind kind : kKinds) {
    answer.line(short_name(kind), shape_count(kind), is_power_law(kind));
    for (const double first : {-beyond, -1.0, -0.5, 0.0, 1e-300, 1.0, beyond, 2.0, 4.0, HUGE_VAL}) {
      for (const double second : {-beyond, -1.0, 0.0, 0.3, 1.0, beyond, std::numbers::pi, 3.2})
        answer.line(first, second, is_in_range(kind, {first, second}));
    }
  }
  expect_recorded("models/noise/ranges.txt", answer.text());
}

TEST(ProcessAnswers, CovarianceOfSummedPowerLaws) {
  Answer answer;
  for (const double alpha : {0.1, 0.9, 1.0, 1.000001, 1.5, 1.95}) {
    for (const double m : {0.0, 1.0, 2.0, 7.0, 39.0, 40.0, 41.0, 1000.0, 1e9})
      answer.line(alpha, m, power_law_sum_covariance(alpha, m));
    const Component law{ProcessKind::kPowerLaw, 3.0, {alpha, 0.0}};
    test::add_model(answer, {power_law_sum(law)});
  }
  test::add_model(answer, without_power_laws({{{ProcessKind::kWhiteNoise, 2.0, {}},
                                               {ProcessKind::kFlicker, 0.5, {}},
                                               {ProcessKind::kRandomWalk, 1.0, {}}}}));
  expect_recorded("models/noise/power_laws.txt", answer.text());
}

const Model kEveryKind{{{ProcessKind::kQuantization, 0.3, {}},
                        {ProcessKind::kWhiteNoise, 2.0, {}},
                        {ProcessKind::kMa1, 1.5, {0.4, 0.0}},
                        {ProcessKind::kArma11, 0.7, {0.8, -0.3}},
                        {ProcessKind::kSinusoid, 0.2, {0.5, 0.0}},
                        {ProcessKind::kResonance, 0.9, {0.1, 1.1}},
                        {ProcessKind::kGaussMarkov, 1.1, {0.05, 0.0}},
                        {ProcessKind::kGaussMarkov, 0.0, {0.02, 0.0}},
                        {ProcessKind::kRandomWalk, 1e-3, {}},
                        {ProcessKind::kRamp, 1e-6, {}}}};

void add_state_space(Answer& answer, const Model& model) {
  const StateSpace form = state_space(model);
  answer.line("F", form.F);
  answer.line("Q", form.Q);
  answer.line("H", form.H, "R", form.R);
  answer.line("P0", form.P0);
  std::string diffuse;
  for (const bool one : form.diffuse) diffuse += one ? '1' : '0';
  answer.line("diffuse", diffuse);
  answer.line("states", state_names(model));
}

TEST(ProcessAnswers, StateSpaces) {
  Answer answer;
  add_state_space(answer, kEveryKind);
  for (const Component& component : kEveryKind.components) {
    answer.line(short_name(component.kind), low_frequency_variance(component));
    add_state_space(answer, {{component}});
    const auto form = continuous_form({{component}}, 50.0);
    if (form)
      answer.line("A", form->a, "Qc", form->qc);
    else
      answer.line(form.error().text());
  }
  const Model continuous{{kEveryKind.components[1], kEveryKind.components[4], kEveryKind.components[5],
                          kEveryKind.components[6], kEveryKind.components[7], kEveryKind.components[8],
                          kEveryKind.components[9], kEveryKind.components[6]}};
  const auto form = continuous_form(continuous, 100.0).value();
  answer.line("A", form.a);
  answer.line("Qc", form.qc);
  answer.line("of flicker noise", state_names({{{ProcessKind::kFlicker, 1.0, {}}}}));
  expect_recorded("models/noise/state_spaces.txt", answer.text(), 1e-6, 1e-15);
}

TEST(ProcessAnswers, WhitenedSeries) {
  Answer answer;
  for (const Model& model : {kEveryKind, Model{{kEveryKind.components[1]}},
                             Model{{kEveryKind.components[1], kEveryKind.components[8]}},
                             Model{{kEveryKind.components[6], kEveryKind.components[9]}}}) {
    Whitener whitener(model, 2);
    for (int i = 0; i < 60; ++i) {
      if (i == 20 || i == 22 || i == 23) whitener.skip();
      std::vector<double> row{std::sin(0.7 * i) + 0.01 * i, i == 5 ? 1.0 : 0.0};
      const bool tells = whitener.push(row);
      if (i < 8 || i > 18) answer.line(tells, row);
    }
  }
  expect_recorded("models/noise/whitened.txt", answer.text(), 1e-5, 1e-9);
}

TEST(ProcessAnswers, SimulatedSeries) {
  Answer answer;
  std::vector<Component> components = kEveryKind.components;
  components.push_back({ProcessKind::kFlicker, 1.2, {}});
  components.push_back({ProcessKind::kPowerLaw, 0.8, {1.5, 0.0}});
  for (const Component& component : components) {
    for (const std::size_t n : {1, 5, 8}) {
      std::mt19937_64 random(21);
      answer.line(short_name(component.kind), simulated_noise({{component}}, n, random));
      answer.line("and next", simulated_noise({{component}}, 2, random));
    }
  }
  std::mt19937_64 random(22);
  std::vector<double> x(6, 100.0);
  simulate_noise(kEveryKind, random, x);
  answer.line("all", x);
  expect_recorded("models/noise/simulated.txt", answer.text());
}

TEST(ProcessAnswers, NonNegativeLeastSquares) {
  Answer answer;
  std::mt19937_64 random(23);
  std::normal_distribution<double> normal;
  for (int i = 0; i < 60; ++i) {
    const Eigen::Index columns = 1 + i % 7;
    const Eigen::Index rows = 8 + i % 5;
    Design a(rows, columns);
    for (double& v : a.reshaped()) v = normal(random);
    // Some are dependent, or nearly so, and some have one sign.
    if (i % 3 == 1 && columns > 2) a.col(1) = a.col(0) + (i % 2 == 0 ? 1e-4 : 0.0) * a.col(2);
    if (i % 4 == 2) a = a.cwiseAbs();
    for (Eigen::Index c = 0; c < columns; ++c) a.col(c).normalize();
    RowVector y(rows);
    for (double& v : y) v = normal(random) + (i % 4 == 2 ? 1.0 : 0.0);
    const ColumnVector x = nnls(a, y);
    // Of dependent columns one stays out, whichever: the residual is the same.
    answer.line("qr", (a * x - y).norm(), x.minCoeff() >= 0.0);
    if (i % 3 != 1) answer.line(x);
    const ColumnVector by_gram = nnls_from_gram(a.transpose() * a, a.transpose() * y);
    answer.line("gram", (a * by_gram - y).norm(), (by_gram - x).norm() < 1e-6 || i % 3 == 1);
  }
  answer.line("zero", nnls(Design::Identity(8, 3), RowVector::Zero(8)));
  answer.line("all negative", nnls(Design::Identity(8, 3), RowVector::Constant(8, -1.0)));
  answer.line("one of them", nnls(Design::Identity(8, 3), RowVector::Unit(8, 1)));
  expect_recorded("models/noise/nnls.txt", answer.text(), 1e-6, 1e-9);
}

TEST(ProcessAnswers, ScalesOfParametersAndOfTheSearch) {
  Answer answer;
  for (const std::string_view name :
       {"sigma2", "beta", "omega", "alpha", "B", "theta", "phi", "exponent", "q2"}) {
    const ParameterScale scale = parameter_scale_of(name);
    for (const double value : {0.1, 0.7, 0.99}) {
      answer.line(name, is_logarithmic(scale), to_scale(scale, value),
                  from_scale(scale, to_scale(scale, value)));
    }
  }
  for (const ProcessKind kind : kKinds) {
    for (int i = 0; i < shape_count(kind); ++i) {
      const CoordinateRange range = coordinate_range(kind, i, 11);
      answer.line(short_name(kind), i, range.low, range.high);
      for (const double shape : {0.05, 0.6, 0.95}) {
        const double u = coordinate_of_shape(kind, shape);
        answer.line(shape, u, shape_of_coordinate(kind, u + 0.1), shape_slope(kind, u));
      }
    }
  }
  expect_recorded("models/noise/parameter_scales.txt", answer.text());
}

TEST(ProcessAnswers, ModelsByTheirNames) {
  Answer answer;
  for (const char* text : {"WN",
                           " wn + gm",
                           "2*GM+WN",
                           "3GM",
                           "8*GM",
                           "9*GM",
                           "0*GM",
                           "*GM",
                           "2",
                           "2*",
                           "",
                           "WN+",
                           "+WN",
                           "WN++GM",
                           "WN+WN",
                           "2*WN",
                           "5*GM+4*GM",
                           "RW+WN+QN",
                           "DR+RW+PL+FN+2*GM+2*RES+2*SIN+ARMA11+MA1+WN+QN",
                           "XY",
                           "GM1",
                           "WN+8*RES+8*SIN",
                           "9*SIN",
                           "2**GM"}) {
    const auto spec = parse_model(text);
    if (spec)
      answer.line(text, "->", spec->name(), spec->parameter_count(), spec->count(ProcessKind::kGaussMarkov));
    else
      answer.line(text, "->", static_cast<int>(spec.error().kind), spec.error().text());
  }
  answer.line(component_names(kEveryKind));
  for (const int level : {1, 4, 10}) answer.line(level, model_wv(kEveryKind, level));
  expect_recorded("models/noise/model_names.txt", answer.text());
}

TEST(ProcessAnswers, ChancesOfChiSquaredAndManyTests) {
  Answer answer;
  for (const double dof : {0.3, 1.0, 2.0, 7.5, 100.0, 1e5, 1e7, 0.99e8, 1e8, 1e9}) {
    for (const double p : {1e-6, 0.025, 0.5, 0.975, 1.0 - 1e-6})
      answer.line(dof, p, chi_squared_quantile(dof, p));
    for (const double x : {0.1, 5.0, 150.0, 1e5}) answer.line(dof, x, chi_squared_p_value(x, dof));
  }
  answer.line(holm_adjusted({0.01, std::nullopt, 0.04, 0.03, 0.005, 0.9, 0.4}));
  expect_recorded("models/noise/chances.txt", answer.text(), 1e-6, 1e-300);
}

}  // namespace
}  // namespace imuscope::noise::process_answers
