#include "drivers/device/decimal.h"

#include <gtest/gtest.h>

#include <cstdio>
#include <cstdlib>
#include <random>
#include <string>

namespace imuscope {
namespace {

TEST(Decimal, EveryPlainDecimalIsTheNearestDouble) {
  std::mt19937_64 random(3);
  for (int i = 0; i < 200'000; ++i) {
    std::string text = std::to_string(random() % (std::uint64_t{1} << (random() % 64)));
    if (random() % 4 != 0) text.insert(random() % (text.size() + 1), ".");
    if (random() % 3 == 0) text.insert(0, "-");
    const auto value = read_decimal(text);
    ASSERT_TRUE(value) << text;
    ASSERT_EQ(*value, std::strtod(text.c_str(), nullptr)) << text;
  }
}

TEST(Decimal, WhatIsNoNumberIsNone) {
  for (const char* text :
       {"", "-", "+", ".", "-.", "1.2.3", "12a", " 1", "1 ", "nan", "inf", "1e400", "--1"}) {
    EXPECT_FALSE(read_decimal(text)) << text;
  }
  EXPECT_EQ(read_decimal("+5."), 5.0);
  EXPECT_EQ(read_decimal("-.5"), -0.5);
  EXPECT_EQ(read_decimal("1.5e3"), 1500.0);
}

TEST(Decimal, IntegersAreReadWhole) {
  EXPECT_EQ(read_integer<int>("+07"), 7);
  EXPECT_EQ(read_integer<int>("-12"), -12);
  EXPECT_FALSE(read_integer<int>("1.0"));
  EXPECT_FALSE(read_integer<int>("99999999999"));
  EXPECT_FALSE(read_integer<unsigned>("-1"));
}

}  // namespace
}  // namespace imuscope
