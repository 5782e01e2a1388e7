#pragma once

/// The rows of scatter_NAME.csv: dynamics and errors of the same samples.

#include <array>
#include <filesystem>
#include <string>
#include <vector>

#include "base/result.h"

namespace imuscope::report {

inline constexpr std::size_t kScatterCovariates = 15;
inline constexpr std::size_t kScatterErrors = 6;
/// Columns of the file, in the order of Scatter::covariates.
extern const std::array<const char*, kScatterCovariates> kScatterCovariateColumns;

/// Columns of equal length; NaN where the file has no number. Gyro errors in deg/s, the others as written.
struct Scatter {
  std::array<std::vector<double>, kScatterCovariates> covariates;
  std::array<std::vector<double>, kScatterErrors> errors;
};

/// Errors: not readable, or a column is missing.
Result<Scatter> read_scatter(const std::filesystem::path& file);

/// Pearson's correlation over the rows where both are known; NaN where one of them does not vary.
double correlation(const std::vector<double>& x, const std::vector<double>& y);

}  // namespace imuscope::report
