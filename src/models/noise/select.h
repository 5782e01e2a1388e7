#pragma once

/// Which terms of a model a signal supports: all sub-models compared by likelihood with a price for each
/// parameter, or, with replicates, by what they predict of a replicate left out.

#include <span>
#include <string>
#include <vector>

#include "base/result.h"
#include "models/noise/fit.h"

namespace imuscope::noise {

/// A sub-model and where it stands.
struct RankedModel {
  FitResult fit;
  /// FitResult::criterion: a term must earn its place.
  double criterion = 0.0;
  std::string reason;  ///< why it stands where it stands
};

/// Sub-models of `full` with at least one term, best first. Identifiable models come before the others; of
/// two whose criteria differ by less than 4 the one with fewer parameters comes first.
Result<std::vector<RankedModel>> rank_models(const WaveletVariance& wv, const ModelSpec& full, double rate_hz,
                                             const FitOptions& options = {});

/// A model and those that fit the record as well: what is said of the sensor has to hold for them, too.
struct GrownModel {
  FitResult best;
  std::vector<FitResult> rivals;  ///< with quick intervals, at most eight, the likeliest first (T-4)
};

/// Term by term: beginning with the best single process, or white noise and one more, each round adds the one
/// of `terms` that gains most, while the criterion falls by more than those of two equally good models may
/// differ (or the data reject what there is); in the end terms without which it is as good go again, and
/// others take the places of those that explain less. A few dozen fits where rank_models() makes all
/// sub-models.
/// @param terms  what may be added, a GM up to three times, the others once; not empty
/// @return the winner, with `options.intervals`. Errors: those of fit() where not even one process fits.
Result<GrownModel> grow_model(const WaveletVariance& wv, std::span<const ProcessKind> terms, double rate_hz,
                              const FitOptions& options = {});

/// A sub-model, and how well it predicts replicates that it has not seen.
struct CrossValidated {
  FitResult pooled;  ///< of all replicates together
  /// Cross-validated WVIC: mean over the replicates of (wv - model)' V^-1 (wv - model), the model fitted to
  /// the other replicates, V one for all models (that of the full model).
  double score = 0.0;
  double worse_by = 0.0;     ///< mean of the score's differences to the best, replicate by replicate
  double worse_by_sd = 0.0;  ///< sd of that mean
  std::string reason;
};

/// Sub-models of `full` by how well they predict a replicate that they have not seen, best first. Models
/// whose difference to the best lies within one sd of itself are equivalent; of those the one with the fewest
/// parameters comes first. Errors: those of fit(), and fewer than three replicates (kUsage).
Result<std::vector<CrossValidated>> cross_validate(std::span<const WaveletVariance> replicates,
                                                   const ModelSpec& full, double rate_hz,
                                                   const FitOptions& options = {});

}  // namespace imuscope::noise
