/// Device bytes are read where they stand in their message: beside the codec that LCM's own generator writes.

#include "capture/record_codec.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <imuscope/raw_t.hpp>
#include <imuscope/run_t.hpp>
#include <random>
#include <variant>

#include "publish/message_codec.h"

namespace imuscope {
namespace {

raw_t drawn(std::mt19937& random) {
  raw_t message{};
  message.utime = static_cast<std::int64_t>(random());
  message.sequence = static_cast<std::int64_t>(random());
  message.device = std::string(random() % 20, 'd');
  message.direction = static_cast<std::int8_t>(random() % 4);
  message.arrival_ns = static_cast<std::int64_t>(random());
  message.continues = static_cast<std::int8_t>(random() % 2);
  message.bytes.resize(random() % 300);
  for (auto& byte : message.bytes) byte = static_cast<std::uint8_t>(random());
  // The instant of a stamped read is one that a clock can have.
  if (message.bytes.size() >= kReceivedBytes)
    std::fill(message.bytes.begin() + 4, message.bytes.begin() + kReceivedBytes, std::uint8_t{0});
  message.n_bytes = static_cast<std::int32_t>(message.bytes.size());
  return message;
}

TEST(RawView, IsWhatTheGeneratedCodecReads) {
  std::mt19937 random(1);
  for (int i = 0; i < 5000; ++i) {
    const raw_t message = drawn(random);
    const auto bytes = encode_message(message);
    const auto view = view_raw(bytes);
    const bool is_stamped = message.direction == raw_t::STAMPED_READ;
    ASSERT_EQ(view.has_value(), !is_stamped || message.bytes.size() >= kReceivedBytes);
    if (!view) continue;
    EXPECT_EQ(view->device, message.device);
    EXPECT_EQ(view->sequence, message.sequence);
    EXPECT_EQ(to_ns(view->arrival), message.arrival_ns);
    EXPECT_EQ(view->continues, message.continues != 0);
    EXPECT_EQ(view->received.has_value(), is_stamped);
    const auto from = message.bytes.begin() + (is_stamped ? kReceivedBytes : 0);
    EXPECT_TRUE(std::equal(from, message.bytes.end(), view->bytes.begin(), view->bytes.end()));
  }
}

TEST(RawView, TakesNoDamagedMessageThatTheGeneratedCodecRefuses) {
  std::mt19937 random(2);
  int taken = 0;
  int refused = 0;
  for (int i = 0; i < 20'000; ++i) {
    auto bytes = encode_message(drawn(random));
    switch (random() % 3) {
      case 0:
        bytes.resize(random() % bytes.size());
        break;
      case 1:
        bytes.resize(bytes.size() + 1 + random() % 9, std::uint8_t{0});
        break;
      default:
        bytes[random() % bytes.size()] ^= static_cast<std::uint8_t>(1U << random() % 8U);
    }
    const auto generated = decode_message<raw_t>(bytes);
    const auto view = view_raw(bytes);
    if (view) {
      ASSERT_TRUE(generated) << i;
      EXPECT_EQ(view->device, generated->device);
      EXPECT_EQ(view->bytes.size(), generated->bytes.size() - (view->received ? kReceivedBytes : 0));
      ++taken;
    } else {
      ++refused;
    }
  }
  // A flipped bit in the bytes themselves is none that a codec could see.
  EXPECT_GT(taken, 3000);
  EXPECT_GT(refused, 10'000);
}

TEST(RawView, IsNoneOfATimeThatNoClockHas) {
  raw_t message{};
  message.device = "mtx1";
  message.arrival_ns = std::int64_t{1} << 62U;
  EXPECT_FALSE(view_raw(encode_message(message)));
  message.arrival_ns = 1;
  message.sequence = -1;
  EXPECT_FALSE(view_raw(encode_message(message)));
  message.sequence = 0;
  EXPECT_TRUE(view_raw(encode_message(message)));
}

TEST(RunRecord, BeginsAtAnyTimeFrom1970OnThatAClockCanHave) {
  run_t message{};
  message.format = kCaptureFormat;
  message.t0_ns = 1;
  message.t0_utime = 0;
  const auto at_1970 = decode_record(encode_message(message));
  ASSERT_TRUE(at_1970);
  EXPECT_EQ(to_ns(std::get<RunHeader>(*at_1970).t0_wall), 0);
  message.t0_utime = 1'700'000'000'000'001;
  EXPECT_EQ(to_ns(std::get<RunHeader>(*decode_record(encode_message(message))).t0_wall),
            1'700'000'000'000'001'000);
  message.t0_utime = -1;
  EXPECT_FALSE(decode_record(encode_message(message)));
  message.t0_utime = std::int64_t{1} << 62U;
  EXPECT_FALSE(decode_record(encode_message(message)));
  message.t0_utime = 0;
  message.t0_ns = std::int64_t{1} << 62U;
  EXPECT_FALSE(decode_record(encode_message(message)));
}

}  // namespace
}  // namespace imuscope
