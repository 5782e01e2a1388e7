#pragma once

/// A fitted model in the terms of a Kalman filter and of a data sheet.

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/result.h"
#include "models/noise/felt_noise.h"
#include "models/noise/fit.h"

namespace imuscope::noise {

enum class SignalUnit : std::uint8_t { kNone, kRadps, kDegps, kMps2, kG };

/// "rad/s", "deg/s", "m/s^2", "g" or "" (none). Errors: kUsage, with the units that exist.
Result<SignalUnit> parse_unit(std::string_view text);
std::string_view unit_name(SignalUnit unit) noexcept;
bool is_gyro(SignalUnit unit) noexcept;
/// Factor from the unit to rad/s or m/s^2; 1 without a unit.
double si_factor(SignalUnit unit) noexcept;

/// One number as a filter or a data sheet writes it, in `unit`, with its interval at the fit's confidence.
struct Quantity {
  std::string process;  ///< "WN", "GM1", ...; "model" for what the sum of the processes has
  std::string name;     ///< "density", "correlation time", "driving density", "angle random walk", ...
  std::string unit;
  double value = 0.0;            ///< of a bound the bound
  std::optional<double> ci_low;  ///< on the logarithm; absent where a parameter it is made of has none
  std::optional<double> ci_high;
  Knowledge knowledge = Knowledge::kFitted;
};

/// At sampling rate f, signal unit u:
/// - WN: density sigma2 / f (u^2/Hz)
/// - RW: driving density gamma2 f (u^2 Hz); its root is the rate random walk
/// - GM: correlation time 1 / beta (s), driving density 2 beta sigma2, sd sqrt(sigma2)
/// - QN: quantization sqrt(q2) / f (u s)
/// - DR: ramp omega f (u/s)
/// - model: angle or velocity random walk (deg/sqrt(h), m/s/sqrt(h)), the root of the density of all that is
///   white at a second (felt_noise.h); bias instability = smallest Allan deviation of the model over the
///   fitted levels / 0.664, a bound where the smallest is the last
///
/// An amplitude without an interval is given as the most that the data allow, where they bound it; a
/// correlation time without one is not known.
///
/// Data-sheet names appear with a known unit only.
std::vector<Quantity> filter_quantities(const FitResult& fit, SignalUnit unit);

/// The same of over_bounding() (conservative.h): what its larger amplitudes make, each a bound; correlation
/// times as fitted.
std::vector<Quantity> over_bounding_quantities(const FitResult& bound, SignalUnit unit);

}  // namespace imuscope::noise
