#pragma once

/// Which terms of a model a signal supports: all sub-models compared by likelihood with a price for each
/// parameter.

#include <string>
#include <vector>

#include "base/result.h"
#include "noise/fit.h"

namespace imuscope::noise {

struct RankedModel {
  FitResult fit;
  /// FitResult::criterion: a term must earn its place.
  double criterion = 0.0;
  std::string reason;  ///< why it stands where it stands
};

/// Sub-models of `full` with at least one term, best first. Identifiable models come before the others; of
/// two whose criteria differ by less than 2 the one with fewer parameters comes first.
Result<std::vector<RankedModel>> rank_models(const WaveletVariance& wv, const ModelSpec& full, double rate_hz,
                                             const FitOptions& options = {});

}  // namespace imuscope::noise
