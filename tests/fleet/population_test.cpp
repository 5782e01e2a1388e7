/// What a population tells, against truths that were planted.

#include "fleet/population.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "models/noise/random_effects.h"

namespace imuscope::test {
namespace {

constexpr std::uint32_t kUnitsDrawn = 20;
constexpr std::uint32_t kDrivesDrawn = 8;
constexpr double kMean = 1.5;

/// One quantity of a fleet; `more` is added to a value of a unit in a drive.
template <typename More>
fleet::Fleet fleet_with(const More& more, double days_between = 20.0) {
  std::mt19937_64 random(7);
  std::normal_distribution<double> normal;
  fleet::Fleet fleet;
  fleet.devices = {"imu"};
  fleet::Quantity quantity{"angle random walk", "static", "gyro_x", "deg/sqrt(h)", true, false, {}, {}};
  for (std::uint32_t u = 0; u < kUnitsDrawn; ++u) {
    fleet.units.push_back("unit" + std::to_string(u));
    const double unit = 0.1 * normal(random);
    for (std::uint32_t d = 0; d < kDrivesDrawn; ++d) {
      const auto capture = static_cast<std::uint32_t>(fleet.captures.size());
      fleet.captures.push_back("capture" + std::to_string(capture));
      fleet.days.push_back(20000.0 + days_between * d);
      fleet.temperatures_degC.push_back({std::nan("")});
      quantity.values.push_back(
          {u, capture, 0, kMean + unit + 0.05 * normal(random) + 0.02 * normal(random) + more(u, d), 0.02});
    }
    quantity.stated.push_back({u, "data sheet", kMean, 0.0});
  }
  fleet.quantities.push_back(std::move(quantity));
  return fleet;
}

TEST(Population, OfAnOrdinaryFleetFindsNothingAndItsSpreads) {
  const auto results = fleet::population_of(fleet_with([](auto, auto) { return 0.0; }));
  const auto& effects = *results.front().effects;
  EXPECT_LT(effects.mean.low, kMean);
  EXPECT_GT(effects.mean.high, kMean);
  EXPECT_LT(effects.unit_sd.low, 0.1);
  EXPECT_GT(effects.unit_sd.high, 0.1);
  EXPECT_NEAR(effects.drive_sd->value, 0.05, 0.02);
  for (const auto& tests :
       {results.front().outlying_units, results.front().outlying_drives, results.front().drifts})
    for (const auto& test : tests) EXPECT_GT(test.p_corrected, 0.05);
  EXPECT_EQ(results.front().outlying_units.size(), kUnitsDrawn);
  for (const auto& holding : results.front().holdings) EXPECT_STRNE(fleet::words_of(holding, 1.25), "no");
}

TEST(Population, FindsTheUnitThatIsUnlikeTheOthersAndNoLongerHolds) {
  const auto results =
      fleet::population_of(fleet_with([](std::uint32_t u, auto) { return u == 4 ? 0.8 : 0.0; }));
  std::vector<std::uint32_t> found;
  for (const auto& test : results.front().outlying_units)
    if (test.p_corrected < 0.05) found.push_back(test.unit);
  EXPECT_EQ(found, std::vector<std::uint32_t>{4});
  for (const auto& holding : results.front().holdings)
    EXPECT_EQ(std::string(fleet::words_of(holding, 1.25)) == "no", holding.unit == 4);
}

TEST(Population, FindsTheDriveThatIsUnlikeTheOthersOfItsUnit) {
  const auto fleet =
      fleet_with([](std::uint32_t u, std::uint32_t d) { return u == 7 && d == 3 ? 0.6 : 0.0; });
  const auto results = fleet::population_of(fleet);
  std::vector<std::string> found;
  for (const auto& test : results.front().outlying_drives)
    if (test.p_corrected < 0.05) found.push_back(fleet.captures[*test.capture]);
  EXPECT_EQ(found, std::vector<std::string>{"capture" + std::to_string(7 * kDrivesDrawn + 3)});
}

TEST(Population, FindsTheUnitThatDriftsOverMonths) {
  const auto results = fleet::population_of(
      fleet_with([](std::uint32_t u, std::uint32_t d) { return u == 2 ? 0.1 * d : 0.0; }));
  std::vector<std::uint32_t> found;
  for (const auto& test : results.front().drifts) {
    if (test.p_corrected >= 0.05) continue;
    found.push_back(test.unit);
    EXPECT_NEAR(test.test.deviation, 0.1 / 20.0 * 365.25, 0.5);
  }
  EXPECT_EQ(found, std::vector<std::uint32_t>{2});
}

TEST(Population, OfAFewDaysTellsNoDrift) {
  const auto results = fleet::population_of(fleet_with([](auto, std::uint32_t d) { return 0.1 * d; }, 1.0));
  EXPECT_TRUE(results.front().drifts.empty());
  EXPECT_FALSE(results.front().per_year);
}

TEST(Population, TakesTemperatureOutAndTellsIt) {
  auto fleet = fleet_with([](auto, auto) { return 0.0; });
  for (auto& value : fleet.quantities.front().values) {
    const double degC = 5.0 + 37.0 * std::fmod(0.618 * value.capture, 1.0);
    fleet.temperatures_degC[value.capture][0] = degC;
    value.value += 0.03 * degC;
  }
  const auto results = fleet::population_of(fleet);
  ASSERT_TRUE(results.front().per_degC);
  EXPECT_NEAR(results.front().per_degC->value, 0.03, 4.0 * results.front().per_degC->sd);
  EXPECT_LT(results.front().per_degC->sd, 0.001);
  EXPECT_NEAR(results.front().effects->drive_sd->value, 0.05, 0.02);
}

TEST(NestedEffects, OfOneDriveAUnitAreTheRandomEffectsOfOneLevel) {
  const std::vector<double> values{1.0, 1.4, 0.7, 1.9, 1.2, 1.1};
  const std::vector<double> variances{0.01, 0.02, 0.01, 0.03, 0.01, 0.02};
  std::vector<noise::DriveValue> rows;
  for (std::size_t i = 0; i < values.size(); ++i) rows.push_back({i, values[i], variances[i], {}});
  const auto nested = noise::nested_effects(rows);
  const auto one = noise::random_effects(values, variances, 0.95);
  ASSERT_TRUE(nested && one);
  EXPECT_FALSE(nested->drive_sd);
  EXPECT_NEAR(nested->mean.value, one->mean, 1e-9);
  EXPECT_NEAR(nested->unit_sd.value, one->spread, 1e-9);
  // Two roads to an interval for five degrees of freedom.
  EXPECT_NEAR(nested->unit_sd.low, one->spread_low, 0.02);
  EXPECT_NEAR(nested->unit_sd.high, one->spread_high, 0.1);
  EXPECT_NEAR(nested->mean.low, one->ci_low, 0.03);
  EXPECT_NEAR(nested->mean.high, one->ci_high, 0.03);
}

TEST(NestedEffects, RefuseWhatIsNoNumber) {
  EXPECT_FALSE(noise::nested_effects(std::vector<noise::DriveValue>{{0, 1.0, 1.0, {}}}));
  EXPECT_FALSE(
      noise::nested_effects(std::vector<noise::DriveValue>{{0, 1.0, 1.0, {}}, {1, std::nan(""), 1.0, {}}}));
  EXPECT_FALSE(noise::nested_effects(std::vector<noise::DriveValue>{{0, 1.0, 1.0, {}}, {1, 1.0, 0.0, {}}}));
}

TEST(NestedEffects, OfDrivesThatAreAllTheSameHaveNoSpread) {
  std::vector<noise::DriveValue> rows;
  for (std::size_t u = 0; u < 4; ++u)
    for (int d = 0; d < 3; ++d) rows.push_back({u, 2.0, 0.01, {}});
  const auto effects = noise::nested_effects(rows);
  ASSERT_TRUE(effects);
  EXPECT_EQ(effects->unit_sd.value, 0.0);
  EXPECT_EQ(effects->drive_sd->value, 0.0);
  EXPECT_NEAR(effects->mean.value, 2.0, 1e-12);
  EXPECT_LT(effects->mean.low, 2.0);
}

}  // namespace
}  // namespace imuscope::test
