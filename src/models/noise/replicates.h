#pragma once

/// Several wavelet variances and one model: replicates of a sensor fitted together, and the distance of a
/// recent window from a model that is in use.

#include <optional>
#include <span>
#include <vector>

#include "base/result.h"
#include "models/noise/fit.h"
#include "models/noise/random_effects.h"

namespace imuscope::noise {

/// The coefficients of all replicates as if recorded with gaps between them; levels that at least one has.
/// Precondition: not empty, all with segments, one efficiency.
WaveletVariance pool(std::span<const WaveletVariance> replicates);

/// What replicates of one model differ by.
struct Spread {
  /// Test that all replicates have the pooled parameters (near-stationarity), homogeneity.h.
  std::optional<JTest> homogeneity;
  /// Of every parameter on the scale of its interval: mean over the replicates, and how much they differ
  /// beyond their errors. Absent where the pooled fit does not determine the parameter.
  std::vector<std::optional<RandomEffects>> of_parameters;
};

/// @param pooled  fitted to all replicates together
Spread spread_of(const FitResult& pooled, std::span<const WaveletVariance> replicates);

/// The pooled intervals become those of the mean of all such replicates and contain their spread. So do sd
/// and covariance, which comparisons and exports are made with.
void contain_spread(FitResult& pooled, const Spread& spread);

/// One model fitted to all replicates, and to each alone.
struct JointFit {
  FitResult pooled;
  std::vector<FitResult> separate;  ///< one a replicate
  Spread spread;                    ///< the pooled intervals contain it
};

/// Errors: those of fit(), and fewer than two replicates (kUsage).
Result<JointFit> fit_jointly(std::span<const WaveletVariance> replicates, const ModelSpec& spec,
                             double rate_hz, const FitOptions& options = {});

/// How far a recent window's wavelet variance is from a model that was fitted to other samples, on the levels
/// with enough coefficients: under the model's own covariance of the window plus the uncertainty of its
/// parameters. Where the model does not explain its own samples (J-test), those samples' wavelet variance
/// stands in for its curve, so that a poor model is not taken for a change. A small p_value says that the
/// behaviour has changed. Absent where the window has no such level.
std::optional<JTest> distance_from_model(const WaveletVariance& window, const FitResult& reference);

}  // namespace imuscope::noise
