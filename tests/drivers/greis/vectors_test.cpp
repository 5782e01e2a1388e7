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
  const auto vectors = test::load_vectors(test::source_path("tests/vectors/greis.hex"));
  const json expected = test::load_json(test::source_path("tests/vectors/greis.json"));
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
  const auto vectors = test::load_vectors(test::source_path("tests/vectors/greis.hex"));
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

// CRC-16 with polynomial 0x1021 from 0 is the XMODEM one, whose published check value over "123456789" is
// 0x31C3.
TEST(GreisStream, ReferenceMessagesProveThemselvesByACrcOf16Bits) {
  EXPECT_EQ(crc16(test::bytes_of("123456789")), 0x31C3);
  Bytes message = test::bytes_of("rE006abcd");
  const std::uint16_t crc = crc16(message);
  message.push_back(static_cast<std::uint8_t>(crc));
  message.push_back(static_cast<std::uint8_t>(crc >> 8U));
  const Bytes reads[] = {message};
  EXPECT_EQ(scan(reads), std::vector<Bytes>{message});
  for (std::size_t bit = 8 * 5; bit < 8 * message.size(); ++bit) {
    Bytes faulty = message;
    faulty[bit / 8] = static_cast<std::uint8_t>(faulty[bit / 8] ^ (1U << bit % 8));
    const Bytes faulty_reads[] = {faulty};
    EXPECT_TRUE(scan(faulty_reads).empty()) << bit;
  }
}

TEST(GreisStream, TheChecksumByWordsIsThatOfBytes) {
  Bytes bytes;
  for (unsigned n = 0; n < 100; ++n) {
    unsigned sum = 0;
    for (const unsigned byte : bytes) sum = ((sum << 2U | sum >> 6U) & 0xFFU) ^ byte;
    EXPECT_EQ(checksum(bytes), (sum << 2U | sum >> 6U) & 0xFFU) << n;
    bytes.push_back(static_cast<std::uint8_t>(37 * n * n + 11));
  }
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
