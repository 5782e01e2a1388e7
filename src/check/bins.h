#pragma once

/// Tracks as means over tenths of a second, which devices of different rates can be compared by.

#include <Eigen/Core>
#include <vector>

#include "check/tracks.h"

namespace imuscope::check {

inline constexpr double kBin_s = 0.1;

/// Bin k is of the times from (first + k) to (first + k + 1) tenths of a second.
struct ImuBins {
  std::int64_t first = 0;
  std::vector<Eigen::Vector3d> omega_radps;
  std::vector<Eigen::Vector3d> f_mps2;
  std::vector<bool> valid;
  [[nodiscard]] bool has(std::int64_t bin) const {
    return bin >= first && bin < first + static_cast<std::int64_t>(valid.size()) && valid[index(bin)];
  }
  [[nodiscard]] std::size_t index(std::int64_t bin) const { return static_cast<std::size_t>(bin - first); }
};

/// Rate that a sensor shows most of the time: its offset, as a vehicle goes straight on or stands. It turns with
/// the sensor's axes as every rate does, so that what is left of two sensors can still be compared.
[[nodiscard]] Eigen::Vector3f usual_rate(const ImuTrack& track);
/// The same, or nothing where it is small.
[[nodiscard]] Eigen::Vector3f plain_offset(const ImuTrack& track);

/// Means over bins, then over `width` (odd) of them, so that nothing is delayed.
[[nodiscard]] ImuBins bins_of(const ImuTrack& track, int width);

/// The motion over ground that positions tell: v and a of a parabola through those around each bin.
struct GnssMotion {
  std::int64_t first = 0;
  std::vector<double> speed_mps;
  std::vector<double> forward_mps2;  ///< acceleration along the course
  std::vector<double> right_mps2;    ///< and across it, to the right
  std::vector<bool> valid;           ///< moves fast enough to have a course
  double half_window_s = 0.0;
};

[[nodiscard]] GnssMotion motion_of(const GnssTrack& track);

}  // namespace imuscope::check
