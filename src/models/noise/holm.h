#pragma once

/// Many tests at once: Holm's step-down correction (Holm 1979), which holds whatever the tests' dependence.

#include <optional>
#include <vector>

namespace imuscope::noise {

/// A difference whose corrected p is below counts as shown.
inline constexpr double kSignificance = 0.05;

/// Adjusted p-values in the order given: rejecting where one is below alpha keeps the chance of any false
/// rejection among all below alpha. A test that was not made (absent) does not count.
std::vector<std::optional<double>> holm_adjusted(const std::vector<std::optional<double>>& p_values);

}  // namespace imuscope::noise
