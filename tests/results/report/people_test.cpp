#include "results/report/people.h"

#include <gtest/gtest.h>

#include <cmath>

namespace imuscope::report {
namespace {

TEST(People, TheSdDecidesHowManyDigitsAreShown) {
  EXPECT_EQ(with_sd(0.812345, 0.00712).str(), "0.8123 ± 0.0071");
  EXPECT_EQ(with_sd(-351.26, 0.83).str(), "−351.26 ± 0.83");
  EXPECT_EQ(with_sd(1234.5, 87.0).str(), "1234 ± 87");
  EXPECT_EQ(with_sd(1.5e-5, 2.1e-6).str(), "(1.50 ± 0.21) × 10<sup>−5</sup>");
}

TEST(People, WithoutAUsableSdTheNumberStandsAlone) {
  EXPECT_EQ(with_sd(0.5, {}).str(), "0.5000");
  EXPECT_EQ(with_sd(0.5, 0.0).str(), "0.5000");
  EXPECT_EQ(with_sd(0.5, std::nan("")).str(), "0.5000");
}

TEST(People, UnknownIsADashAndNeverANumber) {
  EXPECT_EQ(number(std::optional<double>{}).str(), kUnknown);
  EXPECT_EQ(number(std::nan("")).str(), kUnknown);
  EXPECT_EQ(with_sd(std::nan(""), 1.0).str(), kUnknown);
  EXPECT_EQ(count({}).str(), kUnknown);
  EXPECT_EQ(in_sd(1.0, {}), kUnknown);
}

TEST(People, IntervalsShareDigitsAndPowerWithTheirValue) {
  EXPECT_EQ(with_interval(0.50552, 0.50517, 0.50587).str(),
            "0.50552 <span class=\"interval\">[0.50517, 0.50587]</span>");
  EXPECT_EQ(with_interval(1.0e-4, 0.8e-4, 1.3e-4).str(),
            "1.00 <span class=\"interval\">[0.80, 1.30]</span> × 10<sup>−4</sup>");
}

TEST(People, AVeryOneSidedIntervalKeepsItsLowerEndAboveZero) {
  EXPECT_EQ(with_interval(0.0049, 0.00084, 0.0286).str(),
            "0.00490 <span class=\"interval\">[0.00084, 0.02860]</span>");
}

TEST(People, AnEndThatIsNotKnownLeavesABound) {
  EXPECT_EQ(with_interval(0.0049, std::nullopt, 0.0286).str(),
            "0.004900 <span class=\"interval\">below 0.02860</span>");
  EXPECT_EQ(with_interval(0.0049, 0.0012, std::nullopt).str(),
            "0.004900 <span class=\"interval\">above 0.001200</span>");
  EXPECT_EQ(with_interval(0.0049, std::nullopt, std::nullopt).str(), "0.004900");
}

TEST(People, CountsHaveTheirThousandsApart) { EXPECT_EQ(count(1234567).str(), "1\u202f234\u202f567"); }

TEST(People, DurationsAreWords) {
  EXPECT_EQ(duration_words(59.6), "1 min 0 s");
  EXPECT_EQ(duration_words(900.0), "15 min 0 s");
  EXPECT_EQ(duration_words(7260.0), "2 h 1 min");
}

}  // namespace
}  // namespace imuscope::report
