#pragma once

/// How quiet the reference's gyros are: its class, where nobody named it (B-21a).

#include <Eigen/Core>
#include <vector>

namespace imuscope::batch {

/// The angle random walk that the reference's gyros have at most, rad/sqrt(s): what they show in the band from 1 to
/// 7 Hz where they show least, in the quietest fiftieth of windows of five seconds: a stop at a traffic light holds one.
/// Windows and band are chosen by the lower half of its frequencies and read in the upper one: noise that was chosen for
/// being small would be taken for less than it is. Infinite where no window is free of gaps.
/// @param omega_radps  one row per instant of the grid
/// @param valid        per instant
[[nodiscard]] double quietest_gyro_white_radps_per_sqrt_hz(
    const Eigen::Ref<const Eigen::Matrix<double, Eigen::Dynamic, 3>, 0, Eigen::OuterStride<>>& omega_radps,
    const std::vector<char>& valid);

}  // namespace imuscope::batch
