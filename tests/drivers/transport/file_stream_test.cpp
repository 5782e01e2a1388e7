#include "drivers/transport/file_stream.h"

#include <gtest/gtest.h>

#include <fstream>
#include <string>

#include "tests/support/shared_data.h"

namespace imuscope {
namespace {

class FileStreamTest : public testing::Test {
 protected:
  void write(const std::string& name, const std::string& text) { std::ofstream(folder_ / name) << text; }
  /// All reads as text, with their arrivals in nanoseconds.
  Result<std::vector<std::pair<std::string, std::int64_t>>> reads() {
    auto stream = FileStream::open(folder_ / "mtx1.bin");
    if (!stream) return tl::unexpected<Error>(stream.error());
    std::vector<std::pair<std::string, std::int64_t>> all;
    for (;;) {
      auto read = stream->next();
      if (!read) return tl::unexpected<Error>(read.error());
      if (!*read) return all;
      all.emplace_back(std::string((*read)->bytes.begin(), (*read)->bytes.end()), to_ns((*read)->arrival));
    }
  }
  using Reads = std::vector<std::pair<std::string, std::int64_t>>;
  std::filesystem::path folder_ = test::scratch_folder();
};

TEST_F(FileStreamTest, GivesTheReadsBackAsTheyWere) {
  write("mtx1.bin", "abcdefghij");
  write("mtx1.arrivals.csv", "byte_offset,n_bytes,arrival_ns\n0,3,1000\n3,1,2000\n4,6,2000\n");
  const auto all = reads();
  ASSERT_TRUE(all) << all.error().text();
  EXPECT_EQ(*all, (Reads{{"abc", 1000}, {"d", 2000}, {"efghij", 2000}}));
}

TEST_F(FileStreamTest, WithoutArrivalsItComesInBlocks) {
  write("mtx1.bin", std::string(100000, 'x'));
  const auto all = reads();
  ASSERT_TRUE(all);
  std::size_t n = 0;
  for (const auto& [text, arrival] : *all) n += text.size();
  EXPECT_EQ(n, 100000U);
  EXPECT_FALSE(FileStream::open(folder_ / "mtx1.bin")->has_arrivals());
}

TEST_F(FileStreamTest, ARecordingThatWasKilledIsReadAsFarAsItGoes) {
  write("mtx1.bin", "abcdef");
  write("mtx1.arrivals.csv", "byte_offset,n_bytes,arrival_ns\n0,3,1000\n3,2,20");
  const auto torn_list = reads();
  ASSERT_TRUE(torn_list) << torn_list.error().text();
  EXPECT_EQ(*torn_list, (Reads{{"abc", 1000}, {"def", 1000}}));
  write("mtx1.arrivals.csv", "byte_offset,n_bytes,arrival_ns\n0,3,1000\n3,9,2000\n");
  const auto torn_dump = reads();
  ASSERT_TRUE(torn_dump);
  EXPECT_EQ(*torn_dump, (Reads{{"abc", 1000}, {"def", 2000}}));
}

TEST_F(FileStreamTest, AListThatContradictsItselfIsRefusedWithItsLine) {
  write("mtx1.bin", "abcdef");
  for (const char* bad : {"1,2,3000\n", "3,1,500\n", "3,-1,3000\n", "3;1;3000\n", "3,1\n"}) {
    write("mtx1.arrivals.csv",
          std::string("byte_offset,n_bytes,arrival_ns\n0,3,1000\n") + bad + "4,2,9000\n");
    const auto all = reads();
    ASSERT_FALSE(all) << bad;
    EXPECT_NE(all.error().what.find("mtx1.arrivals.csv:3"), std::string::npos) << all.error().what;
  }
}

TEST_F(FileStreamTest, AMissingFileIsSaidByName) {
  const auto all = reads();
  ASSERT_FALSE(all);
  EXPECT_NE(all.error().what.find("mtx1.bin"), std::string::npos);
}

}  // namespace
}  // namespace imuscope
