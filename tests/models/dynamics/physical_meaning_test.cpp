#include "models/dynamics/physical_meaning.h"

#include <gtest/gtest.h>

#include <numbers>

#include "models/dynamics/covariates.h"

namespace imuscope {
namespace {

TEST(PhysicalMeaning, TranslatesWhatTheAxesMean) {
  EXPECT_EQ(describe_coefficient(0, 1, std::numbers::pi / 180.0), "misalignment of 1e+03 mdeg");
  EXPECT_EQ(describe_coefficient(0, 0, 0.002), "scale error of 2e+03 ppm");
  EXPECT_EQ(describe_coefficient(1, 4, 30e-6), "time offset of 30 us");
  EXPECT_EQ(describe_coefficient(4, 13, 30e-6), "time offset of 30 us");
  EXPECT_EQ(describe_coefficient(3, 4, 0.005), "lever arm of 5 mm");
  // 0.01 deg/s per g
  EXPECT_EQ(describe_coefficient(2, 9, 0.01 * std::numbers::pi / 180.0 / 9.80665),
            "g-sensitivity of 0.01 deg/s per g");
}

TEST(PhysicalMeaning, HasAUnitForEveryAxisAndCovariate) {
  for (std::size_t axis = 0; axis < 6; ++axis) {
    for (std::size_t i = 0; i < kCovariates; ++i) {
      const auto meaning = physical_meaning(axis, i);
      EXPECT_FALSE(meaning.what.empty());
      EXPECT_FALSE(meaning.unit.empty());
      EXPECT_GT(meaning.factor, 0.0);
    }
  }
}

}  // namespace
}  // namespace imuscope
