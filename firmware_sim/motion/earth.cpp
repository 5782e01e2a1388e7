#include "firmware_sim/motion/earth.h"

#include <cmath>

namespace imusim {
namespace {

// TR8350.2 tables 3.1 to 3.4.
constexpr double kGravityEquator_mps2 = 9.7803253359;
constexpr double kSomigliana = 0.00193185265241;
constexpr double kCentrifugalRatio = 0.00344978650684;  // omega^2 a^2 b / GM

}  // namespace

EarthRadii earth_radii(double latitude_rad) {
  const double sine = std::sin(latitude_rad);
  const double cosine = std::cos(latitude_rad);
  const double w2 = 1.0 - kEarthEccentricity2 * sine * sine;
  const double w = std::sqrt(w2);
  const double transverse = kEarthSemiMajor_m / w;
  const double meridian = transverse * (1.0 - kEarthEccentricity2) / w2;
  const double slope = kEarthEccentricity2 * sine * cosine / w2;  // d ln(transverse) / d latitude
  return {meridian, transverse, 3.0 * meridian * slope, transverse * slope};
}

double normal_gravity_mps2(double latitude_rad, double height_m) {
  const double sine2 = std::sin(latitude_rad) * std::sin(latitude_rad);
  const double surface =
      kGravityEquator_mps2 * (1.0 + kSomigliana * sine2) / std::sqrt(1.0 - kEarthEccentricity2 * sine2);
  const double x = height_m / kEarthSemiMajor_m;
  const double linear = 1.0 + kEarthFlattening + kCentrifugalRatio - 2.0 * kEarthFlattening * sine2;
  return surface * (1.0 - 2.0 * linear * x + 3.0 * x * x);
}

Eigen::Vector3d ecef_from_geodetic(const GeodeticPosition& position) {
  const double transverse = earth_radii(position.latitude_rad).transverse_m;
  const double horizontal = (transverse + position.height_m) * std::cos(position.latitude_rad);
  return {horizontal * std::cos(position.longitude_rad), horizontal * std::sin(position.longitude_rad),
          (transverse * (1.0 - kEarthEccentricity2) + position.height_m) * std::sin(position.latitude_rad)};
}

Eigen::Matrix3d C_n_e_at(const GeodeticPosition& position) {
  const double sin_lat = std::sin(position.latitude_rad);
  const double cos_lat = std::cos(position.latitude_rad);
  const double sin_lon = std::sin(position.longitude_rad);
  const double cos_lon = std::cos(position.longitude_rad);
  Eigen::Matrix3d C_n_e;
  C_n_e << -sin_lat * cos_lon, -sin_lon, -cos_lat * cos_lon,  //
      -sin_lat * sin_lon, cos_lon, -cos_lat * sin_lon,        //
      cos_lat, 0.0, -sin_lat;
  return C_n_e;
}

// First order along the curvature, plus the two second-order terms of a step on the ellipsoid: the height
// that a tangent gains and the latitude that an eastward tangent loses. What is left is of third order
// (metres cubed over the Earth's radius squared).
GeodeticPosition displaced(const GeodeticPosition& position, const Eigen::Vector3d& displacement_n_m) {
  const EarthRadii radii = earth_radii(position.latitude_rad);
  const double meridian = radii.meridian_m + position.height_m;
  const double transverse = radii.transverse_m + position.height_m;
  const double tangent = std::tan(position.latitude_rad);
  const double north = displacement_n_m.x();
  const double east = displacement_n_m.y();
  const double down = displacement_n_m.z();
  const double north_angle =
      north / (meridian - down) - 0.5 * east * east * tangent / (transverse * meridian);
  const double east_angle = east / (transverse - down) * (1.0 + north * tangent / transverse);
  return {position.latitude_rad + north_angle,
          position.longitude_rad + east_angle / std::cos(position.latitude_rad),
          position.height_m - down + 0.5 * (north * north / meridian + east * east / transverse)};
}

}  // namespace imusim
