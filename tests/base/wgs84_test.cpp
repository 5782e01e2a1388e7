// Geodetic conversion against GeographicLib, an independent implementation.
#include "base/wgs84.h"

#include <gtest/gtest.h>
#include <GeographicLib/Geocentric.hpp>
#include <cmath>
#include <random>

#include "base/units.h"

namespace imuscope {
namespace {

TEST(Wgs84, GeodeticOfEcefEqualsGeographicLibEverywhere) {
  std::mt19937_64 random(5);
  std::uniform_real_distribution<double> lat(-90.0, 90.0), lon(-180.0, 180.0), height(-1e4, 1e5);
  const auto& earth = GeographicLib::Geocentric::WGS84();
  for (int i = 0; i < 20'000; ++i) {
    // The poles, the equator and the date line come first.
    const double lat_deg = i == 0 ? 90.0 : i == 1 ? -90.0 : i == 2 ? 0.0 : lat(random);
    const double lon_deg = i == 3 ? 180.0 : lon(random);
    double x = 0.0, y = 0.0, z = 0.0;
    earth.Forward(lat_deg, lon_deg, height(random), x, y, z);
    double expected_lat = 0.0, expected_lon = 0.0, expected_height = 0.0;
    earth.Reverse(x, y, z, expected_lat, expected_lon, expected_height);
    const Geodetic found = geodetic_of({x, y, z});
    // 1e-14 rad is 0.06 um on the ground, some rounding steps of the coordinates.
    ASSERT_NEAR(found.lat_rad, expected_lat * kRadPerDeg, 1e-14) << lat_deg;
    // At a pole every longitude is right, and pi is -pi.
    if (std::abs(lat_deg) < 90.0) {
      ASSERT_NEAR(std::remainder(found.lon_rad - expected_lon * kRadPerDeg, 2.0 * kPi), 0.0, 1e-14);
    }
    ASSERT_NEAR(found.height_m, expected_height, 1e-8);
    const auto back = ecef_of(found);
    ASSERT_NEAR(std::hypot(back[0] - x, back[1] - y, back[2] - z), 0.0, 1e-8);
  }
}

TEST(Wgs84, NorthEastDownOfAnEcefVectorEqualsGeographicLib) {
  const double lat_deg = 48.8, lon_deg = 2.3;
  double x = 0.0, y = 0.0, z = 0.0;
  std::vector<double> enu_to_ecef(9);
  GeographicLib::Geocentric::WGS84().Forward(lat_deg, lon_deg, 0.0, x, y, z, enu_to_ecef);
  const std::array<double, 3> v{1.25, -0.5, 0.125};
  double enu[3] = {};
  for (std::size_t i = 0; i < 3; ++i) {
    for (std::size_t j = 0; j < 3; ++j) enu[i] += enu_to_ecef[3 * j + i] * v[j];
  }
  const auto ned = ned_of(v, {lat_deg * kRadPerDeg, lon_deg * kRadPerDeg, 0.0});
  EXPECT_NEAR(ned[0], enu[1], 1e-14);
  EXPECT_NEAR(ned[1], enu[0], 1e-14);
  EXPECT_NEAR(ned[2], -enu[2], 1e-14);
}

}  // namespace
}  // namespace imuscope
