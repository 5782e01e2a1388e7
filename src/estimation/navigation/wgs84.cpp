#include "estimation/navigation/wgs84.h"

#include <cmath>
#include <numbers>

#include "base/wgs84.h"

namespace imuscope {

namespace {
constexpr double kE2 = kWgs84EccentricitySquared;
constexpr double kDeepestSea_m = -11e3;
constexpr double kEdgeOfSpace_m = 100e3;  // as the FAI has it
}  // namespace

bool is_on_earth(const GeodeticPosition& position) noexcept {
  return std::abs(position.latitude_rad) <= 0.5 * std::numbers::pi &&
         std::abs(position.longitude_rad) <= 2.0 * std::numbers::pi && position.height_m >= kDeepestSea_m &&
         position.height_m <= kEdgeOfSpace_m;
}

// N-5
Curvature curvature_of(double sin_latitude, double cos_latitude) noexcept {
  const double s = sin_latitude;
  const double c = cos_latitude;
  const double w2 = 1.0 - kE2 * s * s;
  Curvature k;
  k.transverse_m = kWgs84SemiMajorAxis_m / std::sqrt(w2);
  k.meridian_m = k.transverse_m * (1.0 - kE2) / w2;
  k.transverse_slope_m = k.transverse_m * kE2 * s * c / w2;
  k.meridian_slope_m = 3.0 * k.meridian_m * kE2 * s * c / w2;
  return k;
}

Curvature curvature_at(double latitude_rad) noexcept {
  return curvature_of(std::sin(latitude_rad), std::cos(latitude_rad));
}

// N-6
Eigen::Vector3d ecef_from_geodetic(const GeodeticPosition& position) noexcept {
  const auto r_e_m = ecef_of({position.latitude_rad, position.longitude_rad, position.height_m});
  return Eigen::Vector3d::Map(r_e_m.data());
}

GeodeticPosition geodetic_from_ecef(const Eigen::Vector3d& r_e_m) noexcept {
  const Geodetic at = geodetic_of({r_e_m.x(), r_e_m.y(), r_e_m.z()});
  return {at.lat_rad, at.lon_rad, at.height_m};
}

// N-7
Eigen::Matrix3d rotation_ned_to_ecef(double latitude_rad, double longitude_rad) noexcept {
  const auto C_e_n = rotation_ecef_to_ned({latitude_rad, longitude_rad, 0.0});
  return Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(C_e_n.data()).transpose();
}

Eigen::Vector3d ned_offset(const GeodeticPosition& origin, const GeodeticPosition& point) noexcept {
  return rotation_ned_to_ecef(origin.latitude_rad, origin.longitude_rad).transpose() *
         (ecef_from_geodetic(point) - ecef_from_geodetic(origin));
}

GeodeticPosition displaced(const GeodeticPosition& origin, const Eigen::Vector3d& offset_n_m) noexcept {
  return geodetic_from_ecef(ecef_from_geodetic(origin) +
                            rotation_ned_to_ecef(origin.latitude_rad, origin.longitude_rad) * offset_n_m);
}

// N-9: w_ie
Eigen::Vector3d earth_rate_n(double latitude_rad) noexcept {
  return {kEarthRate_radps * std::cos(latitude_rad), 0.0, -kEarthRate_radps * std::sin(latitude_rad)};
}

}  // namespace imuscope
