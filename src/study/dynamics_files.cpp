#include "study/dynamics_files.h"

#include <fmt/format.h>
#include <tbb/parallel_for.h>
#include <algorithm>
#include <cmath>
#include <iterator>

#include "base/text.h"
#include "estimation/regimes/motion_regimes.h"
#include "models/dynamics/covariates.h"
#include "models/dynamics/json.h"
#include "results/tables/columns.h"
#include "service/pipeline/noise_series.h"
#include "service/run/run_folder.h"

namespace imuscope {
namespace {

void append_value(std::string& line, bool known, double value) {
  line += ',';
  if (known) line += fmt::format("{:.9g}", value);
}

std::string scatter_row(const ErrorRow& row, double time_s) {
  constexpr double kRounded = 1e4;
  fmt::memory_buffer time;
  append_time({std::round(time_s * kRounded) / kRounded, row.utc}, time);
  std::string line = fmt::to_string(time);
  for (const double value : covariates(row)) append_value(line, true, value);
  for (const double value : row.e_gyro_radps) append_value(line, row.gyro_valid, value);
  for (const double value : row.e_accel_mps2) append_value(line, row.accel_valid, value);
  return line + '\n';
}

/// The rows of one regime.
class RowsOfRegime final : public ErrorRowSource {
 public:
  /// Everything must outlive the rows.
  RowsOfRegime(ErrorRowSource& rows, const RegimeTrack& track, std::size_t regime)
      : rows_(rows), track_(track), regime_(regime) {}
  void rewind() override { rows_.rewind(); }
  bool next(ErrorRow& row) override {
    while (rows_.next(row)) {
      if (track_.at(row.time) == regime_) return true;
    }
    return false;
  }

 private:
  ErrorRowSource& rows_;
  const RegimeTrack& track_;
  std::size_t regime_;
};

/// Covariates that have no coefficient beside one another, told once for an S-IMU: before projection alone,
/// as what the projection takes out is no finding.
void say_left_out(const std::string& name, const std::array<AxisDynamics, kErrorAxes>& axes,
                  std::vector<std::string>& remarks) {
  std::vector<std::string> told;
  for (const auto& axis : axes) {
    if (!axis.ols) continue;
    for (const auto& [covariate, why] : axis.ols->left_out) {
      auto sentence = fmt::format("{}: {} {}; it has no coefficient", name, covariate_name(covariate),
                                  why == LeftOut::kConstant ? "does not vary in the dynamic part"
                                                            : "is a combination of the covariates before it");
      if (std::find(told.begin(), told.end(), sentence) == told.end()) told.push_back(std::move(sentence));
    }
  }
  remarks.insert(remarks.end(), told.begin(), told.end());
}

void say_what_is_missing(const std::string& name, const std::array<AxisDynamics, kErrorAxes>& axes,
                         std::vector<std::string>& remarks) {
  for (std::size_t axis = 0; axis < kErrorAxes; ++axis) {
    if (!axes[axis].ols) {
      remarks.push_back(fmt::format("{} {}: no regression on the dynamics: too few rows of the dynamic part",
                                    name, axis_name(axis)));
    } else if (!axes[axis].residual_noise) {
      remarks.push_back(fmt::format("{} {}: the regression has no generalised form: {}", name,
                                    axis_name(axis), axes[axis].no_gls_because));
    }
  }
  say_left_out(name, axes, remarks);
}

DynamicsRegressions regressions_of_device(const DeviceConfig& device, RowSpool& rows,
                                          const RegimeTrack& motion, std::size_t dynamic,
                                          const noise::ModelSpec& residual_model) {
  DynamicsRegressions out;
  if (!rows.whole()) {
    out.remarks.push_back(
        fmt::format("{}: no regression on the dynamics: its rows could not be kept on the "
                    "disk of the run folder; check its free space",
                    device.name));
    return out;
  }
  RowsOfRegime moving(rows, motion, dynamic);
  const auto axes = study_dynamics(moving, {device.rate_hz, residual_model});
  say_what_is_missing(device.name, axes, out.remarks);
  nlohmann::json of_device = nlohmann::json::array();
  append_regressions(device.name, axes, of_device);
  for (auto& regression : of_device) {
    regression["regime"] = kDynamicName;
    out.regressions.push_back(std::move(regression));
  }
  return out;
}

/// Every so many rows one, so that few enough are left.
Result<void> write_scatter_of(const std::string& name, RowSpool& rows, HostTime first_reference_time,
                              const OutputFolder& folder) {
  const std::size_t step = rows.size() / kScatterRows + 1;
  CsvFile file;
  if (auto opened = file.open(folder, device_file_name("scatter", name, ".csv"),
                              tables::csv_header(tables::run_table("scatter")));
      !opened)
    return opened;
  rows.rewind();
  std::size_t k = 0;
  for (ErrorRow row{}; rows.next(row); ++k) {
    if (k % step == 0) file.append(scatter_row(row, to_seconds(row.time - first_reference_time)));
  }
  return file.close();
}

}  // namespace

Regressions::Regressions(const Configuration& configuration, std::vector<RowSpool>& rows,
                         const RegimeTrack& motion, const noise::ModelSpec& residual_model)
    : configuration_(configuration),
      rows_(rows),
      motion_(motion),
      residual_model_(residual_model),
      dynamic_(motion.index_of(kDynamicName)),
      of_device_(rows.size()) {
  if (dynamic_ && motion.total_s(*dynamic_) <= 0.0) dynamic_.reset();
}

std::vector<Job> Regressions::jobs() {
  std::vector<Job> jobs;
  if (!dynamic_) return jobs;
  const auto indices = configuration_.study_indices();
  for (std::size_t i = 0; i < rows_.size(); ++i) {
    jobs.emplace_back([this, i, &device = configuration_.devices[indices[i]]] {
      of_device_[i] = regressions_of_device(device, rows_[i], motion_, *dynamic_, residual_model_);
    });
  }
  return jobs;
}

DynamicsRegressions Regressions::result() && {
  DynamicsRegressions out;
  if (!dynamic_) {
    out.remarks.emplace_back("no regression on the dynamics: there is no dynamic part");
    return out;
  }
  for (DynamicsRegressions& part : of_device_) {
    std::move(part.remarks.begin(), part.remarks.end(), std::back_inserter(out.remarks));
    for (auto& regression : part.regressions) out.regressions.push_back(std::move(regression));
  }
  correct_for_number(out.regressions);
  return out;
}

Result<void> write_scatter(const Configuration& configuration, std::vector<RowSpool>& rows,
                           HostTime first_reference_time, const OutputFolder& folder) {
  const auto indices = configuration.study_indices();
  std::vector<Result<void>> written(rows.size());
  tbb::parallel_for(std::size_t{0}, rows.size(), [&](std::size_t i) {
    written[i] =
        write_scatter_of(configuration.devices[indices[i]].name, rows[i], first_reference_time, folder);
  });
  const auto failed = std::ranges::find_if(written, [](const Result<void>& one) { return !one; });
  return failed == written.end() ? Result<void>{} : *failed;
}

}  // namespace imuscope
