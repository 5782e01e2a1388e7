#include "service/time_budget.h"

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
  StudyOutput study;
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

}  // namespace
}  // namespace imuscope
