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

/// The profile likelihood over the models (T-4): of every model's interval what its misfit beyond the least of all
/// leaves of it, and the chosen one's value.
/// @param models  not empty, finite; the first is the chosen one
Interval models_interval(std::span<const ModelsValue> models, double confidence);

}  // namespace imuscope::certificate
