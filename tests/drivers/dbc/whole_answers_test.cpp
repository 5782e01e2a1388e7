// Whole files as they are read, and every sentence about those that are broken.
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <fstream>

#include "drivers/dbc/parser.h"
#include "tests/support/file_content.h"
#include "tests/support/recorded_answer.h"
#include "tests/support/shared_data.h"

namespace imuscope::dbc {
namespace {

using test::expect_recorded;

std::string whole_text(const Database& database) {
  std::string text = database.file + '\n';
  for (const Message& m : database.messages) {
    text +=
        fmt::format("{} {}{} {} bytes, line {}\n", m.name, m.id, m.is_extended ? "x" : "", m.length, m.line);
    for (const Signal& s : m.signals) {
      const SignalLayout& l = s.layout;
      text += fmt::format("  {} {}|{} {} {} ({},{}) [{}|{}] '{}'{}", s.name, l.start, l.length,
                          static_cast<int>(l.order), static_cast<int>(l.coding), l.factor, l.offset,
                          s.minimum, s.maximum, s.unit, s.is_switch ? " switch" : "");
      if (s.switched_by) text += fmt::format(" by {}", *s.switched_by);
      for (const RawRange& range : s.present_for) text += fmt::format(" {}-{}", range.low, range.high);
      for (const NamedValue& value : s.names) text += fmt::format(" {}='{}'", value.number, value.name);
      text += fmt::format(" needs {}\n", bytes_needed(l));
    }
  }
  return text;
}

std::string read_as(const std::string& file) {
  const auto database = parse(file, "some.dbc");
  return database ? whole_text(*database) : database.error().text() + '\n';
}

constexpr std::string_view kRich =
    "\xEF\xBB\xBFVERSION \"1.0\"\n// a comment\nNS_ :\n\tCM_\n\tBO_TX_BU_\n\nBS_: 500 : 1,2\n\nBU_: ECU NAV\n\tGATEWAY\n"
    "VAL_TABLE_ Direction 0 \"stop\" 1 \"forward\" -2 \"backward\" ;\n\n"
    "BO_ 256 GEAR: 8 ECU\n SG_ PAGE M : 0|4@1+ (1,0) [0|15] \"\" NAV,ECU\n SG_ SUB m1M : 4|4@1+ (1,0) [0|15] \"\" NAV, ECU\n"
    " SG_ DIR m0 : 8|8@1- (1,0) [0|0] \"\" NAV ECU\n SG_ DEEP m2 : 16|8@1+ (+1.5,-.5) [-1E2|1e+002] \"\" NAV\n SG_ WIDE m3 : 24|8@0+ (1,0) [0|0] \"m\" NAV\n"
    "BO_ 3221225472 VECTOR__INDEPENDENT_SIG_MSG: 0 NAV\n SG_ ORPHAN : 0|16@1+ (1,0) [0|0] \"\" NAV\n"
    "BO_ 2147483904 GEAR_29: 12.0 ECU\n SG_ DIR : 0|16@1+ (0.5,-3) [0|0] \"m/s\" NAV\n SG_ F : 16|32@1- (1,0) [0|0] \"m/s\" NAV\n SG_ D : 39|64@0- (1,0) [0|0] \"m/s\" NAV\n"
    "BO_ 2047 EMPTY: 0 ECU\n"
    "CM_ SG_ 256 DIR \"a text with ; and\n a second line, and \\\"marks\\\"\";\nBA_DEF_ BO_ \"Cycle\" INT 0 1000;\nBA_ \"Cycle\" BO_ 256 10;\n"
    "VAL_ 256 DIR Direction;\nVAL_ 2147483904 DIR 65535 \"not available\" 1.0 \"one\" 2E+000 \"two\";\nVAL_ SomeEnvironmentVariable 0 \"off\" 1 \"on\" ;\n"
    "VAL_ 3221225472 ORPHAN 1 \"x\" ;\nSIG_VALTYPE_ 2147483904 F : 1;\nSIG_VALTYPE_ 2147483904 D 2;\nSIG_VALTYPE_ 2147483904 DIR : 0;\nSG_MUL_VAL_ 256 DEEP SUB 2-3, 7 - 7;\n"
    "SG_MUL_VAL_ 3221225472 ORPHAN X 2-3;\nEV_DATA_ a; SIG_GROUP_ 1 2;\n";

TEST(DbcWhole, ARichFile) {
  std::string text = read_as(std::string(kRich));
  text += read_as(test::content_of(test::source_path("tests/vectors/odometry.dbc")));
  text += read_as(test::content_of(test::source_path("tests/vectors/xsens_can.dbc")));
  expect_recorded("drivers/dbc/rich.txt", text);
}

/// Each kind of mistake.
TEST(DbcWhole, SentencesAboutBrokenFiles) {
  const std::string message = "BO_ 256 M: 8 ECU\n";
  const std::string signal = " SG_ S : 0|8@1+ (1,0) [0|0] \"\" NAV\n";
  const std::string muxed =
      message + " SG_ P M : 0|4@1+ (1,0) [0|0] \"\" N\n SG_ Q m1 : 4|4@1+ (1,0) [0|0] \"\" N\n";
  std::string text;
  for (const std::string& file : {std::string(),
                                  std::string("BO_"),
                                  std::string("SG_ S : 0|8"),
                                  std::string("XYZ_ 1;"),
                                  std::string("\"text\""),
                                  std::string("256 M"),
                                  std::string("\nVERSION 1"),
                                  std::string("NS_ CM_"),
                                  std::string("NS_: \"open"),
                                  std::string("CM_ \"a\""),
                                  std::string("CM_ \"open"),
                                  std::string("BO_ M: 8 E"),
                                  std::string("BO_ 1 2"),
                                  std::string("BO_ 1 M 8"),
                                  std::string("BO_ 1 M: x"),
                                  std::string("BO_ 1 M: 8"),
                                  std::string("BO_ -1 M: 8 E"),
                                  std::string("BO_ 1.5 M: 8 E"),
                                  std::string("BO_ 2048 M: 8 E"),
                                  std::string("BO_ 2047 M: 8 E"),
                                  std::string("BO_ 2684354560 M: 8 E"),
                                  std::string("BO_ 2684354559 M: 8 E"),
                                  std::string("BO_ 4294967296 M: 8 E"),
                                  std::string("BO_ 1 M: 64 E"),
                                  std::string("BO_ 1 M: 65 E"),
                                  message + message,
                                  std::string(message).append(signal).append(signal),
                                  message + " SG_ S X : 0|8@1+ (1,0) [0|0] \"\" N",
                                  message + " SG_ S m : 0|8@1+ (1,0) [0|0] \"\" N",
                                  message + " SG_ S mX : 0|8@1+ (1,0) [0|0] \"\" N",
                                  message + " SG_ S 1 : 0|8@1+ (1,0) [0|0] \"\" N",
                                  message + " SG_ S : x|8@1+",
                                  message + " SG_ S : 0 8@1+",
                                  message + " SG_ S : 0|x",
                                  message + " SG_ S : 0|8 1+",
                                  message + " SG_ S : 0|8@2+ (1,0)",
                                  message + " SG_ S : 0|8@-1+ (1,0)",
                                  message + " SG_ S : 0|8@1 (1,0)",
                                  message + " SG_ S : 0|8@1+ 1,0)",
                                  message + " SG_ S : 0|8@1+ (x,0)",
                                  message + " SG_ S : 0|8@1+ (1 0)",
                                  message + " SG_ S : 0|8@1+ (1,x)",
                                  message + " SG_ S : 0|8@1+ (1,0 [",
                                  message + " SG_ S : 0|8@1+ (1,0) 0|0]",
                                  message + " SG_ S : 0|8@1+ (1,0) [x|0]",
                                  message + " SG_ S : 0|8@1+ (1,0) [0 0]",
                                  message + " SG_ S : 0|8@1+ (1,0) [0|x]",
                                  message + " SG_ S : 0|8@1+ (1,0) [0|0 \"\"",
                                  message + " SG_ S : 0|8@1+ (1,0) [0|0] N",
                                  message + " SG_ S : 0|8@1+ (1,0) [0|0] \"\"",
                                  message + " SG_ S : 0|8@1+ (1e999,0) [0|0] \"\" N",
                                  message + " SG_ S : 0|8@1+ (0,0) [0|0] \"\" N",
                                  message + " SG_ S : 0|0@1+ (1,0) [0|0] \"\" N",
                                  message + " SG_ S : 0|64@1+ (1,0) [0|0] \"\" N",
                                  message + " SG_ S : 0|65@1+ (1,0) [0|0] \"\" N",
                                  message + " SG_ S : 57|8@1+ (1,0) [0|0] \"\" N",
                                  message + " SG_ S : 56|8@1+ (1,0) [0|0] \"\" N",
                                  message + " SG_ S : 62|8@0+ (1,0) [0|0] \"\" N",
                                  message + " SG_ S : 65536|8@1+ (1,0) [0|0] \"\" N",
                                  message + " SG_ S : 0.0|8E0@1+ (1,0) [0|0] \"\" N",
                                  message + " SG_ S : 1e20|8@1+ (1,0) [0|0] \"\" N",
                                  message + " SG_ S : 0|8@1+ (1,0) [0|0] \"open",
                                  muxed,
                                  message + " SG_ Q m1 : 4|4@1+ (1,0) [0|0] \"\" N\n",
                                  muxed + " SG_ R M : 8|4@1+ (1,0) [0|0] \"\" N\n",
                                  muxed + "VAL_ 256 X 1 \"a\";",
                                  muxed + "VAL_ 257 P 1 \"a\";",
                                  muxed + "VAL_ 256 P T;",
                                  muxed + "VAL_ 256 P 1 a;",
                                  muxed + "VAL_ 256 P 1 \"a\"",
                                  muxed + "VAL_ 256 P x;",
                                  muxed + "VAL_ 256 3 1;",
                                  muxed + "VAL_TABLE_ 1 \"a\";",
                                  muxed + "VAL_TABLE_ T 9e18 \"a\"; VAL_ 256 P T;",
                                  muxed + "VAL_TABLE_ T 1e15 \"a\"; VAL_ 256 P T;",
                                  muxed + "VAL_TABLE_ T 1; VAL_ 256 P T x",
                                  muxed + "SIG_VALTYPE_ 256 P : 1;",
                                  muxed + "SIG_VALTYPE_ 256 P : 2;",
                                  muxed + "SIG_VALTYPE_ 256 P : 3;",
                                  muxed + "SIG_VALTYPE_ 256 P : x;",
                                  muxed + "SIG_VALTYPE_ 256 P : 1",
                                  muxed + "SIG_VALTYPE_ 3221225472 P : 3;",
                                  muxed + "SG_MUL_VAL_ 256 Q P 3-2;",
                                  muxed + "SG_MUL_VAL_ 256 Q P 3;",
                                  muxed + "SG_MUL_VAL_ 256 Q P x;",
                                  muxed + "SG_MUL_VAL_ 256 Q X 1-2;",
                                  muxed + "SG_MUL_VAL_ 256 Q Q 1-2;",
                                  muxed + "SG_MUL_VAL_ 256 Q P 1-2",
                                  muxed + "SG_MUL_VAL_ 256 Q 1-2;",
                                  muxed + "SG_MUL_VAL_ 256 Q P 2-2,3-x;",
                                  muxed + "SG_MUL_VAL_ 256 Q P 0-3, 5-5;\nSG_MUL_VAL_ 256 P Q 1-1;\n"}) {
    text += read_as(file);
  }
  expect_recorded("drivers/dbc/mistakes.txt", text);
}

/// A damaged character at every place.
TEST(DbcWhole, AnotherCharacterAtEveryPlace) {
  std::string text;
  const std::string file =
      std::string(kRich.substr(0, 480)) + std::string(kRich.substr(kRich.find("BO_ 2147483904"), 150));
  for (const char other : {'"', ';', 'x'}) {
    std::string before;
    for (std::size_t at = 0; at < file.size(); ++at) {
      std::string changed = file;
      changed[at] = other;
      const auto database = parse(changed, "f");
      std::size_t signals = 0, names = 0;
      if (database) {
        for (const Message& m : database->messages) {
          signals += m.signals.size();
          for (const Signal& s : m.signals)
            names += s.names.size() + s.present_for.size() + (s.is_switch ? 100 : 0);
        }
      }
      const std::string now = database ? fmt::format("{} {} {}", database->messages.size(), signals, names)
                                       : database.error().text().substr(0, 44);
      if (now != before) text += fmt::format("{}: {}\n", at, now);
      before = now;
    }
  }
  expect_recorded("drivers/dbc/other_characters.txt", text);
}

TEST(DbcWhole, ManyMultiplexersInARow) {
  std::string text;
  for (const int n : {7, 8, 9, 10, 15, 16, 17, 18}) {
    std::string file = "BO_ 1 M: 64 E\n SG_ S0 M : 0|8@1+ (1,0) [0|0] \"\" N\n";
    for (int i = 1; i < n; ++i) file += fmt::format(" SG_ S{} : {}|8@1+ (1,0) [0|0] \"\" N\n", i, 8 * i);
    for (int i = 1; i < n; ++i) file += fmt::format("SG_MUL_VAL_ 1 S{} S{} 5-6;\n", i, i - 1);
    const auto database = parse(file, "f");
    text += fmt::format("{}: ", n);
    if (!database) {
      text += database.error().text() + '\n';
      continue;
    }
    const std::vector<std::uint8_t> data(64, 5);
    for (int i = 0; i < n; ++i)
      text += raw_in_frame(database->messages[0], static_cast<std::size_t>(i), data) ? '1' : '0';
    text += '\n';
  }
  expect_recorded("drivers/dbc/switches.txt", text);
}

TEST(DbcWhole, NumbersInFramesOfEveryLayout) {
  std::vector<std::uint8_t> data(9);
  for (std::size_t i = 0; i < data.size(); ++i) data[i] = static_cast<std::uint8_t>(0x9D * (i + 1) + 3);
  std::string text;
  for (const ByteOrder order : {ByteOrder::kIntel, ByteOrder::kMotorola}) {
    for (const std::uint16_t start : std::vector<std::uint16_t>{0, 3, 7, 8, 20, 39}) {
      for (const std::uint16_t length : std::vector<std::uint16_t>{1, 7, 8, 9, 31, 32, 33, 64}) {
        SignalLayout layout;
        layout.order = order;
        layout.start = start;
        layout.length = length;
        layout.factor = 0.5;
        layout.offset = -3.0;
        const auto raw = raw_of(layout, data);
        text +=
            fmt::format("{} {}|{} needs {}:", static_cast<int>(order), start, length, bytes_needed(layout));
        if (raw) {
          text += fmt::format(" {} {}", *raw, signed_of(layout, *raw));
          for (const Coding coding : {Coding::kUnsigned, Coding::kSigned, Coding::kFloat, Coding::kDouble}) {
            layout.coding = coding;
            text += fmt::format(" {:.9g}", value_of(layout, *raw));
          }
        }
        text += '\n';
      }
    }
  }
  expect_recorded("drivers/dbc/layouts.txt", text);
}

TEST(DbcWhole, WhatIsChosenByName) {
  const auto database = parse(kRich, "some.dbc");
  ASSERT_TRUE(database);
  std::string text;
  for (const char* name :
       {"GEAR.PAGE", "PAGE",   "DIR",    "GEAR_29.DIR",     "GEAR.DIRR",   "GEAR.xxxxxxxxxx",
        "GEER.PAGE", "DEPP",   "WIDDE",  "NOTHING.LIKE.IT", "F",           "D",
        "GEAR",      "",       ".PAGE",  "GEAR.",           "GEAR_28.DIR", "qqqqqqqqqqqq",
        "EMPTY.X",   "X.DEEP", "zz.WIDE"}) {
    const auto choice = database->choose(name);
    text +=
        fmt::format("'{}': {}\n", name,
                    choice ? fmt::format("{} {}", choice->message, choice->signal) : choice.error().text());
  }
  const Signal& direction = database->messages[0].signals[2];
  for (const std::uint64_t raw : {0U, 1U, 254U, 255U, 2U})
    text += fmt::format("{} '{}'\n", raw, name_of(direction, raw));
  for (const std::uint32_t id : {256U, 2047U, 5U})
    text += fmt::format("{} {} {}\n", id, database->find(id, false) != nullptr,
                        database->find(id, true) != nullptr);
  expect_recorded("drivers/dbc/choices.txt", text);
}

TEST(DbcWhole, TextsOfOtherAlphabets) {
  const auto file = test::scratch_folder() / "latin.dbc";
  std::string text;
  for (const char* bytes : {"plain", "\xB0 \xFF \x80 \xC3", "\xC3\xA9", ""}) {
    std::ofstream(file, std::ios::binary) << bytes;
    const auto read = read_text(file);
    text += (read ? *read : "nothing") + '\n';
  }
  expect_recorded("drivers/dbc/texts.txt", text);
  EXPECT_FALSE(read_text(file.parent_path() / "none.dbc"));
}

}  // namespace
}  // namespace imuscope::dbc
