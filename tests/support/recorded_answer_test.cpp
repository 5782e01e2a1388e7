#include "tests/support/recorded_answer.h"

#include <gtest/gtest.h>

namespace imuscope::test {
namespace {

TEST(RecordedAnswer, IsHeldToItsWordsAndToItsNumbersButForRounding) {
  EXPECT_EQ(first_difference("a 1.0 b\nc -2e3\n", "a 1.0 b\nc -2e3\n"), "");
  EXPECT_EQ(first_difference("psi 1.0000000 deg", "psi 1.0000005 deg"), "");
  EXPECT_EQ(first_difference("psi 1.00000 deg", "psi 1.00001 deg"),
            "line 1: recorded \"psi 1.00000 deg\", now \"psi 1.00001 deg\"");
  EXPECT_NE(first_difference("psi 1.0", "psi -1.0"), "");
  EXPECT_NE(first_difference("psi 1.0", "r 1.0"), "");
  EXPECT_NE(first_difference("psi 1.0 deg", "psi 1.0"), "");
  EXPECT_NE(first_difference("psi 1.0", "psi nan"), "");
}

TEST(RecordedAnswer, OfRoundingAloneMayBeAnything) {
  EXPECT_EQ(first_difference("1e-17", "-3e-16"), "");
  EXPECT_NE(first_difference("1e-9", "-3e-9"), "");
  EXPECT_EQ(first_difference("1.00", "1.01", 0.02), "");
  EXPECT_EQ(first_difference("0.001", "-0.001", 0.0, 0.01), "");
}

TEST(RecordedAnswer, HasNoLineMoreAndNoneLess) {
  EXPECT_EQ(first_difference("a\nb\n", "a\n"), "line 2: recorded \"b\", now \"(no line)\"");
  EXPECT_EQ(first_difference("a\n", "a\nb\n"), "line 2: recorded \"(no line)\", now \"b\"");
}

}  // namespace
}  // namespace imuscope::test
