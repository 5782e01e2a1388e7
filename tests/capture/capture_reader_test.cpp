#include "capture/capture_reader.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <algorithm>
#include <filesystem>
#include <fstream>
#include <imuscope/exception_t.hpp>
#include <imuscope/raw_t.hpp>
#include <limits>
#include <random>

#include "capture/capture_writer.h"
#include "publish/message_codec.h"
#include "tests/support/resident_memory.h"
#include "tests/support/shared_data.h"

namespace imuscope {
namespace {

using testing::HasSubstr;
using Bytes = std::vector<std::uint8_t>;

const HostTime kT0 = host_time_from_ns(50'000'000'000);

RunHeader example_run() {
  RunHeader run;
  run.name = "drive 7";
  run.version = "0.1.0";
  run.build = "g++ 12.2 -O2";
  run.processor = "a CPU";
  run.t0 = kT0;
  run.period = std::chrono::milliseconds(10);
  run.t0_wall = utc_time_from_ns(1'700'000'000'000'000'000);
  run.configuration = "[run]\nname = \"drive 7\"\n";
  run.configuration_hash = "abc123";
  run.devices = {"airins", "mtx1"};
  return run;
}

/// A capture under construction, record by record.
class Capture {
 public:
  explicit Capture(const std::filesystem::path& path) : writer_(std::move(*CaptureWriter::create(path))) {}

  void header() { writer_.append("IMUSCOPE_RUN", 1, encode(run_, 0)); }
  void chunk(DeviceIndex device, std::int64_t sequence, std::int64_t arrival_ms, const Bytes& bytes,
             bool continues = false, Direction direction = Direction::kRead) {
    const RawChunk chunk{
        {sequence, kT0 + std::chrono::milliseconds(arrival_ms), device, direction, continues}, bytes};
    writer_.append("IMUSCOPE_RAW_X", 1, encode(chunk, run_.devices.at(device), {run_.t0, run_.t0_wall}));
  }
  /// A read whose arrival is what no clock says.
  void chunk_stamped(DeviceIndex device, std::int64_t arrival_ns) {
    raw_t message{};
    message.sequence = 1;
    message.device = run_.devices.at(device);
    message.direction = raw_t::READ;
    message.arrival_ns = arrival_ns;
    message.n_bytes = 1;
    message.bytes = {2};
    writer_.append("IMUSCOPE_RAW_X", 1, encode_message(message));
  }
  void exception(const RunException& exception) {
    const std::string device =
        exception.kind == ExceptionKind::kSkippedTicks ? "" : run_.devices.at(exception.device);
    writer_.append("IMUSCOPE_EXCEPTION", 1, encode(exception, device, kT0, 0, {run_.t0, run_.t0_wall}));
  }
  void foreign(const Bytes& bytes, std::int64_t utime = 1) { writer_.append("POSE", utime, bytes); }
  void done() { ASSERT_TRUE(writer_.close().has_value()); }

 private:
  RunHeader run_ = example_run();
  CaptureWriter writer_;
};

std::vector<RawRead> read_all(CaptureReader& reader) {
  std::vector<RawRead> reads;
  while (auto read = reader.next()) reads.push_back(std::move(*read));
  return reads;
}

TEST(CaptureReader, GivesBackTheRunHeaderAndEveryReadWithItsBoundaries) {
  const auto path = test::scratch_folder() / "capture.lcm";
  Capture capture(path);
  capture.header();
  capture.chunk(0, 0, 1, {1, 2, 3});
  capture.chunk(1, 0, 2, {9}, false, Direction::kWrite);
  capture.chunk(0, 1, 3, {4});
  capture.done();

  const auto summary = summarise_capture(path);
  ASSERT_TRUE(summary.has_value()) << summary.error().text();
  const RunHeader expected = example_run();
  EXPECT_EQ(summary->run.name, expected.name);
  EXPECT_EQ(summary->run.version, expected.version);
  EXPECT_EQ(summary->run.build, expected.build);
  EXPECT_EQ(summary->run.processor, expected.processor);
  EXPECT_EQ(summary->run.t0, expected.t0);
  EXPECT_EQ(summary->run.period, expected.period);
  EXPECT_EQ(summary->run.t0_wall, expected.t0_wall);
  EXPECT_EQ(summary->run.configuration, expected.configuration);
  EXPECT_EQ(summary->run.configuration_hash, expected.configuration_hash);
  EXPECT_EQ(summary->run.devices, expected.devices);
  EXPECT_EQ(summary->devices.at("airins").reads, 2U);
  EXPECT_EQ(summary->devices.at("airins").bytes_read, 4U);
  EXPECT_EQ(summary->devices.at("mtx1").writes, 1U);

  auto reader = CaptureReader::open(path);
  ASSERT_TRUE(reader.has_value());
  const auto reads = read_all(*reader);
  ASSERT_EQ(reads.size(), 3U);
  EXPECT_EQ(reads[0].device, "airins");
  EXPECT_EQ(reads[0].arrival, kT0 + std::chrono::milliseconds(1));
  EXPECT_EQ(reads[0].bytes, (Bytes{1, 2, 3}));
  EXPECT_EQ(reads[1].direction, Direction::kWrite);
  EXPECT_EQ(reads[2].bytes, (Bytes{4}));
}

TEST(CaptureReader, TellsTheRateOfALineAndCountsItForNoRead) {
  const auto path = test::scratch_folder() / "capture.lcm";
  Capture capture(path);
  capture.header();
  const auto told = line_rate_bytes(std::chrono::nanoseconds(10'851));
  capture.chunk(0, 0, 1, Bytes(told.begin(), told.end()), false, Direction::kLine);
  capture.chunk(0, 1, 2, {4});
  capture.done();
  const auto summary = summarise_capture(path);
  ASSERT_TRUE(summary.has_value()) << summary.error().text();
  EXPECT_TRUE(summary->losses.empty());
  EXPECT_EQ(summary->devices.at("airins").reads, 1U);
  EXPECT_EQ(summary->devices.at("airins").writes, 0U);
  EXPECT_EQ(summary->devices.at("airins").bytes_read, 1U);
  auto reader = CaptureReader::open(path);
  ASSERT_TRUE(reader.has_value());
  const auto reads = read_all(*reader);
  ASSERT_EQ(reads.size(), 2U);
  EXPECT_EQ(reads[0].direction, Direction::kLine);
  EXPECT_EQ(line_rate_of(reads[0].bytes), std::chrono::nanoseconds(10'851));
  EXPECT_EQ(reads[1].direction, Direction::kRead);
}

TEST(CaptureReader, AReadThatTheKernelStampedKeepsBothInstants) {
  const auto path = test::scratch_folder() / "capture.lcm";
  Capture capture(path);
  capture.header();
  const HostTime received = kT0 + std::chrono::microseconds(4'321);
  const auto stamp = received_bytes(received);
  Bytes bytes(stamp.begin(), stamp.end());
  bytes.insert(bytes.end(), {7, 8});
  // A read of more than one piece has its stamp in the first.
  capture.chunk(0, 0, 5, bytes, true, Direction::kStampedRead);
  capture.chunk(0, 1, 5, {9});
  capture.chunk(0, 2, 6, {1});
  capture.chunk(0, 3, 7, {1, 2, 3}, false, Direction::kStampedRead);  // too short to hold one
  capture.done();
  const auto summary = summarise_capture(path);
  ASSERT_TRUE(summary.has_value()) << summary.error().text();
  EXPECT_EQ(summary->devices.at("airins").reads, 2U);
  EXPECT_EQ(summary->devices.at("airins").bytes_read, 4U);
  auto reader = CaptureReader::open(path);
  ASSERT_TRUE(reader.has_value());
  const auto reads = read_all(*reader);
  ASSERT_EQ(reads.size(), 2U);
  EXPECT_EQ(reads[0].direction, Direction::kRead);
  EXPECT_EQ(reads[0].arrival, kT0 + std::chrono::milliseconds(5));
  EXPECT_EQ(reads[0].received, received);
  EXPECT_EQ(reads[0].bytes, (Bytes{7, 8, 9}));
  EXPECT_FALSE(reads[1].received);
}

TEST(RawTap, PutsTheStampOfALongReadBeforeItsFirstPiece) {
  auto ring = std::make_unique<RawRing>();
  RawTap tap(*ring);
  const HostTime received = kT0 + std::chrono::microseconds(1);
  const auto stamp = received_bytes(received);
  Bytes bytes(stamp.begin(), stamp.end());
  for (int i = 0; i < 2500; ++i) bytes.push_back(static_cast<std::uint8_t>(i));
  tap.record(0, Direction::kStampedRead, bytes, kT0 + std::chrono::milliseconds(1));
  Bytes together;
  int pieces = 0;
  while (const auto chunk = ring->front()) {
    EXPECT_EQ(chunk->info.direction, pieces == 0 ? Direction::kStampedRead : Direction::kRead);
    together.insert(together.end(), chunk->bytes.begin(), chunk->bytes.end());
    ++pieces;
    ring->pop();
  }
  EXPECT_EQ(pieces, 3);
  EXPECT_EQ(together, bytes);
}

TEST(CaptureReader, ARateThatNoLineHasIsNone) {
  for (const Duration per_byte : {Duration::zero(), -Duration(1), Duration(std::chrono::seconds(2))})
    EXPECT_EQ(line_rate_of(line_rate_bytes(per_byte)), std::nullopt) << per_byte.count();
  EXPECT_EQ(line_rate_of(Bytes{1, 2, 3}), std::nullopt);
}

TEST(CaptureReader, TakesRecordsWithImpossibleTimesAndCountsForDamage) {
  const auto path = test::scratch_folder() / "capture.lcm";
  Capture capture(path);
  capture.header();
  capture.chunk(0, 0, 1, {1});
  capture.chunk_stamped(0, std::numeric_limits<std::int64_t>::max() - 60'000'000'000);
  capture.chunk(0, -3, 2, {3});
  capture.chunk(0, std::numeric_limits<std::int64_t>::max(), 2, {4});
  capture.exception({ExceptionKind::kSkippedTicks, 0, -1, 7, -1});
  capture.exception({ExceptionKind::kSkippedTicks, 0, -1, 7, std::numeric_limits<std::int64_t>::max()});
  capture.exception({ExceptionKind::kLateSample, 0, 5, std::numeric_limits<std::int64_t>::min(), 1});
  capture.chunk(0, 1, 3, {5});
  capture.done();
  const auto summary = summarise_capture(path);
  ASSERT_TRUE(summary.has_value()) << summary.error().text();
  EXPECT_EQ(summary->devices.at("airins").reads, 2U);
  EXPECT_TRUE(summary->exceptions.empty());
  EXPECT_EQ(summary->other_messages, 6U) << "none is passed over in silence";
  auto reader = CaptureReader::open(path);
  ASSERT_TRUE(reader.has_value());
  const auto reads = read_all(*reader);
  ASSERT_EQ(reads.size(), 2U);
  EXPECT_EQ(reads[1].bytes, (Bytes{5}));
}

TEST(CaptureReader, OrdersByArrivalThenConfigurationThenHappening) {
  const auto path = test::scratch_folder() / "capture.lcm";
  Capture capture(path);
  capture.header();
  capture.chunk(1, 0, 5, {10});
  capture.chunk(1, 1, 7, {11});
  capture.chunk(1, 2, 7, {12});
  capture.chunk(0, 0, 5, {20});
  capture.chunk(0, 1, 6, {21});
  capture.chunk(0, 2, 7, {22});
  capture.done();
  auto reader = CaptureReader::open(path);
  ASSERT_TRUE(reader.has_value());
  std::vector<int> order;
  for (const RawRead& read : read_all(*reader)) order.push_back(read.bytes.at(0));
  EXPECT_EQ(order, (std::vector<int>{20, 10, 21, 22, 11, 12}));
  EXPECT_EQ(reader->disordered(), 0U);
}

TEST(CaptureReader, OneDeviceAloneIsWhatTheWholeHoldsOfIt) {
  const auto path = test::scratch_folder() / "capture.lcm";
  Capture capture(path);
  capture.header();
  for (std::int64_t i = 0; i < 20; ++i) {
    const auto byte = static_cast<std::uint8_t>(i);
    capture.chunk(static_cast<DeviceIndex>(i % 2), i / 2, 10 * i, {byte, 7});
  }
  capture.done();
  auto whole = CaptureReader::open(path);
  ASSERT_TRUE(whole.has_value());
  std::vector<RawRead> expected;
  for (RawRead& read : read_all(*whole)) {
    if (read.device == "mtx1") expected.push_back(std::move(read));
  }
  ASSERT_EQ(expected.size(), 10U);
  auto reader = CaptureReader::open(path, "mtx1");
  ASSERT_TRUE(reader.has_value());
  const auto reads = read_all(*reader);
  ASSERT_EQ(reads.size(), expected.size());
  for (std::size_t i = 0; i < reads.size(); ++i) {
    EXPECT_EQ(reads[i].device, "mtx1");
    EXPECT_EQ(reads[i].arrival, expected[i].arrival);
    EXPECT_EQ(reads[i].bytes, expected[i].bytes);
  }
  auto none = CaptureReader::open(path, "mtx");
  ASSERT_TRUE(none.has_value());
  EXPECT_TRUE(read_all(*none).empty());
}

/// A device that fell silent: its last record waits for a seal, or for what comes next, and what others sent since is not
/// kept with it.
TEST(CaptureReader, WhatOthersSentIsNotHeldForADeviceThatFellSilent) {
  const auto path = test::scratch_folder() / "capture.lcm";
  const RunHeader run = example_run();
  constexpr std::size_t kRecords = 12'000;
  constexpr std::size_t kRecordBytes = 4096;
  std::ofstream file(path, std::ios::binary);
  std::int64_t number = 0;
  const auto put = [&](const std::string& channel, const Bytes& data) {
    Bytes head;
    append_record_head(head, number++, 1, channel, data.size());
    for (const Bytes& bytes : {head, data})
      file.write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  };
  put("IMUSCOPE_RUN", encode(run, 0));
  const auto chunk = [&](DeviceIndex device, std::int64_t sequence, const Bytes& bytes) {
    const RawChunk read{
        {sequence, kT0 + std::chrono::milliseconds(sequence), device, Direction::kRead, false}, bytes};
    put("IMUSCOPE_RAW_X", encode(read, run.devices.at(device), {run.t0, run.t0_wall}));
  };
  chunk(1, 0, {1, 2, 3});
  const Bytes others(kRecordBytes, 7);
  for (std::size_t i = 0; i < kRecords; ++i) chunk(0, static_cast<std::int64_t>(i), others);
  chunk(1, 1, {4, 5, 6});
  file.close();

  auto reader = CaptureReader::open(path, "mtx1");
  ASSERT_TRUE(reader.has_value());
  const std::size_t before = test::resident_bytes();
  const auto reads = read_all(*reader);
  EXPECT_LT(test::resident_bytes(), before + kRecords * kRecordBytes / 4);
  ASSERT_EQ(reads.size(), 2U);
  EXPECT_EQ(reads[0].bytes, (Bytes{1, 2, 3}));
  EXPECT_EQ(reads[1].bytes, (Bytes{4, 5, 6}));
}

/// What the others sent is not even looked at, which may not change what is taken for damage.
TEST(CaptureReader, OneDeviceAloneIsWhatTheWholeHoldsOfItWhateverIsDamaged) {
  const auto folder = test::scratch_folder();
  const auto path = folder / "capture.lcm";
  Capture capture(path);
  capture.header();
  for (std::int64_t i = 0; i < 400; ++i) {
    const auto byte = static_cast<std::uint8_t>(i);
    capture.chunk(static_cast<DeviceIndex>(i % 2), i / 2, 10 * i, {byte, 7, 8}, i % 7 == 0);
    if (i % 50 == 3) capture.foreign({1, 2, 3});
  }
  capture.done();
  std::ifstream file(path, std::ios::binary);
  const std::string good((std::istreambuf_iterator<char>(file)), {});
  std::mt19937 random(11);
  std::size_t lost = 0;
  for (int i = 0; i < 300; ++i) {
    std::string bad = good;
    const auto place = std::uniform_int_distribution<std::size_t>(200, good.size() - 1)(random);
    const auto length = std::min<std::size_t>(1U << (i % 10U), good.size() - place);
    switch (i % 3) {
      case 0:
        bad[place] = static_cast<char>(bad[place] ^ (1 << (i % 8)));
        break;
      case 1:
        bad.erase(place, length);
        break;
      default:
        bad.insert(place, good.substr(good.size() - place > length ? place : 0, length));
    }
    const auto damaged = folder / "damaged.lcm";
    std::ofstream(damaged, std::ios::binary) << bad;
    auto whole = CaptureReader::open(damaged);
    auto alone = CaptureReader::open(damaged, "mtx1");
    ASSERT_TRUE(whole && alone);
    std::vector<RawRead> expected = read_all(*whole);
    std::erase_if(expected, [](const RawRead& read) { return read.device != "mtx1"; });
    const std::vector<RawRead> reads = read_all(*alone);
    ASSERT_EQ(reads.size(), expected.size()) << i;
    for (std::size_t k = 0; k < reads.size(); ++k) {
      EXPECT_EQ(reads[k].device, "mtx1");
      EXPECT_EQ(reads[k].arrival, expected[k].arrival) << i;
      EXPECT_EQ(reads[k].bytes, expected[k].bytes) << i;
    }
    lost += reads.size() < 172 ? 1U : 0U;
  }
  EXPECT_GT(lost, 50U) << "the damage is such";
}

TEST(CaptureReader, IsInOrderWhenOneRingIsRecordedSecondsAfterTheOther) {
  const auto path = test::scratch_folder() / "capture.lcm";
  Capture capture(path);
  capture.header();
  for (std::int64_t second = 0; second < 30; ++second) {
    for (int i = 0; i < 10; ++i) capture.chunk(1, second * 10 + i, second * 1000 + i * 100, {1});
    if (second < 3) continue;
    for (int i = 0; i < 10; ++i) capture.chunk(0, (second - 3) * 10 + i, (second - 3) * 1000 + i * 100, {0});
  }
  capture.done();
  auto reader = CaptureReader::open(path);
  ASSERT_TRUE(reader.has_value());
  HostTime last = HostTime::min();
  const auto reads = read_all(*reader);
  for (const RawRead& read : reads) {
    ASSERT_GE(read.arrival, last);
    last = read.arrival;
  }
  EXPECT_EQ(reads.size(), 570U);
  EXPECT_EQ(reader->disordered(), 0U);
}

TEST(CaptureReader, DisorderBeyondTheWindowIsCounted) {
  const auto path = test::scratch_folder() / "capture.lcm";
  Capture capture(path);
  capture.header();
  capture.chunk(0, 0, 1000, {1});
  capture.chunk(0, 1, 20'000, {2});
  capture.chunk(0, 2, 30'000, {3});
  capture.chunk(1, 0, 500, {4});
  capture.done();
  auto reader = CaptureReader::open(path);
  ASSERT_TRUE(reader.has_value());
  EXPECT_EQ(read_all(*reader).size(), 4U);
  EXPECT_EQ(reader->disordered(), 1U);
}

TEST(CaptureReader, JoinsReadsThatWereSplit) {
  const auto path = test::scratch_folder() / "capture.lcm";
  RawRing* ring = nullptr;
  const auto storage = std::make_unique<RawRing>();
  ring = storage.get();
  RawTap tap(*ring);
  std::mt19937 random(4);
  std::vector<Bytes> written;
  Capture capture(path);
  capture.header();
  std::int64_t at = 0;
  for (const std::size_t size : {1U, 1023U, 1024U, 1025U, 2048U, 2049U, 5000U}) {
    Bytes bytes(size);
    for (auto& byte : bytes) byte = static_cast<std::uint8_t>(random());
    tap.record(0, Direction::kRead, bytes, kT0 + std::chrono::milliseconds(at));
    while (const auto chunk = ring->front()) {
      EXPECT_LE(chunk->bytes.size(), kRawChunkBytes);
      capture.chunk(0, chunk->info.sequence, at, Bytes(chunk->bytes.begin(), chunk->bytes.end()),
                    chunk->info.continues);
      ring->pop();
    }
    written.push_back(bytes);
    at += 1;
  }
  capture.done();
  auto reader = CaptureReader::open(path);
  ASSERT_TRUE(reader.has_value());
  const auto reads = read_all(*reader);
  ASSERT_EQ(reads.size(), written.size());
  for (std::size_t i = 0; i < reads.size(); ++i) EXPECT_EQ(reads[i].bytes, written[i]) << i;
  const auto summary = summarise_capture(path);
  ASSERT_TRUE(summary.has_value());
  EXPECT_EQ(summary->devices.at("airins").reads, written.size()) << "pieces were counted as reads";
}

TEST(CaptureReader, LossesOfTheRecorderAreNamedWithDeviceTimeAndCount) {
  const auto path = test::scratch_folder() / "capture.lcm";
  Capture capture(path);
  capture.header();
  capture.chunk(0, 0, 1, {1});
  capture.chunk(1, 0, 2, {2});
  capture.chunk(0, 5, 3, {3});
  capture.chunk(1, 1, 4, {4});
  capture.done();
  const auto summary = summarise_capture(path);
  ASSERT_TRUE(summary.has_value());
  ASSERT_EQ(summary->losses.size(), 1U);
  EXPECT_EQ(summary->losses[0].device, "airins");
  EXPECT_EQ(summary->losses[0].after, kT0 + std::chrono::milliseconds(1));
  EXPECT_EQ(summary->losses[0].records, 4);
}

TEST(CaptureReader, AReadOfWhichAPieceWasLostComesInPieces) {
  const auto path = test::scratch_folder() / "capture.lcm";
  Capture capture(path);
  capture.header();
  capture.chunk(0, 0, 1, {1}, true);
  capture.chunk(0, 2, 1, {3});
  capture.chunk(0, 3, 2, {4}, true);  // the end of the file takes its rest
  capture.done();
  auto reader = CaptureReader::open(path);
  ASSERT_TRUE(reader.has_value());
  const auto reads = read_all(*reader);
  ASSERT_EQ(reads.size(), 3U);
  EXPECT_EQ(reads[0].bytes, (Bytes{1}));
  EXPECT_EQ(reads[1].bytes, (Bytes{3}));
  EXPECT_EQ(reads[2].bytes, (Bytes{4}));
}

TEST(CaptureReader, ExceptionsComeBackWithDeviceSampleAndTick) {
  const auto path = test::scratch_folder() / "capture.lcm";
  Capture capture(path);
  capture.header();
  capture.chunk(0, 0, 1, {1});
  capture.exception({ExceptionKind::kLateSample, 1, 77, 1234, 1});
  capture.exception({ExceptionKind::kRefusedSample, 0, 78, -1, 1});
  capture.exception({ExceptionKind::kSkippedTicks, 0, -1, 1300, 3});
  capture.done();
  const auto summary = summarise_capture(path);
  ASSERT_TRUE(summary.has_value());
  ASSERT_EQ(summary->exceptions.size(), 3U);
  EXPECT_EQ(summary->exceptions[0].exception.kind, ExceptionKind::kLateSample);
  EXPECT_EQ(summary->exceptions[0].device, "mtx1");
  EXPECT_EQ(summary->exceptions[0].exception.sample_sequence, 77);
  EXPECT_EQ(summary->exceptions[0].exception.tick, 1234);
  EXPECT_EQ(summary->exceptions[1].exception.kind, ExceptionKind::kRefusedSample);
  EXPECT_EQ(summary->exceptions[1].device, "airins");
  EXPECT_EQ(summary->exceptions[2].exception.kind, ExceptionKind::kSkippedTicks);
  EXPECT_EQ(summary->exceptions[2].device, "");
  EXPECT_EQ(summary->exceptions[2].exception.count, 3);
}

TEST(CaptureReader, PassesOverForeignAndDamagedMessages) {
  const auto path = test::scratch_folder() / "capture.lcm";
  Capture capture(path);
  capture.header();
  capture.foreign({});
  capture.foreign({1, 2, 3});
  capture.foreign(Bytes(100, 0xff));
  // The right fingerprint, then array lengths of any size.
  std::mt19937 random(6);
  Bytes fingerprint(8);
  for (unsigned i = 0; i < 8; ++i) {
    fingerprint[i] = static_cast<std::uint8_t>(static_cast<std::uint64_t>(raw_t::getHash()) >> (56 - 8 * i));
  }
  for (int i = 0; i < 300; ++i) {
    Bytes forged = fingerprint;
    const std::size_t size = random() % 80;
    while (forged.size() < 8 + size) forged.push_back(static_cast<std::uint8_t>(random()));
    capture.foreign(forged);
  }
  capture.chunk(0, 0, 1, {1});
  capture.done();
  const auto summary = summarise_capture(path);
  ASSERT_TRUE(summary.has_value()) << summary.error().text();
  EXPECT_EQ(summary->other_messages, 303U);
  EXPECT_EQ(summary->devices.size(), 1U);
}

TEST(CaptureReader, AnEventLogThatIsNoCaptureIsToldApart) {
  const auto folder = test::scratch_folder();
  Capture other(folder / "other.lcm");
  other.foreign({1, 2, 3, 4, 5, 6, 7, 8, 9});
  other.done();
  const auto no_bytes = summarise_capture(folder / "other.lcm");
  ASSERT_FALSE(no_bytes.has_value());
  EXPECT_THAT(no_bytes.error().text(),
              HasSubstr("is an LCM event log without device bytes (1 other messages)"));

  Capture headless(folder / "headless.lcm");
  headless.chunk(0, 0, 1, {1});
  headless.done();
  const auto no_header = summarise_capture(folder / "headless.lcm");
  ASSERT_TRUE(no_header.has_value()) << "its bytes are worth something with a configuration";
  EXPECT_FALSE(no_header->has_run);
  EXPECT_EQ(no_header->devices.size(), 1U);
}

TEST(CaptureReader, ModelsThatWereTakenOverAndWhatAPersonMarkedComeBackWithTheirTimes) {
  const auto path = test::scratch_folder() / "capture.lcm";
  Capture capture(path);
  const RunHeader run = example_run();
  constexpr std::int64_t kLatest = std::numeric_limits<std::int64_t>::max();
  const std::int64_t heard = to_ns(run.t0_wall) / 1000 + 2'500'000;
  event_t marked{};
  marked.text = "before the header";
  capture.foreign(encode_message(marked), heard);
  capture.header();
  capture.chunk(0, 0, 1, {1});
  marked.text = "regime gravel";
  capture.foreign(encode_message(marked), heard);
  // Damaged times: of the record, and of the message.
  capture.foreign(encode_message(marked), kLatest);
  capture.foreign(encode_message(marked), -kLatest);
  marked.utime = kLatest;
  capture.foreign(encode_message(marked), heard);
  applied_model_t applied{};
  applied.tick = 4711;
  capture.foreign(encode_message(applied));
  capture.done();
  const auto summary = summarise_capture(path);
  ASSERT_TRUE(summary) << summary.error().text();
  ASSERT_EQ(summary->events.size(), 1U) << "one has no run to be counted from, three no time";
  EXPECT_EQ(summary->events[0].text, "regime gravel");
  EXPECT_EQ(summary->events[0].time, kT0 + std::chrono::milliseconds(2500));
  ASSERT_EQ(summary->applied_models.size(), 1U);
  EXPECT_EQ(summary->applied_models[0].tick, 4711);
}

TEST(CaptureReader, ExceptionsThatNoRunCanHaveAreDamage) {
  const auto path = test::scratch_folder() / "capture.lcm";
  Capture capture(path);
  capture.header();
  capture.chunk(0, 0, 1, {1});
  exception_t good{};
  good.kind = exception_t::LATE_SAMPLE;
  good.device = "mtx1";
  good.count = 1;
  capture.foreign(encode_message(good));
  for (auto field : {&exception_t::sample_sequence, &exception_t::tick, &exception_t::count}) {
    for (const std::int64_t impossible : {std::int64_t{-2}, std::numeric_limits<std::int64_t>::max()}) {
      exception_t bad = good;
      bad.*field = impossible;
      capture.foreign(encode_message(bad));
    }
  }
  exception_t unknown = good;
  unknown.kind = 77;
  capture.foreign(encode_message(unknown));
  capture.done();
  const auto summary = summarise_capture(path);
  ASSERT_TRUE(summary);
  EXPECT_EQ(summary->exceptions.size(), 1U);
  EXPECT_EQ(summary->other_messages, 7U);
}

TEST(CaptureReader, MoreDevicesThanAConfigurationCanNameAreNotGathered) {
  const auto path = test::scratch_folder() / "capture.lcm";
  Capture capture(path);
  raw_t message{};
  message.direction = raw_t::READ;
  message.arrival_ns = to_ns(kT0);
  message.n_bytes = 1;
  message.bytes = {2};
  for (int i = 0; i < 300; ++i) {
    message.device = "device " + std::to_string(i);
    capture.foreign(encode_message(message));
  }
  capture.done();
  const auto summary = summarise_capture(path);
  ASSERT_TRUE(summary);
  EXPECT_EQ(summary->devices.size(), 255U);
  EXPECT_EQ(summary->other_messages, 45U);
}

TEST(CaptureReader, AReadThatNeverEndsIsGivenInPartsAndNothingOfItIsLost) {
  const auto path = test::scratch_folder() / "capture.lcm";
  constexpr std::size_t kChunks = 40'000;
  {
    Capture capture(path);
    capture.header();
    for (std::size_t i = 0; i < kChunks; ++i)
      capture.chunk(0, static_cast<std::int64_t>(i), 1, Bytes(kRawChunkBytes, 7), true);
    capture.done();
  }
  auto reader = CaptureReader::open(path);
  ASSERT_TRUE(reader);
  std::size_t bytes = 0;
  std::size_t longest = 0;
  while (const auto read = reader->next()) {
    bytes += read->bytes.size();
    longest = std::max(longest, read->bytes.size());
  }
  EXPECT_EQ(bytes, kChunks * kRawChunkBytes);
  EXPECT_LE(longest, std::size_t{16} << 20U);
}

TEST(CaptureReader, TellsHowFarItHasComeInEveryFile) {
  const auto path = test::scratch_folder() / "capture.lcm";
  for (int file = 0; file < 2; ++file) {
    Capture capture(capture_file(path, file));
    capture.header();
    for (int i = 0; i < 1000; ++i) capture.chunk(0, 1000 * file + i, i, Bytes(1000, 7));
    capture.done();
  }
  std::vector<double> shares;
  const auto summary = summarise_capture(path, [&](double share) { shares.push_back(share); });
  ASSERT_TRUE(summary);
  EXPECT_EQ(summary->devices.at("airins").reads, 2000U);
  EXPECT_TRUE(summary->losses.empty());
  ASSERT_GE(shares.size(), 6U);
  for (const double share : shares) {
    EXPECT_GE(share, 0.0);
    EXPECT_LE(share, 1.0);
  }
  EXPECT_EQ(shares.back(), 1.0);
}

/// A capture of five files, ten reads in each, a second apart, between messages that were published; returns the
/// first. The PC's clock is half a year ahead of GNSS, by which the messages have their times.
/// @param silent  so many files at the beginning hold no read
std::filesystem::path five_files(int silent = 0) {
  constexpr std::int64_t kHalfAYear_us = std::int64_t{180} * 86'400 * 1'000'000;
  const auto first = test::scratch_folder() / "drive.lcm";
  const RunHeader run = example_run();
  const RecordClock clock{run.t0, run.t0_wall};
  for (int file = 0; file < 5; ++file) {
    auto writer = std::move(*CaptureWriter::create(capture_file(first, file)));
    const auto publish = [&] {
      writer.append("IMUSCOPE_STATUS", clock.utime(kT0) - kHalfAYear_us, Bytes{1, 2, 3});
    };
    writer.append("IMUSCOPE_RUN", clock.utime(run.t0), encode(run, file));
    if (file % 2 == 1) publish();
    for (int i = 0; i < 10 && file >= silent; ++i) {
      const std::int64_t sequence = 10 * file + i;
      const HostTime arrival = kT0 + std::chrono::seconds(sequence);
      const Bytes bytes{static_cast<std::uint8_t>(sequence)};
      writer.append(
          "IMUSCOPE_RAW_X", clock.utime(arrival),
          encode(RawChunk{{sequence, arrival, 0, Direction::kRead, false}, bytes}, "airins", clock));
    }
    publish();
    EXPECT_TRUE(writer.close().has_value());
  }
  return first;
}

std::size_t reads_of(const std::filesystem::path& first) {
  auto reader = CaptureReader::open(first);
  EXPECT_TRUE(reader.has_value());
  return read_all(*reader).size();
}

TEST(CaptureReader, GoesOnBehindFilesThatAreMissingAndTellsWhatIsLost) {
  const auto first = five_files();
  ASSERT_EQ(reads_of(first), 50U);
  ASSERT_TRUE(summarise_capture(first)->breaks.empty());
  std::filesystem::remove(capture_file(first, 1));
  std::ofstream(capture_file(first, 2)) << "no capture at all";
  EXPECT_EQ(reads_of(first), 30U);
  const auto summary = summarise_capture(first);
  ASSERT_TRUE(summary.has_value());
  ASSERT_EQ(summary->breaks.size(), 1U);
  EXPECT_EQ(summary->breaks[0].first_missing, 1);
  EXPECT_EQ(summary->breaks[0].n_missing, 2);
  EXPECT_EQ(summary->breaks[0].behind, 3);
  EXPECT_NEAR(summary->breaks[0].seconds, 21.0, 1e-6);
  EXPECT_EQ(summary->losses.at(0).records, 20);
}

TEST(CaptureReader, GoesOnBehindTheDamagedBeginningOfAFileAndTellsIt) {
  const auto first = five_files();
  std::fstream(capture_file(first, 1), std::ios::in | std::ios::out | std::ios::binary).put('\0');
  EXPECT_EQ(reads_of(first), 50U) << "its header is damaged, its reads are not";
  const auto summary = summarise_capture(first);
  ASSERT_TRUE(summary.has_value());
  ASSERT_EQ(summary->breaks.size(), 1U);
  EXPECT_EQ(summary->breaks[0].n_missing, 0);
  EXPECT_EQ(summary->breaks[0].behind, 1);
  EXPECT_NEAR(summary->breaks[0].seconds, 1.0, 1e-6);
  EXPECT_GT(health_of(summary->files).bytes_skipped, 0U);
}

TEST(CaptureReader, TheDamagedBeginningOfTheLastFileIsToldToo) {
  const auto first = five_files();
  // Of the last one nothing that follows would show that it is missing.
  std::fstream(capture_file(first, 4), std::ios::in | std::ios::out | std::ios::binary).put('\0');
  EXPECT_EQ(reads_of(first), 50U);
  const auto summary = summarise_capture(first);
  ASSERT_TRUE(summary.has_value());
  ASSERT_EQ(summary->breaks.size(), 1U);
  EXPECT_EQ(summary->breaks[0].behind, 4);
  EXPECT_TRUE(summary->breaks[0].beginning_is_damaged);
}

TEST(CaptureReader, GoesOnBehindADamagedBeginningBeforeAnyDeviceHasSent) {
  const auto first = five_files(1);
  std::fstream(capture_file(first, 1), std::ios::in | std::ios::out | std::ios::binary).put('\0');
  EXPECT_EQ(reads_of(first), 40U);
  const auto summary = summarise_capture(first);
  ASSERT_TRUE(summary.has_value());
  ASSERT_EQ(summary->breaks.size(), 1U);
  EXPECT_EQ(summary->breaks[0].behind, 1);
  EXPECT_EQ(summary->breaks[0].seconds, 0.0) << "nothing came before";
}

TEST(CaptureReader, WhatIsWrongWithItsFilesIsSummed) {
  LogHealth first;
  first.bytes_skipped = 1;
  first.bytes_cut_off = 2;
  first.records_damaged = 3;
  first.records_missing = 4;
  first.records_unsealed = 5;
  LogHealth second;
  second.bytes_skipped = 10;
  second.bytes_cut_off = 20;
  second.records_damaged = 30;
  second.records_missing = 40;
  second.records_unsealed = 50;
  second.is_sealed = true;
  const LogHealth sum = health_of({{0, first}, {1, second}});
  EXPECT_EQ(sum.bytes_skipped, 11U);
  EXPECT_EQ(sum.bytes_cut_off, 22U);
  EXPECT_EQ(sum.records_damaged, 33U);
  EXPECT_EQ(sum.records_missing, 44U);
  EXPECT_EQ(sum.records_unsealed, 55U);
  EXPECT_TRUE(sum.is_sealed);
}

TEST(CaptureReader, LeavesFilesOfAnotherRunAloneWhereverTheyLie) {
  const auto first = five_files();
  RunHeader run = example_run();
  run.t0 += std::chrono::hours(1);
  for (const int file : {1, 3}) {
    std::filesystem::remove(capture_file(first, file));
    auto writer = std::move(*CaptureWriter::create(capture_file(first, file)));
    writer.append("IMUSCOPE_RUN", 1, encode(run, file));
    ASSERT_TRUE(writer.close().has_value());
  }
  std::filesystem::remove(capture_file(first, 4));
  EXPECT_EQ(reads_of(first), 20U);
  EXPECT_EQ(summarise_capture(first)->breaks.size(), 1U);
}

}  // namespace
}  // namespace imuscope
