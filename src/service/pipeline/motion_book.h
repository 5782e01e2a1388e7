#pragma once

/// The motion that one S-IMU has met and how its error follows it, kept up sample by sample in fixed memory.

#include <array>
#include <cstdint>
#include <imuscope/dynamics_t.hpp>
#include <vector>

#include "estimation/error_process/error_row.h"
#include "models/dynamics/covariates.h"
#include "models/dynamics/regression.h"
#include "service/pipeline/noise_series.h"

namespace imuscope {

/// Sums of (prediction p, error e) pairs about their running means (Welford), so that nothing cancels in a
/// long run.
class MotionSums {
 public:
  void add(double prediction, double error) noexcept;
  /// Slope of e on p, least squares with a constant; its sd as for white errors. NaN where unknown; axis
  /// and unit are left to the caller.
  [[nodiscard]] axis_dynamics_t message() const;

 private:
  double n_ = 0.0;
  double mean_p_ = 0.0;
  double mean_e_ = 0.0;
  double sum_pp_ = 0.0;
  double sum_pe_ = 0.0;
  double sum_ee_ = 0.0;
  double largest_p_ = 0.0;
};

class MotionBook {
 public:
  MotionBook();
  /// @param regime  that holds at the row, whatever the row says
  /// Thread: modeller. Allocates: never.
  void add(const ErrorRow& row, Regime regime);
  /// name, utime, sequence and time_s are left to the caller.
  [[nodiscard]] dynamics_t message() const;

 private:
  /// Of the samples in motion every fifth enters the regression: neighbours tell the same of the motion.
  static constexpr std::int64_t kRegressionStep = 5;
  void add_to_regression(const ErrorRow& row);

  std::array<MotionSums, kAxisCount> axes_;
  std::array<std::int64_t, kRegimeCount> rows_{};
  std::array<MotionSums, kCovariates> covariates_;
  std::vector<RegressionSums> regressions_;  ///< one an axis
};

}  // namespace imuscope
