#include "models/certificate/models_interval.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

namespace imuscope::certificate {
namespace {

constexpr double kConfidence = 0.95;
constexpr double kZ = 1.959963985;

TEST(ModelsInterval, OfOneModelIsItsOwn) {
  const Interval interval = models_interval(std::vector<ModelsValue>{{3.0, 10.0, 8.0, 15.0}}, kConfidence);
  EXPECT_DOUBLE_EQ(interval.low, 8.0);
  EXPECT_DOUBLE_EQ(interval.high, 15.0);
}

TEST(ModelsInterval, ReachesOverAModelThatFitsAsWell) {
  const std::vector<ModelsValue> models{
      {2.0, 10.0, 8.0, 15.0}, {2.0, 14.0, 13.0, 17.0}, {1.0, 6.0, 5.0, 7.0}};
  const Interval interval = models_interval(models, kConfidence);
  EXPECT_DOUBLE_EQ(interval.low, 5.0);
  EXPECT_DOUBLE_EQ(interval.high, 17.0);
}

// A parabola of deviance that begins at 2 is at 1.96^2 where 1.8416 of 3.8416 are left.
TEST(ModelsInterval, TakesOfAWorseModelWhatItsMisfitLeaves) {
  const std::vector<ModelsValue> models{{2.0, 0.0, -kZ, kZ}, {5.0, 10.0, 10.0 - kZ, 10.0 + kZ}};
  EXPECT_NEAR(models_interval(models, kConfidence).high, 10.0 + std::sqrt(kZ * kZ - 2.0), 1e-9);
}

TEST(ModelsInterval, TakesOfTheChosenModelNoMoreWhereAnotherIsLikelier) {
  const std::vector<ModelsValue> models{{5.0, 10.0, 10.0 - kZ, 10.0 + kZ}, {2.0, 0.0, -kZ, kZ}};
  const Interval interval = models_interval(models, kConfidence);
  EXPECT_NEAR(interval.high, 10.0 + std::sqrt(kZ * kZ - 2.0), 1e-9);
  EXPECT_NEAR(interval.low, -kZ, 1e-9);
}

TEST(ModelsInterval, HoldsTheChosenModelsValueHoweverUnlikely) {
  const std::vector<ModelsValue> models{{50.0, 10.0, 10.0 - kZ, 10.0 + kZ}, {2.0, 0.0, -kZ, kZ}};
  EXPECT_DOUBLE_EQ(models_interval(models, kConfidence).high, 10.0);
}

TEST(ModelsInterval, HasNothingOfAModelThatIsOutOfTheQuestion) {
  const std::vector<ModelsValue> models{{2.0, 0.0, -kZ, kZ}, {6.9, 10.0, 10.0 - kZ, 10.0 + kZ}};
  EXPECT_NEAR(models_interval(models, kConfidence).high, kZ, 1e-9);
}

// Two readings of a number, the second shifted or not: which, a witness tells badly. The model of fewer
// parameters (no shift) is chosen as long as the witness does not speak against it, and alone it holds too seldom.
TEST(ModelsInterval, HoldsAboutAsOftenAsItSaysWhicheverModelIsRight) {
  std::mt19937_64 random(11);
  std::normal_distribution<double> normal;
  constexpr int kDraws = 20'000;
  for (const double shift : {0.0, 1.0, 2.0, 3.0, 6.0}) {
    int held = 0;
    int held_alone = 0;
    for (int i = 0; i < kDraws; ++i) {
      const double first = normal(random);
      const double witness = shift + normal(random);
      // Without a shift the mean of both readings; with one the first alone.
      const double root = std::sqrt(0.5);
      const double mean = 0.5 * (first + witness);
      const ModelsValue without{0.5 * (first - witness) * (first - witness) + 1.0, mean, mean - kZ * root,
                                mean + kZ * root};
      const ModelsValue with{2.0, first, first - kZ, first + kZ};
      const bool chosen = without.misfit < with.misfit + kZ * kZ;
      const std::vector<ModelsValue> models{chosen ? without : with, chosen ? with : without};
      const Interval interval = models_interval(models, kConfidence);
      const Interval alone{models.front().ci_low, models.front().ci_high};
      held += interval.low <= 0.0 && 0.0 <= interval.high ? 1 : 0;
      held_alone += alone.low <= 0.0 && 0.0 <= alone.high ? 1 : 0;
    }
    EXPECT_GE(static_cast<double>(held) / kDraws, 0.93) << shift;
    EXPECT_LE(static_cast<double>(held) / kDraws, 0.98) << shift;
    if (shift == 2.0) {
      EXPECT_LT(static_cast<double>(held_alone) / kDraws, 0.85);
    }
  }
}

}  // namespace
}  // namespace imuscope::certificate
