#include "models/certificate/record_checks.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "made_record.h"

namespace imuscope::certificate {
namespace {

using test::made_gyro;
using testing::Contains;
using testing::HasSubstr;
using testing::Not;

std::vector<std::string> warnings_of(const AxisRecord& record) {
  const auto axis = characterize_axis(record, {});
  return axis ? axis->warnings : std::vector<std::string>{axis.error().text()};
}

TEST(RecordChecks, AHealthyRecordHasNoWarning) {
  for (unsigned seed = 20; seed < 24; ++seed)
    EXPECT_THAT(warnings_of(made_gyro(30'000, seed)), testing::IsEmpty());
}

TEST(RecordChecks, MotionIsTold) {
  AxisRecord record = made_gyro(60'000, 1);
  for (std::size_t i = 20'000; i < 24'000; ++i)
    record.values[i] += 20.0 * std::sin(0.05 * static_cast<double>(i));
  EXPECT_THAT(warnings_of(record),
              Contains(HasSubstr("the sensor was not at rest: 6.67 % of the record is shaken or "
                                 "turned, first at 200 s;")));
}

TEST(RecordChecks, AValueThatStandsStillIsTold) {
  AxisRecord record = made_gyro(60'000, 2);
  for (std::size_t i = 30'000; i < 30'500; ++i) record.values[i] = record.values[30'000];
  EXPECT_THAT(warnings_of(record), Contains(HasSubstr("stands still for 5 s at 300 s")));
}

// A slow log: what noise and its grid would not make is told before it lasts for a second.
TEST(RecordChecks, OfASlowLogTheGridSaysHowLongAValueMayStand) {
  for (const double step : {0.0, 0.001, 0.8}) {
    AxisRecord record = made_gyro(20'000, 9);
    record.rate_hz = 1.0;
    for (double& v : record.values) {
      if (step > 0.0) v = step * std::round(v / step);
    }
    // Five in a row without a grid; forty with one, and as many times that as the grid is coarser than the noise.
    const std::size_t noise = step == 0.0 ? 4 : step == 0.001 ? 39 : 80;
    const std::size_t stands = step == 0.8 ? 160 : noise + 6;
    for (const std::size_t run : {noise, stands}) {
      AxisRecord stuck = record;
      std::fill_n(stuck.values.begin() + 10'000, run, record.values[10'000]);
      const auto warnings = warnings_of(stuck);
      const bool told = std::any_of(warnings.begin(), warnings.end(), [](const std::string& warning) {
        return warning.find("stands still for") != std::string::npos;
      });
      EXPECT_EQ(told, run > noise) << step << " deg/s, " << run << " in a row";
    }
  }
}

TEST(RecordChecks, ClippedValuesAreTold) {
  AxisRecord record = made_gyro(60'000, 3);
  for (double& v : record.values) v = std::min(v, 0.92);
  EXPECT_THAT(warnings_of(record), Contains(HasSubstr("the end of the sensor's range")));
}

// Clipped so hard that the ends are near the mean, in sds of what is left; with and without a grid.
TEST(RecordChecks, HardClippingIsToldAndACoarseGridIsNone) {
  for (const double step : {0.0, 0.01, 0.05, 0.2, 0.5}) {
    AxisRecord record = made_gyro(60'000, 7);
    double mean = 0.0;
    for (const double v : record.values) mean += v / static_cast<double>(record.values.size());
    for (double& v : record.values) {
      if (step > 0.0) v = step * std::round(v / step);
    }
    EXPECT_THAT(warnings_of(record), Not(Contains(HasSubstr("the end of the sensor's range")))) << step;
    if (step > 0.1) continue;
    for (double& v : record.values) v = std::clamp(v, mean - 0.2, mean + 0.2);
    EXPECT_THAT(warnings_of(record), Contains(HasSubstr("the end of the sensor's range"))) << step;
  }
}

TEST(RecordChecks, ManyMissingSamplesAreTold) {
  AxisRecord record = made_gyro(60'000, 4);
  for (std::size_t i = 0; i < record.values.size(); i += 11) record.values[i] = std::nan("");
  EXPECT_THAT(warnings_of(record), Contains(HasSubstr("% of the samples are missing")));
}

TEST(RecordChecks, TheGridOfTheNumbersIsTheirResolution) {
  AxisRecord record = made_gyro(30'000, 5);
  for (double& v : record.values) v = 0.05 * std::round(v / 0.05);
  const std::vector<std::uint8_t> mask(record.values.size(), 1);
  const auto step = resolution_of(record.values, mask);
  ASSERT_TRUE(step);
  EXPECT_NEAR(*step, 0.05, 1e-9);
  EXPECT_FALSE(resolution_of(made_gyro(30'000, 6).values, mask));
  for (double& v : record.values) v = 0.5 * std::round(v / 0.5);
  EXPECT_THAT(warnings_of(record), Contains(HasSubstr("coarser than the noise")));
}

}  // namespace
}  // namespace imuscope::certificate
