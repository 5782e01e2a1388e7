#include "service/run/describe.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <limits>

#include "base/units.h"

namespace imuscope {
namespace {

using testing::HasSubstr;

Configuration vehicle() {
  return *parse_configuration(R"(
[run]
name = "test"
[[device]]
name = "airins"
role = "reference"
protocol = "csv_imu"
[[device]]
name = "left"
role = "study"
protocol = "csv_imu"
[[device]]
name = "right"
role = "study"
protocol = "csv_imu"
)",
                              "test.toml");
}

std::string told(const EventPayload& what, DeviceIndex device = 1) {
  return describe(vehicle(), {what, device, HostTime{}});
}

TEST(Describe, SpeaksInTheUnitsOfPeople) {
  EXPECT_THAT(told(event::CoarseAlignmentDone{2.0 * kRadPerDeg}),
              HasSubstr("left: mounting found, residual 2.00 deg"));
  EXPECT_THAT(told(event::BoresightPriorWrong{5.0 * kRadPerDeg}), HasSubstr("sits 5.0 deg from where"));
  EXPECT_THAT(told(event::GyroBiasChanged{0.5 * kRadPerDeg}), HasSubstr("changed by 0.500 deg/s"));
  EXPECT_THAT(told(event::AccelBiasChanged{0.5}), HasSubstr("changed by 0.500 m/s^2"));
  EXPECT_THAT(told(event::GnssInconsistent{0.25}), HasSubstr("25 % of its positions"));
  EXPECT_THAT(told(event::SImuInconsistent{0.75}), HasSubstr("75 % of its samples"));
  EXPECT_THAT(told(event::NoiseTooSmall{true, 3.1, 0.6 * kRadPerDeg}),
              HasSubstr("gyro_white_sd_degps = 0.6 would"));
  EXPECT_THAT(told(event::NoiseTooSmall{false, 3.1, 0.05}),
              HasSubstr("forces differ from the reference's by 3.1"));
  EXPECT_THAT(told(event::LeverArmPriorWrong{0.4}), HasSubstr("0.40 m from what"));
  EXPECT_THAT(told(event::ReferenceNoiseSeen{0.3 * kRadPerDeg / 60.0, 200.0 * kMps2PerMicroG}, 0),
              HasSubstr("0.3 deg/sqrt(h) and 200 ug/sqrt(Hz)"));
  EXPECT_THAT(told(event::ReferenceGap{0.25}, 0), HasSubstr("airins: reference silent for 0.250 s"));
}

TEST(Describe, NamesWhatTheEventCarries) {
  EXPECT_THAT(told(event::NavigationStarted{InitialisationMethod::kGyrocompass}, 0),
              HasSubstr("gyrocompassing"));
  EXPECT_THAT(told(event::NavigationStarted{InitialisationMethod::kInMotion}, 0),
              HasSubstr("heading from the motion"));
  EXPECT_THAT(told(event::SImusSwapped{2}), HasSubstr("left and right sit where"));
  EXPECT_THAT(told(event::GnssRejected{250.0}), HasSubstr("NIS 250"));
  EXPECT_THAT(told(event::GnssRejected{std::numeric_limits<double>::infinity()}),
              HasSubstr("nowhere on Earth"));
  EXPECT_THAT(told(event::OdometryRejected{-1.5}), HasSubstr("by -1.50 m/s"));
}

TEST(Describe, AStateThatWasRepairedIsNamedWithItsSensor) {
  const std::string of_navigation = told(event::CovarianceRepaired{0}, 0);
  EXPECT_THAT(of_navigation, HasSubstr("airins: numerical trouble"));
  const std::string of_sensor = told(event::CovarianceRepaired{15}, 0);
  EXPECT_THAT(of_sensor, HasSubstr("left: numerical trouble"));
}

}  // namespace
}  // namespace imuscope
