/// Whole rows of the error process: what is right about them, the tests beside this one prove.

#include <gtest/gtest.h>
#include <array>
#include <cmath>

#include "estimation/error_process/error_row.h"
#include "estimation/error_process/row_low_pass.h"
#include "tests/support/answer.h"
#include "tests/support/recorded_answer.h"

namespace imuscope {
namespace {

using test::Answer;

void add_row(Answer& lines, std::string_view name, const ErrorRow& row) {
  lines.line(name, to_seconds(row.time - HostTime{}), row.counter, row.regime, row.gyro_valid,
             row.accel_valid);
  lines.line(" errors", row.e_gyro_radps, row.e_accel_mps2);
  lines.line(" predicted", row.predicted_omega_s_radps, row.predicted_f_s_mps2);
  lines.line(" derivatives", row.omega_dot_s_radps2, row.omega_ddot_s_radps3, row.f_dot_s_mps3);
}

SImuEpoch full_epoch() {
  SImuEpoch epoch{};
  epoch.time = host_time_from_ns(12'345'000'000);
  epoch.regime = Regime::kDynamic;
  epoch.sample.counter = 4711;
  epoch.sample.flags = kGyroValid | kAccelValid;
  epoch.sample.omega_radps = {0.31, -0.42, 0.53};
  epoch.sample.f_mps2 = {1.1, -2.2, -9.3};
  epoch.C_b_s = {0.36, 0.48, -0.8, -0.8, 0.6, 0.0, 0.48, 0.64, 0.6};
  epoch.r_bs_b_m = {0.7, -1.1, 0.4};
  epoch.omega_ib_b_radps = {0.5, -0.3, 0.2};
  epoch.omega_dot_ib_b_radps2 = {1.5, 2.5, -3.5};
  epoch.omega_ddot_ib_b_radps3 = {4.0, -5.0, 6.0};
  epoch.f_b_mps2 = {0.9, -1.7, -9.6};
  epoch.f_dot_b_mps3 = {7.0, 8.0, -9.0};
  epoch.reference_gyro_bias_radps = {0.01, 0.02, -0.03};
  epoch.reference_accel_bias_mps2 = {0.1, -0.2, 0.3};
  return epoch;
}

TEST(ErrorProcessAnswers, Rows) {
  Answer lines;
  const SImuEpoch epoch = full_epoch();
  add_row(lines, "live", live_error_row(epoch));
  const Mounting mounting{{0.0, 0.6, 0.8, -1.0, 0.0, 0.0, 0.0, -0.8, 0.6}, {-0.3, 0.9, 1.3}};
  const ErrorRow row = error_row(epoch, mounting, {{0.04, -0.05, 0.06}, {0.4, 0.5, -0.6}});
  add_row(lines, "of another mounting", row);
  add_row(lines, "without scale error",
          without_scale_error(row, {{0.01, -0.02, 0.03}, {-0.04, 0.05, -0.06}}));
  test::expect_recorded("estimation/error_process/rows.txt", lines.text());
}

TEST(ErrorProcessAnswers, EachAxisAtTheEndOfItsRangeMakesItsTriadInvalid) {
  for (const std::uint32_t clip : {kGyroClipX, kGyroClipY, kGyroClipZ}) {
    SImuEpoch epoch = full_epoch();
    epoch.sample.flags |= clip;
    EXPECT_FALSE(live_error_row(epoch).gyro_valid);
    EXPECT_TRUE(live_error_row(epoch).accel_valid);
  }
  for (const std::uint32_t clip : {kAccelClipX, kAccelClipY, kAccelClipZ}) {
    SImuEpoch epoch = full_epoch();
    epoch.sample.flags |= clip;
    EXPECT_TRUE(live_error_row(epoch).gyro_valid);
    EXPECT_FALSE(live_error_row(epoch).accel_valid);
  }
  SImuEpoch neither = full_epoch();
  neither.sample.flags = 0;
  EXPECT_FALSE(live_error_row(neither).gyro_valid);
  EXPECT_FALSE(live_error_row(neither).accel_valid);
}

TEST(ErrorProcessAnswers, LowPass) {
  Answer lines;
  for (const double corner_hz : {7.0, 40.0}) {
    RowLowPass filter(100.0, corner_hz);
    lines.line("corner", corner_hz);
    for (int k = 0; k < 120; ++k) {
      SImuEpoch epoch = full_epoch();
      epoch.time = host_time_from_ns(10'000'000LL * k);
      epoch.sample.counter = k + (k >= 60 ? 5 : 0);
      const double wave = std::sin(0.4 * k);
      for (Vector3* v : {&epoch.sample.omega_radps, &epoch.omega_ib_b_radps, &epoch.omega_dot_ib_b_radps2,
                         &epoch.omega_ddot_ib_b_radps3, &epoch.f_b_mps2, &epoch.f_dot_b_mps3})
        for (double& axis : *v) axis *= 1.0 + wave;
      if (k == 90) epoch.sample.flags |= kGyroClipX;
      if (k == 100) epoch.sample.flags |= kAccelClipX;
      ErrorRow row = live_error_row(epoch);
      filter.apply(row);
      if (k % 10 == 3 || k == 60 || k == 90 || k == 91)
        add_row(lines, "row", row);
      else
        lines.line("valid", k, row.gyro_valid, row.accel_valid);
    }
  }
  test::expect_recorded("estimation/error_process/low_pass.txt", lines.text());
}

}  // namespace
}  // namespace imuscope
