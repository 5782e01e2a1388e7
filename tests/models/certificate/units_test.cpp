#include "models/certificate/units.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "made_record.h"

namespace imuscope::certificate {
namespace {

/// A certificate that holds one term alone.
std::vector<AxisCertificate> with_walk(double value, double log_sd) {
  AxisCertificate axis;
  axis.name = "gyro_x";
  axis.unit = noise::SignalUnit::kDegps;
  const double factor = std::exp(1.959964 * log_sd);
  axis.terms.push_back({Term::kRandomWalk, "deg/sqrt(h)", value, value / factor, value * factor,
                        noise::Knowledge::kFitted, ""});
  return {axis};
}

// Howe, W. G. (1969) and ISO 16269-6, table: one-sided, 95 % of the population with 95 % confidence.
TEST(Units, ToleranceFactorsAreThoseOfTheTables) {
  EXPECT_NEAR(tolerance_factor(5, 0.95, 0.95), 4.203, 5e-3);
  EXPECT_NEAR(tolerance_factor(10, 0.95, 0.95), 2.911, 5e-3);
  EXPECT_NEAR(tolerance_factor(30, 0.95, 0.95), 2.220, 5e-3);
}

TEST(Units, MostNewUnitsAreBelowTheToleranceBound) {
  std::mt19937_64 random(1);
  std::normal_distribution<double> normal;
  constexpr int kFleets = 1000;
  constexpr int kUnits = 8;
  int covers = 0;
  for (int fleet = 0; fleet < kFleets; ++fleet) {
    std::vector<std::vector<AxisCertificate>> records;
    for (int unit = 0; unit < kUnits; ++unit)
      records.push_back(with_walk(std::exp(0.2 * normal(random) + 0.01 * normal(random)), 0.01));
    const auto population = population_of(records);
    ASSERT_EQ(population.size(), 1U);
    // The 95th percentile of the true values.
    covers += *population.front().tolerance_upper >= std::exp(1.6449 * 0.2) ? 1 : 0;
  }
  EXPECT_NEAR(covers, 0.95 * kFleets, 3.3 * std::sqrt(0.95 * 0.05 * kFleets));
}

TEST(Units, AUnitThatStandsOutIsNamedAndSeldomAnyOther) {
  std::mt19937_64 random(2);
  std::normal_distribution<double> normal;
  int false_alarms = 0;
  constexpr int kFleets = 1000;
  for (int fleet = 0; fleet < kFleets; ++fleet) {
    std::vector<std::vector<AxisCertificate>> records;
    for (int unit = 0; unit < 10; ++unit) records.push_back(with_walk(std::exp(0.1 * normal(random)), 0.01));
    const auto population = population_of(records);
    bool any = false;
    for (const auto& p : population.front().p_values) any = any || *p < 0.05;
    false_alarms += any ? 1 : 0;
  }
  EXPECT_NEAR(false_alarms, 0.05 * kFleets, 3.3 * std::sqrt(0.05 * 0.95 * kFleets));
  std::vector<std::vector<AxisCertificate>> records;
  for (int unit = 0; unit < 9; ++unit) records.push_back(with_walk(std::exp(0.1 * normal(random)), 0.01));
  records.push_back(with_walk(2.5, 0.01));
  EXPECT_LT(*population_of(records).front().p_values.back(), 1e-3);
}

}  // namespace
}  // namespace imuscope::certificate
