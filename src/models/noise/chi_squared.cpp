#include "models/noise/chi_squared.h"

#include <boost/math/distributions/chi_squared.hpp>
#include <boost/math/distributions/normal.hpp>
#include <cmath>

namespace imuscope::noise {

double chi_squared_quantile(double dof, double p) {
  // Beyond this the cube root is normal to twelve digits (Wilson and Hilferty 1931), and the exact series
  // take long.
  constexpr double kNormalAbove = 1e8;
  if (dof < kNormalAbove) return boost::math::quantile(boost::math::chi_squared(dof), p);
  const double spread = 2.0 / (9.0 * dof);
  const double root = 1.0 - spread + boost::math::quantile(boost::math::normal(), p) * std::sqrt(spread);
  return dof * root * root * root;
}

double chi_squared_p_value(double statistic, double dof) {
  return boost::math::cdf(boost::math::complement(boost::math::chi_squared(dof), statistic));
}

}  // namespace imuscope::noise
