#include "service/run/time_budget.h"

#include <gtest/gtest.h>
#include <chrono>
#include <cmath>

namespace imuscope {
namespace {

using std::chrono::microseconds;

LineStatus heard() {
  LineStatus line;
  line.timing = {microseconds(100), microseconds(16'000)};
  line.counters.samples = 200;  // with an attitude each
  line.epochs = 100;
  line.counters.bytes = 4500;
  line.counters.bytes_skipped = 500;
  line.latency_s = 7e-3;
  line.clock_sd_s = 2e-5;
  line.clock_drift_ppm = 11.0;
  return line;
}

TEST(TimeBudget, TellsWhatTheLineTakesAndLeavesOpenWhatNobodyMeasures) {
  const TimeBudget budget = time_budget(heard(), nullptr);
  EXPECT_DOUBLE_EQ(budget.wire_s, 40 * 100e-6) << "40 good bytes a sample";
  EXPECT_DOUBLE_EQ(budget.adapter_s, 16e-3);
  EXPECT_EQ(budget.latency_s, 7e-3);
  EXPECT_EQ(budget.clock_sd_s, 2e-5);
  EXPECT_EQ(budget.clock_drift_ppm, 11.0);
  EXPECT_TRUE(std::isnan(budget.t_d_s));
  EXPECT_TRUE(std::isnan(budget.sd_t_d_s));
}

TEST(TimeBudget, HasTheConstantDelayOfAnImuOnceItIsEstimated) {
  SImuOutput study;
  study.t_d_s = -4e-3;
  study.sd_t_d_s = 3e-5;
  study.status = CalibrationStatus::kWaiting;
  EXPECT_TRUE(std::isnan(time_budget(heard(), &study).t_d_s));
  study.status = CalibrationStatus::kConverging;
  EXPECT_EQ(time_budget(heard(), &study).t_d_s, -4e-3);
  EXPECT_EQ(time_budget(heard(), &study).sd_t_d_s, 3e-5);
}

TEST(TimeBudget, IsOpenBeforeTheFirstSample) {
  const TimeBudget budget = time_budget(LineStatus{}, nullptr);
  EXPECT_EQ(budget.wire_s, 0.0);
  EXPECT_TRUE(std::isnan(budget.latency_s));
  EXPECT_TRUE(std::isnan(budget.clock_sd_s));
}

TEST(TimeBudget, TellsWhoStampsAndWhatThatSaves) {
  EXPECT_EQ(name_of(time_budget(heard(), nullptr).stamped_by), "read");
  EXPECT_TRUE(std::isnan(time_budget(heard(), nullptr).stamp_lead_s));
  LineStatus line = heard();
  line.stamps = {StampedBy::kInterface, 120e-6, 40e-6};
  const TimeBudget budget = time_budget(line, nullptr);
  EXPECT_EQ(name_of(budget.stamped_by), "interface");
  EXPECT_EQ(budget.stamp_lead_s, 120e-6);
  EXPECT_EQ(budget.stamp_lead_sd_s, 40e-6);
}

TEST(TimeBudget, HasTheConstantDelayOfEachDeviceThatPulsesMeasure) {
  PulseState pulses;
  SImuOutput study;
  study.status = CalibrationStatus::kCalibrated;
  study.t_d_s = -3e-3;
  study.sd_t_d_s = 30e-6;
  EXPECT_TRUE(std::isnan(time_budget(heard(), &study, DeviceRole::kStudy, pulses).delay_s));
  pulses.is_known = true;
  pulses.reference_delay = {4e-3, 40e-6};
  pulses.gnss_delay = {60e-3, 1e-3};
  EXPECT_EQ(time_budget(heard(), nullptr, DeviceRole::kReference, pulses).delay_s, 4e-3);
  EXPECT_EQ(time_budget(heard(), nullptr, DeviceRole::kGnss, pulses).delay_s, 60e-3);
  // It runs 3 ms behind the reference, which is 4 ms late.
  const TimeBudget budget = time_budget(heard(), &study, DeviceRole::kStudy, pulses);
  EXPECT_DOUBLE_EQ(budget.delay_s, 7e-3);
  EXPECT_DOUBLE_EQ(budget.sd_delay_s, 50e-6);
  EXPECT_TRUE(std::isnan(time_budget(heard(), nullptr, DeviceRole::kTime, pulses).delay_s));
}

}  // namespace
}  // namespace imuscope
