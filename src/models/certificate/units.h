#pragma once

/// Several units of one part, or one unit over days, side by side: their mean, what they differ by, and what
/// a unit of that kind keeps below.

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "models/certificate/axis_certificate.h"
#include "models/noise/random_effects.h"

namespace imuscope::certificate {

/// One term of one axis over the records.
struct Population {
  std::string axis;
  Term term = Term::kRandomWalk;
  std::string unit;
  std::vector<std::optional<double>> values;  ///< one a record; absent where it is not fitted there
  std::size_t n = 0;                          ///< values
  /// Of the logarithms: mean, sd between records beyond their own errors. Absent with fewer than two values.
  std::optional<noise::RandomEffects> effects;
  /// A new unit of the same kind is below this in 95 % of cases, with 95 % confidence (T-3); absent below
  /// three values.
  std::optional<double> tolerance_upper;
  /// Probability of a deviation as large as each record's, corrected for their number (Holm 1979); as
  /// `values`.
  std::vector<std::optional<double>> p_values;
};

/// Every axis and term that at least two records have fitted. The unit of an axis is the same in all records.
std::vector<Population> population_of(std::span<const std::vector<AxisCertificate>> records,
                                      double confidence = 0.95);

/// Upper one-sided tolerance factor of n normal values: mean + factor sd lies above a share of the population
/// with the given confidence; n >= 2.
double tolerance_factor(std::size_t n, double share, double confidence);

}  // namespace imuscope::certificate
