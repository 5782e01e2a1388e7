#pragma once

/// On which scale a parameter has its interval, by the name under which it is printed.

#include <cmath>
#include <cstdint>
#include <string_view>

namespace imuscope::noise {

enum class ParameterScale : std::uint8_t {
  kLog,        ///< variances and rates
  kLogSquare,  ///< printed as the root of an amplitude: omega, alpha, B
  kAtanh,      ///< in (-1, 1): theta, phi
  kAboutOne,   ///< in (0, 2): exponent
};

inline ParameterScale parameter_scale_of(std::string_view name) noexcept {
  if (name == "omega" || name == "alpha" || name == "B") return ParameterScale::kLogSquare;
  if (name == "theta" || name == "phi") return ParameterScale::kAtanh;
  return name == "exponent" ? ParameterScale::kAboutOne : ParameterScale::kLog;
}

/// Whether intervals are factors.
inline bool is_logarithmic(ParameterScale scale) noexcept {
  return scale == ParameterScale::kLog || scale == ParameterScale::kLogSquare;
}

/// The place of a printed value on its scale, which is that of the covariance (of roots the square's
/// logarithm).
inline double to_scale(ParameterScale scale, double value) noexcept {
  switch (scale) {
    case ParameterScale::kAtanh:
      return std::atanh(value);
    case ParameterScale::kAboutOne:
      return std::atanh(value - 1.0);
    case ParameterScale::kLogSquare:
      return 2.0 * std::log(value);
    case ParameterScale::kLog:
      break;
  }
  return std::log(value);
}

/// The printed value at a place.
inline double from_scale(ParameterScale scale, double place) noexcept {
  switch (scale) {
    case ParameterScale::kAtanh:
      return std::tanh(place);
    case ParameterScale::kAboutOne:
      return 1.0 + std::tanh(place);
    case ParameterScale::kLogSquare:
      return std::exp(0.5 * place);
    case ParameterScale::kLog:
      break;
  }
  return std::exp(place);
}

}  // namespace imuscope::noise
