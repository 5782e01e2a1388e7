/// The length of a second: navigation over the host's own seconds turns too far, over UTC's it does not.

#include <gtest/gtest.h>
#include <cmath>

#include "estimation/navigation/so3.h"
#include "sample/eigen_arrays.h"
#include "tests/estimation/calibration/simulated_drive.h"

namespace imuscope::test {
namespace {

constexpr double kBegin_s = 10.0;  // of SimulatedDrive
constexpr double kDrive_s = 300.0;
const UtcTime kUtcBegin = utc_time_from_ns(1'773'480'600'000'000'000);

enum class Tells { kNobody, kReference, kReceiver };

struct Arrived {
  NavigationOutput navigation;
  TimeScale time_scale;
};

/// The same drive with the same noise, stamped by a PC whose clock is fast by `ppm`.
Arrived drive_with(double ppm, Tells tells) {
  SimulatedDrive drive(kDrive_s, {});
  Estimator estimator(drive.config());
  while (!drive.done()) {
    const std::vector<Sample> samples = drive.next();
    for (Sample sample : samples) {
      const double t_s = to_seconds(sample.time.time_since_epoch()) - kBegin_s;
      sample.time = sample.arrival =
          host_time_from_ns(std::llround((kBegin_s + t_s * (1.0 + ppm * 1e-6)) * 1e9));
      sample.utc = kUtcBegin + from_seconds(t_s);
      sample.has_utc =
          sample.kind == SampleKind::kGnss ? tells != Tells::kNobody : tells == Tells::kReference;
      estimator.add(sample);
    }
    estimator.advance(
        host_time_from_ns(std::llround((kBegin_s + (drive.time_s() - 0.01) * (1.0 + ppm * 1e-6)) * 1e9)));
  }
  return {estimator.navigation(), estimator.time_scale()};
}

/// Heading of the first less that of the second, in the second's sd.
double turned_in_sd(const Arrived& one, const Arrived& other) {
  const Eigen::Vector3d phi =
      log_so3(to_eigen(other.navigation.C_b_n).transpose() * to_eigen(one.navigation.C_b_n));
  return phi.z() / other.navigation.sd_rpy_rad[2];
}

TEST(Quartz, OfAnyRateLeavesTheNavigationAsItIsWhereADeviceTellsUtc) {
  const Arrived perfect = drive_with(0.0, Tells::kReference);
  ASSERT_EQ(perfect.navigation.status, NavigationStatus::kNavigating);
  for (const double ppm : {-50.0, 50.0}) {
    const Arrived off = drive_with(ppm, Tells::kReference);
    EXPECT_LT(std::abs(turned_in_sd(off, perfect)), 0.1) << ppm;
    for (std::size_t i = 0; i < 3; ++i)
      EXPECT_LT(std::abs(off.navigation.v_n_mps[i] - perfect.navigation.v_n_mps[i]),
                0.1 * perfect.navigation.sd_velocity_mps[i]);
    EXPECT_EQ(off.time_scale.source, UtcSource::kReference);
    EXPECT_NEAR(off.time_scale.rate, -ppm * 1e-6, 3.0 * off.time_scale.sd_rate);
    EXPECT_EQ(off.time_scale.steps, 0U);
  }
}

TEST(Quartz, IsCorrectedByAReceiverWhereTheReferenceTellsNoTime) {
  const Arrived perfect = drive_with(0.0, Tells::kReceiver);
  const Arrived fast = drive_with(50.0, Tells::kReceiver);
  EXPECT_EQ(fast.time_scale.source, UtcSource::kGnss);
  EXPECT_LT(std::abs(turned_in_sd(fast, perfect)), 0.1);
}

TEST(Quartz, ShowsInTheHeadingWhereNobodyTellsUtcAndTheScaleSaysSo) {
  const Arrived perfect = drive_with(0.0, Tells::kNobody);
  const Arrived fast = drive_with(50.0, Tells::kNobody);
  EXPECT_EQ(fast.time_scale.source, UtcSource::kNone);
  EXPECT_GT(std::abs(turned_in_sd(fast, perfect)), 1.0);
}

}  // namespace
}  // namespace imuscope::test
