#pragma once

/// Quantiles of the chi-squared distribution for any degrees of freedom, as models without noise of their own
/// ask for.

namespace imuscope::noise {

/// The value below which a chi-squared number of `dof` (> 0, need not be whole) lies with probability `p`.
double chi_squared_quantile(double dof, double p);

}  // namespace imuscope::noise
