#pragma once

/// Reads raw dumps: X.bin holds the bytes of one device one after another; X.arrivals.csv beside it, where
/// there is one, says which bytes came in one read, and when.

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <utility>

#include "base/result.h"
#include "base/time.h"
#include "capture/file_window.h"

namespace imuscope {

/// Iterates over the reads of a dump in order. Thread: one, non-real-time.
///
/// The columns of X.arrivals.csv are byte_offset, n_bytes, arrival_ns (CLOCK_MONOTONIC); its reads cover the
/// dump without gaps and their arrivals never go back. A dump without it is given in blocks of arbitrary size
/// and no arrival: the times have to come from the bytes themselves.
class RawDump {
 public:
  /// What one read of the device gave; without an arrivals file a block of arbitrary size, without arrival.
  struct Read {
    std::optional<HostTime> arrival;
    std::span<const std::uint8_t> bytes;  ///< valid until the next call
  };

  /// Whether the arrivals file is read to its end before the first read is given. One that this program has
  /// checked before need not be checked again.
  enum class Arrivals : std::uint8_t { kToCheck, kChecked };

  /// Errors name file and line, what is wrong and what is expected.
  /// An arrivals file that speaks of more bytes than the dump has (both were cut off by a kill) is no error:
  /// the dump ends where its bytes end.
  static Result<RawDump> open(const std::filesystem::path& path, Arrivals arrivals = Arrivals::kToCheck);

  /// The next read; nothing at the end.
  [[nodiscard]] std::optional<Read> next();

  [[nodiscard]] bool has_arrivals() const noexcept { return arrivals_.has_value(); }

  /// The file that may stand beside a dump: mtx1.bin has mtx1.arrivals.csv.
  static std::filesystem::path arrivals_path(const std::filesystem::path& dump);

 private:
  struct Arrival {
    std::uint64_t n_bytes;  ///< still to be given
    HostTime arrival;
  };
  RawDump(FileWindow bytes, std::optional<FileWindow> arrivals)
      : bytes_(std::move(bytes)), arrivals_(std::move(arrivals)) {}
  static Result<void> check_arrivals(const std::filesystem::path& path, std::uint64_t dump_bytes);
  bool next_arrival();

  FileWindow bytes_;
  std::optional<FileWindow> arrivals_;  ///< read along with the dump: of ten hours they are many
  Arrival current_{};
  std::string line_;
  std::size_t given_ = 0;  ///< bytes of the last read
};

}  // namespace imuscope
