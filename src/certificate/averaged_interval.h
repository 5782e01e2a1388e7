#pragma once

/// The interval of a number that several models of one record give, none of which the record rules out.

#include <span>

namespace imuscope::certificate {

/// What one model says.
struct ModelsValue {
  double criterion = 0.0;  ///< G-16, on the scale of -2 log likelihood: the lower the better
  double value = 0.0;
  double ci_low = 0.0;  ///< of the same confidence as is asked for
  double ci_high = 0.0;
};

struct Interval {
  double low = 0.0;
  double high = 0.0;
};

/// Each model is believed by exp(-criterion / 2), and says that the number lies about its value as its interval
/// tells, below and above by themselves; the ends leave (1 - confidence) / 2 of what is believed in this way
/// outside, on either side (T-4). One model alone: its own interval. It holds the first model's value.
/// @param models  not empty, finite; the first is the chosen one
Interval averaged_interval(std::span<const ModelsValue> models, double confidence);

}  // namespace imuscope::certificate
