#pragma once

/// One plot that says whether what was predicted is true: the error that was measured over the one that was
/// predicted. One: the prediction is right; above: the sensor is worse than the model says.

#include <string>
#include <vector>

#include "results/page/html.h"

namespace imuscope::page {

/// One ratio of measured to predicted, with its 95 % interval where there is one.
struct AgreementPoint {
  double at = 0.0;  ///< abscissa, above zero
  double ratio = 0.0;
  double low = 0.0;  ///< equal to `ratio` where there is no interval
  double high = 0.0;
};

/// Points of one colour, and what they are.
struct AgreementSeries {
  std::string name;
  std::vector<AgreementPoint> points;
};

/// A drawing with both axes logarithmic; nothing where there is no point. Ratios beyond the drawing stand at
/// its edge.
/// @param x_words  what the abscissa is, with its unit
Html agreement_chart(const std::vector<AgreementSeries>& series, const std::string& x_words);

}  // namespace imuscope::page
