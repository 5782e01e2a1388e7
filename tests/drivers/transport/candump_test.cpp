#include "drivers/transport/candump.h"

#include <gmock/gmock.h>
#include <nlohmann/json.hpp>

#include <cerrno>
#include <cstring>
#include <fstream>

#include "tests/support/child_process.h"
#include "tests/support/shared_data.h"

namespace imuscope {
namespace {

using Kind = CandumpLine::Kind;
using testing::HasSubstr;

std::string hex(std::span<const std::uint8_t> bytes) {
  constexpr const char* kDigits = "0123456789abcdef";
  std::string text;
  for (const auto byte : bytes) {
    text += kDigits[byte >> 4];
    text += kDigits[byte & 15];
  }
  return text;
}

void expect_frame(const nlohmann::json& expected, const CanFrame& frame) {
  if (expected.contains("err_class")) {
    EXPECT_TRUE(frame.is_error);
    EXPECT_EQ(frame.id, expected["err_class"].get<std::uint32_t>());
  } else {
    EXPECT_FALSE(frame.is_error);
    EXPECT_EQ(frame.id, expected["id"].get<std::uint32_t>());
    EXPECT_EQ(frame.is_extended, expected.value("ext", false));
  }
  EXPECT_EQ(frame.is_fd, expected.value("fd", false));
  EXPECT_EQ(frame.is_remote, expected.value("rtr", false));
  EXPECT_EQ(frame.bit_rate_switched, expected.value("brs", false));
  EXPECT_EQ(frame.sender_error_state, expected.value("esi", false));
  EXPECT_EQ(frame.length, expected["len"].get<int>());
  EXPECT_EQ(frame.raw_dlc, expected.value("raw_dlc", 0));
  if (expected.contains("data")) {
    EXPECT_EQ(hex(frame.payload()), expected["data"].get<std::string>());
  }
  if (expected.contains("ns")) {
    EXPECT_EQ(to_ns(frame.stamp) % 1'000'000'000, expected["ns"].get<std::int64_t>());
  }
  if (expected.contains("time_s")) {
    EXPECT_EQ(to_ns(frame.stamp), expected["time_s"].get<std::int64_t>());
  }
}

TEST(Candump, EveryLineOfTheVectorsIsReadAsStated) {
  std::ifstream in(test::source_path("tests/vectors/candump_syntax.json"));
  const auto vectors = nlohmann::json::parse(in);
  int n = 0;
  for (const auto& vector : vectors.at("lines")) {
    const auto line = vector.at("line").get<std::string>();
    SCOPED_TRACE(line);
    const auto& expected = vector.at("expected");
    const auto read = read_candump_line(line);
    if (expected.value("skip", false)) {
      EXPECT_EQ(read.kind, Kind::kRemark);
      EXPECT_EQ(read.drops_total, expected.value("drops_total", 0U));
    } else if (expected.value("error_line", false)) {
      EXPECT_EQ(read.kind, Kind::kError);
      EXPECT_FALSE(read.why.empty());
    } else {
      ASSERT_EQ(read.kind, Kind::kFrame) << read.why;
      expect_frame(expected, read.frame.frame);
    }
    ++n;
  }
  EXPECT_EQ(n, 24);
}

/// Reads a log, writes every frame again and compares with what stands there.
void expect_round_trip(const std::filesystem::path& file, std::size_t lines) {
  std::ifstream text(file);
  auto log = CandumpLog::open(file);
  ASSERT_TRUE(log) << log.error().text();
  std::string line;
  std::size_t n = 0;
  while (const CandumpFrame* frame = log->next()) {
    ASSERT_TRUE(std::getline(text, line));
    ASSERT_EQ(candump_line(*frame), line.substr(0, line.find_last_not_of('\r') + 1))
        << "line " << log->line();
    ++n;
  }
  EXPECT_EQ(n, lines);
  EXPECT_EQ(log->bad_lines(), 0U) << log->first_problem();
}

TEST(Candump, RecordedCarComesBackLineByLine) {
  IMUSCOPE_NEEDS_SHARED("data/can_car/car.candump.log");
  // wc -l of the file, whose seconds have five digits and no leading zeros.
  auto log = CandumpLog::open(test::shared_path("data/can_car/car.candump.log"));
  ASSERT_TRUE(log);
  std::size_t n = 0;
  while (log->next() != nullptr) ++n;
  EXPECT_EQ(n, 98'800U);
  EXPECT_EQ(log->bad_lines(), 0U);
}

TEST(Candump, SecondRecordedCarIsWrittenAgainAsItStandsThere) {
  IMUSCOPE_NEEDS_SHARED("data/streams/can/drive.candump.log");
  expect_round_trip(test::shared_path("data/streams/can/drive.candump.log"), 80'269);
}

TEST(Candump, EveryKindOfFrameIsWrittenAgainAsItStandsThere) {
  for (const char* line :
       {"(1772000000.000001) can0 123#", "(1772000000.000003) vcan1 1ABCDEF0#DEADBEEF",
        "(1772000000.000004) can0 00000123#01", "(1772000000.000006) can0 7FF#R5",
        "(1772000000.000005) can0 7FF#R", "(1772000000.000007) can0 20000040#0000000000000000",
        "(1772000000.000009) can0 123##0", "(1772000000.000010) can0 123##35A5A5A5A5A5A5A5A5A5A5A5A",
        "(1772000000.000012) can0 123#1122334455667788_B", "(1772000000.123456789) can0 123#01"}) {
    const auto read = read_candump_line(line);
    ASSERT_EQ(read.kind, Kind::kFrame) << line << ": " << read.why;
    EXPECT_EQ(candump_line(read.frame), line);
  }
}

class CandumpFile : public testing::Test {
 protected:
  std::filesystem::path write(const std::string& text) {
    auto file = test::scratch_folder() / "x.log";
    std::ofstream(file) << text;
    return file;
  }
};

TEST_F(CandumpFile, DamagedLinesAreCountedAndTheFirstIsNamed) {
  auto log = CandumpLog::open(write(
      "(1.0) can0 123#01\n(1.1) can0 12#01\nDROPCOUNT: dropped 3 CAN frames on 'can0' socket (total drops "
      "7)\n(1.2) can0 123#02\n(1.3) can0 1"));
  ASSERT_TRUE(log) << log.error().text();
  std::size_t n = 0;
  while (log->next() != nullptr) ++n;
  EXPECT_EQ(n, 2U);
  EXPECT_EQ(log->bad_lines(), 2U);
  EXPECT_EQ(log->first_problem(), "line 2: an identifier has 3 or 8 hexadecimal digits");
  EXPECT_EQ(log->drops_total(), 7U);
}

TEST_F(CandumpFile, WhatIsNoLogSaysSoWithItsFirstLine) {
  const auto screen = CandumpLog::open(write("  can0  123   [2]  01 02\n"));
  ASSERT_FALSE(screen);
  EXPECT_THAT(screen.error().text(), HasSubstr("line 1: a line begins with its time"));
  EXPECT_THAT(screen.error().remedy, HasSubstr("candump -l"));
  EXPECT_THAT(CandumpLog::open(write("")).error().text(), HasSubstr("empty"));
  EXPECT_THAT(CandumpLog::open("/no/such/file").error().text(), HasSubstr("no such file"));
  EXPECT_FALSE(CandumpLog::open(write(std::string(100'000, '\x01'))));
}

TEST_F(CandumpFile, WhatIsNoFileOrMayNotBeReadIsAnErrorThatSaysWhat) {
  const auto folder = test::scratch_folder();
  const auto nameless = CandumpLog::open(folder / std::string(300, 'x'));
  ASSERT_FALSE(nameless);
  EXPECT_THAT(nameless.error().text(), HasSubstr(std::strerror(ENAMETOOLONG)));
  EXPECT_THAT(CandumpLog::open(folder).error().text(), HasSubstr("is a folder"));
  const auto file = write("(1.0) can0 123#01\n");
  std::filesystem::permissions(file, std::filesystem::perms::none);
  const int outcome = test::in_child([&] {
    if (!test::become_ordinary()) return test::kNotPermitted;
    const auto log = CandumpLog::open(file);
    return !log && log.error().text().find(std::strerror(EACCES)) != std::string::npos ? 0 : 1;
  });
  std::filesystem::permissions(file, std::filesystem::perms::owner_all);
  EXPECT_EQ(outcome, 0);
}

TEST_F(CandumpFile, ALogOfRemarksAloneIsNotSaidToBeEmpty) {
  const auto log =
      CandumpLog::open(write("DROPCOUNT: dropped 3 CAN frames on 'can0' socket (total drops 7)\n\n"));
  ASSERT_FALSE(log);
  EXPECT_THAT(log.error().text(), HasSubstr("holds no frame"));
  // A frame that comes late is none at the beginning.
  const auto late = CandumpLog::open(write(std::string(200, '\n') + "(1.0) can0 123#01\n"));
  ASSERT_FALSE(late);
  EXPECT_THAT(late.error().text(), HasSubstr("first 100 lines hold no frame"));
}

TEST(Candump, WhatIsWrongWithALineIsNamed) {
  const struct {
    const char* line;
    const char* why;
  } cases[] = {{"1.0 can0 123#01", "begins with its time"},
               {"(1,0) can0 123#01", "begins with its time"},
               {"(1.0 can0 123#01", "begins with its time"},
               {"(-1.0) can0 123#01", "begins with its time"},
               {"(99999999999.0) can0 123#01", "begins with its time"},
               {"(1.0000000001) can0 123#01", "begins with its time"},
               {"(1.00x) can0 123#01", "begins with its time"},
               {"(1.0)can0 123#01", "stands a blank"},
               {"(1.0)  123#01", "stands the interface"},
               {"(1.0) a-name-too-long-for-linux 123#01", "at most 15 letters"},
               {"(1.0) can0", "stands a blank"},
               {"(1.0) can0 12#01", "3 or 8 hexadecimal digits"},
               {"(1.0) can0 1x3#01", "3 or 8 hexadecimal digits"},
               {"(1.0) can0 1234567x#01", "3 or 8 hexadecimal digits"},
               {"(1.0) can0 800#01", "at most 7FF"},
               {"(1.0) can0 80000000#01", "at most 1FFFFFFF"},
               {"(1.0) can0 40000000#01", "at most 1FFFFFFF"},
               {"(1.0) can0 123", "stands a #"},
               {"(1.0) can0 123#0", "two hexadecimal digits"},
               {"(1.0) can0 123#0x", "two hexadecimal digits"},
               {"(1.0) can0 123#001122334455667788", "at most 8 bytes"},
               {"(1.0) can0 123##", "one digit of CAN FD flags"},
               {"(1.0) can0 123##x", "one digit of CAN FD flags"},
               {"(1.0) can0 123##0001122334455667788", "has this length"},
               {"(1.0) can0 123#0011223344556677_8", "from 9 to F"},
               {"(1.0) can0 123#0011223344556677_", "from 9 to F"},
               {"(1.0) can0 123#00 X", "nothing but a direction"},
               {"(1.0) can0 123#R9", "nothing but a direction"},
               {"(1.0) can0 123#0_9", "two hexadecimal digits"}};
  for (const auto& [line, why] : cases) {
    const auto read = read_candump_line(line);
    EXPECT_EQ(read.kind, Kind::kError) << line;
    EXPECT_THAT(std::string(read.why), HasSubstr(why)) << line;
  }
}

TEST(Candump, WhatOtherToolsWriteIsReadAlike) {
  const auto frame_of = [](const std::string& line) {
    const auto read = read_candump_line(line);
    EXPECT_EQ(read.kind, Kind::kFrame) << line << ": " << read.why;
    return read.frame.frame;
  };
  const CanFrame frame = frame_of("(1.5) can0 0AA#DE.AD.BE.EF R\r");
  EXPECT_EQ(hex(frame.payload()), "deadbeef") << "cansend sets bytes apart";
  EXPECT_EQ(to_ns(frame.stamp), 1'500'000'000);
  EXPECT_EQ(hex(frame_of("(1) can0 0aa#deadbeef T").payload()), "deadbeef") << "small letters, whole seconds";
  EXPECT_EQ(to_ns(frame_of("(1) can0 0aa#").stamp), 1'000'000'000);
  EXPECT_EQ(frame_of("(1.0) can0 123#R8_B").raw_dlc, 11);
  EXPECT_EQ(frame_of("(1.0) can0 123#R0").length, 0);
  const CanFrame fd = frame_of("(1.0) can0 123##2" + std::string(128, '5'));
  EXPECT_EQ(fd.length, 64);
  EXPECT_TRUE(fd.sender_error_state);
  EXPECT_FALSE(fd.bit_rate_switched);
  EXPECT_EQ(read_candump_line("(1.0) can0 123##0" + std::string(130, '5')).kind, Kind::kError);
  // candump's own words on what it lost; without a number there is none.
  for (const char* remark : {"", "   ", "DROPCOUNT: dropped 1 CAN frame", "DROPCOUNT (total drops x)"}) {
    const auto read = read_candump_line(remark);
    EXPECT_EQ(read.kind, Kind::kRemark) << remark;
    EXPECT_EQ(read.drops_total, 0U) << remark;
  }
}

}  // namespace
}  // namespace imuscope
