#pragma once

/// The interval of a number that several models of one record give, none of which the record rules out.

#include <span>

namespace imuscope::certificate {

/// What one model says.
struct ModelsValue {
  /// -2 log likelihood plus the number of parameters: fitting them lowers it by their number in the mean, so
  /// that models of any size can be compared.
  double misfit = 0.0;
  double value = 0.0;
  double ci_low = 0.0;  ///< of the same confidence as is asked for
  double ci_high = 0.0;
};

struct Interval {
  double low = 0.0;
  double high = 0.0;
};

/// The profile likelihood over the models (T-4): all of the chosen model's interval, and of every other model's
/// what its larger misfit leaves of it.
/// @param models  not empty, finite; the first is the chosen one
Interval models_interval(std::span<const ModelsValue> models, double confidence);

}  // namespace imuscope::certificate
