#include "models/noise/holm.h"

#include <gtest/gtest.h>

namespace imuscope::noise {
namespace {

TEST(Holm, AdjustsAsInThePublishedExample) {
  // p.adjust(c(0.01, 0.04, 0.03, 0.005), "holm") of R: 0.03 0.06 0.06 0.02.
  const auto adjusted = holm_adjusted({0.01, 0.04, 0.03, 0.005});
  EXPECT_NEAR(*adjusted[0], 0.03, 1e-15);
  EXPECT_NEAR(*adjusted[1], 0.06, 1e-15);
  EXPECT_NEAR(*adjusted[2], 0.06, 1e-15);
  EXPECT_NEAR(*adjusted[3], 0.02, 1e-15);
}

TEST(Holm, ATestThatWasNotMadeDoesNotCount) {
  const auto adjusted = holm_adjusted({0.02, std::nullopt, 0.9});
  EXPECT_NEAR(*adjusted[0], 0.04, 1e-15);
  EXPECT_FALSE(adjusted[1]);
  EXPECT_NEAR(*adjusted[2], 0.9, 1e-15);
  EXPECT_TRUE(holm_adjusted({}).empty());
}

}  // namespace
}  // namespace imuscope::noise
