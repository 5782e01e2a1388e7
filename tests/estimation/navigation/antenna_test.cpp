#include "estimation/navigation/antenna.h"

#include <gtest/gtest.h>
#include <cmath>

#include "estimation/navigation/gnss_measurement.h"
#include "estimation/navigation/so3.h"
#include "estimation/navigation/strapdown.h"
#include "estimation/navigation/wgs84.h"
#include "tests/estimation/navigation/random_states.h"

namespace imuscope {
namespace {

using Eigen::Vector3d;

constexpr double kArmStep_m = 0.5;
constexpr double kTimeStep_s = 1e-3;

/// Antenna, by Earth-fixed coordinates, as an offset from a point.
Vector3d antenna_from(const GeodeticPosition& point, const NavigationState& s, const Vector3d& arm_b) {
  const Eigen::Matrix3d C_n_e = rotation_ned_to_ecef(s.position.latitude_rad, s.position.longitude_rad);
  const Vector3d apart_e =
      ecef_from_geodetic(s.position) + C_n_e * (s.C_b_n * arm_b) - ecef_from_geodetic(point);
  return rotation_ned_to_ecef(point.latitude_rad, point.longitude_rad).transpose() * apart_e;
}

/// Its velocity relative to the Earth, in the NED of b's origin.
Vector3d velocity_of(const NavigationState& s, const Vector3d& omega_ib_b, const Vector3d& arm_b) {
  const double L = s.position.latitude_rad;
  const Vector3d w_ie(kEarthRate_radps * std::cos(L), 0.0, -kEarthRate_radps * std::sin(L));
  return s.v_n_mps + (s.C_b_n * omega_ib_b - w_ie).cross(s.C_b_n * arm_b);
}

struct AntennaScene {
  NavigationState state;
  InertialRates measured;  ///< constant in b
  Vector3d arm;
  /// The state so much later, by the strapdown.
  [[nodiscard]] NavigationState after(double step_s) const {
    NavigationState later = state;
    const InertialRates rates = compensated(measured, state);
    propagate(later, increment_from_samples(rates, rates, step_s));
    return later;
  }
};

AntennaScene random_antenna_scene(test::RandomStates& random) {
  AntennaScene scene;
  scene.state = random.state();
  scene.measured = random.rates();
  scene.measured.omega_ib_b_radps += scene.state.gyro_bias_b_radps;
  scene.measured.f_b_mps2 += scene.state.accel_bias_b_mps2;
  scene.arm = random.normal3(2.0);
  return scene;
}

TEST(Antenna, LeverArmColumnsMatchCentralDifferences) {
  test::RandomStates random(61);
  for (int trial = 0; trial < 100; ++trial) {
    const AntennaScene scene = random_antenna_scene(random);
    const Vector3d omega = compensated(scene.measured, scene.state).omega_ib_b_radps;
    const AntennaMatrix in_position = antenna_in_position(scene.state, scene.measured, scene.arm);
    const AntennaMatrix in_velocity = antenna_in_velocity(scene.state, scene.measured, scene.arm);
    for (Eigen::Index axis = 0; axis < 3; ++axis) {
      const Vector3d step = kArmStep_m * Vector3d::Unit(axis);
      const Vector3d by_position = (antenna_from(scene.state.position, scene.state, scene.arm + step) -
                                    antenna_from(scene.state.position, scene.state, scene.arm - step)) /
                                   (2.0 * kArmStep_m);
      const Vector3d by_velocity = (velocity_of(scene.state, omega, scene.arm + step) -
                                    velocity_of(scene.state, omega, scene.arm - step)) /
                                   (2.0 * kArmStep_m);
      // Earth-fixed coordinates resolve a nanometre.
      EXPECT_LT((in_position.col(kAntennaLeverArmError + axis) - by_position).norm(), 1e-8);
      EXPECT_LT((in_velocity.col(kAntennaLeverArmError + axis) - by_velocity).norm(), 1e-13);
    }
  }
}

TEST(Antenna, LatencyColumnsAreTheAntennasMotionBackwards) {
  test::RandomStates random(62);
  for (int trial = 0; trial < 100; ++trial) {
    const AntennaScene scene = random_antenna_scene(random);
    const Vector3d omega = compensated(scene.measured, scene.state).omega_ib_b_radps;
    const NavigationState later = scene.after(kTimeStep_s);
    const NavigationState earlier = scene.after(-kTimeStep_s);
    const Vector3d velocity = (antenna_from(scene.state.position, later, scene.arm) -
                               antenna_from(scene.state.position, earlier, scene.arm)) /
                              (2.0 * kTimeStep_s);
    const Vector3d acceleration =
        (velocity_of(later, omega, scene.arm) - velocity_of(earlier, omega, scene.arm)) / (2.0 * kTimeStep_s);
    const auto in_position = antenna_in_position(scene.state, scene.measured, scene.arm);
    const auto in_velocity = antenna_in_velocity(scene.state, scene.measured, scene.arm);
    // A nanometre of Earth-fixed coordinates over 2 ms; the third order of 1 ms.
    EXPECT_LT((in_position.col(kReceiverLatencyError) + velocity).norm(), 1e-5);
    EXPECT_LT((in_velocity.col(kReceiverLatencyError) + acceleration).norm(), 1e-5);
  }
}

TEST(Antenna, InjectionAddsTheErrors) {
  AntennaState antenna{Vector3d(1.0, 2.0, 3.0), 0.1};
  inject(antenna, AntennaErrorVector(0.1, 0.2, 0.3, -0.04));
  EXPECT_LT((antenna.r_ba_b_m - Vector3d(1.1, 2.2, 3.3)).norm(), 1e-15);
  EXPECT_NEAR(antenna.latency_s, 0.06, 1e-15);
}

}  // namespace
}  // namespace imuscope
