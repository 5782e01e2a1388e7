/// Random effects of one and of two levels as they were once.

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include "answer.h"
#include "models/noise/nested_effects.h"
#include "models/noise/random_effects.h"
#include "models/noise/spread_solver.h"
#include "tests/support/recorded_answer.h"

namespace imuscope::noise::effects_answers {
namespace {

using imuscope::test::expect_recorded;
using test::Answer;

struct Kind {
  std::size_t units;
  std::size_t drives;  ///< of a unit; of the first one alone where `uneven`
  double unit_sd;
  double drive_sd;
  std::size_t covariates = 0;
  bool uneven = false;
};

/// Units about 3, drives about them, each with an error of its own; what follows the covariates comes on top.
std::vector<DriveValue> drives_of(const Kind& kind, unsigned seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  std::vector<DriveValue> out;
  for (std::size_t u = 0; u < kind.units; ++u) {
    const double unit = 3.0 + kind.unit_sd * normal(random);
    const std::size_t n = kind.uneven && u > 0 ? 1 : kind.drives;
    for (std::size_t j = 0; j < n; ++j) {
      DriveValue value;
      value.unit = u;
      value.variance = 0.01 * (1.0 + static_cast<double>((u + j) % 4));
      value.value = unit + kind.drive_sd * normal(random) + std::sqrt(value.variance) * normal(random);
      for (std::size_t c = 0; c < kind.covariates; ++c) {
        value.covariates.push_back(20.0 + 5.0 * normal(random));
        value.value += (c == 0 ? 0.05 : -0.02) * (value.covariates.back() - 20.0);
      }
      out.push_back(value);
    }
  }
  return out;
}

void add_spread(Answer& answer, std::string_view what, const Spread95& s) {
  answer.line(what, s.value, s.low, s.high);
}

void add_deviation(Answer& answer, const std::optional<Deviation>& d) {
  if (d)
    answer.line(d->deviation, d->t, d->dof, d->p_value);
  else
    answer.line("none");
}

void add_effects(Answer& answer, const std::vector<DriveValue>& values) {
  const auto effects = nested_effects(values);
  if (!effects) {
    answer.line("no effects");
    return;
  }
  answer.line("units", effects->units, "drives", effects->drives);
  add_spread(answer, "mean", effects->mean);
  add_spread(answer, "between units", effects->unit_sd);
  if (effects->drive_sd) add_spread(answer, "between drives", *effects->drive_sd);
  answer.line("tolerance", effects->tolerance_low, effects->tolerance_high);
  for (const Slope& slope : effects->slopes) answer.line("slope", slope.value, slope.sd);
  for (const UnitEffect& unit : effects->of_units) {
    answer.line("unit", unit.drives, unit.mean, unit.variance);
    add_deviation(answer, unit.out);
  }
  answer.line("drives", effects->of_drives.size());
  for (const auto& drive : effects->of_drives) add_deviation(answer, drive);
}

TEST(EffectsAnswers, NestedOnes) {
  Answer answer;
  const std::vector<Kind> kinds{{5, 4, 0.5, 0.2},          {3, 2, 0.0, 0.0},         {2, 3, 1.0, 0.1},
                                {6, 1, 0.4, 0.0},          {4, 5, 0.3, 0.3, 1},      {4, 4, 0.2, 0.1, 2},
                                {3, 4, 0.3, 0.2, 0, true}, {2, 1, 0.5, 0.0},         {1, 5, 0.5, 0.1},
                                {3, 2, 0.0, 0.3, 3},       {2, 2, 0.4, 0.3, 1, true}};
  unsigned seed = 60;
  for (const Kind& kind : kinds) {
    answer.line("kind", kind.units, kind.drives, kind.unit_sd, kind.drive_sd, kind.covariates, kind.uneven);
    add_effects(answer, drives_of(kind, ++seed));
  }
  expect_recorded("models/noise/nested_effects.txt", answer.text());
}

TEST(EffectsAnswers, OddValues) {
  Answer answer;
  add_effects(answer, {});
  // One unit far from all others, and one drive of it.
  auto values = drives_of({4, 4, 0.1, 0.05}, 80);
  for (DriveValue& value : values) value.value += value.unit == 2 ? 4.0 : 0.0;
  values[5].value += 2.0;
  add_effects(answer, values);
  // Values that differ by nothing.
  for (DriveValue& value : values) value.value = 3.0;
  add_effects(answer, values);
  // A covariate that changes between the units alone tells nothing, one that changes within them does.
  values = drives_of({3, 4, 0.2, 0.1, 2}, 81);
  for (DriveValue& value : values) value.covariates[0] = static_cast<double>(value.unit);
  add_effects(answer, values);
  for (const double bad : {std::numeric_limits<double>::quiet_NaN(), HUGE_VAL, 0.0, -1.0}) {
    auto wrong = values;
    wrong[3].variance = bad;
    EXPECT_FALSE(nested_effects(wrong)) << bad;
    const std::vector<double> time(wrong.size(), 1.0);
    for (const auto& drift : unit_drifts(wrong, time)) EXPECT_FALSE(drift);
  }
  values[2].value = std::numeric_limits<double>::infinity();
  EXPECT_FALSE(nested_effects(values));
  expect_recorded("models/noise/odd_effects.txt", answer.text());
}

TEST(EffectsAnswers, DriftsOfUnits) {
  Answer answer;
  for (const double drive_sd : {0.0, 0.3}) {
    auto values = drives_of({4, 5, 0.5, drive_sd}, 82);
    // The last unit has two drives, and none is told of it.
    while (values.back().unit == 3 && values[values.size() - 3].unit == 3) values.pop_back();
    std::vector<double> time;
    for (std::size_t j = 0; j < values.size(); ++j) {
      time.push_back(static_cast<double>(j * j % 11));
      values[j].value += values[j].unit == 1 ? 0.1 * time.back() : 0.0;
    }
    const auto drifts = unit_drifts(values, time);
    answer.line("units", drifts.size());
    for (const auto& drift : drifts) add_deviation(answer, drift);
    // Of a unit whose drives are all at one time nothing is told.
    for (std::size_t j = 0; j < values.size(); ++j)
      if (values[j].unit == 0) time[j] = 7.0;
    const auto of_one_time = unit_drifts(values, time);
    EXPECT_FALSE(of_one_time[0]);
    for (const auto& drift : of_one_time) add_deviation(answer, drift);
  }
  EXPECT_TRUE(unit_drifts({}, {}).empty());
  const auto few = drives_of({2, 2, 0.5, 0.1}, 83);
  for (const auto& drift : unit_drifts(few, std::vector<double>{1.0, 2.0, 1.0, 2.0})) EXPECT_FALSE(drift);
  expect_recorded("models/noise/unit_drifts.txt", answer.text());
}

TEST(EffectsAnswers, OfOneLevel) {
  Answer answer;
  const std::vector<double> values{1.0, 1.3, 0.8, 1.9, 1.1};
  for (const double scale : {0.01, 0.1, 1.0}) {
    std::vector<double> variances;
    for (std::size_t k = 0; k < values.size(); ++k)
      variances.push_back(scale * (1.0 + 0.3 * static_cast<double>(k)));
    for (const std::size_t n : {2, 3, 5}) {
      const auto e =
          random_effects(std::span(values).first(n), std::span(variances).first(n), n == 3 ? 0.8 : 0.95)
              .value();
      answer.line(n, scale, e.mean, e.sd, e.ci_low, e.ci_high, e.spread, e.spread_low, e.spread_high);
    }
    EXPECT_FALSE(random_effects(std::span(values).first(1), std::span(variances).first(1), 0.95));
    for (const double bad : {0.0, -0.1, HUGE_VAL, std::numeric_limits<double>::quiet_NaN()}) {
      auto wrong = variances;
      wrong[1] = bad;
      EXPECT_FALSE(random_effects(values, wrong, 0.95)) << bad;
    }
  }
  const std::vector<double> no_number{1.0, std::numeric_limits<double>::quiet_NaN()};
  EXPECT_FALSE(random_effects(no_number, std::vector{1.0, 1.0}, 0.95));
  expect_recorded("models/noise/random_effects.txt", answer.text());
}

TEST(EffectsAnswers, TheVarianceOfASumOfSquares) {
  const auto q_at = [](double variance) { return 12.0 / (1.0 + variance) + 6.0 / (3.0 + variance); };
  const auto with_fall = [&](double v) {
    return SumOfSquares{q_at(v), 12.0 / ((1.0 + v) * (1.0 + v)) + 6.0 / ((3.0 + v) * (3.0 + v))};
  };
  for (const double q : {13.9, 6.0, 0.5, 1e-3}) {
    const double by_halves = variance_at(q_at, q, 1e-3);
    EXPECT_NEAR(q_at(by_halves), q, 1e-9 * q);
    EXPECT_NEAR(variance_at(q_at, q, 1e6), by_halves, 1e-9 * by_halves);
    EXPECT_NEAR(variance_by_newton(with_fall, q).value(), by_halves, 1e-9 * by_halves);
  }
  EXPECT_EQ(variance_at(q_at, 14.0, 1.0), 0.0);
  EXPECT_EQ(variance_by_newton(with_fall, 14.0), 0.0);
  EXPECT_EQ(variance_by_newton(with_fall, 14.1), 0.0);
  // One that does not fall, or rises, has no such variance.
  EXPECT_FALSE(variance_by_newton([](double) { return SumOfSquares{2.0, 0.0}; }, 1.0));
  EXPECT_FALSE(variance_by_newton([](double) { return SumOfSquares{2.0, -1.0}; }, 1.0));
  EXPECT_FALSE(variance_by_newton([](double) { return SumOfSquares{2.0, 1.0}; }, 1.0));
}

}  // namespace
}  // namespace imuscope::noise::effects_answers
