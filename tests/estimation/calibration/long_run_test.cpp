/// What hours do to a filter that minutes do not show.

#include <gtest/gtest.h>
#include <cmath>

#include "base/units.h"
#include "estimation/calibration/estimator.h"
#include "estimation/navigation/gravity.h"
#include "estimation/navigation/wgs84.h"
#include "firmware_sim/random/random.h"

namespace imuscope {
namespace {

constexpr double kRate_hz = 10.0;
constexpr double kLatitude_rad = 0.8;
constexpr double kHeight_m = 400.0;
constexpr DeviceIndex kLongReference = 0;
constexpr DeviceIndex kLongGnss = 1;

/// An unaided vertical channel multiplies an error by e every ten minutes: after eight hours by 10^21. What
/// the filter has learned must not be carried along like that, or a delayed solution meets its rounding.
TEST(LongRun, DelayedGnssIsStillAppliedRightlyAfterEightHoursOfStandstill) {
  EstimatorConfig config;
  config.reference.device = kLongReference;
  config.reference.rate_hz = kRate_hz;
  config.gnss.enabled = true;
  config.gnss.device = kLongGnss;
  config.navigation.initial_rpy_rad = Vector3{0.0, 0.0, 0.0};
  Estimator estimator(config);
  imusim::Random random(1, "long run");
  const double g_mps2 = normal_gravity(kLatitude_rad, kHeight_m).g_mps2;
  const auto hours = static_cast<std::int64_t>(8.0 * kSecondsPerHour * kRate_hz);
  double worst_m = 0.0;
  for (std::int64_t k = 0; k < hours; ++k) {
    const HostTime now = host_time_from_ns(k * 100'000'000);
    Sample imu{};
    imu.kind = SampleKind::kImu;
    imu.device = kLongReference;
    imu.sequence = static_cast<std::uint64_t>(k);
    imu.time = imu.arrival = now;
    imu.imu.flags = kGyroValid | kAccelValid;
    imu.imu.omega_radps = {kEarthRate_radps * std::cos(kLatitude_rad), 0.0,
                           -kEarthRate_radps * std::sin(kLatitude_rad)};
    imu.imu.f_mps2 = {0.0, 0.0, -g_mps2};
    estimator.add(imu);
    // Once a second, valid 0.4 s ago.
    if (k % 10 == 5) {
      Sample gnss{};
      gnss.kind = SampleKind::kGnss;
      gnss.device = kLongGnss;
      gnss.time = now - std::chrono::milliseconds{400};
      gnss.arrival = now;
      gnss.gnss.latitude_rad = kLatitude_rad;
      gnss.gnss.longitude_rad = 0.1;
      gnss.gnss.height_m = kHeight_m + 0.02 * random.normal();
      gnss.gnss.sd_position_m = {0.01, 0.01, 0.02};
      gnss.gnss.solution = GnssSolution::kFixed;
      gnss.gnss.flags = kPositionValid | kHasPositionSd;
      estimator.add(gnss);
    }
    estimator.advance(now);
    if (k > 1000) worst_m = std::max(worst_m, std::abs(estimator.navigation().height_m - kHeight_m));
  }
  EXPECT_EQ(estimator.counters().gnss_rejected, 0U);
  EXPECT_LT(worst_m, 0.05);
}

}  // namespace
}  // namespace imuscope
