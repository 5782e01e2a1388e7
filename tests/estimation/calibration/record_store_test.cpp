#include "estimation/calibration/record_store.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cerrno>
#include <cstring>
#include <fstream>

#include "tests/support/file_size_limit.h"
#include "tests/support/refused_calls.h"
#include "tests/support/shared_data.h"

namespace imuscope {
namespace {

constexpr std::size_t kDoubles = 100;
constexpr std::size_t kRecordBytes = kDoubles * sizeof(double);

std::vector<double> record_of(std::size_t index) {
  std::vector<double> record(kDoubles);
  for (std::size_t i = 0; i < kDoubles; ++i) record[i] = static_cast<double>(1000 * index + i);
  return record;
}

void expect_records(const RecordStore& store, std::size_t n) {
  ASSERT_EQ(store.size(), n);
  std::vector<double> out(kDoubles);
  // Backwards, as the smoother reads.
  for (std::size_t index = n; index-- > 0;) {
    const auto read = store.read(index, out);
    ASSERT_TRUE(read) << read.error().text();
    ASSERT_EQ(out, record_of(index)) << index;
  }
}

TEST(RecordStore, GivesBackWhatItTookFromMemoryAndFromTheFileThatHasNoName) {
  const auto folder = test::scratch_folder();
  for (const std::size_t memory : {std::size_t{0}, kRecordBytes, 7 * kRecordBytes, 1000 * kRecordBytes}) {
    RecordStore store(kDoubles, {memory, folder});
    for (std::size_t i = 0; i < 50; ++i) ASSERT_TRUE(store.append(record_of(i)));
    expect_records(store, 50);
    EXPECT_EQ(store.file_bytes(), memory < 50 * kRecordBytes ? 50 * kRecordBytes - store.memory_bytes() : 0U);
    EXPECT_LE(store.memory_bytes(), memory);
    EXPECT_TRUE(std::filesystem::is_empty(folder)) << "a crash would leave something behind";
  }
}

TEST(RecordStore, AFullDiskIsAnErrorThatNamesTheFolderAndCostsNoRecordBeforeIt) {
  const auto folder = test::scratch_folder();
  RecordStore store(kDoubles, {2 * kRecordBytes, folder});
  for (std::size_t i = 0; i < 5; ++i) ASSERT_TRUE(store.append(record_of(i)));
  {
    const test::FileSizeLimit limit(store.file_bytes() + kRecordBytes / 2);
    const auto refused = store.append(record_of(5));
    ASSERT_FALSE(refused);
    EXPECT_EQ(refused.error().kind, ErrorKind::kWork);
    EXPECT_THAT(refused.error().text(), testing::HasSubstr("cannot be written in " + folder.string()));
    EXPECT_THAT(refused.error().remedy, testing::HasSubstr("make room"));
  }
  expect_records(store, 5);
  // Room was made: what stands there of the record that was refused is written over.
  ASSERT_TRUE(store.append(record_of(5)));
  expect_records(store, 6);
}

TEST(RecordStore, ASignalCostsNothingAndADamagedDiskIsToldWithItsReason) {
  const auto folder = test::scratch_folder();
  RecordStore store(kDoubles, {0, folder});
  std::vector<double> out(kDoubles);
  {
    const test::RefusedCalls interrupted(test::Call::kPwrite, EINTR, 3);
    ASSERT_TRUE(store.append(record_of(0)));
    EXPECT_EQ(interrupted.left(), 0);
  }
  {
    const test::RefusedCalls interrupted(test::Call::kPread, EINTR, 3);
    ASSERT_TRUE(store.read(0, out));
    EXPECT_EQ(interrupted.left(), 0);
  }
  EXPECT_EQ(out, record_of(0));
  const test::RefusedCalls damaged(test::Call::kPread, EIO);
  const auto lost = store.read(0, out);
  ASSERT_FALSE(lost);
  EXPECT_THAT(lost.error().text(), testing::HasSubstr("cannot be read in " + folder.string()));
  EXPECT_THAT(lost.error().text(), testing::HasSubstr(std::strerror(EIO)));
}

TEST(RecordStore, AFileInThePlaceOfTheFolderIsAnErrorAndAFolderThatVanishesLaterIsNot) {
  const auto folder = test::scratch_folder() / "gone";
  std::ofstream(folder) << "a file";
  RecordStore never(kDoubles, {0, folder});
  const auto refused = never.append(record_of(0));
  ASSERT_FALSE(refused);
  EXPECT_THAT(refused.error().text(), testing::HasSubstr("cannot be kept"));
  EXPECT_THAT(refused.error().text(), testing::HasSubstr(folder.string()));
  EXPECT_EQ(never.size(), 0U);

  std::filesystem::remove(folder);
  ASSERT_TRUE(never.append(record_of(0))) << "the folder is made";
  std::filesystem::remove_all(folder);
  ASSERT_TRUE(never.append(record_of(1)));
  expect_records(never, 2);
}

TEST(RecordStore, MovesWithItsFile) {
  RecordStore store(kDoubles, {kRecordBytes, test::scratch_folder()});
  for (std::size_t i = 0; i < 3; ++i) ASSERT_TRUE(store.append(record_of(i)));
  RecordStore moved(std::move(store));
  ASSERT_TRUE(moved.append(record_of(3)));
  expect_records(moved, 4);
}

}  // namespace
}  // namespace imuscope
