#include "service/dynamics_files.h"

#include <fmt/format.h>

#include "dynamics/covariates.h"
#include "dynamics/json.h"
#include "service/noise_series.h"
#include "service/run_folder.h"

namespace imuscope {
namespace {

std::string scatter_header() {
  std::string header = "time_s";
  for (std::size_t i = 0; i < kCovariates; ++i) header += fmt::format(",{}", covariate_name(i));
  return header +
         ",e_gyro_x_radps,e_gyro_y_radps,e_gyro_z_radps,e_accel_x_mps2,e_accel_y_mps2,e_accel_z_mps2\n";
}

void append_value(std::string& line, bool known, double value) {
  line += ',';
  if (known) line += fmt::format("{:.9g}", value);
}

std::string scatter_row(const ErrorRow& row, double time_s) {
  std::string line = fmt::format("{:.4f}", time_s);
  for (const double value : covariates(row)) append_value(line, true, value);
  for (const double value : row.e_gyro_radps) append_value(line, row.gyro_valid, value);
  for (const double value : row.e_accel_mps2) append_value(line, row.accel_valid, value);
  return line + '\n';
}

std::size_t count_rows(RowSpool& rows) {
  rows.rewind();
  std::size_t n = 0;
  for (ErrorRow row{}; rows.next(row);) ++n;
  return n;
}

}  // namespace

nlohmann::json regressions_of(const Configuration& configuration, std::vector<RowSpool>& rows,
                              const noise::ModelSpec& residual_model, std::vector<std::string>& warnings) {
  nlohmann::json regressions = nlohmann::json::array();
  const auto indices = configuration.study_indices();
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const auto& device = configuration.devices[indices[i]];
    if (!rows[i].whole()) {
      warnings.push_back(
          fmt::format("{}: no regression on the dynamics: its rows could not be kept on the "
                      "disk of the run folder; check its free space",
                      device.name));
      continue;
    }
    const auto axes = study_dynamics(rows[i], {device.rate_hz, residual_model});
    for (std::size_t axis = 0; axis < kErrorAxes; ++axis) {
      if (axes[axis].ols && !axes[axis].residual_noise) {
        warnings.push_back(fmt::format("{} {}: the regression has no generalised form: {}", device.name,
                                       axis_name(axis), axes[axis].no_gls_because));
      }
    }
    append_regressions(device.name, axes, regressions);
  }
  return regressions;
}

Result<void> write_scatter(const Configuration& configuration, std::vector<RowSpool>& rows,
                           HostTime first_reference_time, const std::filesystem::path& folder) {
  const auto indices = configuration.study_indices();
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const std::size_t step = count_rows(rows[i]) / kScatterRows + 1;
    CsvFile file;
    const auto path = folder / fmt::format("scatter_{}.csv", configuration.devices[indices[i]].name);
    if (auto opened = file.open(path, scatter_header()); !opened) return opened;
    rows[i].rewind();
    std::size_t k = 0;
    for (ErrorRow row{}; rows[i].next(row); ++k) {
      if (k % step == 0) file.append(scatter_row(row, to_seconds(row.time - first_reference_time)));
    }
    if (auto closed = file.close(); !closed) return closed;
  }
  return {};
}

}  // namespace imuscope
