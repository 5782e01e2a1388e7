#pragma once

/// Fits, rankings and joint fits as tables for people and as JSON.

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "models/noise/fit.h"
#include "models/noise/quantities.h"
#include "models/noise/replicates.h"
#include "models/noise/select.h"

namespace imuscope::cli {

void print_fit(const noise::FitResult& fit, noise::SignalUnit unit);
/// Parameters and filter quantities of an over-bounding model.
void print_conservative(const noise::FitResult& bound, noise::SignalUnit unit);
void print_ranking(const std::vector<noise::RankedModel>& ranked);
void print_ranking(const std::vector<noise::CrossValidated>& ranked);
/// One column a replicate, and the test that they are one process.
void print_replicates(const noise::JointFit& joint);

/// {"parameters", "quantities"}
nlohmann::json conservative_json(const noise::FitResult& bound, noise::SignalUnit unit);
nlohmann::json ranking_json(const std::vector<noise::CrossValidated>& ranked);
/// {"replicates": [fits], "homogeneity": test or null}
nlohmann::json replicates_json(const noise::JointFit& joint, noise::SignalUnit unit);

}  // namespace imuscope::cli
