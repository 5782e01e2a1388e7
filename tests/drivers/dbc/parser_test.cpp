// What a DBC file may hold, and what is said of one that is broken.
#include <gtest/gtest.h>
#include <fstream>

#include "drivers/dbc/parser.h"
#include "tests/support/shared_data.h"

namespace imuscope::dbc {
namespace {

constexpr std::string_view kWhole = R"(VERSION "1.0"

NS_ :
	CM_
	BO_TX_BU_
	VAL_

BS_: 500 : 1,2

BU_: ECU NAV
	GATEWAY
VAL_TABLE_ Direction 0 "stop" 1 "forward" 2 "backward" ;

BO_ 256 GEAR: 8 ECU
 SG_ PAGE M : 0|4@1+ (1,0) [0|15] "" NAV,ECU
 SG_ SUB m1M : 4|4@1+ (1,0) [0|15] "" NAV
 SG_ DIR m0 : 8|8@1- (1,0) [0|0] "" NAV
 SG_ DEEP m2 : 16|8@1+ (1,0) [0|0] "" NAV
 SG_ WIDE m3 : 24|8@1+ (1,0) [0|0] "" NAV
BO_ 3221225472 VECTOR__INDEPENDENT_SIG_MSG: 0 Vector__XXX
 SG_ ORPHAN : 0|16@1+ (1,0) [0|0] "" Vector__XXX
BO_ 2147483904 GEAR_29: 2 ECU
 SG_ DIR : 0|16@1+ (0.5,-3) [0|0] "m/s" NAV

CM_ SG_ 256 DIR "a text with ; and
a second line, and \"marks\"";
BA_DEF_ BO_ "Cycle" INT 0 1000;
BA_ "Cycle" BO_ 256 10;
VAL_ 256 DIR Direction;
VAL_ 2147483904 DIR 65535 "not available";
VAL_ SomeEnvironmentVariable 0 "off" 1 "on" ;
SG_MUL_VAL_ 256 DEEP SUB 2-3, 7-7;
)";

Database whole() {
  auto database = parse(kWhole, "whole.dbc");
  EXPECT_TRUE(database) << database.error().text();
  return std::move(*database);
}

std::optional<std::uint64_t> read(const Database& database, std::string_view signal,
                                  std::vector<std::uint8_t> data) {
  const auto choice = database.choose(signal);
  EXPECT_TRUE(choice) << choice.error().text();
  return raw_in_frame(database.messages[choice->message], choice->signal, data);
}

TEST(DbcParser, ReadsWhatItUsesAndStepsOverTheRest) {
  const Database database = whole();
  ASSERT_EQ(database.messages.size(), 2U);
  EXPECT_EQ(database.messages[0].signals.size(), 5U);
  EXPECT_EQ(database.messages[0].line, 14U);
  const Message* standard = database.find(256, false);
  const Message* extended = database.find(256, true);
  ASSERT_NE(standard, nullptr);
  ASSERT_NE(extended, nullptr);
  EXPECT_EQ(extended->name, "GEAR_29");
  EXPECT_EQ(name_of(*standard->find("DIR"), 2), "backward");
  EXPECT_EQ(name_of(*standard->find("DIR"), 3), "");
  EXPECT_EQ(name_of(*extended->find("DIR"), 65535), "not available");
  EXPECT_EQ(extended->find("DIR")->unit, "m/s");
  EXPECT_EQ(value_of(extended->find("DIR")->layout, 10), 2.0);
}

TEST(DbcParser, AMultiplexedSignalIsThereOnlyWhereItsSwitchesSaySo) {
  const Database database = whole();
  EXPECT_TRUE(read(database, "GEAR.DIR", {0x00, 5, 0, 0, 0, 0, 0, 0}));
  EXPECT_FALSE(read(database, "GEAR.DIR", {0x01, 5, 0, 0, 0, 0, 0, 0}));
  // DEEP: page 1, and SUB 2, 3 or 7.
  for (unsigned sub = 0; sub < 16; ++sub) {
    const auto first = static_cast<std::uint8_t>(sub << 4U | 1U);
    EXPECT_EQ(read(database, "DEEP", {first, 0, 9, 0, 0, 0, 0, 0}).has_value(),
              sub == 2 || sub == 3 || sub == 7);
    const auto page0 = static_cast<std::uint8_t>(sub << 4U);
    EXPECT_FALSE(read(database, "DEEP", {page0, 0, 9, 0, 0, 0, 0, 0})) << "its switch is itself not there";
  }
}

TEST(DbcParser, ASignalLongerThanTheFrameIsAbsentAndNotZero) {
  const Database database = whole();
  EXPECT_FALSE(read(database, "GEAR_29.DIR", {1}));
  EXPECT_FALSE(read(database, "GEAR_29.DIR", {}));
  EXPECT_EQ(read(database, "GEAR_29.DIR", {1, 2}), 0x0201U);
}

TEST(DbcParser, ASignalWhoseSwitchIsBeyondTheFrameIsAbsent) {
  const auto database = parse(
      "BO_ 5 GEAR: 8 ECU\n SG_ PAGE M : 56|8@1+ (1,0) [0|0] \"\" NAV\n SG_ DIR m0 : 0|8@1+ (1,0) [0|0] \"\" NAV\n",
      "far.dbc");
  ASSERT_TRUE(database) << database.error().text();
  EXPECT_EQ(read(*database, "GEAR.DIR", {7, 0, 0, 0, 0, 0, 0, 0}), 7U);
  EXPECT_FALSE(read(*database, "GEAR.DIR", {7, 0, 0, 0, 0, 0, 0, 1}));
  EXPECT_FALSE(read(*database, "GEAR.DIR", {7, 0}));
}

TEST(DbcParser, AnUnknownSignalIsAnsweredWithTheNearestName) {
  const Database database = whole();
  EXPECT_EQ(database.choose("GEAR.DIRR").error().text(),
            "whole.dbc: no signal 'GEAR.DIRR'; did you mean 'GEAR.DIR'?");
  EXPECT_EQ(database.choose("GAER_29.DIR").error().text(),
            "whole.dbc: no signal 'GAER_29.DIR'; did you mean 'GEAR_29.DIR'?");
  EXPECT_EQ(database.choose("WIDER").error().text(),
            "whole.dbc: no signal 'WIDER'; did you mean 'GEAR.WIDE'?");
  EXPECT_EQ(database.choose("DIR").error().text(),
            "whole.dbc: 2 messages have a signal 'DIR'; write one of GEAR.DIR, GEAR_29.DIR");
  EXPECT_EQ(database.choose("GEAR.DIR").error().kind, ErrorKind::kUsage);
}

struct Broken {
  std::string_view name;
  std::string_view text;
  std::string_view says;  ///< with file and line
};

class BrokenDbc : public testing::TestWithParam<Broken> {};

TEST_P(BrokenDbc, IsRefusedWithFileLineAndReason) {
  const auto database = parse(GetParam().text, "car.dbc");
  ASSERT_FALSE(database);
  EXPECT_EQ(database.error().what, GetParam().says);
  EXPECT_EQ(database.error().kind, ErrorKind::kUsage);
  EXPECT_FALSE(database.error().remedy.empty());
}

INSTANTIATE_TEST_SUITE_P(
    Files, BrokenDbc,
    testing::Values(
        Broken{"Empty", "", "car.dbc:1: it describes no message (BO_)"},
        Broken{"NotDbc", "[device]\nname = 1\n", "car.dbc:1: expected a keyword such as BO_, found '['"},
        Broken{"UnknownKeyword", "VERSION \"\"\nBOO_ 1 A: 8 X\n", "car.dbc:2: unknown keyword 'BOO_'"},
        Broken{"NoBar", "BO_ 1 A: 8 X\n SG_ S : 0,8@1+ (1,0) [0|0] \"\" X\n",
               "car.dbc:2: SG_ S: expected '|', found ','"},
        Broken{"NoFactor", "BO_ 1 A: 8 X\n SG_ S : 0|8@1+ [0|0] \"\" X\n",
               "car.dbc:2: SG_ S: expected '(', found '['"},
        Broken{"CutOff", "BO_ 1 A: 8 X\n SG_ S : 0|8@1+ (1,",
               "car.dbc:2: SG_ S: expected the offset, found the end of the file"},
        Broken{"OpenText", "BO_ 1 A: 8 X\n SG_ S : 0|8@1+ (1,0) [0|0] \"km/h X\n",
               "car.dbc:2: SG_ S: expected the unit in quotation marks, found a text "
               "without its closing quotation mark"},
        Broken{"ByteOrder", "BO_ 1 A: 8 X\n SG_ S : 0|8@2+ (1,0) [0|0] \"\" X\n",
               "car.dbc:2: SG_ S: byte order 2 is neither 0 (Motorola) nor 1 (Intel)"},
        Broken{"BeyondTheFrame", "BO_ 1 A: 2 X\n SG_ S : 8|16@1+ (1,0) [0|0] \"\" X\n",
               "car.dbc:2: SG_ S: reaches into byte 3, and message A has 2 bytes"},
        Broken{"BeyondTheFrameMotorola", "BO_ 1 A: 2 X\n\n SG_ S : 15|16@0+ (1,0) [0|0] \"\" X\n",
               "car.dbc:3: SG_ S: reaches into byte 3, and message A has 2 bytes"},
        Broken{"NoBits", "BO_ 1 A: 2 X\n SG_ S : 8|0@1+ (1,0) [0|0] \"\" X\n",
               "car.dbc:2: SG_ S: 0 bits; a signal has 1 to 64"},
        Broken{"TooManyBits", "BO_ 1 A: 64 X\n SG_ S : 0|65@1+ (1,0) [0|0] \"\" X\n",
               "car.dbc:2: SG_ S: 65 bits; a signal has 1 to 64"},
        Broken{"ZeroFactor", "BO_ 1 A: 8 X\n SG_ S : 0|8@1+ (0,0) [0|0] \"\" X\n",
               "car.dbc:2: SG_ S: its factor is 0, so that it says nothing"},
        Broken{"SignalTwice",
               "BO_ 1 A: 8 X\n SG_ S : 0|8@1+ (1,0) [0|0] \"\" X\n SG_ S : 8|8@1+ (1,0) [0|0] \"\" X\n",
               "car.dbc:3: SG_ S: message A has a signal of that name already"},
        Broken{"IdTwice", "BO_ 1 A: 8 X\nBO_ 1 B: 8 X\n",
               "car.dbc:2: BO_ B: identifier 1 is A's already (line 1)"},
        Broken{"IdTooLarge", "BO_ 2048 A: 8 X\n", "car.dbc:1: BO_ A: identifier 2048 has more than 11 bits"},
        Broken{"FrameTooLong", "BO_ 1 A: 65 X\n",
               "car.dbc:1: BO_ A: 65 bytes are more than the 64 of a CAN FD frame"},
        Broken{"SignalWithoutMessage", "SG_ S : 0|8@1+ (1,0) [0|0] \"\" X\n",
               "car.dbc:1: SG_ stands before any BO_"},
        Broken{"NoSwitch", "BO_ 1 A: 8 X\n SG_ S m2 : 0|8@1+ (1,0) [0|0] \"\" X\n",
               "car.dbc:2: SG_ S: is multiplexed (m2), and message A has no M"},
        Broken{"TwoSwitches",
               "BO_ 1 A: 8 X\n SG_ S M : 0|8@1+ (1,0) [0|0] \"\" X\n SG_ T M : 8|8@1+ (1,0) [0|0] \"\" X\n",
               "car.dbc:3: SG_ T: message A has a second multiplexer M beside S"},
        Broken{"MuxMark", "BO_ 1 A: 8 X\n SG_ S x2 : 0|8@1+ (1,0) [0|0] \"\" X\n",
               "car.dbc:2: SG_ S: expected ':', M or m with a number, found 'x2'"},
        Broken{"MuxCircle",
               "BO_ 1 A: 8 X\n SG_ M0 M : 0|2@1+ (1,0) [0|0] \"\" X\n SG_ S m0M : 8|8@1+ (1,0) [0|0] \"\" X\n"
               " SG_ T m0M : 16|8@1+ (1,0) [0|0] \"\" X\nSG_MUL_VAL_ 1 S T 0-0;\nSG_MUL_VAL_ 1 T S 0-0;\n",
               "car.dbc:3: SG_ S: its multiplexers switch one another in a circle"},
        Broken{"FloatLength", "BO_ 1 A: 8 X\n SG_ S : 0|16@1- (1,0) [0|0] \"\" X\nSIG_VALTYPE_ 1 S : 1;\n",
               "car.dbc:3: SIG_VALTYPE_: signal S has 16 bits, a float has 32"},
        Broken{"NamesOfNothing", "BO_ 1 A: 8 X\nVAL_ 1 S 0 \"off\" ;\n",
               "car.dbc:2: VAL_: message A has no signal 'S'"},
        Broken{"NamesOfNoMessage", "BO_ 1 A: 8 X\nVAL_ 7 S 0 \"off\" ;\n",
               "car.dbc:2: VAL_: no message has the identifier 7"},
        Broken{"NoSemicolon", "BO_ 1 A: 8 X\nCM_ \"text\"\n", "car.dbc:2: CM_ has no ';' at its end"}),
    [](const auto& broken) { return std::string(broken.param.name); });

TEST(DbcParser, AFileInLatin1IsReadAsUtf8) {
  const auto file = test::scratch_folder() / "latin1.dbc";
  std::ofstream(file, std::ios::binary) << "BO_ 1 A: 8 X\n SG_ S : 0|8@1+ (1,0) [0|0] \"\xB0"
                                           "C\" X\n";
  const auto text = read_text(file);
  ASSERT_TRUE(text);
  const auto database = parse(*text, "latin1.dbc");
  ASSERT_TRUE(database);
  EXPECT_EQ(database->messages[0].signals[0].unit,
            "\xC2\xB0"
            "C");
  std::ofstream(file, std::ios::binary) << *text;
  EXPECT_EQ(*read_text(file), *text);
  EXPECT_EQ(read_text(file.parent_path() / "absent.dbc").error().kind, ErrorKind::kUsage);
}

// Whatever is cut away, the parser ends with an answer.
TEST(DbcParser, EveryPrefixOfAFileIsReadOrRefused) {
  for (std::size_t size = 0; size < kWhole.size(); ++size) {
    const auto database = parse(kWhole.substr(0, size), "cut.dbc");
    if (!database) {
      EXPECT_EQ(database.error().what.find("cut.dbc:"), 0U);
    }
  }
}

TEST(DbcParser, RemarksAndWholeNumbersWithAPointAreRead) {
  const auto database = parse(
      "// written by a tool\nBO_ 1.0E+002 GEAR: 8 ECU // of the shaft\n SG_ DIR : 0|8@1+ (1,0) [0|0] \"\" "
      "NAV\n"
      "VAL_ 100 DIR 1.0 \"forward\" ;",
      "tool.dbc");
  ASSERT_TRUE(database) << database.error().text();
  ASSERT_EQ(database->messages.size(), 1U);
  EXPECT_EQ(database->messages[0].id, 100U);
  ASSERT_EQ(database->messages[0].signals.at(0).names.size(), 1U);
  EXPECT_EQ(database->messages[0].signals[0].names[0].number, 1);
}

TEST(DbcParser, NumbersOfSixtyFourBitsAreExact) {
  const auto database = parse(
      "BO_ 5 GEAR: 8 ECU\n SG_ DIR : 0|64@1- (1,0) [0|0] \"\" NAV\n"
      "VAL_ 5 DIR -9007199254740993 \"backward\" +9223372036854775807 \"forward\" ;",
      "large.dbc");
  ASSERT_TRUE(database) << database.error().text();
  const auto& names = database->messages.at(0).signals.at(0).names;
  ASSERT_EQ(names.size(), 2U);
  EXPECT_EQ(names[0].number, -9007199254740993);
  EXPECT_EQ(names[1].number, 9223372036854775807);
}

TEST(DbcParser, NumbersThatAreNotWholeOrDoNotFitAreRefused) {
  for (const char* id : {"1.5", "-1.0", "1e300", "99999999999"}) {
    const auto database = parse(std::string("BO_ ") + id + " GEAR: 8 ECU\n", "bad.dbc");
    ASSERT_FALSE(database) << id;
    EXPECT_NE(database.error().text().find(id), std::string::npos) << database.error().text();
  }
  const auto text = parse("BO_ \"GEAR\" GEAR: 8 ECU\n", "bad.dbc");
  ASSERT_FALSE(text);
  EXPECT_NE(text.error().text().find("\"GEAR\""), std::string::npos) << text.error().text();
}

TEST(DbcParser, WhatAFileClaimsIsBounded) {
  const auto refusal_of = [](const std::string& text) {
    const auto database = parse(text, "large.dbc");
    EXPECT_FALSE(database);
    return database ? std::string() : database.error().what;
  };
  std::string messages;
  for (int id = 0; id <= 16'384; ++id)
    messages += "BO_ " + std::to_string(0x8000'0000U + static_cast<unsigned>(id)) + " M: 8 E\n";
  EXPECT_NE(refusal_of(messages).find("more than 16384 messages"), std::string::npos);

  std::string signals = "BO_ 1 M: 64 E\n";
  for (int i = 0; i <= 131'072; ++i)
    signals += " SG_ S" + std::to_string(i) + " : 0|8@1+ (1,0) [0|0] \"\" E\n";
  EXPECT_NE(refusal_of(signals).find("more than 131072 signals"), std::string::npos);

  // A table that each of many signals takes as its own.
  std::string tables = "VAL_TABLE_ T ";
  for (int i = 0; i < 20'000; ++i) tables += std::to_string(i) + " \"name\" ";
  tables += ";\nBO_ 1 M: 64 E\n";
  for (int i = 0; i < 60; ++i) tables += " SG_ S" + std::to_string(i) + " : 0|8@1+ (1,0) [0|0] \"\" E\n";
  for (int i = 0; i < 60; ++i) tables += "VAL_ 1 S" + std::to_string(i) + " T;\n";
  EXPECT_NE(refusal_of(tables).find("names more than 1048576 values"), std::string::npos);

  std::string chain = "BO_ 1 M: 64 E\n";
  for (int i = 0; i < 30; ++i) chain += " SG_ S" + std::to_string(i) + " : 0|8@1+ (1,0) [0|0] \"\" E\n";
  for (int i = 1; i < 30; ++i)
    chain += "SG_MUL_VAL_ 1 S" + std::to_string(i) + " S" + std::to_string(i - 1) + " 0-0;\n";
  EXPECT_NE(refusal_of(chain).find("more than 16 multiplexers in a row"), std::string::npos);

  EXPECT_LT(refusal_of("BO_ " + std::string(1'000'000, 'x')).size(), 200U)
      << "what is shown of a file is short";
}

}  // namespace
}  // namespace imuscope::dbc
