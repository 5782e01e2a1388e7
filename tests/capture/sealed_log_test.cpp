/// Captures that are flipped, cut and torn: what is read is what was recorded, and what is lost is told.

#include "capture/sealed_log.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <map>
#include <random>

#include "capture/capture_repair.h"
#include "capture/capture_writer.h"
#include "capture/record_codec.h"
#include "tests/support/resident_memory.h"
#include "tests/support/shared_data.h"

namespace imuscope {
namespace {

using Bytes = std::vector<std::uint8_t>;
namespace fs = std::filesystem;

constexpr HostTime kBegin{std::chrono::seconds(1000)};
constexpr int kReadsPerFile = 24;

Bytes content_of(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

void put_content(const fs::path& path, const Bytes& bytes) {
  std::ofstream(path, std::ios::binary)
      .write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
}

RunHeader small_run() {
  RunHeader run;
  run.name = "drive";
  run.t0 = kBegin;
  run.period = std::chrono::milliseconds(10);
  run.t0_wall = utc_time_from_ns(1'700'000'000'000'000'000);
  run.configuration = "# none";
  run.devices = {"airins"};
  return run;
}

/// A capture of so many files, flushed every six reads; returns the first.
fs::path record_files(const fs::path& folder, int files) {
  const fs::path first = folder / "capture.lcm";
  const RunHeader run = small_run();
  const RecordClock clock{run.t0, run.t0_wall};
  for (int file = 0; file < files; ++file) {
    auto writer = std::move(*CaptureWriter::create(capture_file(first, file), "IMUSCOPE", file));
    writer.append("IMUSCOPE_RUN", clock.utime(run.t0), encode(run, file));
    EXPECT_TRUE(writer.flush());
    for (int i = 0; i < kReadsPerFile; ++i) {
      const std::int64_t sequence = kReadsPerFile * file + i;
      const HostTime arrival = kBegin + std::chrono::milliseconds(10 * sequence);
      const Bytes bytes(20, static_cast<std::uint8_t>(sequence));
      writer.append(
          "IMUSCOPE_RAW_AIRINS", clock.utime(arrival),
          encode(RawChunk{{sequence, arrival, 0, Direction::kRead, false}, bytes}, "airins", clock));
      const bool is_due = i % 6 == 5;
      EXPECT_TRUE(!is_due || writer.flush());
    }
    EXPECT_TRUE(writer.close());
  }
  return first;
}

struct Read {
  std::vector<LogEvent> events;
  LogHealth health;
};

Read read_log(const fs::path& path) {
  Read read;
  auto log = SealedLog::open(path, EventLogReader::Beginning::kMayBeDamaged);
  if (!log) return read;
  for (LogEvent event; log->next(event);) read.events.push_back(event);
  read.health = log->health();
  return read;
}

bool is_among(const LogEvent& event, const std::vector<LogEvent>& events) {
  return std::any_of(events.begin(), events.end(), [&](const LogEvent& other) {
    return event.utime == other.utime && event.channel == other.channel && event.data == other.data;
  });
}

std::size_t in_both(const std::vector<LogEvent>& found, const std::vector<LogEvent>& recorded) {
  return static_cast<std::size_t>(std::count_if(
      found.begin(), found.end(), [&](const LogEvent& event) { return is_among(event, recorded); }));
}

std::size_t size_of(const LogEvent& event) {
  return kEventLogHeaderBytes + event.channel.size() + event.data.size();
}

/// Where each record ends in the file; seals and index left out.
std::vector<std::size_t> ends_of_records(const fs::path& path) {
  std::vector<std::size_t> ends;
  auto log = EventLogReader::open(path);
  std::size_t end = 0;
  for (LogEvent event; log->next(event);) {
    end += size_of(event);
    if (!is_seal_or_index(event)) ends.push_back(end);
  }
  return ends;
}

/// The index is the last record.
std::size_t begin_of_index(const fs::path& path) {
  auto log = EventLogReader::open(path);
  std::size_t last = 0;
  for (LogEvent event; log->next(event);) last = size_of(event);
  return fs::file_size(path) - last;
}

TEST(SealedLog, GivesWhatWasAppendedAndKnowsThatItIsWhole) {
  const auto first = record_files(test::scratch_folder(), 1);
  const auto read = read_log(first);
  EXPECT_EQ(read.events.size(), kReadsPerFile + 1U);
  EXPECT_TRUE(read.health.is_sealed);
  ASSERT_TRUE(read.health.index.has_value());
  EXPECT_EQ(read.health.records_unsealed, 0U);
  const auto check = check_capture(first);
  ASSERT_TRUE(check.has_value());
  EXPECT_TRUE(check->is_whole());
}

/// A power cut takes what is not sealed out of what is checked: 32 kB at most, however seldom the file is flushed.
TEST(SealedLog, ManyRecordsBetweenTwoFlushesAreSealedInParts) {
  const fs::path path = test::scratch_folder() / "capture.lcm";
  auto writer = std::move(*CaptureWriter::create(path, "IMUSCOPE", 0));
  const Bytes kilobyte(1000, 7);
  constexpr int kRecords = 200;
  for (int i = 0; i < kRecords; ++i) writer.append("IMUSCOPE_RAW_AIRINS", 1000 + i, kilobyte);
  EXPECT_TRUE(writer.close());
  auto log = EventLogReader::open(path);
  ASSERT_TRUE(log);
  std::size_t unsealed = 0;
  std::size_t most = 0;
  std::size_t records = 0;
  for (LogEvent event; log->next(event);) {
    const bool seals = is_seal_or_index(event);
    records += seals ? 0 : 1;
    unsealed = seals ? 0 : unsealed + size_of(event);
    most = std::max(most, unsealed);
  }
  EXPECT_EQ(records, static_cast<std::size_t>(kRecords));
  EXPECT_GT(most, 31U << 10U);
  EXPECT_LT(most, 34U << 10U);
}

TEST(SealedLog, ARecordLongerThanAnyWaitWaitsForItsSeal) {
  const fs::path path = test::scratch_folder() / "capture.lcm";
  auto writer = std::move(*CaptureWriter::create(path, "IMUSCOPE", 0));
  writer.append("IMUSCOPE_RUN", 1, encode(small_run(), 0));
  EXPECT_TRUE(writer.flush());
  constexpr std::size_t kLong = std::size_t{20} << 20U;
  writer.append("POSE", 2, Bytes(kLong, 7));
  EXPECT_TRUE(writer.close());
  Bytes bytes = content_of(path);
  auto read = read_log(path);
  EXPECT_EQ(read.events.size(), 2U);
  EXPECT_EQ(read.health.records_unsealed, 0U);
  bytes[kLong / 2] ^= 1U;
  put_content(path, bytes);
  read = read_log(path);
  EXPECT_EQ(read.events.size(), 1U);
  EXPECT_EQ(read.health.records_damaged, 1U);
}

/// What was read before damage is given, and what comes after it, however much of it there is; none of it is kept.
TEST(SealedLog, DamageThatIsLongerThanAnyWaitIsNotKept) {
  const auto first = record_files(test::scratch_folder(), 1);
  const Bytes good = content_of(first);
  const auto whole = read_log(first);
  constexpr std::size_t kDamage = std::size_t{64} << 20U;
  // Within the last reads, whose seal comes after it.
  const std::size_t place = 3 * good.size() / 4;
  {
    std::ofstream file(first, std::ios::binary);
    const auto put = [&](const std::uint8_t* bytes, std::size_t n) {
      file.write(reinterpret_cast<const char*>(bytes), static_cast<std::streamsize>(n));
    };
    put(good.data(), place);
    const Bytes zeros(std::size_t{1} << 20U, 0);
    for (std::size_t n = 0; n < kDamage; n += zeros.size()) put(zeros.data(), zeros.size());
    put(good.data() + place, good.size() - place);
  }
  auto log = SealedLog::open(first);
  ASSERT_TRUE(log);
  const std::size_t before = test::resident_bytes();
  std::size_t most = before;
  std::size_t found = 0;
  for (LogEventView event; log->next(event); ++found) most = std::max(most, test::resident_bytes());
  EXPECT_LT(std::max(most, test::resident_bytes()), before + kDamage / 2);
  // The one that is torn, and no other.
  EXPECT_EQ(found, whole.events.size() - 1);
  EXPECT_GT(log->health().bytes_skipped, kDamage);
}

/// Wherever the reader knows its place, it goes on from there with the same records when it is sent back.
TEST(SealedLog, OfAPlaceTheRestIsReadAgain) {
  const auto first = record_files(test::scratch_folder(), 2);
  std::vector<LogEvent> all;
  std::vector<std::pair<std::size_t, CaptureFiles::Place>> places;
  auto files = CaptureFiles::open(first);
  ASSERT_TRUE(files.has_value());
  EXPECT_FALSE(files->place()) << "before the first record nobody knows what capture it is";
  for (LogEvent event; files->next(event);) {
    all.push_back(event);
    if (const auto place = files->place()) places.emplace_back(all.size(), *place);
  }
  ASSERT_EQ(all.size(), 2U * (kReadsPerFile + 1));
  // A place follows every seal but those that the index follows.
  ASSERT_GE(places.size(), 6U);
  EXPECT_EQ(places.back().second.number, 1);
  for (const auto& [n, place] : places) {
    ASSERT_TRUE(files->go_to(place).has_value());
    std::size_t at = n;
    for (LogEvent event; files->next(event); ++at) {
      ASSERT_LT(at, all.size());
      EXPECT_EQ(event.data, all[at].data) << n << " of file " << place.number;
    }
    EXPECT_EQ(at, all.size()) << n << " of file " << place.number;
  }
}

/// As lcm-logplayer and lcm-logger do: other stamps, other numbers, the seals among the rest.
TEST(SealedLog, ACaptureThatWasPlayedAndRecordedAnewLosesNothingToItsOldSeals) {
  const auto folder = test::scratch_folder();
  const auto first = record_files(folder, 1);
  Bytes anew;
  auto log = EventLogReader::open(first);
  for (LogEvent event; log->next(event);) {
    append_record_head(anew, event.number, event.utime + 1'000'000, event.channel, event.data.size());
    anew.insert(anew.end(), event.data.begin(), event.data.end());
  }
  put_content(folder / "anew.lcm", anew);
  const auto read = read_log(folder / "anew.lcm");
  const auto is_old_seal = [](const LogEvent& event) { return is_seal_or_index(event); };
  const auto old_seals = std::count_if(read.events.begin(), read.events.end(), is_old_seal);
  EXPECT_EQ(read.events.size() - static_cast<std::size_t>(old_seals), kReadsPerFile + 1U);
  EXPECT_EQ(read.health.records_damaged + read.health.records_missing, 0U);
  EXPECT_FALSE(read.health.is_sealed);

  // Copied by ours, it is sealed anew, the old seals as records.
  {
    auto copy = std::move(*CaptureWriter::create(folder / "copy.lcm"));
    auto again = EventLogReader::open(first);
    for (LogEvent event; again->next(event);) copy.append(event.channel, event.utime, event.data);
    ASSERT_TRUE(copy.close());
  }
  const auto copied = read_log(folder / "copy.lcm");
  EXPECT_EQ(copied.health.records_damaged + copied.health.records_missing + copied.health.records_unsealed,
            0U);
  EXPECT_TRUE(copied.health.index.has_value());
}

TEST(SealedLog, AFlippedByteAnywhereCostsItsRecordAndNeverGoesUnnoticed) {
  const auto folder = test::scratch_folder();
  const auto first = record_files(folder, 1);
  const Bytes whole = content_of(first);
  const auto recorded = read_log(first).events;
  const fs::path damaged = folder / "damaged.lcm";
  const std::size_t index_begin = begin_of_index(first);
  for (std::size_t at = 0; at < whole.size(); at += 3) {
    Bytes bytes = whole;
    bytes[at] ^= static_cast<std::uint8_t>(1U << (at % 8));
    put_content(damaged, bytes);
    const auto read = read_log(damaged);
    // A seal that is no longer known as one is the only thing that is given and was no record.
    ASSERT_GE(in_both(read.events, recorded) + std::min<std::size_t>(read.health.records_unsealed, 1),
              read.events.size())
        << "byte " << at << ": a wrong record was given";
    // A damaged length may swallow just the record after.
    ASSERT_GE(read.events.size() + 2, recorded.size()) << "byte " << at;
    if (at >= index_begin) continue;  // number and stamp of the index itself are nothing that anybody uses
    const auto check = check_capture(damaged);
    ASSERT_FALSE(check && check->is_whole()) << "byte " << at << " went unnoticed";
  }
}

TEST(SealedLog, ACutAnywhereLeavesEveryRecordBeforeIt) {
  const auto folder = test::scratch_folder();
  const auto first = record_files(folder, 1);
  const Bytes whole = content_of(first);
  const auto recorded = read_log(first).events;
  const auto ends = ends_of_records(first);
  const fs::path cut = folder / "cut.lcm";
  for (std::size_t size = 4; size < whole.size(); size += 7) {
    put_content(cut, Bytes(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(size)));
    const auto read = read_log(cut);
    const auto before = static_cast<std::size_t>(
        std::count_if(ends.begin(), ends.end(), [&](std::size_t end) { return end <= size; }));
    ASSERT_EQ(read.events.size(), before) << "cut at " << size;
    ASSERT_EQ(in_both(read.events, recorded), before);
    ASSERT_FALSE(read.health.index.has_value());
    ASSERT_EQ(read.health.bytes_skipped + read.health.records_damaged + read.health.records_missing, 0U);
  }
}

/// Pages of zeros, of junk, and taken out, as disks leave them. Where a seal is gone with its records, those
/// that look like some are given and counted.
TEST(SealedLog, WhateverBecomesOfTheBytesNoRecordIsGivenForCheckedThatWasNotRecorded) {
  const auto folder = test::scratch_folder();
  const auto first = record_files(folder, 1);
  const Bytes whole = content_of(first);
  const auto recorded = read_log(first).events;
  std::mt19937 random(7);
  std::size_t given = 0;
  for (int round = 0; round < 300; ++round) {
    Bytes bytes = whole;
    const auto place = static_cast<std::ptrdiff_t>(random() % bytes.size());
    const auto length = static_cast<std::ptrdiff_t>(
        std::min<std::size_t>(1 + random() % 512, bytes.size() - static_cast<std::size_t>(place)));
    switch (random() % 3) {
      case 0:
        std::fill_n(bytes.begin() + place, length, std::uint8_t{0});
        break;
      case 1:
        std::generate_n(bytes.begin() + place, length, [&] { return static_cast<std::uint8_t>(random()); });
        break;
      default:
        bytes.erase(bytes.begin() + place, bytes.begin() + place + length);
    }
    put_content(folder / "damaged.lcm", bytes);
    const auto read = read_log(folder / "damaged.lcm");
    ASSERT_GE(in_both(read.events, recorded) + read.health.records_unsealed, read.events.size())
        << "round " << round;
    ASSERT_GE(in_both(read.events, recorded) + 2, read.events.size()) << "round " << round;
    given += read.events.size();
  }
  EXPECT_GT(given, 200U * recorded.size()) << "most records are whole, and most were not given";
}

TEST(CaptureRepair, ACopyHoldsAllThatIsWholeAndIsWholeItself) {
  const auto folder = test::scratch_folder();
  const auto first = record_files(folder, 3);
  Bytes second = content_of(capture_file(first, 1));
  second[40] ^= 1U;  // in its header
  second[second.size() / 2] ^= 1U;
  put_content(capture_file(first, 1), second);
  Bytes third = content_of(capture_file(first, 2));
  third.resize(third.size() / 2);
  put_content(capture_file(first, 2), third);

  const auto check = check_capture(first);
  ASSERT_TRUE(check.has_value());
  EXPECT_FALSE(check->is_whole());
  ASSERT_EQ(check->files.size(), 3U);
  EXPECT_EQ(check->files[0].index, IndexVerdict::kAgrees);
  EXPECT_EQ(check->files[1].index, IndexVerdict::kDisagrees);
  EXPECT_EQ(check->files[2].index, IndexVerdict::kNone);
  const auto reads = check->summary.devices.at("airins").reads;
  ASSERT_GT(reads, 2U * kReadsPerFile);

  const fs::path out = folder / "repaired.lcm";
  const auto repaired = repair_capture(first, *check, out);
  ASSERT_TRUE(repaired.has_value()) << repaired.error().text();
  EXPECT_EQ(repaired->files.size(), 3U);
  const auto again = check_capture(out);
  ASSERT_TRUE(again.has_value());
  for (const auto& file : again->files) EXPECT_EQ(file.index, IndexVerdict::kAgrees) << file.file.number;
  EXPECT_TRUE(again->summary.breaks.empty());
  EXPECT_EQ(again->summary.devices.at("airins").reads, reads);
  EXPECT_EQ(again->summary.losses.size(), check->summary.losses.size()) << "a repair invents nothing";
  const auto refused = repair_capture(first, *check, out);
  ASSERT_FALSE(refused.has_value()) << "a capture was written over";
  EXPECT_THAT(refused.error().text(), testing::HasSubstr("never overwritten"));
}

TEST(CaptureRepair, ASealWhosePlaceIsDamagedIsNoRecordOfTheCopy) {
  const auto folder = test::scratch_folder();
  const auto first = record_files(folder, 1);
  // The number of the seal after the first six reads, in its record's header.
  Bytes bytes = content_of(first);
  const Bytes channel{'I', 'M', 'U', 'S', 'C', 'O', 'P', 'E', '_', 'S', 'E', 'A', 'L'};
  auto place = bytes.begin();
  for (int seal = 0; seal < 2; ++seal)
    place = std::search(place + 1, bytes.end(), channel.begin(), channel.end());
  ASSERT_NE(place, bytes.end());
  constexpr std::ptrdiff_t kLastByteOfNumber = 11;
  *(place - static_cast<std::ptrdiff_t>(kEventLogHeaderBytes) + kLastByteOfNumber) = 0;
  put_content(first, bytes);

  const auto check = check_capture(first);
  ASSERT_TRUE(check.has_value());
  const fs::path out = folder / "repaired.lcm";
  const auto repaired = repair_capture(first, *check, out);
  ASSERT_TRUE(repaired.has_value()) << repaired.error().text();
  EXPECT_EQ(repaired->records, 1U + kReadsPerFile) << "the header and the reads";
  auto log = SealedLog::open(out);
  ASSERT_TRUE(log.has_value());
  std::size_t reads = 0;
  for (LogEvent event; log->next(event);) reads += event.channel == "IMUSCOPE_RAW_AIRINS" ? 1U : 0U;
  EXPECT_EQ(reads, kReadsPerFile);
  EXPECT_EQ(log->health().records_damaged, 0U);
  EXPECT_EQ(log->health().records_missing, 0U);
}

TEST(CaptureRepair, AFirstFileWithoutItsHeaderGetsThatOfTheOthers) {
  const auto folder = test::scratch_folder();
  const auto first = record_files(folder, 2);
  Bytes bytes = content_of(first);
  std::fill_n(bytes.begin(), 8, std::uint8_t{0});
  put_content(first, bytes);
  const auto check = check_capture(first);
  ASSERT_TRUE(check.has_value()) << check.error().text();
  EXPECT_TRUE(check->summary.has_run);
  EXPECT_EQ(check->summary.devices.at("airins").reads, 2U * kReadsPerFile);
  ASSERT_TRUE(repair_capture(first, *check, folder / "repaired.lcm"));
  const auto summary = summarise_capture(folder / "repaired.lcm");
  ASSERT_TRUE(summary.has_value());
  EXPECT_EQ(summary->run.name, "drive");
  EXPECT_EQ(summary->devices.at("airins").reads, 2U * kReadsPerFile);
}

}  // namespace
}  // namespace imuscope
