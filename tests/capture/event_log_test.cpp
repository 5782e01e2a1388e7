#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <lcm/lcm-cpp.hpp>
#include <random>

#include "capture/capture_writer.h"
#include "capture/event_log_reader.h"
#include "capture/seal.h"
#include "tests/support/child_process.h"
#include "tests/support/file_size_limit.h"
#include "tests/support/shared_data.h"

namespace imuscope {
namespace {

using testing::HasSubstr;
using Bytes = std::vector<std::uint8_t>;

Bytes bytes_of(const std::string& text) { return {text.begin(), text.end()}; }

Bytes read_file(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

void write_file(const std::filesystem::path& path, const Bytes& bytes) {
  std::ofstream(path, std::ios::binary)
      .write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
}

std::vector<LogEvent> read_all(EventLogReader& reader) {
  std::vector<LogEvent> events;
  for (LogEvent event; reader.next(event);) events.push_back(event);
  return events;
}

std::vector<LogEvent> read_with_lcm(const std::filesystem::path& path) {
  std::vector<LogEvent> events;
  lcm::LogFile log(path.string(), "r");
  while (const lcm::LogEvent* event = log.readNextEvent()) {
    const auto* data = static_cast<const std::uint8_t*>(event->data);
    events.push_back({event->eventnum, event->timestamp, event->channel, Bytes(data, data + event->datalen)});
  }
  return events;
}

bool same(const LogEvent& a, const LogEvent& b) {
  return a.number == b.number && a.utime == b.utime && a.channel == b.channel && a.data == b.data;
}

/// Without the seals and the index, which are none of those who appended.
std::vector<LogEvent> appended(std::vector<LogEvent> events) {
  std::erase_if(events, [](const LogEvent& event) { return is_seal_or_index(event); });
  return events;
}

/// A log without seals, of n records of differing sizes, one of them empty; returns where each ends.
std::vector<std::size_t> write_plain_example(const std::filesystem::path& path, int n) {
  Bytes file;
  std::vector<std::size_t> ends;
  for (int i = 0; i < n; ++i) {
    const Bytes data(static_cast<std::size_t>(i * 7), static_cast<std::uint8_t>(i));
    append_record_head(file, i, 1'700'000'000'000'000 + i, "CHANNEL_" + std::to_string(i), data.size());
    file.insert(file.end(), data.begin(), data.end());
    ends.push_back(file.size());
  }
  write_file(path, file);
  return ends;
}

/// Writes n records of differing sizes, one of them empty, and returns where each ends in the file.
std::vector<std::size_t> write_example(const std::filesystem::path& path, int n) {
  auto writer = CaptureWriter::create(path);
  EXPECT_TRUE(writer.has_value());
  std::vector<std::size_t> ends;
  for (int i = 0; i < n; ++i) {
    const Bytes data(static_cast<std::size_t>(i * 7), static_cast<std::uint8_t>(i));
    writer->append("CHANNEL_" + std::to_string(i), 1'700'000'000'000'000 + i, data);
    EXPECT_TRUE(writer->flush().has_value());
    ends.push_back(static_cast<std::size_t>(writer->bytes_written()));
  }
  EXPECT_TRUE(writer->close().has_value());
  return ends;
}

// The last read fills what was missing, and not a byte more.
TEST(EventLog, ALastRecordThatLiesAcrossTwoReadsIsWhole) {
  const auto path = test::scratch_folder() / "two.lcm";
  for (unsigned power = 10; power <= 20; ++power) {
    Bytes file;
    for (const std::size_t size : {(std::size_t{1} << power) - 100, std::size_t{200}}) {
      append_record_head(file, 0, 1'700'000'000'000'000, "C", size);
      file.resize(file.size() + size, 7);
    }
    write_file(path, file);
    auto reader = EventLogReader::open(path);
    ASSERT_TRUE(reader);
    EXPECT_EQ(read_all(*reader).size(), 2U) << power;
    EXPECT_EQ(reader->bytes_cut_off(), 0U) << power;
  }
}

TEST(CaptureWriter, WritesWhatTheLcmLibraryReads) {
  const auto path = test::scratch_folder() / "new" / "capture.lcm";
  write_example(path, 20);
  const auto events = appended(read_with_lcm(path));
  ASSERT_EQ(events.size(), 20U);
  for (int i = 0; i < 20; ++i) {
    const LogEvent expected{2 * i, 1'700'000'000'000'000 + i, "CHANNEL_" + std::to_string(i),
                            Bytes(static_cast<std::size_t>(i * 7), static_cast<std::uint8_t>(i))};
    EXPECT_TRUE(same(events[static_cast<std::size_t>(i)], expected)) << i;
  }
}

TEST(CaptureWriter, NeverOverwritesACapture) {
  const auto path = test::scratch_folder() / "capture.lcm";
  write_example(path, 3);
  const auto second = CaptureWriter::create(path);
  ASSERT_FALSE(second.has_value());
  EXPECT_THAT(second.error().text(), HasSubstr("never overwritten"));
  EXPECT_EQ(appended(read_with_lcm(path)).size(), 3U);
}

TEST(CaptureWriter, SaysWhyAFileCannotBeMade) {
  const auto folder = test::scratch_folder();
  write_file(folder / "file", {1});
  const auto writer = CaptureWriter::create(folder / "file" / "capture.lcm");
  ASSERT_FALSE(writer.has_value());
  EXPECT_THAT(writer.error().text(), HasSubstr((folder / "file" / "capture.lcm").string()));
}

TEST(CaptureWriter, AFullDiskCostsTheRecordsItRefusesAndNothingElse) {
  const auto path = test::scratch_folder() / "capture.lcm";
  auto writer = CaptureWriter::create(path);
  ASSERT_TRUE(writer.has_value());
  const Bytes data(100, 7);
  const auto append_and_flush = [&](const std::string& channel) {
    writer->append(channel, 1, data);
    return writer->flush();
  };
  ASSERT_TRUE(append_and_flush("BEFORE").has_value());

  Result<void> refused;
  {
    const test::FileSizeLimit full(writer->bytes_written() + 50);
    refused = append_and_flush("DURING");
  }

  ASSERT_FALSE(refused.has_value());
  EXPECT_THAT(refused.error().text(), HasSubstr("records were lost"));
  EXPECT_EQ(writer->records_lost(), 1U);
  EXPECT_EQ(std::filesystem::file_size(path), writer->bytes_written()) << "a part of a record is in the file";
  ASSERT_TRUE(append_and_flush("AFTER").has_value());
  ASSERT_TRUE(writer->close().has_value());
  const auto events = appended(read_with_lcm(path));
  ASSERT_EQ(events.size(), 2U);
  EXPECT_EQ(events[0].channel, "BEFORE");
  EXPECT_EQ(events[1].channel, "AFTER");
  EXPECT_EQ(events[1].number, 4) << "the event numbers show the loss";
}

TEST(EventLogReader, ReadsWhatTheLcmLibraryWrites) {
  const auto path = test::scratch_folder() / "log.lcm";
  {
    lcm::LogFile log(path.string(), "w");
    for (int i = 0; i < 10; ++i) {
      std::string data = "data " + std::to_string(i);
      lcm::LogEvent event;
      event.timestamp = 1000 + i;
      event.channel = "POSE";
      event.datalen = static_cast<std::int32_t>(data.size());
      event.data = data.data();
      ASSERT_EQ(log.writeEvent(&event), 0);
    }
  }
  auto reader = EventLogReader::open(path);
  ASSERT_TRUE(reader.has_value()) << reader.error().text();
  const auto events = read_all(*reader);
  ASSERT_EQ(events.size(), 10U);
  EXPECT_TRUE(same(events[9], {9, 1009, "POSE", bytes_of("data 9")}));
  EXPECT_EQ(reader->bytes_skipped(), 0U);
  EXPECT_EQ(reader->bytes_cut_off(), 0U);
}

TEST(EventLogReader, AKillAtAnyByteOfTheLastRecordLosesOnlyThatRecord) {
  const auto folder = test::scratch_folder();
  const auto ends = write_plain_example(folder / "whole.lcm", 12);
  const Bytes whole = read_file(folder / "whole.lcm");
  for (std::size_t size = ends[10]; size < ends[11]; ++size) {
    const auto path = folder / "cut.lcm";
    write_file(path, Bytes(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(size)));
    auto reader = EventLogReader::open(path);
    ASSERT_TRUE(reader.has_value());
    ASSERT_EQ(read_all(*reader).size(), 11U) << "cut at byte " << size;
    ASSERT_EQ(reader->bytes_cut_off(), size - ends[10]) << "cut at byte " << size;
    ASSERT_EQ(reader->bytes_skipped(), 0U) << "cut at byte " << size;
    ASSERT_EQ(read_with_lcm(path).size(), 11U) << "cut at byte " << size;
  }
}

TEST(EventLogReader, AFlippedByteCostsAtMostTheRecordItIsIn) {
  const auto folder = test::scratch_folder();
  const auto ends = write_plain_example(folder / "whole.lcm", 12);
  const Bytes whole = read_file(folder / "whole.lcm");
  const auto intact = read_with_lcm(folder / "whole.lcm");
  for (std::size_t at = ends[4]; at < ends[5]; ++at) {
    Bytes damaged = whole;
    damaged[at] ^= 0xffU;
    write_file(folder / "damaged.lcm", damaged);
    auto reader = EventLogReader::open(folder / "damaged.lcm");
    ASSERT_TRUE(reader.has_value());
    const auto events = read_all(*reader);
    for (std::size_t i = 0; i < intact.size(); ++i) {
      const bool found = std::any_of(events.begin(), events.end(),
                                     [&](const LogEvent& event) { return same(event, intact[i]); });
      ASSERT_EQ(found, i != 5) << "record " << i << " with byte " << at << " flipped";
    }
  }
}

TEST(EventLogReader, EveryByteIsAccountedForInRandomDamage) {
  const auto folder = test::scratch_folder();
  write_plain_example(folder / "whole.lcm", 40);
  const Bytes whole = read_file(folder / "whole.lcm");
  std::mt19937 random(11);
  for (int round = 0; round < 200; ++round) {
    Bytes damaged = whole;
    for (int i = 0; i < 30; ++i)
      damaged[4 + random() % (damaged.size() - 4)] = static_cast<std::uint8_t>(random());
    // Forged sync words with forged lengths.
    for (int i = 0; i < 3; ++i) {
      const Bytes sync{0xed, 0xa1, 0xda, 0x01};
      std::copy(sync.begin(), sync.end(),
                damaged.begin() + static_cast<std::ptrdiff_t>(4 + random() % (damaged.size() - 8)));
    }
    write_file(folder / "damaged.lcm", damaged);
    auto reader = EventLogReader::open(folder / "damaged.lcm");
    ASSERT_TRUE(reader.has_value());
    std::uint64_t in_records = 0;
    for (const LogEvent& event : read_all(*reader)) {
      in_records += kEventLogHeaderBytes + event.channel.size() + event.data.size();
    }
    ASSERT_EQ(in_records + reader->bytes_skipped() + reader->bytes_cut_off(), damaged.size())
        << "round " << round;
  }
}

/// Each claims more than the file has, and each has a whole record after it: what is left is not moved once
/// for every one of them.
TEST(EventLogReader, ClaimsBeyondTheEndCostNoMoreThanTheyAreLong) {
  const auto folder = test::scratch_folder();
  const auto path = folder / "claims.lcm";
  Bytes whole;
  append_record_head(whole, 0, 1, "C", 0);
  ASSERT_EQ(whole.size(), kEventLogHeaderBytes + 1);
  Bytes claim = whole;
  claim[24] = 0x03;  // of the length of the data: 50 MB
  constexpr std::size_t kBytes = std::size_t{16} << 20U;
  Bytes file = whole;
  std::size_t n = 1;
  for (; file.size() < kBytes; ++n) {
    file.insert(file.end(), claim.begin(), claim.end());
    file.insert(file.end(), whole.begin(), whole.end());
    file.insert(file.end(), whole.begin(), whole.end());
  }
  write_file(path, file);
  auto reader = EventLogReader::open(path);
  ASSERT_TRUE(reader.has_value());
  std::size_t found = 0;
  for (LogEvent event; reader->next(event);) ++found;
  EXPECT_EQ(found, 2 * n - 1);
  EXPECT_EQ(reader->bytes_skipped(), (n - 1) * claim.size());
}

TEST(EventLogReader, SaysWhatAFileIsThatIsNoCapture) {
  const auto folder = test::scratch_folder();
  write_file(folder / "empty.lcm", {});
  write_file(folder / "text.lcm", bytes_of("time_s,lat_deg\n1,2\n"));
  write_file(folder / "log.gz", {0x1f, 0x8b, 0x08, 0x00});
  write_file(folder / "mtx1.bin", {0xfa, 0xff, 0x32, 0x00, 0x01});
  write_file(folder / "short.lcm", {0xed, 0xa1});
  const struct {
    const char* name;
    const char* what;
  } cases[] = {{"absent.lcm", "does not exist"},
               {"", "is a folder, not a capture"},
               {"empty.lcm", "is empty: nothing was recorded"},
               {"text.lcm", "but text that begins with 'time_s,lat_deg'"},
               {"log.gz", "but a gzip archive"},
               {"mtx1.bin", "but binary data that begins with the bytes fa ff 32 00 01"},
               {"short.lcm", "but binary data that begins with the bytes ed a1"}};
  for (const auto& [name, what] : cases) {
    const auto reader = EventLogReader::open(folder / name);
    ASSERT_FALSE(reader.has_value()) << name;
    EXPECT_THAT(reader.error().text(), HasSubstr((folder / name).string()));
    EXPECT_THAT(reader.error().text(), HasSubstr(what));
    EXPECT_FALSE(reader.error().remedy.empty()) << name;
  }
}

TEST(EventLogReader, AFileThatMayNotBeReadOrReachedIsNotSaidToBeAbsent) {
  const auto folder = test::scratch_folder();
  EXPECT_THAT(EventLogReader::open(folder / std::string(300, 'x')).error().text(),
              HasSubstr("cannot be reached: " + std::string(std::strerror(ENAMETOOLONG))));
  write_example(folder / "capture.lcm", 3);
  std::filesystem::permissions(folder / "capture.lcm", std::filesystem::perms::none);
  const int outcome = test::in_child([&] {
    if (!test::become_ordinary()) return test::kNotPermitted;
    const auto reader = EventLogReader::open(folder / "capture.lcm");
    return !reader && reader.error().text().find("cannot be read; check its permissions") != std::string::npos
               ? 0
               : 1;
  });
  std::filesystem::permissions(folder / "capture.lcm", std::filesystem::perms::owner_all);
  EXPECT_EQ(outcome, 0);
}

}  // namespace
}  // namespace imuscope
