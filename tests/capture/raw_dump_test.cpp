#include "capture/raw_dump.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <fstream>
#include <string>

#include "tests/support/child_process.h"
#include "tests/support/shared_data.h"

namespace imuscope {
namespace {

using testing::HasSubstr;

class RawDumpTest : public testing::Test {
 protected:
  void write(const std::string& name, const std::string& content) const {
    std::ofstream(folder_ / name, std::ios::binary) << content;
  }
  [[nodiscard]] std::string error_of(const std::string& arrivals) const {
    write("mtx1.arrivals.csv", arrivals);
    const auto dump = RawDump::open(folder_ / "mtx1.bin");
    return dump.has_value() ? "accepted" : dump.error().text();
  }
  const std::filesystem::path folder_ = test::scratch_folder();
};

TEST_F(RawDumpTest, GivesTheReadsAsTheyWere) {
  write("mtx1.bin", "abcdefgh");
  write("mtx1.arrivals.csv", "byte_offset,n_bytes,arrival_ns\n0,3,1000\n3,1,1000\n4,4,2500\n");
  auto dump = RawDump::open(folder_ / "mtx1.bin");
  ASSERT_TRUE(dump.has_value()) << dump.error().text();
  EXPECT_TRUE(dump->has_arrivals());
  const struct {
    const char* bytes;
    std::int64_t arrival_ns;
  } expected[] = {{"abc", 1000}, {"d", 1000}, {"efgh", 2500}};
  for (const auto& [bytes, arrival_ns] : expected) {
    const auto read = dump->next();
    ASSERT_TRUE(read.has_value());
    EXPECT_EQ(std::string(read->bytes.begin(), read->bytes.end()), bytes);
    EXPECT_EQ(to_ns(read->arrival.value()), arrival_ns);
  }
  EXPECT_FALSE(dump->next().has_value());
}

TEST_F(RawDumpTest, WithoutArrivalsGivesAllBytesAndNoTime) {
  std::string content;
  for (int i = 0; i < 100'000; ++i) content += static_cast<char>(i * 31);
  write("mtx1.bin", content);
  auto dump = RawDump::open(folder_ / "mtx1.bin");
  ASSERT_TRUE(dump.has_value());
  EXPECT_FALSE(dump->has_arrivals());
  std::string together;
  while (const auto read = dump->next()) {
    EXPECT_FALSE(read->arrival.has_value());
    together.append(read->bytes.begin(), read->bytes.end());
  }
  EXPECT_EQ(together, content);
}

TEST_F(RawDumpTest, TakesWindowsLineEndsCommentsAndALastLineWithoutEnd) {
  write("mtx1.bin", "abcd");
  EXPECT_EQ(error_of("byte_offset,n_bytes,arrival_ns\r\n# by hand\r\n0,2,5\r\n2,2,6"), "accepted");
}

TEST_F(RawDumpTest, AKilledRecordingEndsWhereItsBytesEnd) {
  write("mtx1.bin", "abcde");
  write("mtx1.arrivals.csv", "byte_offset,n_bytes,arrival_ns\n0,3,10\n3,9,20\n12,7,30\n");
  auto dump = RawDump::open(folder_ / "mtx1.bin");
  ASSERT_TRUE(dump.has_value()) << dump.error().text();
  EXPECT_EQ(dump->next()->bytes.size(), 3U);
  EXPECT_EQ(dump->next()->bytes.size(), 2U);
  EXPECT_FALSE(dump->next().has_value());
}

TEST_F(RawDumpTest, ReadsAndCommentsOfAnyLengthAreFollowedToTheEnd) {
  constexpr std::size_t kReads = 20'000;  // their lines alone are several windows of the file
  std::string bytes;
  std::string arrivals = "byte_offset,n_bytes,arrival_ns\n";
  for (std::size_t i = 0; i < kReads; ++i) {
    if (i % 100 == 0) arrivals += "#" + std::string(i, 'c') + ",1,2\n";
    const std::size_t n = 1 + i % 37;
    arrivals +=
        std::to_string(bytes.size()) + "," + std::to_string(n) + "," + std::to_string(1000 + i) + "\n";
    bytes += std::string(n, static_cast<char>('a' + i % 26));
  }
  write("mtx1.bin", bytes);
  write("mtx1.arrivals.csv", arrivals);
  for (const auto how : {RawDump::Arrivals::kToCheck, RawDump::Arrivals::kChecked}) {
    auto dump = RawDump::open(folder_ / "mtx1.bin", how);
    ASSERT_TRUE(dump.has_value()) << dump.error().text();
    for (std::size_t i = 0; i < kReads; ++i) {
      const auto read = dump->next();
      ASSERT_TRUE(read) << i;
      ASSERT_EQ(read->arrival, host_time_from_ns(static_cast<std::int64_t>(1000 + i)));
      ASSERT_EQ(std::string(read->bytes.begin(), read->bytes.end()),
                std::string(1 + i % 37, static_cast<char>('a' + i % 26)));
    }
    EXPECT_FALSE(dump->next());
  }
}

TEST_F(RawDumpTest, NamesTheLineThatCannotBe) {
  write("mtx1.bin", "abcdefgh");
  const std::string header = "byte_offset,n_bytes,arrival_ns\n";
  EXPECT_THAT(error_of("offset,bytes,ns\n"),
              HasSubstr("mtx1.arrivals.csv:1: the header is 'offset,bytes,ns'"));
  EXPECT_THAT(error_of(header + "0,4,1\n4,x,2\n"), HasSubstr(":3: '4,x,2' is not three whole numbers"));
  EXPECT_THAT(error_of(header + "0,4,1.5\n"), HasSubstr(":2: '0,4,1.5' is not three whole numbers"));
  EXPECT_THAT(error_of(header + "0,4\n"), HasSubstr("is not three whole numbers"));
  EXPECT_THAT(error_of(header + "0,4,1\n5,3,2\n"),
              HasSubstr(":3: byte_offset is 5, but the read before ends at 4"));
  EXPECT_THAT(error_of(header + "0,0,1\n"), HasSubstr("a read of 0 bytes"));
  EXPECT_THAT(error_of(header + "0,4,9\n4,4,8\n"), HasSubstr(":3: arrival_ns goes back"));
  EXPECT_THAT(error_of(header + "0,4,9\n"), HasSubstr("the reads end at byte 4 of 8"));
  EXPECT_THAT(error_of(header + "0,4,9\n4,4,9223372036854775807\n"), HasSubstr("that no clock has reached"));
  EXPECT_THAT(error_of(""), HasSubstr("the file is empty"));
}

TEST_F(RawDumpTest, ALengthThatNoFileHasDoesNotAskForItsMemory) {
  write("mtx1.bin", "abcd");
  write("mtx1.arrivals.csv", "byte_offset,n_bytes,arrival_ns\n0,4000000000000,1\n");
  auto dump = RawDump::open(folder_ / "mtx1.bin");
  ASSERT_TRUE(dump.has_value());
  EXPECT_EQ(dump->next()->bytes.size(), 4U);
}

TEST_F(RawDumpTest, AReadThatIsLongerThanAnyComesInPiecesOfItsArrival) {
  constexpr std::size_t kMiB = 1U << 20U;
  write("mtx1.bin", std::string(2 * kMiB + 5, 'x'));
  write("mtx1.arrivals.csv", "byte_offset,n_bytes,arrival_ns\n0,2097157,7\n");
  auto dump = RawDump::open(folder_ / "mtx1.bin");
  ASSERT_TRUE(dump.has_value());
  std::size_t bytes = 0;
  while (const auto read = dump->next()) {
    EXPECT_LE(read->bytes.size(), kMiB);
    EXPECT_EQ(read->arrival, host_time_from_ns(7));
    bytes += read->bytes.size();
  }
  EXPECT_EQ(bytes, 2 * kMiB + 5);
}

TEST_F(RawDumpTest, SaysWhatIsThereInstead) {
  write("empty.bin", "");
  EXPECT_THAT(RawDump::open(folder_ / "absent.bin").error().text(), HasSubstr("does not exist"));
  EXPECT_THAT(RawDump::open(folder_).error().text(), HasSubstr("is a folder"));
  EXPECT_THAT(RawDump::open(folder_ / "empty.bin").error().text(), HasSubstr("is empty"));
  EXPECT_THAT(RawDump::open("/dev/null").error().text(), HasSubstr("is empty"));
  EXPECT_THAT(RawDump::open(folder_ / std::string(300, 'x')).error().text(), HasSubstr("cannot be reached"));
}

TEST_F(RawDumpTest, ADumpThatMayNotBeReadSaysSo) {
  write("mtx1.bin", "abcd");
  std::filesystem::permissions(folder_ / "mtx1.bin", std::filesystem::perms::none);
  const int outcome = test::in_child([&] {
    if (!test::become_ordinary()) return test::kNotPermitted;
    const auto dump = RawDump::open(folder_ / "mtx1.bin");
    return !dump && dump.error().text().find("check its permissions") != std::string::npos ? 0 : 1;
  });
  std::filesystem::permissions(folder_ / "mtx1.bin", std::filesystem::perms::owner_all);
  EXPECT_EQ(outcome, 0);
}

}  // namespace
}  // namespace imuscope
