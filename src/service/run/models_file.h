#pragma once

/// models.json: fits by S-IMU, axis and regime.

#include <nlohmann/json.hpp>
#include <string>

#include "base/output_folder.h"
#include "base/result.h"
#include "models/noise/fit.h"

namespace imuscope {

/// One entry.
/// @param axis  0 to 5, see noise_series.h
nlohmann::json model_json(const noise::FitResult& fit, const std::string& name, std::size_t axis,
                          const std::string& regime);

/// @param models  an array of model_json()
Result<void> write_models(const OutputFolder& folder, const nlohmann::json& models);

/// The fit of one entry. Errors (kWork): there is none, or it is damaged.
/// @param models  the array
Result<noise::FitResult> read_model(const nlohmann::json& models, const std::string& name, std::size_t axis,
                                    const std::string& regime);

}  // namespace imuscope
