#pragma once

/// regression.json and scatter_NAME.csv: how the errors of a run depend on the dynamics.

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "base/result.h"
#include "noise/model.h"
#include "service/config.h"
#include "service/row_spool.h"

namespace imuscope {

/// The entries of regression.json for every S-IMU. What could not be studied becomes a warning.
nlohmann::json regressions_of(const Configuration& configuration, std::vector<RowSpool>& rows,
                              const noise::ModelSpec& residual_model, std::vector<std::string>& warnings);

/// Writes scatter_NAME.csv for every S-IMU: time_s, the fifteen covariates and the six errors of at most
/// kScatterRows rows, evenly spaced over the drive, at rest and in motion alike.
inline constexpr std::size_t kScatterRows = 3000;
Result<void> write_scatter(const Configuration& configuration, std::vector<RowSpool>& rows,
                           HostTime first_reference_time, const std::filesystem::path& folder);

}  // namespace imuscope
