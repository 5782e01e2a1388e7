#include "base/line_reader.h"

#include <gtest/gtest.h>
#include <sstream>

namespace imuscope {
namespace {

TEST(LineReader, GivesLinesWithoutTheirEndsAndCountsEveryByte) {
  std::istringstream in("one\n\ntwo\r\nlast");
  std::string line;
  std::uint64_t passed = 0;
  ASSERT_TRUE(read_line(in, line, 100, passed));
  EXPECT_EQ(line, "one");
  EXPECT_EQ(passed, 4U);
  ASSERT_TRUE(read_line(in, line, 100, passed));
  EXPECT_EQ(line, "");
  ASSERT_TRUE(read_line(in, line, 100, passed));
  EXPECT_EQ(line, "two\r");
  EXPECT_FALSE(in.eof());
  ASSERT_TRUE(read_line(in, line, 100, passed));
  EXPECT_EQ(line, "last");
  EXPECT_TRUE(in.eof()) << "no line end came";
  EXPECT_FALSE(read_line(in, line, 100, passed));
  EXPECT_EQ(passed, in.str().size());
}

TEST(LineReader, PassesOverWhatALineHasTooMuch) {
  constexpr std::size_t kLongest = 8;
  const std::string endless(1 << 20, 'x');
  std::istringstream in("12345678\n" + endless + "\nnext\n");
  std::string line;
  std::uint64_t passed = 0;
  ASSERT_TRUE(read_line(in, line, kLongest, passed));
  EXPECT_EQ(line, "12345678") << "just fits";
  ASSERT_TRUE(read_line(in, line, kLongest, passed));
  EXPECT_EQ(line.size(), kLongest + 1) << "as much as shows that it is too long";
  EXPECT_LT(line.capacity(), 64U);
  EXPECT_EQ(passed, 9 + endless.size() + 1);
  ASSERT_TRUE(read_line(in, line, kLongest, passed));
  EXPECT_EQ(line, "next");
}

}  // namespace
}  // namespace imuscope
