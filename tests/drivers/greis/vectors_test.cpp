// Every vector of the protocol sheet, by name, and the scanner against damaged streams.
#include <gtest/gtest.h>
#include <cmath>

#include "drivers/greis/messages.h"
#include "drivers/greis/scanner.h"
#include "tests/drivers/greis/message_builder.h"
#include "tests/support/shared_data.h"

namespace imuscope::greis {
namespace {

using nlohmann::json;
using test::Bytes;

struct Found {
  Frame::Kind kind;
  std::string id;
  Bytes bytes;
  json fields;
};

std::vector<Found> find_all(const Bytes& bytes) {
  Scanner scanner;
  std::vector<Found> found;
  Frame frame;
  std::span<const std::uint8_t> rest(bytes);
  const auto drain = [&](bool at_end) {
    while (scanner.next(frame, at_end)) {
      Found one{frame.kind, "TEXT", {frame.bytes.begin(), frame.bytes.end()}, json::object()};
      if (frame.kind == Frame::Kind::kMessage) {
        one.id = {static_cast<char>(frame.bytes[0]), static_cast<char>(frame.bytes[1])};
        for_each_field(frame.id, frame.body,
                       [&](const NamedValue& value) { one.fields[std::string(value.name)] = value.number; });
      }
      found.push_back(one);
    }
  };
  while (!rest.empty()) {
    rest = rest.subspan(scanner.append(rest, {}));
    drain(false);
  }
  drain(true);
  return found;
}

void expect_fields(const json& found, const json& expected) {
  ASSERT_EQ(found.size(), expected.size()) << found << expected;
  for (const auto& [name, value] : expected.items()) {
    ASSERT_TRUE(found.contains(name)) << name;
    if (value == "NaN") {
      EXPECT_TRUE(std::isnan(found[name].get<double>())) << name;
    } else {
      EXPECT_EQ(found[name].get<double>(), value.get<double>()) << name;
    }
  }
}

TEST(GreisVectors, EveryVectorDecodesToItsPublishedValues) {
  IMUSCOPE_NEEDS_SHARED("oracle/protocols/greis.hex");
  const auto vectors = test::load_vectors(test::shared_path("oracle/protocols/greis.hex"));
  const json expected = test::load_json(test::shared_path("oracle/protocols/greis.json"));
  ASSERT_EQ(vectors.size(), expected["vectors"].size());
  for (const json& vector : expected["vectors"]) {
    const std::string name = vector["name"];
    SCOPED_TRACE(name);
    const Bytes& bytes = test::vector_named(vectors, name);
    ASSERT_EQ(bytes.size(), vector["length"]);
    const auto found = find_all(bytes);
    if (vector.value("valid", true) == false) {
      EXPECT_TRUE(found.empty());
    } else if (vector.contains("ids")) {
      ASSERT_GE(found.size(), vector["ids"].size());
      for (std::size_t i = 0; i < vector["ids"].size(); ++i) EXPECT_EQ(found[i].id, vector["ids"][i]);
    } else {
      ASSERT_EQ(found.size(), 1U);
      EXPECT_EQ(found[0].id, vector["id"]);
      EXPECT_EQ(found[0].bytes.back(), vector["checksum"]);
      ASSERT_NO_FATAL_FAILURE(expect_fields(found[0].fields, vector["fields"]));
    }
  }
}

TEST(GreisVectors, AReplyWithoutChecksumIsFoundBehindTextAndAMessage) {
  IMUSCOPE_NEEDS_SHARED("oracle/protocols/greis.hex");
  const auto vectors = test::load_vectors(test::shared_path("oracle/protocols/greis.hex"));
  const auto found = find_all(test::vector_named(vectors, "nmea_inside"));
  ASSERT_EQ(found.size(), 3U);
  EXPECT_EQ(found[2].id, "RE");
}

std::vector<Bytes> scan(std::span<const Bytes> reads) {
  Scanner scanner;
  std::vector<Bytes> frames;
  Frame frame;
  for (const Bytes& read : reads) {
    std::span<const std::uint8_t> rest(read);
    while (!rest.empty()) {
      rest = rest.subspan(scanner.append(rest, {}));
      while (scanner.next(frame)) frames.emplace_back(frame.bytes.begin(), frame.bytes.end());
    }
  }
  while (scanner.next(frame, true)) frames.emplace_back(frame.bytes.begin(), frame.bytes.end());
  return frames;
}

/// An epoch; one of its messages holds id characters, hex digits and text openers.
test::StreamUnderTest stream() {
  test::StreamUnderTest under_test;
  under_test.scan = scan;
  under_test.separator = {'\r', '\n'};
  // Text and messages that are text have no check of their own that a fault could break.
  under_test.may_appear = [](const Bytes& frame) {
    const std::string_view text(reinterpret_cast<const char*>(frame.data()), frame.size());
    return (frame[0] >= 33 && frame[0] <= 47) || text.starts_with("RE") || text.starts_with("ER") ||
           text.starts_with("JP");
  };
  under_test.accidents_max = 2.0 / 256.0;
  under_test.frames = {
      test::rt(45'000'100),
      test::rd(2026, 3, 14, 1),
      test::st(45'000'100, 4),
      test::pg(0.85, 0.04, 106.5, 0.012F, 4),
      test::greis_message(
          "XX", test::Body().put(test::U32{0x30307e7e}).put(test::U32{0x24240535}).put(test::U8{0x80})),
      test::vg(1.5F, -0.5F, 0.25F, 0.02F, 4),
      test::et(45'000'100),
  };
  return under_test;
}

TEST(GreisStream, EverySplitIntoReadsGivesTheSameMessages) {
  test::expect_every_split_keeps_all_frames(stream());
}
TEST(GreisStream, EverySingleBitFlipLosesOnlyItsMessage) {
  test::expect_every_bit_flip_loses_only_its_frame(stream());
}
TEST(GreisStream, EveryCutLosesOnlyTheMessagesItTouches) {
  test::expect_every_cut_loses_only_its_frames(stream());
}
TEST(GreisStream, EveryInsertionLosesOnlyItsMessage) {
  test::expect_every_insertion_loses_only_its_frame(stream(), 21);
}
TEST(GreisStream, NoMessageInsideGarbageIsLost) {
  test::expect_no_frame_in_garbage_is_lost(stream(), "~~0$%::FFPVE", 22);
}

TEST(GreisStream, ALineOfTextThatNeverEndsIsGivenUp) {
  Bytes bytes(1000, 'x');
  bytes[0] = '$';
  const Bytes good = test::rt(1000);
  bytes.insert(bytes.end(), good.begin(), good.end());
  const Bytes reads[] = {bytes};
  EXPECT_EQ(scan(reads), std::vector<Bytes>{good});
}

TEST(GreisCapture, TheJavadLogHas130EpochsAndNoBadByteBeforeItsCutEnd) {
  IMUSCOPE_NEEDS_SHARED("data/streams/greis/javad.jps");
  const Bytes bytes = test::load_bytes(test::shared_path("data/streams/greis/javad.jps"));
  Scanner scanner;
  Frame frame;
  std::size_t epochs = 0;
  std::span<const std::uint8_t> rest(bytes);
  while (!rest.empty()) {
    rest = rest.subspan(scanner.append(rest, {}));
    while (scanner.next(frame)) epochs += frame.id == kReceiverTime ? 1 : 0;
  }
  EXPECT_EQ(epochs, 130U);
  EXPECT_EQ(scanner.counters().bytes_skipped, 0U);
  EXPECT_EQ(scanner.counters().bad_checksums, 0U);
}

}  // namespace
}  // namespace imuscope::greis
