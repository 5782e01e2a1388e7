#include "drivers/xsens_mt/scanner.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numeric>
#include <random>

#include "drivers/xsens_mt/messages.h"
#include "tests/drivers/support/streams.h"
#include "tests/support/shared_data.h"

namespace imuscope::xsens {
namespace {

using test::Bytes;

struct Found {
  std::uint64_t offset;
  Bytes bytes;
  bool nested;
};

std::vector<Found> scan(std::span<const Bytes> reads, ScanCounters* counters = nullptr) {
  Scanner scanner;
  std::vector<Found> found;
  Frame frame;
  Bytes all;
  for (const Bytes& read : reads) all.insert(all.end(), read.begin(), read.end());
  const auto take = [&](bool at_end) {
    while (scanner.next(frame, at_end)) {
      const auto begin = all.begin() + static_cast<std::ptrdiff_t>(frame.offset);
      found.push_back(
          {frame.offset, Bytes(begin, begin + static_cast<std::ptrdiff_t>(frame.size)), frame.nested});
    }
  };
  for (const Bytes& read : reads) {
    std::span<const std::uint8_t> rest = read;
    while (!rest.empty()) {
      rest = rest.subspan(scanner.append(rest, HostTime{}));
      take(false);
    }
  }
  take(true);
  if (counters != nullptr) *counters = scanner.counters();
  return found;
}

Bytes frame_of(std::uint8_t mid, const Bytes& data) {
  const OutgoingFrame frame(kMasterBid, mid, data);
  return {frame.bytes().begin(), frame.bytes().end()};
}

// Random garbage holds, every now and then, a whole false frame with a right checksum that swallows the start
// of a good one and ends in the middle of it. The good one must still be found.
TEST(MtScanner, FindsTheFrameThatAFalseFrameWithARightChecksumSwallowed) {
  const Bytes good = frame_of(mid::kMtData, Bytes(20, 0x11));
  const Bytes next = frame_of(mid::kMtData, Bytes(20, 0x22));
  for (std::size_t swallowed = 1; swallowed < good.size(); ++swallowed) {
    // FA FF 32 LEN x [swallowed bytes of the good frame up to its checksum byte]; x makes the sum right.
    Bytes bytes{kPreamble, kMasterBid, mid::kMtData, static_cast<std::uint8_t>(swallowed), 0};
    bytes.insert(bytes.end(), good.begin(), good.begin() + static_cast<std::ptrdiff_t>(swallowed));
    const auto sum = std::accumulate(bytes.begin() + 1, bytes.end(), 0U);
    bytes[4] = static_cast<std::uint8_t>(0U - sum);
    bytes.insert(bytes.end(), good.begin() + static_cast<std::ptrdiff_t>(swallowed), good.end());
    bytes.insert(bytes.end(), next.begin(), next.end());
    const Bytes reads[] = {bytes};
    const auto found = scan(reads);
    ASSERT_EQ(found.size(), 3U) << swallowed;
    EXPECT_EQ(found[1].bytes, good) << swallowed;
    EXPECT_EQ(found[2].bytes, next) << swallowed;
  }
}

// The false frame covers a good one whole, or two, or ends just where a good one begins.
TEST(MtScanner, GivesEveryFrameThatAFalseFrameWithARightChecksumCovers) {
  const Bytes good = frame_of(mid::kMtData, Bytes(20, 0x11));
  const Bytes other = frame_of(mid::kMtData, Bytes(20, 0x22));
  const Bytes next = frame_of(mid::kMtData, Bytes(20, 0x33));
  for (const std::size_t behind : {0U, 1U, 7U}) {
    for (const bool two : {false, true}) {
      Bytes covered(3, 0x55);
      covered.insert(covered.end(), good.begin(), good.end());
      if (two) covered.insert(covered.end(), other.begin(), other.end());
      covered.insert(covered.end(), behind, 0x66);
      Bytes bytes{kPreamble, kMasterBid, mid::kMtData, static_cast<std::uint8_t>(covered.size())};
      bytes.insert(bytes.end(), covered.begin(), covered.end());
      const auto sum = std::accumulate(bytes.begin() + 1, bytes.end(), 0U);
      bytes.push_back(static_cast<std::uint8_t>(0U - sum));
      const Bytes false_frame = bytes;
      bytes.insert(bytes.end(), next.begin(), next.end());
      const Bytes reads[] = {bytes};
      const auto found = scan(reads);
      ASSERT_EQ(found.size(), two ? 4U : 3U) << behind;
      EXPECT_EQ(found[0].bytes, false_frame);
      EXPECT_EQ(found[1].bytes, good);
      if (two) {
        EXPECT_EQ(found[2].bytes, other);
      }
      EXPECT_EQ(found.back().bytes, next);
    }
  }
}

// What no scanner of this protocol can tell: a false start passes the sum (1 in 256), covers the beginning of
// a good frame, and behind it, inside the good frame, the next one passes too. In garbage that is a quarter
// preambles and lengths some twenty starts a run pass for headers, so that 20 / 65536 of the runs may lose a
// frame.
TEST(MtScanner, GarbageHidesAFrameOnlyWhereTwoFalseStartsInARowPassTheChecksum) {
  constexpr int kRuns = 20'000;
  constexpr double kStartsARun = 20.0;
  const Bytes lures{0xFA, 0xFF, 0xFA, 0x32, 0x26, 0x31, 0x00};
  std::mt19937 random(5);
  int lost = 0;
  for (int run = 0; run < kRuns; ++run) {
    std::vector<Bytes> sent;
    Bytes stream;
    for (int i = 0; i < 8; ++i) {
      for (std::size_t n = random() % 200; n > 0; --n) {
        stream.push_back(
            static_cast<std::uint8_t>(random() % 4 == 0 ? lures[random() % lures.size()] : random()));
      }
      Bytes data(i % 2 == 0 ? 38 : 54);
      for (auto& byte : data) byte = static_cast<std::uint8_t>(random() % 5 == 0 ? 0xFA : random());
      sent.push_back(frame_of(mid::kMtData, data));
      stream.insert(stream.end(), sent.back().begin(), sent.back().end());
    }
    const Bytes reads[] = {stream};
    std::size_t next = 0;
    for (const Found& found : scan(reads)) next += next < sent.size() && found.bytes == sent[next] ? 1 : 0;
    lost += next < sent.size() ? 1 : 0;
  }
  // Poisson with this mean exceeds it by four roots once in 30 000 seeds.
  const double expected = kRuns * kStartsARun / 65536.0;
  EXPECT_LT(lost, expected + 4.0 * std::sqrt(expected));
}

TEST(MtScanner, CountsEveryByteAsFrameOrSkipped) {
  std::mt19937 random(3);
  Bytes bytes;
  std::size_t in_frames = 0;
  for (int i = 0; i < 400; ++i) {
    const Bytes frame = frame_of(mid::kMtData, Bytes(38, static_cast<std::uint8_t>(i)));
    bytes.insert(bytes.end(), frame.begin(), frame.end());
    for (std::size_t n = random() % 9; n > 0; --n) bytes.push_back(static_cast<std::uint8_t>(random() % 250));
  }
  ScanCounters counters;
  const Bytes reads[] = {bytes};
  for (const Found& found : scan(reads, &counters)) in_frames += found.bytes.size();
  EXPECT_EQ(in_frames, 400U * (38 + 5));
  EXPECT_EQ(in_frames + counters.bytes_skipped, bytes.size());
}

TEST(MtScanner, RefusesALengthBeyondTheDocumentedCeilingAtOnce) {
  Bytes bytes = frame_of(0x30, {});
  const Bytes endless{kPreamble, kMasterBid, mid::kMtData, kExtendedLength, 0x08, 0x01};  // 2049
  const Bytes good = frame_of(0x31, {});
  bytes.insert(bytes.end(), endless.begin(), endless.end());
  bytes.insert(bytes.end(), good.begin(), good.end());
  Scanner scanner;
  ASSERT_EQ(scanner.append(bytes, HostTime{}), bytes.size());
  Frame frame;
  ASSERT_TRUE(scanner.next(frame));
  ASSERT_TRUE(scanner.next(frame));
  EXPECT_EQ(frame.mid, 0x31);
  EXPECT_EQ(scanner.counters().bad_lengths, 1U);
}

TEST(MtScanner, TakesAFrameOfTheLongestLengthThroughOneByteReads) {
  Bytes bytes{kPreamble, kMasterBid, 0x91, kExtendedLength, 0x08, 0x00};
  for (std::size_t i = 0; i < kDataMax; ++i) bytes.push_back(static_cast<std::uint8_t>(7 * i));
  const auto sum = std::accumulate(bytes.begin() + 1, bytes.end(), 0U);
  bytes.push_back(static_cast<std::uint8_t>(0U - sum));
  std::vector<Bytes> reads;
  for (int twice = 0; twice < 3; ++twice) {
    for (const std::uint8_t byte : bytes) reads.push_back({byte});
  }
  const auto found = scan(reads);
  ASSERT_EQ(found.size(), 3U);
  EXPECT_EQ(found[2].bytes, bytes);
}

TEST(MtScanner, StampsTheFirstByteOfAFrameByWhatFollowedItInItsRead) {
  // 10 bytes at 1 ms each: the first byte of the second frame had 5 byte times to go.
  const Bytes ack = frame_of(0x31, {});
  Bytes bytes = ack;
  bytes.insert(bytes.end(), ack.begin(), ack.end());
  Scanner scanner(byte_time(10000.0));
  const HostTime arrival = host_time_from_ns(1'000'000'000);
  scanner.append(bytes, arrival);
  Frame frame;
  ASSERT_TRUE(scanner.next(frame));
  EXPECT_EQ(frame.first_byte, arrival - std::chrono::milliseconds(10));
  ASSERT_TRUE(scanner.next(frame));
  EXPECT_EQ(frame.first_byte, arrival - std::chrono::milliseconds(5));
}

TEST(MtScanner, ReadsTheControlVectors) {
  const auto vectors = test::load_vectors(test::source_path("tests/vectors/xsens_control.hex"));
  const auto oracle = test::load_json(test::source_path("tests/vectors/xsens_control.json"));
  ASSERT_EQ(oracle["vectors"].size(), 48U);
  const auto expect_frame = [](const Found& found, const nlohmann::json& expected) {
    const std::size_t header = found.bytes[3] == kExtendedLength ? kExtendedHeaderSize : kHeaderSize;
    std::string data;
    for (std::size_t i = header; i + 1 < found.bytes.size(); ++i) {
      char hex[3];
      std::snprintf(hex, sizeof hex, "%02x", found.bytes[i]);
      data += hex;
    }
    EXPECT_EQ(found.bytes[1], expected["bid"]);
    EXPECT_EQ(found.bytes[2], expected["mid"]);
    EXPECT_EQ(data, expected["data"]);
  };
  for (const auto& expected : oracle["vectors"]) {
    SCOPED_TRACE(expected["name"].get<std::string>());
    const Bytes& bytes = test::vector_named(vectors, expected["name"].get<std::string>());
    const Bytes reads[] = {bytes};
    auto found = scan(reads);
    // One payload holds what would pass for a frame by itself.
    std::erase_if(found, [](const Found& one) { return one.nested; });
    if (expected.contains("frames")) {
      ASSERT_EQ(found.size(), expected["frames"].size());
      for (std::size_t i = 0; i < found.size(); ++i) {
        expect_frame(found[i], expected["frames"][i]);
        EXPECT_EQ(found[i].offset, expected["frames"][i]["offset"]);
      }
    } else if (expected.value("valid", true)) {
      ASSERT_EQ(found.size(), 1U);
      expect_frame(found[0], expected);
    } else {
      EXPECT_TRUE(found.empty());
    }
  }
}

TEST(MtMessages, BuildsTheFramesOfTheControlVectors) {
  const auto vectors = test::load_vectors(test::source_path("tests/vectors/xsens_control.hex"));
  const auto built = [](std::uint8_t mid, std::span<const std::uint8_t> data = {}) {
    const OutgoingFrame frame(kMasterBid, mid, data);
    return Bytes(frame.bytes().begin(), frame.bytes().end());
  };
  EXPECT_EQ(built(mid::kGoToConfig), test::vector_named(vectors, "GoToConfig"));
  EXPECT_EQ(built(mid::kWakeUpAck), test::vector_named(vectors, "WakeUpAck"));
  EXPECT_EQ(built(mid::kReset), test::vector_named(vectors, "Reset"));
  EXPECT_EQ(built(mid::kPeriod, be16(1152)), test::vector_named(vectors, "SetPeriod_100Hz"));
  EXPECT_EQ(built(mid::kOutputMode, be16(7)), test::vector_named(vectors, "SetOutputMode_calib_orient_temp"));
  EXPECT_EQ(built(mid::kOutputSettings, be32(0x205)),
            test::vector_named(vectors, "SetOutputSettings_counter_euler_fp1632"));
}

}  // namespace
}  // namespace imuscope::xsens
