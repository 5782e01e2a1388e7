// After any fault the search goes on at the byte after the false start: for every protocol, at every
// position of a stream, a fault loses only the frames that it touches.
#include <gtest/gtest.h>

#include <numeric>
#include <random>

#include "drivers/greis/scanner.h"
#include "drivers/ixblue_stdbin/scanner.h"
#include "drivers/nmea/scanner.h"
#include "drivers/rtklib_pos/scanner.h"
#include "drivers/ubx/scanner.h"
#include "drivers/xsens_mt/scanner.h"
#include "tests/drivers/greis/message_builder.h"
#include "tests/drivers/ixblue_stdbin/telegram_builder.h"
#include "tests/drivers/nmea/sentence_builder.h"
#include "tests/drivers/support/streams.h"
#include "tests/drivers/ubx/message_builder.h"
#include "tests/drivers/xsens_mt/mt_frames.h"

namespace imuscope::test {
namespace {

/// Frames found in a stream that comes in the given reads, cut out of it by their offset and size.
template <typename Scanner, typename Frame, typename SizeOf>
Scan scan_with(SizeOf&& size_of) {
  return [size_of](std::span<const Bytes> reads) {
    Bytes all;
    for (const Bytes& read : reads) all.insert(all.end(), read.begin(), read.end());
    Scanner scanner;
    Frame frame;
    std::vector<Bytes> frames;
    const auto drain = [&](bool at_end) {
      while (scanner.next(frame, at_end)) {
        const auto begin = all.begin() + static_cast<std::ptrdiff_t>(frame.offset);
        frames.emplace_back(begin, begin + static_cast<std::ptrdiff_t>(size_of(frame)));
      }
    };
    for (const Bytes& read : reads) {
      std::span<const std::uint8_t> rest(read);
      while (!rest.empty()) {
        rest = rest.subspan(scanner.append(rest, HostTime{}));
        drain(false);
      }
    }
    drain(true);
    return frames;
  };
}

/// Frames as an MTx sends them, the preamble in their data included, with handshake frames among them.
StreamUnderTest xsens_mt() {
  std::mt19937 random(7);
  StreamUnderTest s;
  s.name = "xsens_mt";
  for (int i = 0; i < 8; ++i) {
    Bytes data(i % 2 == 0 ? 38 : 54);
    for (auto& byte : data) byte = static_cast<std::uint8_t>(random() % 5 == 0 ? 0xFA : random());
    s.frames.push_back(xsens::test_frames::frame(0x32, data));
    if (i == 3) s.frames.push_back(xsens::test_frames::frame(0x31));
  }
  s.scan = scan_with<xsens::Scanner, xsens::Frame>([](const xsens::Frame& frame) { return frame.size; });
  // One false frame in 256 has a right checksum; the layout and the counter tell it apart later. No frame is
  // lost to it: see MtScanner.GarbageHidesAFrameOnlyWhereTwoFalseStartsInARowPassTheChecksum for what can be.
  s.may_appear = [](const Bytes& frame) {
    return std::accumulate(frame.begin() + 1, frame.end(), 0U) % 256 == 0;
  };
  s.lures = std::string_view("\xFA\xFF\xFA\x32\x26\x31\x00", 7);
  return s;
}

/// Telegrams of every version, whose data contain the sync bytes.
StreamUnderTest ixblue_stdbin() {
  StreamUnderTest s;
  s.name = "ixblue_stdbin";
  std::uint32_t counter = 7;
  for (std::uint8_t version = 2; version <= 5; ++version) {
    ++counter;
    TelegramBuilder builder(version, counter, 1000 * counter);
    builder.nav(0, TelegramBuilder::floats({1.5F, -2.5F, 3.5F}));
    builder.nav(28, Bytes{'I', 'X', 3, 'I', 'X', 5, 'A', 'N', 4, 0, 1, 2});
    if (version > 2) builder.extended(2, TelegramBuilder::floats({0.1F, 0.2F, 0.3F}));
    builder.external(13, Bytes{0, 0, 1, 2, 0, 0, 3, 4});
    s.frames.push_back(builder.build());
  }
  s.scan = scan_with<ixblue_stdbin::Scanner, ixblue_stdbin::Frame>(
      [](const ixblue_stdbin::Frame& frame) { return frame.bytes.size(); });
  s.lures = std::string_view(
      "IXIX\x02\x03\x04\x05"
      "AN",
      10);
  return s;
}

/// An epoch; one of its messages holds id characters, hex digits and text openers.
StreamUnderTest greis() {
  StreamUnderTest s;
  s.name = "greis";
  s.separator = {'\r', '\n'};
  s.frames = {
      rt(45'000'100),
      rd(2026, 3, 14, 1),
      st(45'000'100, 4),
      pg(0.85, 0.04, 106.5, 0.012F, 4),
      greis_message("XX", Body().put(U32{0x30307e7e}).put(U32{0x24240535}).put(U8{0x80})),
      vg(1.5F, -0.5F, 0.25F, 0.02F, 4),
      et(45'000'100),
  };
  s.scan =
      scan_with<greis::Scanner, greis::Frame>([](const greis::Frame& frame) { return frame.bytes.size(); });
  // Text, and messages that are text, have no check of their own that a fault could break.
  s.may_appear = [](const Bytes& frame) {
    const std::string_view text(reinterpret_cast<const char*>(frame.data()), frame.size());
    return (frame[0] >= 33 && frame[0] <= 47) || text.starts_with("RE") || text.starts_with("ER") ||
           text.starts_with("JP");
  };
  s.accidents_max = 2.0 / 256.0;
  s.lures = "~~0$%::FFPVE";
  return s;
}

StreamUnderTest nmea() {
  StreamUnderTest s;
  s.name = "nmea";
  s.separator = bytes_of("\r\n");
  const auto bare = [](const std::string& content) {
    const std::string text = sentence(content);
    return bytes_of(text.substr(0, text.size() - 2));
  };
  s.frames = {
      bare("GPGGA,123456.10,4851.39684,N,00221.13314,E,4,18,0.7,35.250,M,46.250,M,1.0,0123"),
      bare("GNRMC,123456.10,A,4851.39684,N,00221.13314,E,2.617,338.17,140326,,,R,V"),
      bare("GPZDA,123456.10,14,03,2026,00,00"),
  };
  s.scan =
      scan_with<nmea::Scanner, nmea::Frame>([](const nmea::Frame& frame) { return frame.sentence.size(); });
  // A checksum of exclusive ors does not see that two equal characters are missing, nor that a digit of its
  // own changed case: a sentence with a hole may appear. What must hold is that its neighbours do not suffer.
  s.may_appear = [](const Bytes& frame) { return frame[0] == '$' || frame[0] == '!'; };
  s.lures = "$*$!G0";
  return s;
}

StreamUnderTest ubx() {
  StreamUnderTest s;
  s.name = "ubx";
  s.frames = {
      ubx_message(1, 3, {1, 2, 3, 0xB5, 0x62, 1, 7, 92, 0}),
      ubx_message(5, 1, {6, 1}),
      bytes_of("$GPZDA,123456.10,14,03,2026,00,00*60"),
      ubx_message(1, 4, Bytes(18, 0x80)),
      ubx_message(0x0A, 4, {}),
  };
  s.scan = scan_with<ubx::Scanner, ubx::Frame>([](const ubx::Frame& frame) { return frame.bytes.size(); });
  s.may_appear = [](const Bytes& frame) { return frame[0] == '$' || frame[0] == '!'; };  // as of nmea
  s.lures = "\xB5\x62\xB5\x62$*";
  return s;
}

/// Lines without any check: a damaged one may be read as another. A line cannot do without the end of the one
/// before it, and garbage in front of it is part of it.
StreamUnderTest rtklib_pos() {
  StreamUnderTest s;
  s.name = "rtklib_pos";
  for (int i = 0; i < 4; ++i) {
    s.frames.push_back(
        bytes_of("2026/03/14 12:34:5" + std::to_string(i) +
                 ".100  48.856614000  2.352219000  81.5000  1 12 0.01 0.01 0.02 0 0 0 0.1 12.3\n"));
  }
  s.scan = scan_with<rtklib_pos::Scanner, rtklib_pos::Frame>(
      [](const rtklib_pos::Frame& frame) { return frame.size; });
  s.may_appear = [](const Bytes&) { return true; };
  s.lead = 1;
  s.has_start_mark = false;
  return s;
}

class Resynchronisation : public testing::TestWithParam<StreamUnderTest> {};

TEST_P(Resynchronisation, EverySplitIntoReadsGivesTheSameFrames) {
  expect_every_split_keeps_all_frames(GetParam());
}
TEST_P(Resynchronisation, EverySingleBitFlipLosesOnlyItsFrame) {
  expect_every_bit_flip_loses_only_its_frame(GetParam());
}
TEST_P(Resynchronisation, EveryCutLosesOnlyTheFramesItTouches) {
  expect_every_cut_loses_only_its_frames(GetParam());
}
TEST_P(Resynchronisation, EveryInsertionLosesOnlyTheFrameItTouches) {
  expect_every_insertion_loses_only_its_frame(GetParam(), 11);
}
TEST_P(Resynchronisation, NoFrameInsideGarbageIsLost) {
  if (!GetParam().has_start_mark) GTEST_SKIP() << "lines have no start mark: garbage becomes part of a line";
  expect_no_frame_in_garbage_is_lost(GetParam(), 12);
}

INSTANTIATE_TEST_SUITE_P(AllProtocols, Resynchronisation,
                         testing::Values(xsens_mt(), ixblue_stdbin(), greis(), nmea(), ubx(), rtklib_pos()),
                         [](const auto& stream) { return stream.param.name; });

}  // namespace
}  // namespace imuscope::test
