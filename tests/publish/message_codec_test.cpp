/// Bytes from a network or a file that claim to be messages.

#include "publish/message_codec.h"

#include <gtest/gtest.h>
#include <sys/resource.h>
#include <imuscope/raw_t.hpp>
#include <imuscope/status_t.hpp>

#include "example_messages.h"

namespace imuscope {
namespace {

/// Most memory that this process has ever held.
long peak_kilobytes() {
  rusage usage{};
  EXPECT_EQ(::getrusage(RUSAGE_SELF, &usage), 0);
  return usage.ru_maxrss;
}

raw_t raw_of(std::size_t n_bytes) {
  raw_t raw{};
  raw.device = "mtx1";
  raw.bytes.assign(n_bytes, 0x55);
  raw.n_bytes = static_cast<std::int32_t>(n_bytes);
  return raw;
}

/// Overwrites the count in front of the payload, which ends the message.
std::vector<std::uint8_t> with_count(std::size_t n_bytes, std::uint32_t claimed) {
  std::vector<std::uint8_t> message = encode_message(raw_of(n_bytes));
  const std::size_t count_at = message.size() - n_bytes - 4;
  for (std::size_t i = 0; i < 4; ++i)
    message[count_at + i] = static_cast<std::uint8_t>(claimed >> (24 - 8 * i));
  return message;
}

TEST(MessageCodec, AClaimedLengthTakesNoMemoryThatTheMessageCannotFill) {
  constexpr std::uint32_t kTwoGigabytes = 0x7FFFFFFF;
  constexpr std::uint32_t kNegative = 0x80000000;
  constexpr long kSmall_kB = 64L * 1024;
  const long before_kB = peak_kilobytes();
  EXPECT_TRUE(decode_message<raw_t>(with_count(77, 77)).has_value());
  EXPECT_FALSE(decode_message<raw_t>(with_count(77, 78)).has_value());
  EXPECT_FALSE(decode_message<raw_t>(with_count(77, 76)).has_value())
      << "a byte too many is no such message either";
  EXPECT_FALSE(decode_message<raw_t>(with_count(77, kTwoGigabytes)).has_value());
  EXPECT_FALSE(decode_message<raw_t>(with_count(77, kNegative)).has_value());
  EXPECT_LT(peak_kilobytes() - before_kB, kSmall_kB);
}

TEST(MessageCodec, AStringHasAtLeastItsZero) {
  constexpr std::size_t kNameLengthAt = 24;  // after fingerprint, utime and sequence
  const std::vector<std::uint8_t> message = encode_message(raw_of(0));
  ASSERT_EQ(message[kNameLengthAt + 3], std::string("mtx1").size() + 1);
  for (const unsigned sign : {0x00U, 0x80U, 0xFFU}) {  // 0, the least number there is, one of the negative
    std::vector<std::uint8_t> hostile = message;
    hostile[kNameLengthAt] = static_cast<std::uint8_t>(sign);
    hostile[kNameLengthAt + 3] = 0;
    EXPECT_FALSE(decode_message<raw_t>(hostile).has_value()) << sign;
  }
}

TEST(MessageCodec, AnyFieldOfAStatusMayClaimTheMost) {
  constexpr long kSmall_kB = 64L * 1024;
  const std::vector<std::uint8_t> message = encode_message(test::example_status());
  ASSERT_TRUE(decode_message<status_t>(message).has_value());
  const long before_kB = peak_kilobytes();
  constexpr std::size_t kFingerprint = 8;
  for (std::size_t at = kFingerprint; at + 4 <= message.size(); ++at) {
    std::vector<std::uint8_t> hostile = message;
    const std::vector<std::uint8_t> claim = {0x01, 0xFF, 0xFF,
                                             0xFF};  // 33 million of whatever is counted here
    std::copy(claim.begin(), claim.end(), hostile.begin() + static_cast<std::ptrdiff_t>(at));
    (void)decode_message<status_t>(hostile);
  }
  EXPECT_LT(peak_kilobytes() - before_kB, kSmall_kB);
}

}  // namespace
}  // namespace imuscope
