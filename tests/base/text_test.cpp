#include "base/text.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <fstream>
#include <nlohmann/json.hpp>
#include <random>

#include "tests/support/child_process.h"
#include "tests/support/shared_data.h"

namespace imuscope {
namespace {

using testing::EndsWith;
using testing::HasSubstr;

TEST(Printable, LeavesTextOfAnyLanguageAlone) {
  for (const char* text :
       {"", "mtx1: 4.2 ms", "Straße, Kurve rechts", "\u00A0\u07FF\u0800\uFFFD", "\U0001F697\U0010FFFF"})
    EXPECT_EQ(printable(text), text);
}

TEST(Printable, NothingIsLeftThatATerminalObeys) {
  EXPECT_EQ(printable("\x1b]0;title\a\x1b[31mred"), "?]0;title??[31mred");
  EXPECT_EQ(printable("one\ntwo\r\tthree\x7f"), "one?two??three?");
  EXPECT_EQ(printable("\u0085next\u009b31m"),
            "?next?31m");  // C1: next line, and the one-character escape sequence
  EXPECT_EQ(printable(std::string_view("a\0b", 3)), "a?b");
}

TEST(OneLine, IsCutBeforeTheCharacterThatDoesNotFit) {
  EXPECT_EQ(one_line("Straße\n", 6), "Straß");
  EXPECT_EQ(one_line("Straße\n", 5), "Stra");
  EXPECT_EQ(one_line("\U0001F697", 3), "");
  EXPECT_EQ(one_line("a\x1b"
                     "b",
                     3),
            "a?b");
}

TEST(DeviceName, IsWhatCanBePartOfAFileNameAnywhere) {
  for (const char* name : {"mtx1", "MTi-680_roof", "a", "12345678901234567890123456789012"})
    EXPECT_TRUE(is_device_name(name)) << name;
  for (const char* name : {"", "..", "a/b", "a b", "a.b", "ä", "a\n", "123456789012345678901234567890123"})
    EXPECT_FALSE(is_device_name(name)) << name;
  EXPECT_EQ(device_file_name("errors", "mtx1", ".csv"), "errors_mtx1.csv");
}

TEST(Printable, BytesThatAreNoCharacterAreTold) {
  EXPECT_EQ(printable("\xff\xc3"), "??");
  EXPECT_EQ(printable("\xc0\xaf"), "??") << "a slash in more bytes than it needs";
  EXPECT_EQ(printable("\xed\xa0\x80"), "???") << "half of a pair of UTF-16";
  EXPECT_EQ(printable("\xf4\x90\x80\x80"), "????") << "beyond the last character";
}

/// The library that writes JSON refuses what is not UTF-8: an opinion from elsewhere.
TEST(Printable, WhateverComesInGoesOutAsUtf8) {
  std::mt19937 random(7);
  for (int round = 0; round < 20000; ++round) {
    std::string text(random() % 12, ' ');
    for (char& byte : text) byte = static_cast<char>(random() % 3 == 0 ? random() % 64 + 128 : random());
    const std::string shown = printable(text);
    EXPECT_NO_THROW((void)nlohmann::json(shown).dump())
        << nlohmann::json(text).dump(-1, ' ', true, nlohmann::json::error_handler_t::ignore);
    bool library_takes_it = true;
    try {
      (void)nlohmann::json(text).dump();
    } catch (const nlohmann::json::exception&) {
      library_takes_it = false;
    }
    EXPECT_EQ(is_utf8(text), library_takes_it);
    if (!library_takes_it) {
      EXPECT_NE(shown, text);
    }
  }
}

TEST(ReadTextFile, GivesTheContentOrSaysWhatIsThere) {
  const std::filesystem::path folder = test::scratch_folder();
  const auto read = [&](const std::filesystem::path& file) {
    return read_text_file(file, "list", "give a list");
  };
  std::ofstream(folder / "text") << std::string("a\0b\n", 4);
  EXPECT_EQ(read(folder / "text").value(), std::string("a\0b\n", 4));
  std::ofstream(folder / "empty");
  EXPECT_EQ(read(folder / "empty").value(), "");

  EXPECT_THAT(read(folder / "none").error().text(), EndsWith("none does not exist; give a list"));
  EXPECT_THAT(read(folder).error().text(), HasSubstr("is a folder"));
  EXPECT_THAT(read("/dev/zero").error().text(), HasSubstr("list /dev/zero is a device or a pipe"));
  std::ofstream(folder / "huge");
  std::filesystem::resize_file(folder / "huge", kTextFileMax + 1);  // sparse: it takes no room
  EXPECT_THAT(read(folder / "huge").error().text(), HasSubstr("larger than 64 MiB"));
}

TEST(ReadTextFile, AFileBehindAClosedDoorIsNotSaidToBeAbsent) {
  const std::filesystem::path folder = test::scratch_folder();
  const auto error_of = [](const std::filesystem::path& file) {
    const auto text = read_text_file(file, "list", "give a list");
    return text ? Error{} : text.error();
  };
  const Error nameless = error_of(folder / std::string(300, 'x'));
  EXPECT_THAT(nameless.text(), HasSubstr("cannot be reached: " + std::string(std::strerror(ENAMETOOLONG))));
  EXPECT_EQ(nameless.remedy, "give a list");
  std::filesystem::create_symlink("loop", folder / "loop");
  EXPECT_THAT(error_of(folder / "loop").text(), HasSubstr(std::strerror(ELOOP)));
  std::ofstream(folder / "text") << "text";
  EXPECT_THAT(error_of(folder / "text" / "below").text(), HasSubstr("does not exist"));
  std::filesystem::create_directory(folder / "closed");
  std::ofstream(folder / "closed" / "text") << "text";
  std::filesystem::permissions(folder / "closed", std::filesystem::perms::none);
  const int outcome = test::in_child([&] {
    if (!test::become_ordinary()) return test::kNotPermitted;
    const Error closed = error_of(folder / "closed" / "text");
    return closed.what.find(std::strerror(EACCES)) != std::string::npos &&
                   closed.remedy.find("permissions") != std::string::npos
               ? 0
               : 1;
  });
  std::filesystem::permissions(folder / "closed", std::filesystem::perms::owner_all);
  EXPECT_EQ(outcome, 0);
}

}  // namespace
}  // namespace imuscope
