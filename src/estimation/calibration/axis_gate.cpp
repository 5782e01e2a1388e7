#include "estimation/calibration/axis_gate.h"

#include <boost/math/distributions/chi_squared.hpp>

namespace imuscope {

// E-3
double axis_gate(double probability) {
  return boost::math::quantile(boost::math::chi_squared(1.0), probability);
}

}  // namespace imuscope
