#pragma once

/// The motion that one S-IMU has met and how its error follows it, kept up sample by sample in fixed memory.

#include <array>
#include <cstdint>
#include <limits>
#include <vector>

#include "estimation/error_process/error_row.h"
#include "models/dynamics/covariates.h"
#include "models/dynamics/regression.h"
#include "service/pipeline/noise_series.h"

namespace imuscope {

/// Motion about or along one axis, and how the error follows it; NaN: unknown. Units: those of the axis.
struct MotionFit {
  static constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  double mean = kNone;         ///< of the prediction, as the next two
  double rms = kNone;          ///< about the mean
  double largest = kNone;      ///< absolute
  double slope = kNone;        ///< of the error on the prediction
  double slope_sd = kNone;     ///< as for white errors
  double correlation = kNone;  ///< of error and prediction
  double r2 = kNone;           ///< of the regression on all covariates, as the next two
  double f = kNone;
  double p_value = kNone;
};

/// The motion of one S-IMU.
struct MotionSummary {
  std::int64_t n_static = 0;   ///< samples at rest
  std::int64_t n_dynamic = 0;  ///< in motion
  std::array<MotionFit, kAxisCount> axes;
  std::array<MotionFit, kCovariates> covariates;  ///< mean, rms, largest; known where n_dynamic > 0
};

/// Sums of (prediction p, error e) pairs about their running means (Welford), so that nothing cancels in a
/// long run.
class MotionSums {
 public:
  void add(double prediction, double error) noexcept;
  /// Slope of e on p, least squares with a constant. What the regression on covariates says is left unknown.
  [[nodiscard]] MotionFit fit() const;

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
  [[nodiscard]] MotionSummary summary() const;

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
