#include "certificate/averaged_interval.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

namespace imuscope::certificate {
namespace {

constexpr double kConfidence = 0.95;
constexpr double kZ = 1.959963985;

TEST(AveragedInterval, OfOneModelIsItsOwn) {
  const Interval interval = averaged_interval(std::vector<ModelsValue>{{3.0, 10.0, 8.0, 15.0}}, kConfidence);
  EXPECT_DOUBLE_EQ(interval.low, 8.0);
  EXPECT_DOUBLE_EQ(interval.high, 15.0);
}

TEST(AveragedInterval, OfModelsThatAgreeIsTheirs) {
  const std::vector<ModelsValue> models{{3.0, 10.0, 8.0, 15.0}, {5.0, 10.0, 8.0, 15.0}, {3.5, 10.0, 8.0, 15.0}};
  const Interval interval = averaged_interval(models, kConfidence);
  EXPECT_NEAR(interval.low, 8.0, 1e-6);
  EXPECT_NEAR(interval.high, 15.0, 1e-6);
}

// Of two that are far apart and believed alike each has its end where 5 % of its own belief lies beyond.
TEST(AveragedInterval, OfTwoThatAreFarApartLeavesTwiceTheShareOutsideOfEach) {
  const std::vector<ModelsValue> models{{0.0, 0.0, -kZ, kZ}, {0.0, 100.0, 100.0 - kZ, 100.0 + kZ}};
  constexpr double kZOf95 = 1.644853627;
  const Interval interval = averaged_interval(models, kConfidence);
  EXPECT_NEAR(interval.low, -kZOf95, 1e-6);
  EXPECT_NEAR(interval.high, 100.0 + kZOf95, 1e-6);
}

TEST(AveragedInterval, HardlyReachesToAModelThatIsHardlyBelieved) {
  const std::vector<ModelsValue> models{{0.0, 0.0, -kZ, kZ}, {12.0, 100.0, 100.0 - kZ, 100.0 + kZ}};
  EXPECT_NEAR(averaged_interval(models, kConfidence).high, kZ, 0.05);
}

TEST(AveragedInterval, HoldsTheChosenModelsValueWhateverTheOthersSay) {
  std::vector<ModelsValue> models{{4.0, 0.0, -kZ, kZ}};
  for (int i = 0; i < 8; ++i) models.push_back({0.0, 100.0, 100.0 - kZ, 100.0 + kZ});
  const Interval interval = averaged_interval(models, kConfidence);
  EXPECT_LE(interval.low, 0.0);
  EXPECT_GT(interval.high, 100.0);
}

TEST(AveragedInterval, OfAModelThatIsSureIsFinite) {
  const std::vector<ModelsValue> models{{0.0, 5.0, 5.0, 5.0}, {0.0, 5.0, 4.0, 6.0}};
  const Interval interval = averaged_interval(models, kConfidence);
  EXPECT_GT(interval.low, 4.0);
  EXPECT_LT(interval.low, 5.0);
  EXPECT_GT(interval.high, 5.0);
  EXPECT_LT(interval.high, 6.0);
}

// One observation of each of two quantities decides which of two models made them: the belief is Bayes', so
// that the intervals hold the truth as often as they say, although neither model alone does.
TEST(AveragedInterval, HoldsAsOftenAsItSaysWhereEitherModelMayBeTheRightOne) {
  std::mt19937_64 random(11);
  std::normal_distribution<double> normal;
  std::bernoulli_distribution coin;
  std::uniform_real_distribution<double> uniform(-1000.0, 1000.0);
  constexpr double kShift = 3.0;     // what the second model takes off the observation
  constexpr double kWitness = 1.5;   // by which sd the witness tells them apart
  constexpr int kDraws = 20'000;
  int held = 0;
  for (int i = 0; i < kDraws; ++i) {
    const double truth = uniform(random);
    const bool second = coin(random);
    const double seen = truth + (second ? kShift : 0.0) + normal(random);
    const double witness = (second ? kWitness : 0.0) + normal(random);
    const double other = seen - kShift;
    const ModelsValue one{witness * witness, seen, seen - kZ, seen + kZ};
    const ModelsValue two{(witness - kWitness) * (witness - kWitness), other, other - kZ, other + kZ};
    const bool first_chosen = one.criterion <= two.criterion;
    const std::vector<ModelsValue> models = first_chosen ? std::vector{one, two} : std::vector{two, one};
    const Interval interval = averaged_interval(models, kConfidence);
    held += interval.low <= truth && truth <= interval.high ? 1 : 0;
  }
  const double share = static_cast<double>(held) / kDraws;
  EXPECT_NEAR(share, kConfidence, 3.3 * std::sqrt(0.95 * 0.05 / kDraws));
}

}  // namespace
}  // namespace imuscope::certificate
