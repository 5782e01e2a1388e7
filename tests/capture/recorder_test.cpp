#include "capture/recorder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <fstream>
#include <imuscope/event_t.hpp>
#include <lcm/lcm-cpp.hpp>
#include <map>
#include <memory>
#include <thread>

#include "capture/capture_reader.h"
#include "publish/message_codec.h"
#include "rt/host_clock.h"
#include "tests/support/shared_data.h"

namespace imuscope {
namespace {

using std::chrono::milliseconds;
using testing::HasSubstr;
using Bytes = std::vector<std::uint8_t>;

Recorder::Options options_for(const std::filesystem::path& path) {
  Recorder::Options options;
  options.path = path;
  options.run.name = "test";
  options.run.t0 = host_now();
  options.run.period = milliseconds(10);
  options.run.t0_wall = wall_clock_now();
  options.run.configuration = "# none";
  options.run.devices = {"airins", "mtx1", "gnss"};
  return options;
}

/// Bytes by which a read can be recognised: its number, then a pattern.
Bytes numbered_bytes(std::uint32_t number, std::size_t size) {
  Bytes bytes(size);
  for (std::size_t i = 0; i < size; ++i)
    bytes[i] = static_cast<std::uint8_t>((number >> (8 * (i % 4))) + i / 4);
  return bytes;
}

TEST(Recorder, KeepsEveryReadOfTwoIoThreadsInOrderWithItsArrival) {
  constexpr std::uint32_t kReads = 3000;
  const auto path = test::scratch_folder() / "capture.lcm";
  const auto ring_a = std::make_unique<RawRing>();
  const auto ring_b = std::make_unique<RawRing>();
  const auto exceptions = std::make_unique<ExceptionRing>();
  auto recorder = Recorder::start(options_for(path), {ring_a.get(), ring_b.get()}, {exceptions.get()});
  ASSERT_TRUE(recorder.has_value()) << recorder.error().text();

  std::map<std::string, std::vector<HostTime>> arrivals;  // by device; each written by one thread
  arrivals["airins"].reserve(kReads);
  arrivals["mtx1"].reserve(kReads);
  const auto io = [&](RawRing& ring, DeviceIndex device, std::vector<HostTime>& times) {
    RawTap tap(ring);
    for (std::uint32_t i = 0; i < kReads; ++i) {
      const HostTime now = host_now();
      times.push_back(now);
      tap.record(device, i % 10 == 0 ? Direction::kWrite : Direction::kRead, numbered_bytes(i, 1 + i % 1500),
                 now);
      std::this_thread::sleep_for(std::chrono::microseconds(100));
    }
  };
  std::thread a([&] { io(*ring_a, 0, arrivals.at("airins")); });
  std::thread b([&] { io(*ring_b, 1, arrivals.at("mtx1")); });
  ASSERT_TRUE(exceptions->try_push({ExceptionKind::kSkippedTicks, 0, -1, 5, 2}));
  a.join();
  b.join();
  const auto stopped = (*recorder)->stop();
  ASSERT_TRUE(stopped.has_value()) << stopped.error().text();
  ASSERT_EQ(ring_a->counters().refused + ring_b->counters().refused, 0U)
      << "the machine is too slow for this test";

  const auto summary = summarise_capture(path);
  ASSERT_TRUE(summary.has_value());
  EXPECT_TRUE(summary->losses.empty());
  EXPECT_EQ(summary->exceptions.size(), 1U);
  auto reader = CaptureReader::open(path);
  ASSERT_TRUE(reader.has_value());
  std::map<std::string, std::uint32_t> next;
  HostTime last = HostTime::min();
  while (const auto read = reader->next()) {
    const std::uint32_t i = next[read->device]++;
    ASSERT_EQ(read->bytes, numbered_bytes(i, 1 + i % 1500)) << read->device << " " << i;
    ASSERT_EQ(read->arrival, arrivals.at(read->device).at(i));
    ASSERT_EQ(read->direction, i % 10 == 0 ? Direction::kWrite : Direction::kRead);
    ASSERT_GE(read->arrival, last);
    last = read->arrival;
  }
  EXPECT_EQ(next["airins"], kReads);
  EXPECT_EQ(next["mtx1"], kReads);
  EXPECT_EQ(reader->disordered(), 0U);
  const RecorderStatus status = (*recorder)->status();
  EXPECT_EQ(status.bytes, std::filesystem::file_size(path));
  EXPECT_EQ(status.records_lost, 0U);
  EXPECT_FALSE(status.problem.has_value());
}

TEST(Recorder, WritesALogThatLcmToolsRead) {
  const auto path = test::scratch_folder() / "capture.lcm";
  const auto ring = std::make_unique<RawRing>();
  auto recorder = Recorder::start(options_for(path), {ring.get()}, {});
  ASSERT_TRUE(recorder.has_value());
  RawTap tap(*ring);
  tap.record(1, Direction::kRead, numbered_bytes(1, 10), host_now());
  tap.record(2, Direction::kRead, numbered_bytes(2, 10), host_now());
  ASSERT_TRUE((*recorder)->stop().has_value());

  lcm::LogFile log(path.string(), "r");
  std::vector<std::string> channels;
  const std::int64_t now_us = to_ns(wall_clock_now()) / 1000;
  constexpr std::int64_t kMinuteUs = 60'000'000;
  while (const lcm::LogEvent* event = log.readNextEvent()) {
    channels.push_back(event->channel);
    EXPECT_NEAR(static_cast<double>(event->timestamp), static_cast<double>(now_us), kMinuteUs);
  }
  EXPECT_EQ(channels, (std::vector<std::string>{"IMUSCOPE_RUN", "IMUSCOPE_SEAL", "IMUSCOPE_RAW_MTX1",
                                                "IMUSCOPE_RAW_GNSS", "IMUSCOPE_SEAL", "IMUSCOPE_INDEX"}));
}

/// The child feeds numbered reads at 1 kHz and reports each; the parent kills it at a moment of its own
/// choice.
TEST(Recorder, AKillLosesLessThanASecond) {
  for (const auto lifetime : {milliseconds(1), milliseconds(900), milliseconds(1300)}) {
    const auto path = test::scratch_folder() / "capture.lcm";
    int report[2];
    ASSERT_EQ(pipe(report), 0);
    const pid_t child = fork();
    if (child == 0) {
      const auto ring = std::make_unique<RawRing>();
      auto recorder = Recorder::start(options_for(path), {ring.get()}, {});
      if (!recorder) _exit(1);
      RawTap tap(*ring);
      for (;;) {
        const std::int64_t ns = to_ns(host_now());
        tap.record(0, Direction::kRead, numbered_bytes(0, 30), host_time_from_ns(ns));
        if (::write(report[1], &ns, sizeof ns) != sizeof ns) _exit(1);
        std::this_thread::sleep_for(milliseconds(1));
      }
    }
    close(report[1]);
    std::int64_t last_ns = 0;
    ASSERT_EQ(read(report[0], &last_ns, sizeof last_ns), static_cast<ssize_t>(sizeof last_ns));
    std::this_thread::sleep_for(lifetime);
    kill(child, SIGKILL);
    waitpid(child, nullptr, 0);
    while (read(report[0], &last_ns, sizeof last_ns) == static_cast<ssize_t>(sizeof last_ns)) {
    }
    close(report[0]);

    auto reader = CaptureReader::open(path);
    ASSERT_TRUE(reader.has_value()) << reader.error().text();
    HostTime recorded = HostTime::min();
    while (const auto record = reader->next()) recorded = record->arrival;
    if (lifetime < milliseconds(500)) continue;  // nothing need have been flushed but the header
    EXPECT_LT(last_ns - to_ns(recorded), 1'000'000'000) << "killed after " << lifetime.count() << " ms";
  }
}

TEST(Recorder, AFullRingCostsRecordsAndTheCaptureSaysWhere) {
  const auto path = test::scratch_folder() / "capture.lcm";
  const auto ring = std::make_unique<RawRing>();
  RawTap tap(*ring);
  const HostTime now = host_now();
  // The recorder stands still, as behind a dead disk: the ring fills, and what follows is refused.
  // Its length, what is said of it, and its four bytes, each at a multiple of eight.
  constexpr std::size_t kPlace = 8 + sizeof(RawChunkInfo) + 8;
  const auto fits = static_cast<std::uint32_t>(ring->capacity() / kPlace);
  for (std::uint32_t i = 0; i < fits + 10; ++i) {
    tap.record(1, Direction::kRead, numbered_bytes(i, 4), now + milliseconds(i));
  }
  EXPECT_EQ(ring->counters().refused, 10U);
  auto recorder = Recorder::start(options_for(path), {ring.get()}, {});
  ASSERT_TRUE(recorder.has_value());
  while (ring->counters().level > 0) std::this_thread::sleep_for(milliseconds(5));
  tap.record(1, Direction::kRead, numbered_bytes(9999, 4), now + milliseconds(3000));
  ASSERT_TRUE((*recorder)->stop().has_value());

  const auto summary = summarise_capture(path);
  ASSERT_TRUE(summary.has_value());
  EXPECT_EQ(summary->devices.at("mtx1").reads, fits + 1);
  ASSERT_EQ(summary->losses.size(), 1U);
  EXPECT_EQ(summary->losses[0].records, 10);
  EXPECT_EQ(summary->losses[0].after, now + milliseconds(fits - 1));
}

TEST(Recorder, WhatIsHeardKeepsItsInstantThoughTheWallClockSteps) {
  const auto path = test::scratch_folder() / "capture.lcm";
  const auto ring = std::make_unique<RawRing>();
  Recorder::Options options = options_for(path);
  // Since the run began the wall clock was put back by an hour: at t0 it showed that much more.
  options.run.t0_wall += std::chrono::hours(1);
  const HostTime heard = options.run.t0 + milliseconds(9000);
  auto recorder = Recorder::start(options, {ring.get()}, {});
  ASSERT_TRUE(recorder.has_value());
  event_t event;
  event.utime = 1;
  event.source = "test";
  event.text = "regime gravel";
  RawTap(*ring).record(0, Direction::kRead, Bytes{9}, host_now());
  (*recorder)->record_heard("IMUSCOPE_EVENT", heard, encode_message(event));
  ASSERT_TRUE((*recorder)->stop().has_value());
  const auto summary = summarise_capture(path);
  ASSERT_TRUE(summary.has_value());
  ASSERT_EQ(summary->events.size(), 1U);
  EXPECT_LE(std::abs(to_seconds(summary->events[0].time - heard)), 1e-6);
}

TEST(Recorder, KeepsPublishedMessagesBesideTheBytesAndReplayPassesOverThem) {
  const auto path = test::scratch_folder() / "capture.lcm";
  const auto ring = std::make_unique<RawRing>();
  auto recorder = Recorder::start(options_for(path), {ring.get()}, {});
  ASSERT_TRUE(recorder.has_value());
  (*recorder)->record_message("IMUSCOPE_STATUS", 1234, Bytes{1, 2, 3});
  RawTap(*ring).record(0, Direction::kRead, Bytes{9}, host_now());
  (*recorder)->record_message("IMUSCOPE_STATUS", 1235, Bytes(std::size_t{32} << 20U));
  EXPECT_EQ((*recorder)->status().messages_lost, 1U) << "memory for waiting messages must be bounded";
  ASSERT_TRUE((*recorder)->stop().has_value());
  lcm::LogFile log(path.string(), "r");
  std::vector<std::int64_t> utimes;
  while (const lcm::LogEvent* event = log.readNextEvent()) {
    if (event->channel == "IMUSCOPE_STATUS") utimes.push_back(event->timestamp);
  }
  EXPECT_EQ(utimes, (std::vector<std::int64_t>{1234}));
  const auto summary = summarise_capture(path);
  ASSERT_TRUE(summary.has_value());
  EXPECT_EQ(summary->other_messages, 1U);
}

TEST(Recorder, WaitingMessagesMayTakeSixteenMebibytesAndAgainOnceTheyAreWritten) {
  constexpr std::size_t kMost = std::size_t{16} << 20U;
  const auto ring = std::make_unique<RawRing>();
  auto recorder = Recorder::start(options_for(test::scratch_folder() / "capture.lcm"), {ring.get()}, {});
  ASSERT_TRUE(recorder.has_value());
  const std::uint64_t before = (*recorder)->status().records;
  const HostTime give_up = host_now() + std::chrono::seconds(30);
  for (std::uint64_t n = 1; n <= 2; ++n) {
    (*recorder)->record_message("IMUSCOPE_STATUS", 1, Bytes(kMost));
    EXPECT_EQ((*recorder)->status().messages_lost, 0U);
    while ((*recorder)->status().records < before + n && host_now() < give_up)
      std::this_thread::sleep_for(milliseconds(5));
  }
  (*recorder)->record_message("IMUSCOPE_STATUS", 1, Bytes(kMost + 1));
  EXPECT_EQ((*recorder)->status().messages_lost, 1U);
  ASSERT_TRUE((*recorder)->stop().has_value());
}

/// Records 1500 numbered reads, in 1.5 s at least, with limits that split them into three files or more.
void expect_files_that_join(std::uint64_t max_file_bytes, Duration max_file_age) {
  const auto folder = test::scratch_folder();
  const auto ring = std::make_unique<RawRing>();
  auto options = options_for(folder / "capture.lcm");
  options.max_file_bytes = max_file_bytes;
  options.max_file_age = max_file_age;
  auto recorder = Recorder::start(options, {ring.get()}, {});
  ASSERT_TRUE(recorder.has_value()) << recorder.error().text();
  RawTap tap(*ring);
  constexpr std::uint32_t kReads = 1500;
  for (std::uint32_t i = 0; i < kReads; ++i) {
    tap.record(0, Direction::kRead, numbered_bytes(i, 40), host_now());
    std::this_thread::sleep_for(milliseconds(1));
  }
  ASSERT_TRUE((*recorder)->stop().has_value());
  ASSERT_TRUE(std::filesystem::exists(folder / "capture_002.lcm")) << "the capture was not split";

  auto reader = CaptureReader::open(folder / "capture.lcm");
  ASSERT_TRUE(reader.has_value());
  std::uint32_t next = 0;
  while (const auto read = reader->next()) {
    ASSERT_EQ(read->bytes, numbered_bytes(next, 40));
    next += 1;
  }
  EXPECT_EQ(next, kReads);
  const auto summary = summarise_capture(folder / "capture.lcm");
  ASSERT_TRUE(summary.has_value());
  EXPECT_EQ(summary->devices.at("airins").reads, kReads);
  EXPECT_TRUE(summary->losses.empty());
  std::uintmax_t bytes = 0;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) bytes += entry.file_size();
  const RecorderStatus status = (*recorder)->status();
  EXPECT_EQ(status.bytes, bytes);
  EXPECT_EQ(status.path, capture_file(folder / "capture.lcm", static_cast<int>(summary->files.size()) - 1))
      << "the file that is written now";
  EXPECT_EQ(status.records, kReads + summary->files.size()) << "each file begins with the run's header";
  EXPECT_EQ(status.records_lost, 0U);
}

TEST(Recorder, AFullFileGoesOnInAnotherAndTheReaderJoinsThem) {
  expect_files_that_join(20'000, Duration::zero());
}

TEST(Recorder, AnOldFileGoesOnInAnotherAndTheReaderJoinsThem) {
  expect_files_that_join(0, milliseconds(400));
}

TEST(Recorder, WithoutLimitsOneFileHoldsAll) {
  const auto folder = test::scratch_folder();
  const auto ring = std::make_unique<RawRing>();
  auto options = options_for(folder / "capture.lcm");
  options.max_file_bytes = 0;
  options.max_file_age = Duration::zero();
  auto recorder = Recorder::start(options, {ring.get()}, {});
  ASSERT_TRUE(recorder.has_value()) << recorder.error().text();
  RawTap tap(*ring);
  for (std::uint32_t i = 0; i < 120; ++i) {  // 1.2 s at least: flushed several times
    tap.record(0, Direction::kRead, numbered_bytes(i, 40), host_now());
    std::this_thread::sleep_for(milliseconds(10));
  }
  ASSERT_TRUE((*recorder)->stop().has_value());
  EXPECT_FALSE(std::filesystem::exists(folder / "capture_001.lcm"));
  EXPECT_EQ(summarise_capture(folder / "capture.lcm")->devices.at("airins").reads, 120U);
}

TEST(Recorder, AFileInTheWayOfTheNextOneIsToldAndThePresentOneGoesOn) {
  const auto folder = test::scratch_folder();
  std::ofstream(folder / "capture_001.lcm") << "from another run";
  const auto ring = std::make_unique<RawRing>();
  auto options = options_for(folder / "capture.lcm");
  options.max_file_age = milliseconds(1);
  auto recorder = Recorder::start(options, {ring.get()}, {});
  ASSERT_TRUE(recorder.has_value());
  RawTap tap(*ring);
  tap.record(0, Direction::kRead, Bytes{1}, host_now());
  const HostTime give_up = host_now() + std::chrono::seconds(5);
  while (!(*recorder)->status().problem && host_now() < give_up)
    std::this_thread::sleep_for(milliseconds(10));
  const auto problem = (*recorder)->status().problem;
  ASSERT_TRUE(problem.has_value());
  EXPECT_THAT(problem->text(), HasSubstr("capture_001.lcm"));
  tap.record(0, Direction::kRead, Bytes{2}, host_now());
  ASSERT_TRUE((*recorder)->stop().has_value());
  const auto summary = summarise_capture(folder / "capture.lcm");
  ASSERT_TRUE(summary.has_value());
  EXPECT_EQ(summary->devices.at("airins").reads, 2U);
  EXPECT_EQ(health_of(summary->files).bytes_skipped, 0U)
      << "the other run's file was taken for a part of this one";
}

TEST(Recorder, DoesNotStartWhereNothingCanBeWritten) {
  const auto folder = test::scratch_folder();
  std::ofstream(folder / "taken.lcm") << "x";
  const auto recorder = Recorder::start(options_for(folder / "taken.lcm"), {}, {});
  ASSERT_FALSE(recorder.has_value());
  EXPECT_THAT(recorder.error().text(), HasSubstr("taken.lcm"));
}

}  // namespace
}  // namespace imuscope
