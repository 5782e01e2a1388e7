/// The thread that reads every line, on lines whose far ends are in the test's hand.

#include "service/lines/io_thread.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <functional>
#include <string>
#include <thread>
#include <vector>

#include "one_study.h"

namespace imuscope {
namespace {

using std::chrono::milliseconds;
using Bytes = std::vector<std::uint8_t>;

constexpr std::size_t kRawRingBytes = std::size_t{1} << 16U;
constexpr Duration kAge = milliseconds(5);  ///< of a sample when it is read

/// What a line, its session and its decoder are asked and told. What is no atomic is looked at once the thread has ended.
struct Device {
  Device() { EXPECT_EQ(pipe2(ends.data(), O_NONBLOCK), 0); }
  ~Device() {
    for (const int end : ends) close(end);
  }
  Device(const Device&) = delete;
  Device& operator=(const Device&) = delete;
  void send(const std::string& text) const {
    EXPECT_EQ(::write(ends[1], text.data(), text.size()), static_cast<ssize_t>(text.size()));
  }

  std::array<int, 2> ends{};
  // Of the line.
  int lines = 0;  ///< of it that are open
  std::atomic<bool> is_gone{false};
  LineHealth health;
  LineTiming timing;
  Duration received_before{};  ///< the read, as the kernel says; zero: it says nothing
  std::size_t read_most = 4096;
  std::size_t written_most = 100;
  std::string written;
  // Of the session.
  std::string heard;
  std::string to_say;
  std::atomic<SessionState> state{SessionState::kStreaming};
  std::atomic<bool> wants_other_baud{false};
  std::string problem;
  // Of the decoder.
  Duration per_byte{};
  std::string remark;
  double drift_ppm = 0.0;
  double sd_s = 0.0;
};

class TestLine final : public Transport {
 public:
  explicit TestLine(Device& device) : device_(device) { ++device_.lines; }
  ~TestLine() override { --device_.lines; }
  TestLine(const TestLine&) = delete;
  TestLine& operator=(const TestLine&) = delete;
  IoResult read(std::span<std::uint8_t> buffer) noexcept override {
    if (device_.is_gone) return {IoStatus::kGone};
    const std::size_t most = std::min(buffer.size(), device_.read_most);
    const ssize_t n = ::read(device_.ends[0], buffer.data(), most);
    if (n <= 0) return {};
    IoResult result{IoStatus::kDone, static_cast<std::size_t>(n), static_cast<std::size_t>(n) == most};
    if (device_.received_before != Duration::zero()) result.received = host_now() - device_.received_before;
    return result;
  }
  IoResult write(std::span<const std::uint8_t> bytes) noexcept override {
    if (device_.written_most == 0) return {};
    const std::size_t n = std::min(bytes.size(), device_.written_most);
    device_.written.append(bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(n));
    return {IoStatus::kDone, n};
  }
  [[nodiscard]] int fd() const noexcept override { return device_.ends[0]; }
  LineHealth health() noexcept override { return device_.health; }
  [[nodiscard]] LineTiming timing() const noexcept override { return device_.timing; }
  [[nodiscard]] std::string describe() const override { return "a pipe"; }

 private:
  Device& device_;
};

class TestSession final : public DeviceSession {
 public:
  explicit TestSession(Device& device) : device_(device) {}
  void on_bytes(std::span<const std::uint8_t> bytes, HostTime) noexcept override {
    device_.heard.append(bytes.begin(), bytes.end());
  }
  std::span<const std::uint8_t> poll(HostTime) noexcept override {
    if (has_said_) return {};
    has_said_ = true;
    return {reinterpret_cast<const std::uint8_t*>(device_.to_say.data()), device_.to_say.size()};
  }
  [[nodiscard]] SessionState state() const noexcept override { return device_.state; }
  [[nodiscard]] bool wants_other_baud() const noexcept override { return device_.wants_other_baud; }
  [[nodiscard]] std::string_view problem() const noexcept override { return device_.problem; }

 private:
  Device& device_;
  bool has_said_ = false;
};

/// Every byte is a sample: 'a' of an attitude, 's' of a clock's steering, all else of an IMU.
class TestDecoder final : public DeviceDecoder {
 public:
  TestDecoder(DeviceIndex index, Device& device) : index_(index), device_(device) {}
  void push(std::span<const std::uint8_t> bytes, Arrival arrival, SampleSink& sink) noexcept override {
    for (const std::uint8_t byte : bytes) {
      Sample sample{};
      sample.kind = byte == 'a'   ? SampleKind::kAttitude
                    : byte == 's' ? SampleKind::kSteering
                                  : SampleKind::kImu;
      sample.device = index_;
      sample.sequence = counters_.samples++;
      sample.arrival = arrival.read;
      sample.time = arrival.received - kAge;
      sink.on_sample(sample);
    }
    counters_.bytes += bytes.size();
  }
  [[nodiscard]] const DecoderCounters& counters() const noexcept override { return counters_; }
  void set_per_byte(Duration per_byte) noexcept override { device_.per_byte = per_byte; }
  [[nodiscard]] Duration per_byte() const noexcept override { return device_.per_byte; }
  [[nodiscard]] std::string_view remark() const noexcept override { return device_.remark; }
  [[nodiscard]] double clock_drift_ppm() const noexcept override { return device_.drift_ppm; }
  [[nodiscard]] double clock_sd_s() const noexcept override { return device_.sd_s; }

 private:
  DeviceIndex index_;
  Device& device_;
  DecoderCounters counters_;
};

class IoThreadTest : public testing::Test {
 protected:
  void start(const std::vector<std::size_t>& line_owners = {0, 1}) {
    std::vector<std::unique_ptr<DeviceDecoder>> decoders;
    for (std::size_t i = 0; i < devices_.size(); ++i)
      decoders.push_back(std::make_unique<TestDecoder>(static_cast<DeviceIndex>(i), devices_[i]));
    io_ = std::make_unique<IoThread>(core_, std::move(decoders), line_owners, kRawRingBytes);
    std::vector<Error> refusals;
    ASSERT_TRUE(io_->start({"io", Scheduling::kNormal, 0, {}}, host_now() + milliseconds(10), refusals));
  }
  void offer(DeviceIndex device, bool is_serial = false) {
    auto connection = std::make_unique<Connection>();
    connection->line = std::make_unique<TestLine>(devices_[device]);
    connection->session = std::make_unique<TestSession>(devices_[device]);
    connection->is_serial = is_serial;
    io_->offer(device, std::move(connection));
  }
  /// Until the published status of the device fulfils it.
  [[nodiscard]] bool comes_to(DeviceIndex device, const std::function<bool(const LineStatus&)>& wish) {
    const HostTime end = host_now() + std::chrono::seconds(20);
    while (host_now() < end) {
      if (wish(io_->status(device))) return true;
      std::this_thread::sleep_for(milliseconds(5));
    }
    return false;
  }
  [[nodiscard]] bool has_bytes(DeviceIndex device, std::uint64_t n) {
    return comes_to(device, [n](const LineStatus& status) { return status.counters.bytes >= n; });
  }
  std::vector<Sample> samples(DeviceIndex device) {
    std::vector<Sample> all;
    for (Sample sample; core_.ring(device).try_pop(sample);) all.push_back(sample);
    return all;
  }
  struct Chunk {
    RawChunkInfo info;
    Bytes bytes;
    [[nodiscard]] std::string text() const { return {bytes.begin(), bytes.end()}; }
  };
  std::vector<Chunk> chunks() {
    std::vector<Chunk> all;
    for (; const auto chunk = io_->raw_ring().front(); io_->raw_ring().pop())
      all.push_back({chunk->info, {chunk->bytes.begin(), chunk->bytes.end()}});
    return all;
  }
  /// What went one way, as it came, however it was cut.
  static std::string all_of(const std::vector<Chunk>& chunks, DeviceIndex device, Direction direction) {
    std::string text;
    for (const Chunk& chunk : chunks)
      if (chunk.info.device == device && chunk.info.direction == direction) text += chunk.text();
    return text;
  }

  std::array<Device, 2> devices_;
  Core core_{test::one_study(), 2};
  std::unique_ptr<IoThread> io_;
};

TEST_F(IoThreadTest, WhatIsReadGoesToDecoderSessionAndRecorder) {
  start();
  EXPECT_EQ(io_->status(1).line, LineState::kClosed);
  EXPECT_EQ(io_->statistics().ticks, 0U);
  devices_[1].health = {true, 7, {StampedBy::kKernel, 0.25, 0.125}};
  devices_[1].timing = {Duration::zero(), milliseconds(16)};
  devices_[1].remark = "its times stand still";
  devices_[1].drift_ppm = 12.5;
  devices_[1].sd_s = 1e-5;
  offer(1);
  const HostTime begin = host_now();
  devices_[1].send("iias");
  ASSERT_TRUE(has_bytes(1, 4));
  devices_[1].send("i");
  ASSERT_TRUE(has_bytes(1, 5));
  EXPECT_GT(io_->heartbeat().last(), begin);
  io_->stop();
  const LineStatus status = io_->status(1);
  EXPECT_EQ(status.line, LineState::kOpen);
  EXPECT_EQ(status.session, SessionState::kStreaming);
  EXPECT_EQ(status.counters.samples, 5U);
  EXPECT_EQ(status.epochs, 3U);
  EXPECT_EQ(status.refused, 0U);
  EXPECT_GE(status.reads, 2U);
  EXPECT_EQ(status.frames_dropped, 7U);
  EXPECT_EQ(status.clock_drift_ppm, 12.5);
  EXPECT_EQ(status.clock_sd_s, 1e-5);
  EXPECT_EQ(status.timing.held, milliseconds(16));
  EXPECT_EQ(status.stamps.by, StampedBy::kKernel);
  EXPECT_EQ(status.stamps.lead_s, 0.25);
  EXPECT_STREQ(status.problem.data(), "its times stand still");
  EXPECT_GT(status.last_arrival, begin);
  EXPECT_EQ(io_->status(0).line, LineState::kClosed);
  EXPECT_EQ(io_->status(0).reads, 0U);

  const auto samples_of_it = samples(1);
  ASSERT_EQ(samples_of_it.size(), 5U);
  EXPECT_EQ(samples_of_it[4].sequence, 4U);
  EXPECT_EQ(io_->newest_arrival(), samples_of_it[4].arrival);
  EXPECT_EQ(samples_of_it[4].arrival, status.last_arrival);
  EXPECT_TRUE(samples(0).empty());
  EXPECT_EQ(devices_[1].heard, "iiasi");
  const auto recorded = chunks();
  EXPECT_EQ(all_of(recorded, 1, Direction::kRead), "iiasi");
  EXPECT_EQ(recorded.size(), status.reads);
  EXPECT_EQ(recorded.back().info.arrival, status.last_arrival);
}

TEST_F(IoThreadTest, OfALineThatIsStampedTheStampIsRecordedAndDecoded) {
  devices_[1].received_before = milliseconds(3);
  start();
  offer(1);
  devices_[1].send("iii");
  ASSERT_TRUE(has_bytes(1, 3));
  io_->stop();
  const auto read = samples(1);
  ASSERT_EQ(read.size(), 3U);
  const Duration before = read[0].arrival - (read[0].time + kAge);
  EXPECT_GT(before, milliseconds(2));
  EXPECT_LT(before, std::chrono::seconds(10));
  const auto recorded = chunks();
  ASSERT_FALSE(recorded.empty());
  EXPECT_EQ(recorded[0].info.direction, Direction::kStampedRead);
  ASSERT_GT(recorded[0].bytes.size(), kReceivedBytes);
  EXPECT_EQ(recorded[0].text().substr(kReceivedBytes, 1), "i");
  EXPECT_EQ(nanoseconds_of(std::span(recorded[0].bytes).first<kReceivedBytes>()), to_ns(read[0].time + kAge));
}

TEST_F(IoThreadTest, AStampAfterTheReadIsNotBelieved) {
  devices_[1].received_before = -std::chrono::seconds(5);
  start();
  offer(1);
  devices_[1].send("i");
  ASSERT_TRUE(has_bytes(1, 1));
  io_->stop();
  const auto read = samples(1);
  ASSERT_EQ(read.size(), 1U);
  EXPECT_EQ(read[0].arrival, read[0].time + kAge);
  EXPECT_EQ(chunks()[0].info.direction, Direction::kRead);
}

TEST_F(IoThreadTest, WhatTheSessionSaysIsWrittenAndRecordedAsFarAsTheLineTakesIt) {
  devices_[0].to_say = "hello";
  devices_[0].written_most = 3;
  devices_[1].to_say = "hello";
  devices_[1].written_most = 0;
  start();
  offer(0);
  offer(1);
  for (const DeviceIndex device : {DeviceIndex{0}, DeviceIndex{1}}) {
    devices_[device].send("i");
    ASSERT_TRUE(has_bytes(device, 1));
  }
  io_->stop();
  EXPECT_EQ(devices_[0].written, "hel");
  const auto recorded = chunks();
  EXPECT_EQ(all_of(recorded, 0, Direction::kWrite), "hel");
  EXPECT_EQ(all_of(recorded, 1, Direction::kWrite), "");
}

// One read takes no more than it has room for, and the thread goes on at once.
TEST_F(IoThreadTest, ALineWithMoreThanARoomfulIsReadToItsEnd) {
  devices_[0].read_most = 10;
  start();
  offer(0);
  std::string all;
  for (int i = 0; i < 500; ++i) all += static_cast<char>('A' + i % 26);
  devices_[0].send(all);
  ASSERT_TRUE(has_bytes(0, all.size()));
  io_->stop();
  EXPECT_EQ(devices_[0].heard, all);
  EXPECT_EQ(all_of(chunks(), 0, Direction::kRead), all);
  EXPECT_GE(io_->status(0).reads, 50U);
}

// The events of a serial line are off while it rests; what it sends meanwhile is read at a beat.
TEST_F(IoThreadTest, ASerialLineIsReadThroughItsRests) {
  for (const auto state : {SessionState::kConfiguring, SessionState::kStreaming}) {
    devices_[0].state = state;
    devices_[0].heard.clear();
    start();
    offer(0, true);
    std::string all;
    for (int i = 0; i < 40; ++i) {
      const std::string part(1 + static_cast<std::size_t>(i) % 3, static_cast<char>('A' + i % 26));
      devices_[0].send(part);
      all += part;
      std::this_thread::sleep_for(milliseconds(i % 4 == 0 ? 12 : 1));
    }
    ASSERT_TRUE(has_bytes(0, all.size()));
    EXPECT_GT(io_->statistics().ticks, 0U);
    io_->stop();
    EXPECT_EQ(devices_[0].heard, all);
    EXPECT_EQ(all_of(chunks(), 0, Direction::kRead), all);
    EXPECT_EQ(samples(0).size(), all.size());
  }
}

TEST_F(IoThreadTest, ALineThatIsGoneIsGivenBackAndItsLossesAddUp) {
  devices_[0].health.frames_dropped = 5;
  start();
  EXPECT_EQ(io_->take_back(0), nullptr);
  offer(0);
  devices_[0].send("i");
  ASSERT_TRUE(has_bytes(0, 1));
  devices_[0].is_gone = true;
  devices_[0].send("x");
  ASSERT_TRUE(comes_to(0, [](const LineStatus& status) { return status.line == LineState::kClosed; }));
  EXPECT_EQ(io_->status(0).session, SessionState::kConnecting);
  const auto back = io_->take_back(0);
  ASSERT_NE(back, nullptr);
  EXPECT_EQ(back->line->fd(), devices_[0].ends[0]);
  EXPECT_EQ(io_->take_back(0), nullptr);
  devices_[0].is_gone = false;
  offer(0);
  ASSERT_TRUE(comes_to(0, [](const LineStatus& status) { return status.line == LineState::kOpen; }));
  devices_[0].send("i");
  ASSERT_TRUE(has_bytes(0, 3));
  io_->stop();
  EXPECT_EQ(io_->status(0).frames_dropped, 10U);
  EXPECT_EQ(devices_[0].heard, "ixi");
}

TEST_F(IoThreadTest, AnotherBaudRateIsTriedOnASerialLineAlone) {
  start();
  offer(0, true);
  offer(1, false);
  for (auto& device : devices_) device.wants_other_baud = true;
  std::unique_ptr<Connection> back;
  for (int i = 0; i < 2000 && back == nullptr; ++i) {
    back = io_->take_back(0);
    std::this_thread::sleep_for(milliseconds(5));
  }
  EXPECT_NE(back, nullptr);
  EXPECT_EQ(io_->take_back(1), nullptr);
  ASSERT_TRUE(comes_to(1, [](const LineStatus& status) { return status.line == LineState::kOpen; }));
  io_->stop();
}

TEST_F(IoThreadTest, ALineThatIsDownAndWhatItsSessionComplainsOfAreTold) {
  devices_[0].health.is_up = false;
  devices_[0].problem = std::string(400, 'p');
  devices_[0].remark = "not this";
  devices_[0].state = SessionState::kFailed;
  start();
  offer(0);
  ASSERT_TRUE(comes_to(0, [](const LineStatus& status) { return status.line == LineState::kDown; }));
  io_->stop();
  const LineStatus status = io_->status(0);
  EXPECT_EQ(status.session, SessionState::kFailed);
  EXPECT_EQ(std::string(status.problem.data()), std::string(status.problem.size() - 1, 'p'));
}

// Two devices behind one head: the bytes of the line are both decoders', and its state is both devices'.
TEST_F(IoThreadTest, BytesOfASharedLineAreDecodedForBothAndRecordedOnce) {
  devices_[0].timing = {std::chrono::microseconds(87), milliseconds(1)};
  devices_[0].health = {true, 3, {StampedBy::kInterface, 0.5, 0.25}};
  devices_[0].problem = "it is not set up";
  devices_[0].state = SessionState::kConfiguring;
  start({0, 0});
  offer(0);
  devices_[0].send("iii");
  ASSERT_TRUE(has_bytes(1, 3));
  io_->stop();
  EXPECT_EQ(samples(0).size(), 3U);
  const auto others = samples(1);
  ASSERT_EQ(others.size(), 3U);
  EXPECT_EQ(others[0].device, 1);
  const LineStatus status = io_->status(1);
  EXPECT_EQ(status.line, LineState::kOpen);
  EXPECT_EQ(status.session, SessionState::kConfiguring);
  EXPECT_STREQ(status.problem.data(), "it is not set up");
  EXPECT_EQ(status.timing.per_byte, std::chrono::microseconds(87));
  EXPECT_EQ(status.stamps.by, StampedBy::kInterface);
  EXPECT_EQ(status.reads, io_->status(0).reads);
  EXPECT_EQ(status.last_arrival, io_->status(0).last_arrival);
  EXPECT_EQ(status.frames_dropped, 0U) << "they are counted once";
  // The rate of the line is both decoders' and stands in the recording before what it dates.
  EXPECT_EQ(devices_[0].per_byte, std::chrono::microseconds(87));
  EXPECT_EQ(devices_[1].per_byte, std::chrono::microseconds(87));
  const auto recorded = chunks();
  ASSERT_GE(recorded.size(), 2U);
  EXPECT_EQ(recorded[0].info.direction, Direction::kLine);
  EXPECT_EQ(line_rate_of(recorded[0].bytes), std::chrono::microseconds(87));
  EXPECT_EQ(all_of(recorded, 0, Direction::kRead), "iii");
  for (const Chunk& chunk : recorded) EXPECT_EQ(chunk.info.device, 0);
}

TEST_F(IoThreadTest, ARateThatTheDecoderKnowsIsNotRecorded) {
  devices_[0].timing.per_byte = devices_[0].per_byte = std::chrono::microseconds(87);
  start();
  offer(0);
  devices_[0].send("i");
  ASSERT_TRUE(has_bytes(0, 1));
  io_->stop();
  for (const Chunk& chunk : chunks()) EXPECT_EQ(chunk.info.direction, Direction::kRead);
}

TEST_F(IoThreadTest, SamplesThatTheCoreHasNoRoomForAreCountedAndNoted) {
  start();
  offer(1);
  const std::size_t room = core_.ring(1).capacity();
  std::size_t sent = 0;
  while (sent < room + 3) {
    const std::size_t n = std::min<std::size_t>(2000, room + 3 - sent);
    devices_[1].send(std::string(n, 'i'));
    sent += n;
    ASSERT_TRUE(has_bytes(1, sent));
    while (io_->raw_ring().front()) io_->raw_ring().pop();
  }
  io_->stop();
  EXPECT_EQ(io_->status(1).refused, 3U);
  EXPECT_EQ(io_->status(1).epochs, room + 3);
  EXPECT_EQ(samples(1).size(), room);
  RunException noted{};
  for (std::int64_t i = 0; i < 3; ++i) {
    ASSERT_TRUE(io_->exceptions().try_pop(noted));
    EXPECT_EQ(noted.kind, ExceptionKind::kRefusedSample);
    EXPECT_EQ(noted.device, 1);
    EXPECT_EQ(noted.sample_sequence, static_cast<std::int64_t>(room) + i);
    EXPECT_EQ(noted.tick, -1);
    EXPECT_EQ(noted.count, 1);
  }
  EXPECT_FALSE(io_->exceptions().try_pop(noted));
}

TEST_F(IoThreadTest, AnOfferThatNobodyTakesOverGoesWithTheNextOneOrTheThread) {
  start();
  io_->stop();
  offer(0);
  offer(0);
  EXPECT_EQ(devices_[0].lines, 1);
  EXPECT_EQ(io_->take_back(0), nullptr);
  EXPECT_EQ(io_->newest_arrival(), HostTime::min());
  io_.reset();
  EXPECT_EQ(devices_[0].lines, 0);
}

}  // namespace
}  // namespace imuscope
