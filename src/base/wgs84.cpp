#include "base/wgs84.h"

#include <cmath>

#include "base/wgs84_ellipsoid.h"

namespace imuscope {
namespace {

constexpr double kSemiMajor_m = kWgs84SemiMajorAxis_m;
constexpr double kFlattening = kWgs84Flattening;
constexpr double kE2 = kWgs84EccentricitySquared;

/// Bowring's iteration gains about three digits near the ellipsoid and more than one far above it.
constexpr int kIterations = 5;

}  // namespace

// N-6: the inverse
Geodetic geodetic_of(const std::array<double, 3>& xyz_ecef_m) noexcept {
  const auto [x, y, z] = xyz_ecef_m;
  const double p = std::hypot(x, y);
  // Bowring 1976: beta is the parametric (reduced) latitude.
  double beta = std::atan2(z, (1.0 - kFlattening) * p);
  double lat = 0.0;
  for (int i = 0; i < kIterations; ++i) {
    const double sin_beta = std::sin(beta);
    const double cos_beta = std::cos(beta);
    lat = std::atan2(z + kE2 / (1.0 - kFlattening) * kSemiMajor_m * sin_beta * sin_beta * sin_beta,
                     p - kE2 * kSemiMajor_m * cos_beta * cos_beta * cos_beta);
    beta = std::atan2((1.0 - kFlattening) * std::sin(lat), std::cos(lat));
  }
  const double sin_lat = std::sin(lat);
  const double cos_lat = std::cos(lat);
  // Well conditioned at the equator and at the poles alike.
  const double height = p * cos_lat + z * sin_lat - kSemiMajor_m * std::sqrt(1.0 - kE2 * sin_lat * sin_lat);
  return {lat, std::atan2(y, x), height};
}

// N-6
std::array<double, 3> ecef_of(const Geodetic& at) noexcept {
  const double sin_lat = std::sin(at.lat_rad), cos_lat = std::cos(at.lat_rad);
  const double normal_m = kSemiMajor_m / std::sqrt(1.0 - kE2 * sin_lat * sin_lat);
  const double p_m = (normal_m + at.height_m) * cos_lat;
  return {p_m * std::cos(at.lon_rad), p_m * std::sin(at.lon_rad),
          (normal_m * (1.0 - kE2) + at.height_m) * sin_lat};
}

// N-7, transposed
std::array<double, 9> rotation_ecef_to_ned(const Geodetic& at) noexcept {
  const double sin_lat = std::sin(at.lat_rad), cos_lat = std::cos(at.lat_rad);
  const double sin_lon = std::sin(at.lon_rad), cos_lon = std::cos(at.lon_rad);
  return {-sin_lat * cos_lon,
          -sin_lat * sin_lon,
          cos_lat,  // north
          -sin_lon,
          cos_lon,
          0.0,  // east
          -cos_lat * cos_lon,
          -cos_lat * sin_lon,
          -sin_lat};  // down
}

std::array<double, 3> ned_of(const std::array<double, 3>& v_ecef, const Geodetic& at) noexcept {
  const auto c = rotation_ecef_to_ned(at);
  const auto [x, y, z] = v_ecef;
  return {c[0] * x + c[1] * y + c[2] * z, c[3] * x + c[4] * y + c[5] * z, c[6] * x + c[7] * y + c[8] * z};
}

}  // namespace imuscope
