#pragma once

/// The heading of a level frame of arbitrary heading (frame a), by least squares between the changes of
/// velocity that an IMU felt in it and those that GNSS positions show in NED. EQUATIONS.md N-43 to N-46.
/// Core: no allocation, noexcept, thread-safe.

#include <Eigen/Core>
#include <span>

namespace imuscope {

/// One window of three GNSS epochs: the mean velocity of its second half minus that of its first half,
/// horizontal. In this difference the unknown velocity has gone and noise is divided by seconds.
struct VelocityChange {
  Eigen::Vector2d felt_a_mps = Eigen::Vector2d::Zero();  ///< from the IMU, in frame a
  Eigen::Vector2d seen_n_mps = Eigen::Vector2d::Zero();  ///< from GNSS, north and east
  double half_span_s = 0.0;  ///< a constant acceleration error of 1 m/s^2 changes felt_a by this
  double age_s = 0.0;        ///< of the window's middle, at the instant the heading is asked for
  double sd_mps = 0.0;       ///< of seen_n from the receiver's sd
};

/// What else than the noise of GNSS makes felt and seen differ, and how much the windows repeat one another;
/// all above zero.
struct HeadingPriors {
  double gyro_bias_sd_radps = 0.0;    ///< of the vertical gyro bias that is left after the rest
  double acceleration_sd_mps2 = 0.0;  ///< of the constant error from tilt and accelerometer bias
  double window_overlap = 1.0;        ///< windows that share most of their data; inflates the sd
};

/// The heading of frame a with what was found beside it; `scale` far from 1 says that felt and seen are not
/// the same motion.
struct HeadingSolution {
  double heading_rad = 0.0;  ///< of frame a's first axis, clockwise from north, at age 0
  double sd_rad = 0.0;
  Eigen::Vector2d acceleration_error_a_mps2 = Eigen::Vector2d::Zero();  ///< to add to what was felt
  double acceleration_error_sd_mps2 = 0.0;
  double scale = 0.0;         ///< of a fit with free scale: 1 where felt and seen are the same motion
  double weight_share = 0.0;  ///< of the windows, after outliers have lost theirs
};

/// @return false where the windows are too few or show too little change to tell anything
[[nodiscard]] bool solve_heading(std::span<const VelocityChange> windows, const HeadingPriors& priors,
                                 HeadingSolution& out) noexcept;

}  // namespace imuscope
