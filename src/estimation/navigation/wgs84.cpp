#include "estimation/navigation/wgs84.h"

#include <cmath>
#include <numbers>

namespace imuscope {

namespace {
constexpr double kE2 = kWgs84EccentricitySquared;
constexpr double kSemiMinorAxis_m = kWgs84SemiMajorAxis_m * (1.0 - kWgs84Flattening);
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
  const double radius = curvature_at(position.latitude_rad).transverse_m;
  const double s = std::sin(position.latitude_rad);
  const double from_axis = (radius + position.height_m) * std::cos(position.latitude_rad);
  return {from_axis * std::cos(position.longitude_rad), from_axis * std::sin(position.longitude_rad),
          (radius * (1.0 - kE2) + position.height_m) * s};
}

// Bowring's closed start for the reduced latitude, repeated until it no longer moves: twice is enough up to
// 1000 km of height.
GeodeticPosition geodetic_from_ecef(const Eigen::Vector3d& r_e_m) noexcept {
  constexpr int kRepeats = 3;
  constexpr double kSecondEccentricitySquared = kE2 / (1.0 - kE2);
  const double from_axis = std::hypot(r_e_m.x(), r_e_m.y());
  double reduced = std::atan2(r_e_m.z(), from_axis * (1.0 - kWgs84Flattening));
  double latitude = 0.0;
  for (int i = 0; i < kRepeats; ++i) {
    const double s = std::sin(reduced);
    const double c = std::cos(reduced);
    latitude = std::atan2(r_e_m.z() + kSecondEccentricitySquared * kSemiMinorAxis_m * s * s * s,
                          from_axis - kE2 * kWgs84SemiMajorAxis_m * c * c * c);
    reduced = std::atan2((1.0 - kWgs84Flattening) * std::sin(latitude), std::cos(latitude));
  }
  const double s = std::sin(latitude);
  const double w = std::sqrt(1.0 - kE2 * s * s);
  // Well conditioned at any latitude, unlike a division by the cosine.
  const double height = from_axis * std::cos(latitude) + r_e_m.z() * s - kWgs84SemiMajorAxis_m * w;
  return {latitude, std::atan2(r_e_m.y(), r_e_m.x()), height};
}

// N-7
Eigen::Matrix3d rotation_ned_to_ecef(double latitude_rad, double longitude_rad) noexcept {
  const double sl = std::sin(latitude_rad);
  const double cl = std::cos(latitude_rad);
  const double so = std::sin(longitude_rad);
  const double co = std::cos(longitude_rad);
  Eigen::Matrix3d C_n_e;
  C_n_e << -sl * co, -so, -cl * co,  //
      -sl * so, co, -cl * so,        //
      cl, 0.0, -sl;
  return C_n_e;
}

Eigen::Vector3d ned_offset(const GeodeticPosition& origin, const GeodeticPosition& point) noexcept {
  return rotation_ned_to_ecef(origin.latitude_rad, origin.longitude_rad).transpose() *
         (ecef_from_geodetic(point) - ecef_from_geodetic(origin));
}

GeodeticPosition displaced(const GeodeticPosition& origin, const Eigen::Vector3d& offset_n_m) noexcept {
  return geodetic_from_ecef(ecef_from_geodetic(origin) +
                            rotation_ned_to_ecef(origin.latitude_rad, origin.longitude_rad) * offset_n_m);
}

Eigen::Vector3d earth_rate_n(double latitude_rad) noexcept {
  return {kEarthRate_radps * std::cos(latitude_rad), 0.0, -kEarthRate_radps * std::sin(latitude_rad)};
}

// N-9
Eigen::Vector3d transport_rate_n(const GeodeticPosition& position, const Eigen::Vector3d& v_n_mps) noexcept {
  const Curvature k = curvature_at(position.latitude_rad);
  const double M = k.meridian_m + position.height_m;
  const double N = k.transverse_m + position.height_m;
  return {v_n_mps.y() / N, -v_n_mps.x() / M, -v_n_mps.y() * std::tan(position.latitude_rad) / N};
}

}  // namespace imuscope
