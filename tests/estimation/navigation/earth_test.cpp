#include <gtest/gtest.h>
#include <cmath>
#include <limits>

#include "estimation/navigation/gravity.h"
#include "estimation/navigation/local_earth.h"
#include "estimation/navigation/so3.h"
#include "estimation/navigation/wgs84.h"
#include "tests/estimation/navigation/random_states.h"

namespace imuscope {
namespace {

using Eigen::Vector3d;

TEST(Wgs84, EccentricityAndPolarRadiusAreThePublishedDerivedConstants) {
  // TR8350.2 table 3.3.
  EXPECT_NEAR(kWgs84EccentricitySquared, 6.69437999014e-3, 1e-14);
  EXPECT_NEAR(kWgs84SemiMajorAxis_m * (1.0 - kWgs84Flattening), 6356752.3142, 5e-5);
  // Polar radius of curvature c = a^2/b, both radii at the pole.
  EXPECT_NEAR(curvature_at(kPi / 2.0).transverse_m, 6399593.6258, 5e-5);
  EXPECT_NEAR(curvature_at(kPi / 2.0).meridian_m, 6399593.6258, 5e-5);
  EXPECT_NEAR(curvature_at(0.0).meridian_m, 6378137.0 * (1.0 - 6.69437999014e-3), 1e-4);
}

TEST(Wgs84, WhereAVehicleCanBeAndWhereNot) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (const GeodeticPosition& place : {GeodeticPosition{0.0, 0.0, 0.0},
                                        {kPi / 2.0, kPi, -430.0},
                                        {-kPi / 2.0, -kPi, 8849.0},
                                        {0.8, 6.0, 4e4}})
    EXPECT_TRUE(is_on_earth(place)) << place.height_m;
  for (const GeodeticPosition& place : {GeodeticPosition{1.6, 0.0, 0.0},
                                        {0.8, 7.0, 0.0},
                                        {0.8, 0.0, -12e3},
                                        {0.8, 0.0, 101e3},
                                        {nan, 0.0, 0.0},
                                        {0.8, nan, 0.0},
                                        {0.8, 0.0, nan},
                                        geodetic_from_ecef({0.0, 0.0, 0.0})})
    EXPECT_FALSE(is_on_earth(place)) << place.latitude_rad << ' ' << place.height_m;
}

TEST(Wgs84, RadiiAreWhatMovesAPointByOneMetre) {
  // Central differences of the Earth-fixed coordinates, independent of the formulae for the radii.
  const double L = 46.52 * kRadPerDeg;
  const double h = 420.0;
  constexpr double kStep = 1e-5;
  const Vector3d north =
      (ecef_from_geodetic({L + kStep, 0.1, h}) - ecef_from_geodetic({L - kStep, 0.1, h})) / (2.0 * kStep);
  const Vector3d east =
      (ecef_from_geodetic({L, 0.1 + kStep, h}) - ecef_from_geodetic({L, 0.1 - kStep, h})) / (2.0 * kStep);
  const Curvature k = curvature_at(L);
  EXPECT_NEAR(north.norm(), k.meridian_m + h, 1e-3);
  EXPECT_NEAR(east.norm(), (k.transverse_m + h) * std::cos(L), 1e-3);
}

TEST(Wgs84, CurvatureSlopesMatchCentralDifferences) {
  for (const double L : {-1.2, -0.3, 0.0, 0.8, 1.4}) {
    constexpr double kStep = 1e-5;
    const Curvature k = curvature_at(L);
    const Curvature plus = curvature_at(L + kStep);
    const Curvature minus = curvature_at(L - kStep);
    EXPECT_NEAR(k.meridian_slope_m, (plus.meridian_m - minus.meridian_m) / (2.0 * kStep), 1e-3);
    EXPECT_NEAR(k.transverse_slope_m, (plus.transverse_m - minus.transverse_m) / (2.0 * kStep), 1e-3);
  }
}

TEST(Wgs84, GeodeticCoordinatesSurviveTheWayThroughEcef) {
  test::RandomStates random(11);
  for (int i = 0; i < 500; ++i) {
    const GeodeticPosition in{random.uniform(-1.57, 1.57), random.uniform(-3.14, 3.14),
                              random.uniform(-1e4, 1e6)};
    const GeodeticPosition out = geodetic_from_ecef(ecef_from_geodetic(in));
    constexpr double kMicrometre_rad = 1e-6 / 6.4e6;
    EXPECT_NEAR(out.latitude_rad, in.latitude_rad, kMicrometre_rad);
    EXPECT_NEAR(out.longitude_rad, in.longitude_rad, 1e-12);
    EXPECT_NEAR(out.height_m, in.height_m, 1e-6);
  }
}

TEST(Wgs84, EcefAxesAreWhereTheyBelong) {
  EXPECT_LT((ecef_from_geodetic({0.0, 0.0, 0.0}) - Vector3d(6378137.0, 0.0, 0.0)).norm(), 1e-9);
  EXPECT_LT((ecef_from_geodetic({0.0, kPi / 2.0, 0.0}) - Vector3d(0.0, 6378137.0, 0.0)).norm(), 1e-8);
  EXPECT_LT((ecef_from_geodetic({kPi / 2.0, 0.0, 0.0}) - Vector3d(0.0, 0.0, 6356752.314245)).norm(), 1e-6);
}

TEST(Wgs84, NedAxesPointNorthEastAndDown) {
  const GeodeticPosition here{0.8, 0.1, 400.0};
  constexpr double kStep = 1e-7;
  const Vector3d north = ned_offset(here, {0.8 + kStep, 0.1, 400.0});
  const Vector3d east = ned_offset(here, {0.8, 0.1 + kStep, 400.0});
  const Vector3d up = ned_offset(here, {0.8, 0.1, 410.0});
  EXPECT_GT(north.normalized().x(), 1.0 - 1e-7);
  EXPECT_GT(east.normalized().y(), 1.0 - 1e-7);
  EXPECT_NEAR(up.z(), -10.0, 1e-8);
}

TEST(Wgs84, DisplacedUndoesNedOffsetOverCentimetresAndKilometres) {
  test::RandomStates random(12);
  for (const double distance : {0.01, 10.0, 1e3, 1e5}) {
    const GeodeticPosition origin = random.state().position;
    const Vector3d offset = random.normal3(distance);
    EXPECT_LT((ned_offset(origin, displaced(origin, offset)) - offset).norm(), 1e-7);
  }
}

TEST(Wgs84, TransportRateIsTheTurningOfLocalNed) {
  // d(C_n_e)/dt = C_n_e [w_en x] along the motion, by central differences.
  const GeodeticPosition p{0.7, 0.3, 500.0};
  const Vector3d v(20.0, -15.0, 1.0);
  const Curvature k = curvature_at(p.latitude_rad);
  constexpr double kStep_s = 100.0;
  const double dL = kStep_s * v.x() / (k.meridian_m + p.height_m);
  const double dl = kStep_s * v.y() / ((k.transverse_m + p.height_m) * std::cos(p.latitude_rad));
  const Eigen::Matrix3d forward = rotation_ned_to_ecef(p.latitude_rad + dL, p.longitude_rad + dl);
  const Eigen::Matrix3d back = rotation_ned_to_ecef(p.latitude_rad - dL, p.longitude_rad - dl);
  const Vector3d turned = log_so3(back.transpose() * forward) / (2.0 * kStep_s);
  EXPECT_LT((LocalEarth(p).transport_rate(v) - turned).norm(), 1e-6 * turned.norm());
}

TEST(NormalGravity, HasThePublishedValuesAtEquatorAndPole) {
  // TR8350.2 tables 3.4 and 4.1; the value at 45 degrees is Somigliana's with those two and the radii.
  EXPECT_NEAR(normal_gravity(0.0, 0.0).g_mps2, 9.7803253359, 1e-10);
  EXPECT_NEAR(normal_gravity(kPi / 2.0, 0.0).g_mps2, 9.8321849378, 2e-10);
  const double a = 6378137.0;
  const double b = 6356752.3142;
  const double at_45 = (a * 9.7803253359 + b * 9.8321849378) / (std::sqrt(2.0) * std::hypot(a, b));
  EXPECT_NEAR(normal_gravity(kPi / 4.0, 0.0).g_mps2, at_45, 1e-9);
}

TEST(NormalGravity, FallsWithHeightAsTheFreeAirGradientOfGeodesy) {
  // 0.3086 mGal per metre is the textbook free-air gradient at mid latitudes.
  const Gravity g = normal_gravity(kPi / 4.0, 0.0);
  EXPECT_NEAR(g.height_slope_per_s2, -3.086e-6, 1e-9);
  EXPECT_NEAR(normal_gravity(kPi / 4.0, 1000.0).g_mps2, g.g_mps2 - 3.086e-3, 2e-6);
}

TEST(NormalGravity, SlopesMatchCentralDifferences) {
  for (const double L : {-1.2, -0.4, 0.0, 0.8, 1.3}) {
    for (const double h : {0.0, 420.0, 8000.0}) {
      const Gravity g = normal_gravity(L, h);
      EXPECT_NEAR(g.latitude_slope_mps2,
                  (normal_gravity(L + 1e-4, h).g_mps2 - normal_gravity(L - 1e-4, h).g_mps2) / 2e-4, 1e-9);
      EXPECT_NEAR(g.height_slope_per_s2,
                  (normal_gravity(L, h + 10.0).g_mps2 - normal_gravity(L, h - 10.0).g_mps2) / 20.0, 1e-14);
    }
  }
}

}  // namespace
}  // namespace imuscope
