#pragma once

/// The interval of a number that several models of one record give, none of which the record rules out.

#include <span>

namespace imuscope::certificate {

/// What one model says.
struct ModelsValue {
  /// -2 log likelihood and the number of parameters, by which that of a right model is smaller than it would be
  /// with the true ones: models of any size can be compared.
  double misfit = 0.0;
  double value = 0.0;
  double ci_low = 0.0;  ///< of the same confidence as is asked for
  double ci_high = 0.0;
};

struct Interval {
  double low = 0.0;
  double high = 0.0;
};

/// Ends of the likelihood's profile over the numbers and the models (T-4): the first model's interval whole, of
/// each other one what its larger misfit leaves of it, and so never less than the first one's and never more
/// than what all of them reach over.
/// @param models  not empty, finite; the first is the chosen one
Interval models_interval(std::span<const ModelsValue> models, double confidence);

}  // namespace imuscope::certificate
