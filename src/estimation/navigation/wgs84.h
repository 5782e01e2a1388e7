#pragma once

/// The Earth as navigation needs it: WGS-84 ellipsoid, its radii of curvature, geodetic and Earth-fixed
/// coordinates, metric offsets. Source: NIMA TR8350.2, third edition, amendment 1 (2000).
/// All functions are pure, thread-safe and do not allocate. Latitudes within +-89.9 deg.

#include <Eigen/Core>

#include "base/wgs84_ellipsoid.h"

namespace imuscope {

/// Angular velocity of the Earth relative to inertial space, TR8350.2 table 3.1.
inline constexpr double kEarthRate_radps = 7.292115e-5;

/// A point relative to the ellipsoid.
struct GeodeticPosition {
  double latitude_rad = 0.0;
  double longitude_rad = 0.0;
  double height_m = 0.0;  ///< above the ellipsoid
};

/// Whether a vehicle can be there: a latitude that exists, a longitude within a turn, and a height between
/// the deepest sea and the edge of space. False for what is no number.
[[nodiscard]] bool is_on_earth(const GeodeticPosition& position) noexcept;

/// Radii of curvature of the ellipsoid at one latitude, with their derivatives; without the height.
struct Curvature {
  double meridian_m;          ///< R_M, north-south
  double transverse_m;        ///< R_N, east-west
  double meridian_slope_m;    ///< dR_M/dL, per rad
  double transverse_slope_m;  ///< dR_N/dL, per rad
};
[[nodiscard]] Curvature curvature_at(double latitude_rad) noexcept;
/// The same where sine and cosine of the latitude are at hand.
[[nodiscard]] Curvature curvature_of(double sin_latitude, double cos_latitude) noexcept;

/// Earth-fixed Cartesian coordinates, m (N-6).
[[nodiscard]] Eigen::Vector3d ecef_from_geodetic(const GeodeticPosition& position) noexcept;

/// Inverse of ecef_from_geodetic to better than 1 micrometre for heights of -10 km to 1000 km.
[[nodiscard]] GeodeticPosition geodetic_from_ecef(const Eigen::Vector3d& r_e_m) noexcept;

/// C_n_e: local north-east-down to Earth-fixed axes (N-7).
[[nodiscard]] Eigen::Matrix3d rotation_ned_to_ecef(double latitude_rad, double longitude_rad) noexcept;

/// Straight-line vector from `origin` to `point`, resolved in the NED axes of `origin`, m. Any distance.
[[nodiscard]] Eigen::Vector3d ned_offset(const GeodeticPosition& origin,
                                         const GeodeticPosition& point) noexcept;

/// Point whose ned_offset() from `origin` is `offset_n_m`.
[[nodiscard]] GeodeticPosition displaced(const GeodeticPosition& origin,
                                         const Eigen::Vector3d& offset_n_m) noexcept;

/// Earth rate in NED, rad/s.
[[nodiscard]] Eigen::Vector3d earth_rate_n(double latitude_rad) noexcept;

}  // namespace imuscope
