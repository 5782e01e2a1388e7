#pragma once

/// How the host's clock is steered. CLOCK_MONOTONIC, by which everything is stamped, is corrected by whoever
/// sets the PC's clock: NTP changes its rate by up to 500 ppm from one moment to the next.
/// CLOCK_MONOTONIC_RAW is the same quartz, left alone. Between two changes the one is a straight line over
/// the other; this is that line, piece by piece.

#include <array>
#include <cstddef>

#include "base/time.h"

namespace imuscope {

/// Core: no allocation, noexcept. Not thread-safe; trivially copyable.
class SteeringLine {
 public:
  /// A piece begins.
  /// @param time       host time; one that is not later than the piece before is left out
  /// @param unsteered  the quartz at that instant; its origin is of no concern
  /// @param rate       of the quartz from there on, against the host's clock: its seconds in one of the
  ///                   host's, minus 1
  void observe(HostTime time, HostTime unsteered, double rate) noexcept;

  [[nodiscard]] bool is_known() const noexcept { return n_ > 0; }
  /// The quartz at any instant: shown as the host's clock was when the first piece began, and as the host's
  /// clock where nothing is known. Before the oldest of the pieces that are kept along its line.
  [[nodiscard]] HostTime unsteered(HostTime time) const noexcept;
  /// Of the newest piece.
  [[nodiscard]] double rate() const noexcept;

 private:
  struct Piece {
    HostTime time{};
    HostTime unsteered{};
    double rate = 0.0;
  };
  /// A pulse is told less than a second after it came, and rates change a few times a minute.
  static constexpr std::size_t kPieces = 8;

  std::array<Piece, kPieces> pieces_{};  ///< the newest is the (n_ - 1)th, counted around
  std::size_t n_ = 0;                    ///< that ever began
  Duration shift_{};                     ///< from the quartz's own count to what is shown
};

}  // namespace imuscope
