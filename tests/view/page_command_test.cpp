/// What a page may ask for, and what it may not.

#include "view/page_command.h"

#include <gtest/gtest.h>

namespace imuscope::view {
namespace {

TEST(PageCommand, IsOneOfFour) {
  const auto mark = read_page_command(R"({"mark":"kerb on the left"})");
  ASSERT_TRUE(mark);
  EXPECT_EQ(std::get<Mark>(*mark).text, "kerb on the left");
  const auto seek = read_page_command(R"({"seek_s":12.5})");
  ASSERT_TRUE(seek);
  EXPECT_EQ(std::get<Seek>(*seek).time_s, 12.5);
  EXPECT_EQ(std::get<Seek>(*read_page_command(R"({"seek_s":-3})")).time_s, 0.0);
  EXPECT_TRUE(std::holds_alternative<Pause>(*read_page_command(R"({"pause":true})")));
  EXPECT_EQ(std::get<Play>(*read_page_command(R"({"play":10})")).speed, 10.0);
}

TEST(PageCommand, ATextIsOneLineOfBoundedLength) {
  EXPECT_EQ(std::get<Mark>(*read_page_command(R"({"mark":""})")).text, "mark");
  EXPECT_EQ(std::get<Mark>(*read_page_command("{\"mark\":\"a\\nb\\u001b[2J\"}")).text, "a?b?[2J");
  const auto longest = read_page_command(R"({"mark":")" + std::string(900, 'x') + R"("})");
  ASSERT_TRUE(longest);
  EXPECT_EQ(std::get<Mark>(*longest).text.size(), kMarkTextMax);
}

TEST(PageCommand, EverythingElseIsRefused) {
  for (const char* text :
       {"", "mark", "[]", "{}", "null", R"({"mark":1})", R"({"mark":"a","pause":true})", R"({"seek_s":"1"})",
        R"({"seek_s":1e999})", R"({"play":0})", R"({"play":-1})", R"({"play":1000})", R"({"quit":true})",
        R"({"mark":{"a":{"b":{}}}})", "{\"mark\":\"\xff\"}", R"({"mark":"a")"})
    EXPECT_FALSE(read_page_command(text)) << text;
  EXPECT_FALSE(read_page_command(R"({"mark":")" + std::string(kPageMessageMax, 'x') + R"("})"));
  EXPECT_FALSE(read_page_command(std::string(kPageMessageMax, '[')));
}

}  // namespace
}  // namespace imuscope::view
