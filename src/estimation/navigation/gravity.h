#pragma once

/// Normal gravity of WGS-84: Somigliana's closed formula on the ellipsoid and the second-order height
/// expansion (NIMA TR8350.2, equations 4-1 and 4-3), N-8. Points along +down in NED; the deflection from the
/// ellipsoid normal with height (below 0.01 mGal per metre) is left out. Heights -1 km to 20 km.

namespace imuscope {

struct Gravity {
  double g_mps2;               ///< downwards
  double latitude_slope_mps2;  ///< dg/dL, per rad
  double height_slope_per_s2;  ///< dg/dh, (m/s^2)/m, negative
};

[[nodiscard]] Gravity normal_gravity(double latitude_rad, double height_m) noexcept;
/// The same where sine and cosine of the latitude are at hand.
[[nodiscard]] Gravity normal_gravity_of(double sin_latitude, double cos_latitude, double height_m) noexcept;

}  // namespace imuscope
