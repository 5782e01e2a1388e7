#pragma once

/// The Earth of the simulator: WGS-84 ellipsoid, rotation and normal gravity. Written from the definitions,
/// not from imuscope's own navigation library, so that an error in one shows as a difference between the two.
/// Source: NIMA TR8350.2, 3rd edition.

#include <Eigen/Core>

namespace imusim {

inline constexpr double kEarthSemiMajor_m = 6378137.0;
inline constexpr double kEarthFlattening = 1.0 / 298.257223563;
inline constexpr double kEarthEccentricity2 = kEarthFlattening * (2.0 - kEarthFlattening);
inline constexpr double kEarthRate_radps = 7.292115e-5;

/// Radii of curvature at a latitude, and their derivatives by latitude.
struct EarthRadii {
  double meridian_m;
  double transverse_m;
  double meridian_per_rad_m;
  double transverse_per_rad_m;
};
EarthRadii earth_radii(double latitude_rad);

/// Normal gravity, downwards, m/s^2: Somigliana's formula (TR8350.2 eq. 4-1) continued to the height above
/// the ellipsoid to second order (eq. 4-3).
double normal_gravity_mps2(double latitude_rad, double height_m);

/// A place on or near the Earth.
struct GeodeticPosition {
  double latitude_rad;
  double longitude_rad;
  double height_m;  ///< above the ellipsoid
};

/// Cartesian Earth-fixed coordinates, m.
Eigen::Vector3d ecef_from_geodetic(const GeodeticPosition& position);

/// Rotates north-east-down to Earth-fixed axes.
Eigen::Matrix3d C_n_e_at(const GeodeticPosition& position);

/// The place at a small displacement (north, east, down; below 100 m) of another, to below a micrometre for a
/// few metres.
GeodeticPosition displaced(const GeodeticPosition& position, const Eigen::Vector3d& displacement_n_m);

}  // namespace imusim
