#pragma once

/// Checksums of a capture: of each record in seals, of a whole file in its index.

#include <cstddef>
#include <cstdint>
#include <imuscope/capture_index_t.hpp>
#include <imuscope/capture_seal_t.hpp>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "capture/event_log.h"

namespace imuscope {

/// CRC-32, the one of zlib, of what came before and these bytes.
[[nodiscard]] std::uint32_t crc32_of(std::span<const std::uint8_t> bytes, std::uint32_t before = 0) noexcept;

/// CRC-32 of a record as it stands in the file.
[[nodiscard]] std::uint32_t crc32_of(const LogEventView& event);

/// Their channels are PREFIX_SEAL and PREFIX_INDEX.
inline constexpr std::string_view kSealKind = "SEAL";
inline constexpr std::string_view kIndexKind = "INDEX";

/// Of a file being written: what is to be sealed, and what its index will say. Thread: one.
class Sealer {
 public:
  /// @param record  as it will stand in the file
  void add(std::int64_t number, std::int64_t utime, std::span<const std::uint8_t> record);
  [[nodiscard]] bool has_unsealed() const noexcept { return !checksums_.empty(); }
  /// Of what was added since the last one.
  [[nodiscard]] std::vector<std::uint8_t> seal();
  /// Bytes that did, whole records.
  void written(std::span<const std::uint8_t> bytes, std::uint64_t records);
  /// Of the file as it was written so far.
  [[nodiscard]] std::vector<std::uint8_t> index(std::int64_t file_number) const;
  [[nodiscard]] std::int64_t utime() const noexcept { return utime_; }

 private:
  std::int64_t first_number_ = 0;
  std::vector<std::int32_t> checksums_;
  std::int64_t seals_ = 0;
  std::int64_t utime_ = 0;
  std::int64_t n_bytes_ = 0;
  std::int64_t n_records_ = 0;
  std::uint32_t file_checksum_ = 0;
  std::vector<std::int64_t> offsets_;
  std::vector<std::int64_t> utimes_;
};

/// The seal or index that a message is, where it is one and undamaged.
[[nodiscard]] std::optional<capture_seal_t> decode_seal(std::span<const std::uint8_t> message);
[[nodiscard]] std::optional<capture_index_t> decode_index(std::span<const std::uint8_t> message);

/// Whether a record claims to be a seal or an index, by its message or its channel.
[[nodiscard]] bool is_seal_or_index(const LogEventView& event);
/// Of device bytes, as nearly all are: told by one look, and neither of the two.
[[nodiscard]] bool is_surely_no_seal(const LogEventView& event);

}  // namespace imuscope
