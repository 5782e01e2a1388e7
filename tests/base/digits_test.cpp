#include "base/digits.h"

#include <gtest/gtest.h>

namespace imuscope {
namespace {

TEST(DigitsBeside, WhatMissesItsGoalByLittleDoesNotReadAsIfItMetIt) {
  EXPECT_EQ(digits_beside(0.1049, 0.1), "0.105");
  EXPECT_EQ(digits_beside(0.10004, 0.1), "0.1");
  EXPECT_EQ(digits_beside(0.1004, 0.1), "0.1004");
}

TEST(DigitsBeside, OthersHaveTwoDigitsWithoutAPowerOfTen) {
  EXPECT_EQ(digits_beside(0.2512, 0.1), "0.25");
  EXPECT_EQ(digits_beside(500.0, 10.0), "500");
  EXPECT_EQ(digits_beside(99.6, 10.0), "100");
}

}  // namespace
}  // namespace imuscope
