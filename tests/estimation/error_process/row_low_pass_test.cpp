#include "estimation/error_process/row_low_pass.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace imuscope {
namespace {

constexpr double kRate_hz = 100.0;

ErrorRow row_at(std::int64_t counter, double value) {
  ErrorRow row{};
  row.counter = counter;
  row.gyro_valid = row.accel_valid = true;
  row.e_gyro_radps = row.e_accel_mps2 = {value, -value, 2.0 * value};
  row.predicted_omega_s_radps = row.predicted_f_s_mps2 = {value, value, value};
  return row;
}

/// Amplitude of the filter's answer to a sinusoid of 1, once it has settled, from whole periods.
double gain_at(double frequency_hz, double corner_hz) {
  RowLowPass filter(kRate_hz, corner_hz);
  double squares = 0.0;
  double n = 0.0;
  for (std::int64_t k = 0; k < 6000; ++k) {
    ErrorRow row =
        row_at(k, std::sin(2.0 * std::numbers::pi * frequency_hz * static_cast<double>(k) / kRate_hz));
    filter.apply(row);
    if (k < 1000) continue;
    squares += row.e_gyro_radps[0] * row.e_gyro_radps[0];
    n += 1.0;
  }
  return std::sqrt(2.0 * squares / n);
}

TEST(RowLowPass, HasTheGainOfASecondOrderButterworth) {
  constexpr double kCorner_hz = 10.0;
  // |H|^2 = 1 / (1 + (w/wc)^4) with both frequencies warped by the bilinear transform.
  for (const double f : {0.5, 3.0, 10.0, 20.0, 31.0}) {
    const double w =
        std::tan(std::numbers::pi * f / kRate_hz) / std::tan(std::numbers::pi * kCorner_hz / kRate_hz);
    EXPECT_NEAR(gain_at(f, kCorner_hz), 1.0 / std::sqrt(1.0 + w * w * w * w), 3e-3) << f << " Hz";
  }
}

TEST(RowLowPass, ErrorAndPredictionPassTheSameFilter) {
  RowLowPass filter(kRate_hz, 8.0);
  for (std::int64_t k = 0; k < 500; ++k) {
    ErrorRow row = row_at(k, std::sin(0.3 * static_cast<double>(k)) + 0.2);
    filter.apply(row);
    EXPECT_DOUBLE_EQ(row.e_gyro_radps[0], row.predicted_omega_s_radps[0]);
    EXPECT_DOUBLE_EQ(row.e_accel_mps2[2], 2.0 * row.predicted_f_s_mps2[2]);
  }
}

TEST(RowLowPass, AfterAGapRowsAreNotValidUntilItHasSettled) {
  RowLowPass filter(kRate_hz, 10.0);
  const auto valid_at = [&](std::int64_t counter) {
    ErrorRow row = row_at(counter, 1.0);
    filter.apply(row);
    EXPECT_NEAR(row.e_gyro_radps[0], 1.0, 1e-12) << "a constant passes at once";
    return row.gyro_valid;
  };
  EXPECT_FALSE(valid_at(0));
  for (std::int64_t k = 1; k < 100; ++k) (void)valid_at(k);
  EXPECT_TRUE(valid_at(100));
  EXPECT_FALSE(valid_at(103)) << "two samples are missing";
  for (std::int64_t k = 104; k < 200; ++k) (void)valid_at(k);
  EXPECT_TRUE(valid_at(200));
}

// A step's answer lacks at most sqrt(2) exp(-t / T), T = sqrt(2) / (2 pi corner): after seven T a permille.
TEST(RowLowPass, IsTrustedOnceAStepHasSettledAndNoSooner) {
  for (const double corner_hz : {3.0, 10.0, 20.0}) {
    const double time_constant_s = std::numbers::sqrt2 / (2.0 * std::numbers::pi * corner_hz);
    RowLowPass filter(kRate_hz, corner_hz);
    std::int64_t k = 0;
    const auto next = [&](double value) {
      ErrorRow row = row_at(k++, value);
      filter.apply(row);
      return row;
    };
    while (!next(0.0).gyro_valid) {
    }
    const std::int64_t waited = k - 1;
    EXPECT_EQ(waited, static_cast<std::int64_t>(std::ceil(7.0 * time_constant_s * kRate_hz))) << corner_hz;
    const double still_lacking = std::numbers::sqrt2 * std::exp(-7.0);
    double largest_before = 0.0;
    for (std::int64_t i = 1; i <= 2 * waited; ++i) {
      const double left = std::abs(next(1.0).e_gyro_radps[0] - 1.0);
      if (2 * i >= waited && i < waited) largest_before = std::max(largest_before, left);
      if (i > waited) {
        EXPECT_LT(left, still_lacking) << corner_hz;
      }
    }
    EXPECT_GT(largest_before, still_lacking) << corner_hz;
  }
}

TEST(RowLowPass, WhatAnInvalidTriadHeldReachesNoRowThatIsValid) {
  for (const bool gyro : {true, false}) {
    RowLowPass filter(kRate_hz, 10.0);
    int valid = 0;
    for (std::int64_t k = 0; k < 300; ++k) {
      const bool is_clipped = k >= 100 && k < 105;
      ErrorRow row = row_at(k, is_clipped ? 1e9 : 1.0);
      (gyro ? row.gyro_valid : row.accel_valid) = !is_clipped;
      filter.apply(row);
      if (is_clipped) {
        EXPECT_FALSE(gyro ? row.gyro_valid : row.accel_valid);
      }
      if (!row.gyro_valid || !row.accel_valid) continue;
      ++valid;
      EXPECT_NEAR(row.e_gyro_radps[0], 1.0, 1e-12) << k;
      EXPECT_NEAR(row.e_accel_mps2[0], 1.0, 1e-12) << k;
    }
    EXPECT_GT(valid, 200);
  }
}

}  // namespace
}  // namespace imuscope
