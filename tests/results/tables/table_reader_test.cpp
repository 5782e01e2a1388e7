#include "results/tables/table_reader.h"

#include <gtest/gtest.h>

#include <cmath>
#include <fstream>

#include "service/run/run_folder.h"
#include "tests/support/shared_data.h"

namespace imuscope::tables {
namespace {

class TableReaderTest : public testing::Test {
 protected:
  std::filesystem::path file_with(const std::string& content) const {
    const auto file = folder_ / "errors_a.csv";
    std::ofstream(file, std::ios::binary) << content;
    return file;
  }
  static Result<TableReader> open(const std::filesystem::path& file) {
    return TableReader::open(file, run_table("errors"));
  }

 private:
  std::filesystem::path folder_ = test::scratch_folder();
};

TEST_F(TableReaderTest, ReadsWhatTheRunWrote) {
  ErrorRow row{};
  row.counter = 7;
  row.gyro_valid = true;
  row.e_gyro_radps = {1e-3, -2.5, 0.1};
  auto reader =
      open(file_with(error_csv_header() + error_csv_row(row, 1.25, "dynamic") + error_csv_row(row, 2.5, "")));
  ASSERT_TRUE(reader) << reader.error().text();
  const auto block = reader->next(10);
  ASSERT_TRUE(block) << block.error().text();
  EXPECT_EQ(block->rows, 2U);
  EXPECT_EQ(block->columns[0], (std::vector{1.25, 2.5}));
  EXPECT_TRUE(std::isnan(block->columns[1][0]));
  EXPECT_EQ(block->columns[2][0], 7.0);
  EXPECT_EQ(block->columns[4][0], -2.5);
  EXPECT_TRUE(std::isnan(block->columns[6][0]));
  EXPECT_EQ(block->columns[9], (std::vector{0.0, -1.0}));
  EXPECT_EQ(reader->words(9), std::vector<std::string>{"dynamic"});
}

TEST_F(TableReaderTest, GivesBlocksAndThenNothing) {
  auto reader = open(file_with("time_s\n1\n2\n3\n"));
  EXPECT_EQ(reader->next(2)->rows, 2U);
  EXPECT_EQ(reader->next(2)->rows, 1U);
  EXPECT_EQ(reader->next(2)->rows, 0U);
  EXPECT_FALSE(reader->was_cut_off());
}

TEST_F(TableReaderTest, LeavesARowOutThatWasCutOff) {
  auto reader = open(file_with("time_s,utc_s\n1,2\n3,4"));
  EXPECT_EQ(reader->next(9)->rows, 1U);
  EXPECT_TRUE(reader->was_cut_off());
}

TEST_F(TableReaderTest, TellsLineAndColumnOfWhatIsWrong) {
  auto reader = open(file_with("time_s,utc_s\n1,2\n3,four\n"));
  const auto block = reader->next(9);
  ASSERT_FALSE(block);
  EXPECT_NE(block.error().text().find("line 3: utc_s is \"four\""), std::string::npos)
      << block.error().text();
  EXPECT_FALSE(open("/dev/zero"));
  EXPECT_FALSE(open(file_with("time_s,time_s\n")));
}

}  // namespace
}  // namespace imuscope::tables
