#pragma once

/// Between the records of a capture and their LCM messages. Any non-real-time thread.

#include <cstdint>
#include <imuscope/applied_model_t.hpp>
#include <imuscope/event_t.hpp>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "capture/records.h"

namespace imuscope {

/// A chunk as it is stored: RawChunk with the device's name.
struct RawPiece {
  RawRead read;
  std::int64_t sequence = 0;
  bool continues = false;
};

/// The same where it stands in its message, and valid as long as that.
struct RawView {
  std::string_view device;
  Direction direction = Direction::kRead;
  HostTime arrival{};
  std::optional<HostTime> received{};  ///< see RawRead
  std::span<const std::uint8_t> bytes;
  std::int64_t sequence = 0;
  bool continues = false;
};

/// An exception as it is stored: with the device's name.
struct StoredException {
  RunException exception{};
  std::string device;  ///< empty with kSkippedTicks
};

using CaptureRecord = std::variant<RunHeader, RawPiece, StoredException, applied_model_t, event_t>;

/// Maps the host's clock to the utime of records: the wall clock of the PC as it was at t0, running on with
/// the host's clock, so that a clock set during the run does not disturb it.
struct RecordClock {
  HostTime t0{};
  UtcTime t0_wall{};
  [[nodiscard]] std::int64_t utime(HostTime time) const noexcept;
  [[nodiscard]] HostTime host_time(std::int64_t utime) const noexcept;
};

/// @param file number of the file within the run
[[nodiscard]] std::vector<std::uint8_t> encode(const RunHeader& header, std::int64_t file);
[[nodiscard]] std::vector<std::uint8_t> encode(const RawChunk& chunk, const std::string& device,
                                               const RecordClock& clock);
/// @param at       when the recorder learned of it
/// @param sequence counts the exceptions of the run
[[nodiscard]] std::vector<std::uint8_t> encode(const RunException& exception, const std::string& device,
                                               HostTime at, std::int64_t sequence, const RecordClock& clock);

/// What a message of a capture says, recognised by the fingerprint of its type, not by its channel. Nothing
/// for a message of another type (a capture may hold published messages) and for one that is damaged.
[[nodiscard]] std::optional<CaptureRecord> decode_record(std::span<const std::uint8_t> message);

/// Bytes of a device, without a copy; nothing for any other message and for one that is damaged.
[[nodiscard]] std::optional<RawView> view_raw(std::span<const std::uint8_t> message) noexcept;

/// Whether a message is one of device bytes, by what it says of itself.
[[nodiscard]] bool is_raw(std::span<const std::uint8_t> message) noexcept;
/// Whose bytes it has; empty where it is no such message.
[[nodiscard]] std::string_view device_of_raw(std::span<const std::uint8_t> message) noexcept;
[[nodiscard]] RawRead to_read(const RawView& view);

}  // namespace imuscope
