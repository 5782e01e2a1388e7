#include "service/recording/read_ahead.h"

#include <gtest/gtest.h>
#include <imuscope/raw_t.hpp>

#include "capture/capture_writer.h"
#include "publish/message_codec.h"
#include "service/recording/byte_source.h"
#include "tests/support/shared_data.h"

namespace imuscope {
namespace {

using Bytes = std::vector<std::uint8_t>;

struct Read {
  HostTime arrival{};
  Bytes bytes;
  bool operator==(const Read&) const = default;
};

constexpr std::int64_t kMinute_ms = 60'000;
const std::vector<CapturedLine> kLines{{"fast", 0}, {"slow", 0}, {"late", 0}};

/// A minute of three devices: one every 2 ms, one every second, one that begins at the end.
/// @param more_bytes  of every read of the first
std::filesystem::path capture(std::size_t more_bytes = 0) {
  const auto path = test::scratch_folder() / "capture.lcm";
  auto writer = CaptureWriter::create(path);
  std::int64_t sequence = 0;
  const auto add = [&](const char* device, std::int64_t at_ms) {
    raw_t message{};
    message.sequence = ++sequence;
    message.device = device;
    message.direction = raw_t::READ;
    message.arrival_ns = 5'000'000'000 + at_ms * 1'000'000;
    const std::size_t more = device == kLines[0].device ? more_bytes : 0;
    message.bytes.assign(1 + more + static_cast<std::size_t>(at_ms) % 90,
                         static_cast<std::uint8_t>(sequence));
    message.n_bytes = static_cast<std::int32_t>(message.bytes.size());
    writer->append("IMUSCOPE_RAW", sequence, encode_message(message));
  };
  for (std::int64_t at_ms = 0; at_ms < kMinute_ms; at_ms += 2) {
    add("fast", at_ms);
    if (at_ms % 1000 == 0) add("slow", at_ms);
    if (at_ms >= kMinute_ms - 100) add("late", at_ms);
  }
  EXPECT_TRUE(writer->close());
  return path;
}

std::optional<Read> next(ByteSource& source) {
  const auto read = source.next();
  EXPECT_TRUE(read);
  if (!read || !*read) return std::nullopt;
  return Read{(*read)->arrival.value(), Bytes((*read)->bytes.begin(), (*read)->bytes.end())};
}

std::vector<Read> rest(ByteSource& source) {
  std::vector<Read> reads;
  while (auto read = next(source)) reads.push_back(std::move(*read));
  return reads;
}

TEST(ReadAhead, GivesEveryReadOfTheCaptureInItsOrder) {
  const auto path = capture();
  auto plain = CaptureReader::open(path);
  ASSERT_TRUE(plain);
  ReadAhead ahead(*CaptureReader::open(path));
  std::size_t n = 0;
  RawRead read;
  while (const auto expected = plain->next()) {
    ASSERT_TRUE(ahead.next(read)) << n;
    ASSERT_EQ(read.device, expected->device) << n;
    ASSERT_EQ(read.arrival, expected->arrival) << n;
    ASSERT_EQ(read.bytes, expected->bytes) << n;
    ++n;
  }
  EXPECT_EQ(n, 30'000U + 60U + 50U);
  EXPECT_FALSE(ahead.next(read));
  EXPECT_FALSE(ahead.next(read)) << "the end stays the end";
}

TEST(ReadAhead, EndsWhereverItIsLeft) {
  const auto path = capture();
  for (const int taken : {0, 1, 1500}) {
    ReadAhead ahead(*CaptureReader::open(path));
    RawRead read;
    for (int i = 0; i < taken; ++i) ASSERT_TRUE(ahead.next(read));
  }
}

TEST(ReadAhead, LinesSideBySideAreThoseOfEachDeviceAlone) {
  const auto path = capture();
  for (const Reading reading : {Reading::kWhenAsked, Reading::kAhead}) {
    auto lines = open_captured_lines(path, kLines, reading);
    ASSERT_TRUE(lines);
    // The last device first, so that all of the others waits for its turn.
    for (std::size_t i = lines->size(); i-- > 0;) {
      auto alone = open_captured_device(path, kLines[i].device, 0);
      ASSERT_TRUE(alone);
      const auto expected = rest(**alone);
      EXPECT_FALSE(expected.empty());
      EXPECT_EQ(rest(*(*lines)[i]), expected) << kLines[i].device;
    }
  }
}

TEST(ReadAhead, OneDeviceIsTheSameHoweverItIsRead) {
  const auto path = capture();
  for (const auto& line : kLines) {
    auto asked = open_captured_device(path, line.device, 0);
    auto ahead = open_captured_device(path, line.device, 0, Reading::kAhead);
    ASSERT_TRUE(asked && ahead);
    EXPECT_EQ(rest(**ahead), rest(**asked)) << line.device;
  }
}

TEST(ReadAhead, ALineThatIsFarAheadOfAnotherGoesItsOwnWayAndMissesNothing) {
  constexpr std::size_t kSoMuchThatNobodyKeepsIt = 1500;  // 45 MB in all
  const auto path = capture(kSoMuchThatNobodyKeepsIt);
  auto lines = open_captured_lines(path, kLines, Reading::kWhenAsked);
  ASSERT_TRUE(lines);
  for (const std::size_t i : {1U, 2U}) {
    auto alone = open_captured_device(path, kLines[i].device, 0);
    ASSERT_TRUE(alone);
    const auto expected = rest(**alone);
    EXPECT_EQ(rest(*(*lines)[i]), expected) << kLines[i].device;
  }
  std::size_t reads = 0;
  while (next(*(*lines)[0])) ++reads;
  EXPECT_EQ(reads, 30'000U);
}

}  // namespace
}  // namespace imuscope
