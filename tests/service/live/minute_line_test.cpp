#include "service/live/minute_line.h"

#include <gtest/gtest.h>

#include "base/units.h"

namespace imuscope {
namespace {

Configuration vehicle() {
  Configuration configuration;
  for (const char* name : {"ref", "front", "rear"}) {
    DeviceConfig device;
    device.name = name;
    device.role = configuration.devices.empty() ? DeviceRole::kReference : DeviceRole::kStudy;
    configuration.devices.push_back(device);
  }
  return configuration;
}

Snapshot driving(std::int64_t tick) {
  Snapshot snapshot{};
  snapshot.tick = tick;
  snapshot.n_studies = 2;
  snapshot.navigation.status = NavigationStatus::kInitialising;
  snapshot.studies[0].status = CalibrationStatus::kConverging;
  snapshot.studies[0].sd_psi_rad = {0.01 * kRadPerDeg, 0.032 * kRadPerDeg, 0.02 * kRadPerDeg};
  snapshot.studies[0].sd_r_bs_b_m = {0.0011, 0.001, 0.0009};
  snapshot.studies[0].sd_t_d_s = 0.00012;
  snapshot.studies[1].status = CalibrationStatus::kCoarse;
  return snapshot;
}

TEST(MinuteLine, SaysOnceAMinuteHowWellEverythingIsKnown) {
  const Configuration configuration = vehicle();
  MinuteLine line(configuration);
  EXPECT_FALSE(line.look(driving(5999)));
  EXPECT_EQ(line.look(driving(6000)),
            "1 min: no navigation yet; front boresight 0.032 deg, lever arm 1.1 mm, time 0.12 "
            "ms; rear looking for its mounting");
  EXPECT_FALSE(line.look(driving(6010)));
  Snapshot later = driving(18005);
  later.navigation.status = NavigationStatus::kNavigating;
  later.navigation.v_n_mps = {6.0, 8.0, 0.3};
  later.navigation.sd_position_m = {0.011, 0.012, 0.021};
  const auto said = line.look(later);
  ASSERT_TRUE(said) << "after a stall minutes are not told one by one";
  EXPECT_EQ(said->substr(0, said->find(';')), "3 min: 36 km/h, position 0.021 m");
  EXPECT_FALSE(line.look(driving(18010)));
}

}  // namespace
}  // namespace imuscope
