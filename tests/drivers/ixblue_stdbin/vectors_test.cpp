// Every vector of the protocol sheet, by name.
#include <gtest/gtest.h>
#include <map>

#include "base/bytes.h"
#include "drivers/ixblue_stdbin/messages.h"
#include "drivers/ixblue_stdbin/scanner.h"
#include "drivers/ixblue_stdbin/status_names.h"
#include "tests/drivers/support/streams.h"
#include "tests/support/shared_data.h"

namespace imuscope::ixblue_stdbin {
namespace {

using nlohmann::json;

struct Found {
  Frame::Kind kind;
  std::uint64_t offset;
  test::Bytes bytes;
};

std::vector<Found> scan(const test::Bytes& bytes) {
  Scanner scanner;
  std::vector<Found> found;
  Frame frame;
  EXPECT_EQ(scanner.append(bytes, {}), bytes.size());
  while (scanner.next(frame, true)) {
    found.push_back({frame.kind, frame.offset, {frame.bytes.begin(), frame.bytes.end()}});
  }
  return found;
}

json blocks_of(const Telegram& telegram) {
  json blocks = json::object();
  telegram.for_each_block([&](const BlockLayout& layout, std::span<const std::uint8_t> bytes) {
    json& block = blocks[std::string(layout.name)];
    for_each_field(layout, bytes, [&](const FieldLayout& field, const FieldValue& value) {
      const bool is_text = field.type == FieldType::kText8 || field.type == FieldType::kText32;
      block[std::string(field.name)] = is_text ? json(value.text) : json(value.number);
    });
  });
  return blocks;
}

void expect_telegram(const Telegram& telegram, const json& expected) {
  EXPECT_EQ(telegram.version, expected["version"]);
  EXPECT_EQ(telegram.nav_mask, expected["nav_mask"]);
  EXPECT_EQ(telegram.extended_mask, expected["ext_mask"]);
  EXPECT_EQ(telegram.external_mask, expected["external_mask"]);
  EXPECT_EQ(telegram.nav_size.has_value(), !expected["nav_size"].is_null());
  if (telegram.nav_size) {
    EXPECT_EQ(*telegram.nav_size, expected["nav_size"]);
  }
  EXPECT_EQ(telegram.total_size, expected["telegram_size"]);
  EXPECT_EQ(telegram.validity_ticks, expected["validity_100us"]);
  EXPECT_EQ(telegram.counter, expected["counter"]);
  EXPECT_EQ(telegram.checksum, expected["checksum"]);
  EXPECT_FALSE(telegram.rest_unread);
  EXPECT_EQ(blocks_of(telegram), expected["blocks"]);
}

TEST(StdBinVectors, EveryVectorDecodesToItsPublishedValues) {
  const auto vectors = test::load_vectors(test::source_path("tests/vectors/ixblue_stdbin.hex"));
  const json expected = test::load_json(test::source_path("tests/vectors/ixblue_stdbin.json"));
  ASSERT_EQ(vectors.size(), expected["vectors"].size());
  for (const json& vector : expected["vectors"]) {
    const std::string name = vector["name"];
    SCOPED_TRACE(name);
    const test::Bytes& bytes = test::vector_named(vectors, name);
    ASSERT_EQ(bytes.size(), vector["length"]);
    const auto found = scan(bytes);
    if (vector.contains("expected") && vector["expected"].contains("kind")) {
      ASSERT_EQ(found.size(), 1U);
      EXPECT_EQ(found[0].kind, Frame::Kind::kAnswer);
    } else if (vector.contains("expected")) {
      ASSERT_EQ(found.size(), 1U);
      expect_telegram(parse_telegram(found[0].bytes), vector["expected"]);
    } else if (vector.contains("expected_frames")) {
      ASSERT_EQ(found.size(), vector["expected_frames"].size());
      for (std::size_t i = 0; i < found.size(); ++i) {
        const json& frame = vector["expected_frames"][i];
        const Telegram telegram = parse_telegram(found[i].bytes);
        if (frame.contains("offset")) {
          EXPECT_EQ(found[i].offset, frame["offset"]);
        }
        if (frame.contains("counter")) {
          EXPECT_EQ(telegram.counter, frame["counter"]);
        }
        if (frame.contains("validity_100us")) {
          EXPECT_EQ(telegram.validity_ticks, frame["validity_100us"]);
        }
      }
    } else {
      EXPECT_EQ(vector["valid"], false);
      EXPECT_TRUE(found.empty());
    }
  }
}

struct Capture {
  const char* file;
  std::size_t telegrams;
};

TEST(StdBinCaptures, EveryTelegramOfTheRecordedUnitsIsReadWithoutASkippedByte) {
  IMUSCOPE_NEEDS_SHARED("data/streams/ixblue_stdbin");
  for (const Capture capture : {Capture{"v2.bin", 1}, Capture{"v3.bin", 17}, Capture{"v3_old.bin", 1},
                                Capture{"v4.bin", 1}, Capture{"v5.bin", 1}}) {
    SCOPED_TRACE(capture.file);
    const auto bytes =
        test::load_bytes(test::shared_path(std::string("data/streams/ixblue_stdbin/") + capture.file));
    Scanner scanner;
    Frame frame;
    std::size_t telegrams = 0;
    std::span<const std::uint8_t> rest(bytes);
    while (!rest.empty()) {
      rest = rest.subspan(scanner.append(rest, {}));
      while (scanner.next(frame)) {
        EXPECT_FALSE(parse_telegram(frame.bytes).rest_unread);
        ++telegrams;
      }
    }
    EXPECT_EQ(telegrams, capture.telegrams);
    EXPECT_EQ(scanner.counters().bytes_skipped, 0U);
  }
}

std::vector<std::string_view> names_in(std::uint32_t algorithm_word) {
  std::vector<std::string_view> names;
  for_each_set_bit(kAlgorithmStatus1, algorithm_word, [&](std::string_view name) { names.push_back(name); });
  return names;
}

// The unit receives log, GPS, USBL and LBL while it aligns; with a name left out before bit 18, the bits
// above it would make no sense.
TEST(StdBinStatus, TheRecordedAlgorithmWordReadsAsAnAligningUnit) {
  IMUSCOPE_NEEDS_SHARED("data/streams/ixblue_stdbin/v3.bin");
  const auto bytes = test::load_bytes(test::shared_path("data/streams/ixblue_stdbin/v3.bin"));
  Scanner scanner;
  Frame frame;
  std::span<const std::uint8_t> rest(bytes);
  int telegrams = 0;
  while (!rest.empty()) {
    rest = rest.subspan(scanner.append(rest, {}));
    while (scanner.next(frame)) {
      ++telegrams;
      const Telegram telegram = parse_telegram(frame.bytes);
      const auto word = read_be<std::uint32_t>(telegram.block(Nav::kAlgorithmStatus));
      EXPECT_EQ(word, 0x81013112U);
      EXPECT_EQ(names_in(word), (std::vector<std::string_view>{"alignment", "altitude_gps", "log_received",
                                                               "gps_received", "gps_valid", "usbl_received",
                                                               "lbl_received", "heave_initialising"}));
    }
  }
  EXPECT_EQ(telegrams, 17);
}

TEST(StdBinStatus, TheBitsThatTheDecoderActsOnAreTheNamedOnes) {
  const auto name_of = [](std::uint32_t bit) {
    std::string_view found;
    for_each_set_bit(kUserStatus, bit, [&](std::string_view name) { found = name; });
    return found;
  };
  EXPECT_EQ(name_of(kUserTimeReceived), "time_valid");
  EXPECT_EQ(name_of(kUserHrpInvalid), "hrp_invalid");
  EXPECT_EQ(name_of(kUserAlignment), "alignment");
  EXPECT_EQ(name_of(kUserFailure), "failure");
}

TEST(StdBinCaptures, TheMakersOwnAssertionsHoldForTheV2Telegram) {
  IMUSCOPE_NEEDS_SHARED("data/streams/ixblue_stdbin/v2.bin");
  const auto found = scan(test::load_bytes(test::shared_path("data/streams/ixblue_stdbin/v2.bin")));
  ASSERT_EQ(found.size(), 1U);
  const json blocks = blocks_of(parse_telegram(found[0].bytes));
  // Values asserted by the unit test of the maker's public decoder.
  EXPECT_NEAR(blocks["attitude_heading"]["heading_deg"], 209.982, 1e-3);
  EXPECT_NEAR(blocks["attitude_heading"]["roll_deg"], 0.016, 1e-3);
  EXPECT_NEAR(blocks["attitude_heading"]["pitch_deg"], 0.206, 1e-3);
  EXPECT_NEAR(blocks["position"]["lat_deg"], 2.1332412116, 1e-9);
  EXPECT_NEAR(blocks["position"]["lon_deg"], 48.0000371788, 1e-9);
  EXPECT_NEAR(blocks["position"]["alt_m"], 1.0547082, 1e-6);
}

}  // namespace
}  // namespace imuscope::ixblue_stdbin
