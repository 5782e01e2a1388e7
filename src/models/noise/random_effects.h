#pragma once

/// Random effects: units of one kind (replicates of a sensor, sensors of a fleet) whose true values differ
/// about a common mean, each known with an error of its own.

#include <optional>
#include <span>

namespace imuscope::noise {

/// Mean and spread of one quantity over the units, on the scale that it was given on.
struct RandomEffects {
  double mean = 0.0;
  double sd = 0.0;  ///< of the mean
  double ci_low =
      0.0;  ///< of the mean of all such units, spread included: Student's t with K - 1 degrees of freedom
  double ci_high = 0.0;
  double spread = 0.0;  ///< sd between units beyond their errors (Paule and Mandel 1982)
  double spread_low = 0.0;
  double spread_high = 0.0;
};

/// The interval of the mean is that of Hartung and Knapp (2001): exact for equal errors, whatever the spread.
/// That of the spread is the Q-profile (Viechtbauer 2007). Absent below two units and where a variance is not
/// positive.
/// @param values     one estimate a unit
/// @param variances  squares of their sd
std::optional<RandomEffects> random_effects(std::span<const double> values, std::span<const double> variances,
                                            double confidence);

}  // namespace imuscope::noise
