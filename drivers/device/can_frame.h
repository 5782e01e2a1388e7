#pragma once

/// One frame of a CAN bus, classic or FD, and its form as bytes: the form in which frames travel from a
/// socket or a log to a decoder and into the capture, so that a CAN device is a device like any other.
///
/// A read of a CAN device holds whole records, one per frame, oldest first. A record, least significant byte
/// first:
///
///     offset 0  u32   identifier; bit 31: of 29 bits, bit 30: remote frame, bit 29: error frame
///            4  u8    length of the data
///            5  u8    bit 0: bit rate switched, bit 1: error state of the sender, bit 2: CAN FD
///            6  u8    raw DLC 9..15 of a classic frame with 8 bytes, otherwise 0
///            7  u8    0
///            8  i64   receive time, ns
///           16  u8[]  the data; none in a remote frame
///
/// The first 8 bytes are those of the kernel's struct canfd_frame.

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "base/time.h"

namespace imuscope {

inline constexpr std::size_t kCanMaxData = 64;
inline constexpr std::size_t kCanRecordHeaderBytes = 16;
inline constexpr std::size_t kCanRecordMaxBytes = kCanRecordHeaderBytes + kCanMaxData;
inline constexpr std::uint32_t kCanStandardIdMax = 0x7FF;
inline constexpr std::uint32_t kCanExtendedIdMax = 0x1FFF'FFFF;

struct CanFrame {
  std::uint32_t id = 0;             ///< 11 or 29 bits, without flags; the error classes of an error frame
  bool is_extended = false;         ///< the identifier has 29 bits
  bool is_remote = false;           ///< asks for data, holds none; length says how much is asked for
  bool is_error = false;            ///< made by the kernel: id and data say what is wrong with the bus
  bool is_fd = false;               ///< CAN FD: up to 64 bytes
  bool bit_rate_switched = false;   ///< FD only
  bool sender_error_state = false;  ///< FD only: the sender is error passive
  std::uint8_t length = 0;          ///< bytes of data
  std::uint8_t raw_dlc = 0;         ///< 9..15 where a classic frame of 8 bytes came with such a DLC
  HostTime stamp{};                 ///< received, as the kernel or the interface stamped it
  std::array<std::uint8_t, kCanMaxData> data{};

  [[nodiscard]] std::span<const std::uint8_t> payload() const noexcept {
    return {data.data(), is_remote ? 0U : length};
  }
};

/// Which frames a decoder understands: what a socket asks the kernel to let through.
struct CanId {
  std::uint32_t id = 0;
  bool is_extended = false;
  friend constexpr bool operator==(const CanId&, const CanId&) noexcept = default;
};

/// Whether a frame of this kind can have this length: 0..8, FD also 12, 16, 20, 24, 32, 48, 64. (A virtual
/// bus passes any.)
[[nodiscard]] bool is_can_length(std::size_t length, bool fd) noexcept;

/// Appends the record of a frame at the beginning of `out`, which has room for it.
/// @return bytes written
/// Core: no allocation.
std::size_t write_can_record(const CanFrame& frame, std::span<std::uint8_t> out) noexcept;

/// Walks over the records of one read. Core: no allocation.
class CanFrameReader {
 public:
  explicit CanFrameReader(std::span<const std::uint8_t> bytes) noexcept : rest_(bytes) {}

  /// Fetches the next frame. False at the end, and where what is left is no record (see bytes_skipped()).
  [[nodiscard]] bool next(CanFrame& frame) noexcept;

  /// Bytes at the end of a read that are no whole record: a damaged capture. 0 until next() returned false.
  [[nodiscard]] std::size_t bytes_skipped() const noexcept { return bytes_skipped_; }

 private:
  std::span<const std::uint8_t> rest_;
  std::size_t bytes_skipped_ = 0;
};

}  // namespace imuscope
