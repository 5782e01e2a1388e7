#pragma once

/// The decoded samples of all devices of a recording side by side, so that one pass over a capture serves them all.
/// Non-real-time: allocates.

#include <cstddef>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "base/result.h"
#include "configuration/config.h"
#include "service/recording/decoded_reads.h"
#include "service/recording/replay.h"

namespace imuscope {

/// What one read of a device brought; the samples stay valid until the next call of next() or next_of().
struct LineRead {
  std::size_t device;
  std::span<const Sample> samples;
};

/// Thread: one.
class DecodedLines {
 public:
  /// @param is_wanted  per device of the configuration
  /// @param reading    ahead: lines that have nothing in common are decoded by a thread each
  static Result<DecodedLines> open(const Configuration& configuration, const Recording& recording,
                                   const std::vector<bool>& is_wanted, Reading reading);

  /// The read that arrived first of all that are left; where nothing is said of arrivals, one device after the other.
  /// Nothing at the end of all. After an error the others go on.
  Result<std::optional<LineRead>> next();
  /// The next read of this device; nothing at its end.
  Result<std::optional<LineRead>> next_of(std::size_t device);
  /// No more of this device is wanted.
  void leave(std::size_t device);

 private:
  struct Line {
    std::unique_ptr<DecodedReads> reads;  ///< none: not wanted, left, or at its end
    std::optional<DecodedRead> pending;
    bool is_given = false;  ///< `pending` was handed out
  };

  DecodedLines() = default;
  /// Brings the line's next read, or its end, to the front.
  Result<void> fetch(Line& line);

  std::vector<Line> lines_;
};

}  // namespace imuscope
