#include "results/report/scatter.h"

#include <cmath>

#include "base/units.h"
#include "results/tables/csv_reader.h"

namespace imuscope::report {
namespace {

using tables::CsvReader;

constexpr std::array<const char*, kScatterErrors> kErrorColumns{"e_gyro_x_radps", "e_gyro_y_radps",
                                                                "e_gyro_z_radps", "e_accel_x_mps2",
                                                                "e_accel_y_mps2", "e_accel_z_mps2"};
constexpr std::size_t kGyroErrors = 3;
/// More points than this in one small figure hide each other.
constexpr std::size_t kPointsMax = 1500;

}  // namespace

const std::array<const char*, kScatterCovariates> kScatterCovariateColumns{
    "omega_x",     "omega_y",      "omega_z",      "omega_dot_x",  "omega_dot_y",
    "omega_dot_z", "omega_ddot_x", "omega_ddot_y", "omega_ddot_z", "f_x",
    "f_y",         "f_z",          "f_dot_x",      "f_dot_y",      "f_dot_z"};

Result<Scatter> read_scatter(const std::filesystem::path& file) {
  std::vector<std::string> columns(kScatterCovariateColumns.begin(), kScatterCovariateColumns.end());
  columns.insert(columns.end(), kErrorColumns.begin(), kErrorColumns.end());
  auto reader = CsvReader::open(file, columns);
  if (!reader) return tl::unexpected<Error>(reader.error());
  Scatter all;
  while (reader->next()) {
    for (std::size_t i = 0; i < kScatterCovariates; ++i) all.covariates[i].push_back(reader->number(i));
    for (std::size_t i = 0; i < kScatterErrors; ++i) {
      all.errors[i].push_back((i < kGyroErrors ? kDegPerRad : 1.0) * reader->number(kScatterCovariates + i));
    }
  }
  const std::size_t step = (all.errors[0].size() + kPointsMax - 1) / kPointsMax;
  const auto thin = [step](std::vector<double>& values) {
    if (step <= 1) return;
    std::size_t kept = 0;
    for (std::size_t i = 0; i < values.size(); i += step) values[kept++] = values[i];
    values.resize(kept);
  };
  for (auto& values : all.covariates) thin(values);
  for (auto& values : all.errors) thin(values);
  return all;
}

double correlation(const std::vector<double>& x, const std::vector<double>& y) {
  double n = 0.0;
  double mean_x = 0.0;
  double mean_y = 0.0;
  double xx = 0.0;
  double yy = 0.0;
  double xy = 0.0;
  for (std::size_t i = 0; i < x.size(); ++i) {
    if (!std::isfinite(x[i]) || !std::isfinite(y[i])) continue;
    n += 1.0;
    const double dx = x[i] - mean_x;
    const double dy = y[i] - mean_y;
    mean_x += dx / n;
    mean_y += dy / n;
    xx += dx * (x[i] - mean_x);
    yy += dy * (y[i] - mean_y);
    xy += dx * (y[i] - mean_y);
  }
  return xy / std::sqrt(xx * yy);
}

}  // namespace imuscope::report
