#pragma once

/// Samples, counts and conversations as text, for answers that are held whole (tests/support/recorded_answer.h). Real
/// numbers have twelve digits; times are whole nanoseconds in groups of three digits, so that the share of a number that
/// a comparison lets pass does not swallow them.

#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "drivers/device/device.h"
#include "sample/sample.h"
#include "tests/drivers/support/streams.h"

namespace imuscope::test {

/// What sample_text() writes may differ by this share: one unit of its last digits.
inline constexpr double kSampleShare = 1e-9;

/// "-1_002_000"
std::string in_groups(std::int64_t number);
std::string real_text(double value, int digits = 12);
/// Twelve digits each.
std::string real_text(std::span<const double> values);
/// Two digits a byte, and a blank before each: no run of digits is one number to whoever compares.
std::string hex_text(std::span<const std::uint8_t> bytes);

/// One line, every field.
std::string sample_text(const Sample& sample);
/// One line, the counts that are not zero.
std::string counts_text(const DecoderCounters& counters);

/// Hands `bytes` over in reads of `read_size`, `apart` from one another from `begin` on, and ends the stream: all
/// samples, the counts and the remark.
std::string decoded_text(DeviceDecoder& decoder, std::span<const std::uint8_t> bytes, std::size_t read_size,
                         HostTime begin, Duration apart);

/// Sums of what the samples of each kind hold, weighted by their place: one line that tells whether any number moved.
std::string sums_text(std::span<const Sample> samples);

/// What became of a stream with damage at each place: lines where it differs from that of the place before. What came of
/// another place already is named by that.
/// @param damage  makes the stream with damage at a place
/// @param decode  a whole stream, to a line
template <typename Damage, typename Decode>
std::string at_every_place(std::size_t places, Damage&& damage, Decode&& decode) {
  std::string text;
  std::map<std::string, std::size_t> first_at;
  std::size_t before = places;
  for (std::size_t at = 0; at < places; ++at) {
    const auto [same, is_new] = first_at.emplace(decode(damage(at)), at);
    if (is_new) {
      text += std::to_string(at) + ": " + same->first + '\n';
    } else if (same->second != before) {
      text += std::to_string(at) + " as " + std::to_string(same->second) + '\n';
    }
    before = same->second;
  }
  return text;
}

/// All of a stream in one read at `begin`, to its end: sums and counts.
std::string outcome_text(DeviceDecoder& decoder, std::span<const std::uint8_t> bytes, HostTime begin);

/// What a session says and what is told of it, step by step: lines where something changed.
class SessionDiary {
 public:
  explicit SessionDiary(DeviceSession& session) : session_(&session) {}
  /// Polls, and writes down what differs from the step before.
  /// @return what the session wants written
  Bytes step(HostTime now);
  [[nodiscard]] const std::string& text() const { return text_; }

 private:
  DeviceSession* session_;
  std::string text_;
  std::string before_;
};

/// A session that only listens, through silence, noise, good messages and their end.
std::string listening_text(const std::function<std::unique_ptr<DeviceSession>()>& make_session,
                           const Bytes& good);

}  // namespace imuscope::test
