#pragma once

/// The chi-squared distribution, for any degrees of freedom: models without noise of their own ask for many.

namespace imuscope::noise {

/// The value below which a chi-squared number of `dof` (> 0, need not be whole) lies with probability `p`.
double chi_squared_quantile(double dof, double p);

/// Probability of a statistic at least as large, dof > 0.
double chi_squared_p_value(double statistic, double dof);

}  // namespace imuscope::noise
