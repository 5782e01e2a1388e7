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

TEST(LineReader, GivesWhatTheStandardLibraryGivesForLinesOfEveryLength) {
  std::string text;
  for (std::size_t length = 0; length < 1100; ++length) {
    for (std::size_t i = 0; i < length; ++i) text += static_cast<char>('\v' + (length * 31 + i * 7) % 240);
    if (length % 5 == 0 && length > 0) text.back() = '\0';
    text += '\n';
  }
  for (const std::string& whole : {text, text + std::string(511, 'e'), text + std::string(1022, 'e')}) {
    std::istringstream in(whole);
    std::istringstream same(whole);
    std::string line;
    std::string expected;
    std::uint64_t passed = 0;
    while (std::getline(same, expected)) {
      ASSERT_TRUE(read_line(in, line, 2000, passed));
      ASSERT_EQ(line, expected);
      ASSERT_EQ(in.eof(), same.eof());
    }
    EXPECT_FALSE(read_line(in, line, 2000, passed));
    EXPECT_TRUE(in.eof());
    EXPECT_EQ(passed, whole.size());
  }
}

}  // namespace
}  // namespace imuscope
