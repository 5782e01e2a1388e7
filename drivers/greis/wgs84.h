#pragma once

/// Earth-centred coordinates to geodetic ones, for receivers that send only the former.

#include <array>

namespace imuscope::greis {

struct Geodetic {
  double lat_rad;
  double lon_rad;
  double height_m;  ///< above the WGS-84 ellipsoid
};

/// WGS-84. Right to 1e-9 m and 1e-15 rad or so from 10 km below the ellipsoid to 10 000 km above it.
[[nodiscard]] Geodetic geodetic_of(const std::array<double, 3>& xyz_ecef_m) noexcept;

/// A vector of ECEF components to north-east-down at a place.
[[nodiscard]] std::array<double, 3> ned_of(const std::array<double, 3>& v_ecef, const Geodetic& at) noexcept;

}  // namespace imuscope::greis
