#pragma once

/// Earth-centred (ECEF) and geodetic coordinates, for receivers that send either and for the navigation. Pure
/// functions: any thread, no allocation.

#include <array>

namespace imuscope {

/// A place in WGS-84 geodetic coordinates.
struct Geodetic {
  double lat_rad;
  double lon_rad;
  double height_m;  ///< above the WGS-84 ellipsoid
};

/// WGS-84. Right to 1e-9 m and 1e-15 rad or so from 10 km below the ellipsoid to 10 000 km above it.
[[nodiscard]] Geodetic geodetic_of(const std::array<double, 3>& xyz_ecef_m) noexcept;

/// The other way round.
[[nodiscard]] std::array<double, 3> ecef_of(const Geodetic& at) noexcept;

/// Rows: north, east, down in ECEF components; rotates ECEF to the local frame at a place.
[[nodiscard]] std::array<double, 9> rotation_ecef_to_ned(const Geodetic& at) noexcept;

/// A vector of ECEF components to north-east-down at a place.
[[nodiscard]] std::array<double, 3> ned_of(const std::array<double, 3>& v_ecef, const Geodetic& at) noexcept;

}  // namespace imuscope
