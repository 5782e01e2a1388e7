#pragma once

/// The dependence of an S-IMU's error on the dynamics: per axis, ordinary least squares as in the literature
/// (Table I of Stebler et al., 2014) beside generalised least squares that holds under the noise's own
/// autocorrelation, each before and after projecting out what calibration errors would produce.

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "estimation/error_process/error_row.h"
#include "models/dynamics/regression.h"
#include "models/noise/fit.h"

namespace imuscope {

/// Rows of one S-IMU in the order of their counters, readable from the start as often as is needed. A row
/// that comes again counts once.
class ErrorRowSource {
 public:
  virtual ~ErrorRowSource() = default;
  virtual void rewind() = 0;
  /// False at the end.
  [[nodiscard]] virtual bool next(ErrorRow& row) = 0;
};

inline constexpr std::size_t kErrorAxes = 6;  ///< gyro x y z, accel x y z

/// One axis. A regression is absent where there are too few rows or nothing moved.
struct AxisDynamics {
  std::optional<Regression> ols;
  std::optional<Regression> ols_projected;
  std::optional<Regression> gls;
  std::optional<Regression> gls_projected;
  std::optional<noise::FitResult> residual_noise;  ///< with which the rows were whitened
  std::string no_gls_because;                      ///< why there is no residual_noise
};

/// What study_dynamics() must know of the rows: their rate, and which noise model fits what a regression
/// leaves.
struct DynamicsOptions {
  double rate_hz = 100.0;
  noise::ModelSpec noise_model;  ///< of the residual
  double confidence = 0.95;
};

/// Least squares; the noise of its residual; least squares on rows whitened by that; and again with the noise
/// of what the generalised fit leaves, the noise that the fit itself took being given back. Tests and
/// intervals count what is not known of the noise.
/// Memory: one double a row and axis of a triad, and one a column, axis and sixteen rows.
std::array<AxisDynamics, kErrorAxes> study_dynamics(ErrorRowSource& rows, const DynamicsOptions& options);

}  // namespace imuscope
