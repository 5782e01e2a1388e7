/// Recording onto disks that are full, damaged, write-protected or taken away.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cerrno>
#include <chrono>
#include <cstring>
#include <fstream>
#include <functional>
#include <memory>
#include <thread>

#include "capture/capture_reader.h"
#include "capture/capture_writer.h"
#include "capture/recorder.h"
#include "rt/host_clock.h"
#include "tests/support/child_process.h"
#include "tests/support/file_size_limit.h"
#include "tests/support/refused_calls.h"
#include "tests/support/shared_data.h"

namespace imuscope {
namespace {

namespace fs = std::filesystem;
using test::Call;
using test::RefusedCalls;
using testing::AllOf;
using testing::HasSubstr;

Recorder::Options recording_to(const fs::path& path) {
  Recorder::Options options;
  options.path = path;
  options.run.name = "test";
  options.run.t0 = host_now();
  options.run.period = std::chrono::milliseconds(10);
  options.run.t0_wall = wall_clock_now();
  options.run.devices = {"airins"};
  return options;
}

/// Within five seconds.
bool comes_true(const std::function<bool()>& condition) {
  const HostTime give_up = host_now() + std::chrono::seconds(5);
  while (!condition()) {
    if (host_now() > give_up) return false;
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  return true;
}

std::uint64_t reads_in(const fs::path& capture) {
  const auto summary = summarise_capture(capture);
  return summary ? summary->devices.at("airins").reads : 0;
}

TEST(RefusingDisk, ASignalCostsNoRecord) {
  const auto path = test::scratch_folder() / "capture.lcm";
  auto writer = CaptureWriter::create(path);
  ASSERT_TRUE(writer);
  const std::vector<std::uint8_t> data(100, 7);
  writer->append("CHANNEL", 1, data);
  const RefusedCalls interrupted(Call::kWrite, EINTR, 3);
  ASSERT_TRUE(writer->flush());
  EXPECT_EQ(interrupted.left(), 0);
  EXPECT_EQ(writer->records_written(), 1U);
  EXPECT_EQ(fs::file_size(path), writer->bytes_written());
}

TEST(RefusingDisk, EveryReasonComesWithItsOwnRemedy) {
  const struct {
    int error;
    const char* remedy;
  } cases[] = {{ENOSPC, "free space on that disk"},
               {EDQUOT, "free space on that disk"},
               {EIO, "check the disk and its cable"},
               {ENODEV, "check the disk and its cable"},
               {EFBIG, "ulimit -f"},
               {EROFS, "may write"},
               {ELOOP, "check the path"}};
  for (const auto& [error, remedy] : cases) {
    const auto path = test::scratch_folder() / "capture.lcm";
    auto writer = CaptureWriter::create(path);
    ASSERT_TRUE(writer);
    const std::vector<std::uint8_t> data(100, 7);
    writer->append("CHANNEL", 1, data);
    const RefusedCalls refused(Call::kWrite, error);
    const auto flushed = writer->flush();
    ASSERT_FALSE(flushed) << std::strerror(error);
    EXPECT_THAT(flushed.error().text(), AllOf(HasSubstr(path.string()), HasSubstr("records were lost"),
                                              HasSubstr(std::strerror(error))));
    EXPECT_THAT(flushed.error().remedy, HasSubstr(remedy)) << std::strerror(error);
    EXPECT_EQ(writer->records_lost(), 1U);
    EXPECT_EQ(writer->pending_bytes(), 0U);
  }
}

TEST(RefusingDisk, ADiskThatTakesTheBytesAndLosesThemIsToldAtTheEnd) {
  const auto path = test::scratch_folder() / "capture.lcm";
  auto writer = CaptureWriter::create(path);
  ASSERT_TRUE(writer);
  const std::vector<std::uint8_t> data(100, 7);
  writer->append("CHANNEL", 1, data);
  const RefusedCalls lost(Call::kFdatasync, EIO);
  const auto closed = writer->close();
  ASSERT_FALSE(closed);
  EXPECT_THAT(closed.error().text(), AllOf(HasSubstr("cannot be completed"), HasSubstr(std::strerror(EIO))));
  EXPECT_THAT(closed.error().remedy, HasSubstr("cable"));
}

TEST(RefusingDisk, OfTwoRefusalsAtTheEndTheFirstIsTold) {
  const auto path = test::scratch_folder() / "capture.lcm";
  auto writer = CaptureWriter::create(path);
  ASSERT_TRUE(writer);
  writer->append("CHANNEL", 1, std::vector<std::uint8_t>(100, 7));
  const RefusedCalls full(Call::kWrite, ENOSPC);
  const RefusedCalls lost(Call::kFdatasync, EIO);
  const auto closed = writer->close();
  ASSERT_FALSE(closed);
  EXPECT_THAT(closed.error().text(), AllOf(HasSubstr("records were lost"), HasSubstr(std::strerror(ENOSPC))));
}

TEST(RefusingDisk, AWriterThatIsDroppedHasWrittenWhatItHeld) {
  const auto path = test::scratch_folder() / "capture.lcm";
  {
    auto writer = CaptureWriter::create(path);
    ASSERT_TRUE(writer);
    const std::vector<std::uint8_t> data(100, 7);
    writer->append("CHANNEL", 1, data);
  }
  auto log = EventLogReader::open(path);
  ASSERT_TRUE(log);
  LogEvent event;
  EXPECT_TRUE(log->next(event));
  EXPECT_EQ(event.data.size(), 100U);
}

TEST(RefusingDisk, AFolderThatMayNotBeWrittenAndADiskThatIsWriteProtectedSaySo) {
  const auto folder = test::scratch_folder();
  const auto says = [](const fs::path& where, const std::string& reason) {
    const auto writer = CaptureWriter::create(where / "capture.lcm");
    return !writer && writer.error().text().find(reason) != std::string::npos &&
           writer.error().remedy == "choose a folder that this user may write";
  };
  fs::permissions(folder, fs::perms::owner_read | fs::perms::owner_exec);
  const int forbidden = test::in_child([&] {
    if (!test::become_ordinary()) return test::kNotPermitted;
    return says(folder, std::strerror(EACCES)) && says(folder / "new", std::strerror(EACCES)) ? 0 : 1;
  });
  fs::permissions(folder, fs::perms::owner_all);
  EXPECT_EQ(forbidden, 0);
  const int read_only = test::in_child([&] {
    if (!test::mount_disk(folder, "1m") ||
        mount("none", folder.c_str(), nullptr, MS_REMOUNT | MS_RDONLY, nullptr) != 0)
      return test::kNotPermitted;
    return says(folder, std::strerror(EROFS)) ? 0 : 1;
  });
  if (read_only == test::kNotPermitted) GTEST_SKIP() << "mounting needs root";
  EXPECT_EQ(read_only, 0);
}

TEST(RefusingDisk, RecordingDoesNotBeginWhereNotEvenItsHeaderFitsAndLeavesNoEmptyFile) {
  const auto path = test::scratch_folder() / "capture.lcm";
  {
    const test::FileSizeLimit full(100);
    const auto refused = Recorder::start(recording_to(path), {}, {});
    ASSERT_FALSE(refused);
    EXPECT_THAT(refused.error().text(), HasSubstr(path.string()));
    EXPECT_FALSE(refused.error().remedy.empty());
  }
  EXPECT_FALSE(fs::exists(path)) << "it would stand in the way of the next attempt";
  EXPECT_TRUE(Recorder::start(recording_to(path), {}, {}));
}

/// A disk that fills up while it is recorded on, and has room again: exit codes name what was not as it
/// should.
int record_on_a_disk_that_fills_up(const fs::path& folder) {
  if (!test::mount_disk(folder, "1m")) return test::kNotPermitted;
  const auto ring = std::make_unique<RawRing>();
  auto recorder = Recorder::start(recording_to(folder / "capture.lcm"), {ring.get()}, {});
  if (!recorder) return 1;
  RawTap tap(*ring);
  const auto record = [&](int n) {
    for (int i = 0; i < n; ++i)
      tap.record(0, Direction::kRead, std::vector<std::uint8_t>(1000, 1), host_now());
  };
  record(10);
  if (!comes_true([&] { return (*recorder)->status().records == 11; })) return 2;
  std::ofstream(folder / "other").write(std::string(2 << 20, 'x').data(), 2 << 20);
  record(20);
  if (!comes_true([&] { return (*recorder)->status().problem.has_value(); })) return 3;
  const auto full = (*recorder)->status();
  if (full.problem->remedy.find("free space") == std::string::npos || full.records_lost == 0) return 4;
  fs::remove(folder / "other");
  record(30);
  if (!comes_true([&] { return !(*recorder)->status().problem && ring->counters().level == 0; })) return 5;
  if (!(*recorder)->stop()) return 6;
  const auto status = (*recorder)->status();
  if (status.records + status.records_lost != 61) return 7;
  const auto summary = summarise_capture(folder / "capture.lcm");
  if (!summary || health_of(summary->files).bytes_skipped > 0 || !summary->files.back().health.index)
    return 8;
  if (summary->devices.at("airins").reads != status.records - 1) return 9;
  std::int64_t missing = 0;
  for (const auto& loss : summary->losses) missing += loss.records;
  return missing == static_cast<std::int64_t>(status.records_lost) ? 0 : 10;
}

TEST(RefusingDisk, AFullDiskIsToldAndRecordingGoesOnWhereThereIsRoomAgain) {
  const auto folder = test::scratch_folder();
  const int outcome = test::in_child([&] { return record_on_a_disk_that_fills_up(folder); });
  if (outcome == test::kNotPermitted) GTEST_SKIP() << "mounting needs root";
  EXPECT_EQ(outcome, 0);
}

/// What four devices send at a hundred hertz: their reads wait a minute, and not much longer.
TEST(RefusingDisk, ADiskThatStandsStillForAMinuteCostsNothingAndWhatIsLostBeyondIsCounted) {
  constexpr std::size_t kDevices = 4;
  constexpr std::size_t kBytes = 110;
  constexpr double kReads_hz = 100.0;
  const auto path = test::scratch_folder() / "capture.lcm";
  const auto ring =
      std::make_unique<RawRing>(raw_ring_capacity(kDevices * kReads_hz * kBytes, kDevices * kReads_hz));
  auto options = recording_to(path);
  options.run.devices = {"airins", "mtx1", "mtx2", "mtx3"};
  auto recorder = Recorder::start(options, {ring.get()}, {});
  ASSERT_TRUE(recorder);
  RawTap tap(*ring);
  const HostTime begin = host_now();
  std::uint64_t ticks = 0;
  const auto tick = [&] {
    for (std::size_t i = 0; i < kDevices; ++i) {
      tap.record(static_cast<DeviceIndex>(i), Direction::kRead, std::vector<std::uint8_t>(kBytes, 1),
                 begin + std::chrono::milliseconds(10 * ticks));
    }
    ++ticks;
  };
  std::uint64_t kept = 0;
  {
    const test::StalledDisk stalled;
    tick();
    ASSERT_TRUE(comes_true([&] { return stalled.waiting() > 0; }));
    while (ticks < 60 * static_cast<std::uint64_t>(kReads_hz)) tick();
    ASSERT_EQ(ring->counters().refused, 0U);
    while (ring->counters().refused < 1000) tick();
    kept = kDevices * ticks - ring->counters().refused;
  }
  ASSERT_TRUE((*recorder)->stop());
  const auto summary = summarise_capture(path);
  ASSERT_TRUE(summary);
  std::uint64_t reads = 0;
  for (const auto& [name, device] : summary->devices) reads += device.reads;
  EXPECT_EQ(reads, kept);
  EXPECT_EQ((*recorder)->status().records, kept + 1);
  std::int64_t missing = 0;
  for (const auto& loss : summary->losses) missing += loss.records;
  // After the last read of a device nothing tells that more were to come.
  EXPECT_LE(missing, static_cast<std::int64_t>(ring->counters().refused));
}

TEST(RefusingDisk, WhatWasRecordedIsOnTheDiskWithoutBeingAskedFor) {
  const auto ring = std::make_unique<RawRing>();
  auto options = recording_to(test::scratch_folder() / "capture.lcm");
  options.sync_interval = std::chrono::milliseconds(20);
  auto recorder = Recorder::start(options, {ring.get()}, {});
  ASSERT_TRUE(recorder);
  const auto before = test::synced_bytes();
  RawTap(*ring).record(0, Direction::kRead, std::vector<std::uint8_t>(1000, 1), host_now());
  EXPECT_TRUE(comes_true([&] { return test::synced_bytes() > before + 1000; }));
}

TEST(RefusingDisk, AFolderThatIsRemovedWhileItIsRecordedIsToldAndRecordingBeginsAnewThere) {
  const auto folder = test::scratch_folder() / "run";
  const auto ring = std::make_unique<RawRing>();
  auto recorder = Recorder::start(recording_to(folder / "capture.lcm"), {ring.get()}, {});
  ASSERT_TRUE(recorder);
  RawTap tap(*ring);
  const auto record = [&] { tap.record(0, Direction::kRead, std::vector<std::uint8_t>(10, 1), host_now()); };
  for (int i = 0; i < 5; ++i) record();
  ASSERT_TRUE(comes_true([&] { return (*recorder)->status().records == 6; }));
  fs::remove_all(folder);
  std::optional<Error> told;
  ASSERT_TRUE(comes_true([&] {
    const auto problem = (*recorder)->status().problem;
    if (problem) told = problem;
    return told && fs::exists(folder / "capture.lcm");
  }));
  EXPECT_THAT(told->text(), AllOf(HasSubstr((folder / "capture.lcm").string()), HasSubstr("removed")));
  EXPECT_FALSE(told->remedy.empty());
  EXPECT_GE((*recorder)->status().records_lost, 6U) << "what was in the file is gone";
  for (int i = 0; i < 7; ++i) record();
  ASSERT_TRUE((*recorder)->stop());
  EXPECT_EQ(reads_in(folder / "capture.lcm"), 7U);
  const auto status = (*recorder)->status();
  EXPECT_EQ(status.bytes, fs::file_size(folder / "capture.lcm"));
  EXPECT_EQ(status.records, 8U);
}

TEST(RefusingDisk, AFileThatIsRemovedLastIsToldWhenRecordingEnds) {
  const auto path = test::scratch_folder() / "capture.lcm";
  auto writer = CaptureWriter::create(path);
  ASSERT_TRUE(writer);
  const std::vector<std::uint8_t> data(100, 7);
  writer->append("CHANNEL", 1, data);
  ASSERT_TRUE(writer->flush());
  fs::remove(path);
  const auto closed = writer->close();
  ASSERT_FALSE(closed);
  EXPECT_THAT(closed.error().text(), HasSubstr("removed"));
  EXPECT_EQ(writer->records_written(), 0U);
  EXPECT_EQ(writer->records_lost(), 1U);
}

TEST(RefusingDisk, AFileThatIsMovedIsStillRecordedTo) {
  const auto folder = test::scratch_folder();
  auto writer = CaptureWriter::create(folder / "capture.lcm");
  ASSERT_TRUE(writer);
  fs::rename(folder / "capture.lcm", folder / "kept.lcm");
  const std::vector<std::uint8_t> data(100, 7);
  writer->append("CHANNEL", 1, data);
  ASSERT_TRUE(writer->close());
  EXPECT_EQ(fs::file_size(folder / "kept.lcm"), writer->bytes_written());
}

}  // namespace
}  // namespace imuscope
