#pragma once

/// How bias and noise of an axis vary with its temperature.

#include <cstdint>
#include <functional>
#include <optional>
#include <span>

#include "base/result.h"
#include "models/noise/fit.h"

namespace imuscope::certificate {

struct Temperature {
  double mean_c = 0.0;
  double lowest_c = 0.0;
  double highest_c = 0.0;
  double bias_per_c = 0.0;     ///< signal unit per degree, about the mean temperature
  double bias_per_c_sd = 0.0;  ///< under the fitted noise (generalised least squares)
  double bias_p_value = 1.0;
  /// Relative change of the variance of fast noise per degree; absent where the record is too short for
  /// windows.
  std::optional<double> noise_per_c;
  double noise_per_c_sd = 0.0;
};

/// A stretch of an axis with its temperatures, one a sample.
struct PieceWithTemperature {
  std::span<const double> x;
  std::span<const std::uint8_t> mask;  ///< empty: all are there; NaN and infinity count as missing
  std::span<const float> temperature_c;
};

/// Hands on the pieces of a record one after the other. Asked twice.
using ReadWithTemperature =
    std::function<Result<void>(const std::function<void(const PieceWithTemperature&)>& take)>;

/// Of a record that is read piece by piece. Errors: those of `read`.
Result<std::optional<Temperature>> temperature_of(const ReadWithTemperature& read,
                                                  const noise::FitResult& fit);

/// Absent where the temperature is missing, or does not vary by kLeastRange_c, and where no term of the fit has an
/// amplitude.
std::optional<Temperature> temperature_of(std::span<const double> x, std::span<const std::uint8_t> mask,
                                          std::span<const float> temperature_c, const noise::FitResult& fit);

inline constexpr double kLeastRange_c = 0.5;

}  // namespace imuscope::certificate
