#pragma once

/// Finds telegrams ("IX") and answers ("AN") in a byte stream. The checksum is the only proof of a frame;
/// after a false start the search goes on at the byte after it, so that no good frame inside garbage is
/// lost. Core: bounded memory, no allocation, noexcept.

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "base/time.h"
#include "drivers/device/scan_loop.h"
#include "drivers/ixblue_stdbin/wire.h"

namespace imuscope::ixblue_stdbin {

/// One telegram or answer with a right checksum; its span points into the scanner's buffer.
struct Frame {
  enum class Kind : std::uint8_t { kTelegram, kAnswer };
  Kind kind = Kind::kTelegram;
  std::span<const std::uint8_t> bytes;  ///< whole frame; valid until the next append()
  std::uint64_t offset = 0;             ///< of its first byte in the stream
  HostTime first_byte{};                ///< when its first byte arrived at the latest
};

class Scanner {
 public:
  /// @param per_byte  time of one byte on the wire, zero for a network stream
  explicit Scanner(Duration per_byte = Duration::zero()) noexcept : loop_(per_byte) {}

  /// Time of one byte on the wire, see DeviceDecoder::set_per_byte().
  [[nodiscard]] Duration per_byte() const noexcept { return loop_.per_byte(); }
  void set_per_byte(Duration per_byte) noexcept { loop_.set_per_byte(per_byte); }

  /// Takes as many bytes as fit; see FrameBuffer::append(). Drain next() after every call.
  std::size_t append(std::span<const std::uint8_t> bytes, HostTime arrival) noexcept {
    return loop_.append(bytes, arrival);
  }

  /// The next frame, or false where more bytes are needed.
  /// @param at_end  no more bytes will come: look for frames after a start that announced more
  [[nodiscard]] bool next(Frame& frame, bool at_end = false) noexcept;

  [[nodiscard]] const ScanCounters& counters() const noexcept { return loop_.counters(); }
  /// Headers of a later protocol version than this code reads.
  [[nodiscard]] std::uint64_t unsupported_versions() const noexcept { return unsupported_versions_; }

 private:
  [[nodiscard]] Examined examine(std::span<const std::uint8_t> pending) noexcept;
  [[nodiscard]] Examined examine_telegram(std::span<const std::uint8_t> pending) noexcept;

  ScanLoop<2 * kTelegramMax> loop_;
  std::uint64_t unsupported_versions_ = 0;
  /// Masks and sizes of the last telegram that was taken: the next one's are the same, as a rule.
  std::array<std::uint8_t, kSizesEnd> possible_{};
};

}  // namespace imuscope::ixblue_stdbin
