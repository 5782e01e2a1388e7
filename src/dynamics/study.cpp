#include "dynamics/study.h"

#include <algorithm>
#include <span>

#include "dynamics/covariates.h"
#include "noise/wavelet_variance.h"
#include "noise/whitener.h"

namespace imuscope {
namespace {

/// A hole in the counters longer than this (10 min at 100 Hz) starts the whitening filter's prediction no
/// further: by then nothing is known of the noise.
constexpr std::int64_t kLongestHole = 60'000;

/// Layout of one axis' row: intercept, calibration columns, covariates, error.
class AxisColumns {
 public:
  explicit AxisColumns(std::size_t axis) : axis_(axis), calibration_(calibration_column_count(axis)) {}

  [[nodiscard]] std::size_t size() const { return 1 + calibration_ + kCovariates + 1; }
  [[nodiscard]] std::size_t calibration() const { return calibration_; }

  /// False where the axis has no value in the row.
  bool fill(const ErrorRow& row) {
    if (!(axis_ < 3 ? row.gyro_valid : row.accel_valid)) return false;
    values_[0] = 1.0;
    std::array<double, kAccelCalibrationColumns> columns{};
    calibration_columns(row, axis_, columns);
    std::copy_n(columns.begin(), calibration_, values_.begin() + 1);
    const auto all = covariates(row);
    std::copy(all.begin(), all.end(), values_.begin() + 1 + static_cast<std::ptrdiff_t>(calibration_));
    values_[size() - 1] = axis_ < 3 ? row.e_gyro_radps[axis_] : row.e_accel_mps2[axis_ - 3];
    return true;
  }
  [[nodiscard]] std::span<double> all() { return {values_.data(), size()}; }

 private:
  std::size_t axis_;
  std::size_t calibration_;
  std::array<double, 1 + kAccelCalibrationColumns + kCovariates + 1> values_{};
};

/// Sums of one axis before and after projection.
class AxisSums {
 public:
  explicit AxisSums(const AxisColumns& columns)
      : calibration_(columns.calibration()),
        raw_(1, kCovariates),
        projected_(1 + calibration_, kCovariates) {}

  void add(std::span<const double> row) {
    std::array<double, 1 + kCovariates + 1> without{};
    without[0] = row[0];
    std::copy(row.begin() + 1 + static_cast<std::ptrdiff_t>(calibration_), row.end(), without.begin() + 1);
    raw_.add(without);
    projected_.add(row);
  }
  [[nodiscard]] const RegressionSums& raw() const { return raw_; }
  [[nodiscard]] const RegressionSums& projected() const { return projected_; }

 private:
  std::size_t calibration_;
  RegressionSums raw_;
  RegressionSums projected_;
};

/// What is left of the errors of one axis beside everything that the columns explain, one value a counter.
struct ResidualSeries {
  std::vector<double> values;
  std::vector<std::uint8_t> mask;
};

/// Walks over the rows counter by counter: `row` for each, `missing` for those that are not there.
template <typename OnRow, typename OnMissing>
void for_each_counter(ErrorRowSource& rows, OnRow&& on_row, OnMissing&& on_missing) {
  rows.rewind();
  ErrorRow row{};
  bool started = false;
  std::int64_t expected = 0;
  while (rows.next(row)) {
    if (started && row.counter < expected) continue;
    const std::int64_t hole = started ? std::min(row.counter - expected, kLongestHole) : 0;
    for (std::int64_t i = 0; i < hole; ++i) on_missing();
    on_row(row);
    started = true;
    expected = row.counter + 1;
  }
}

double residual_of(std::span<const double> row, const Eigen::VectorXd& gamma_beta) {
  double value = row.back();
  for (std::size_t i = 0; i + 1 < row.size(); ++i) value -= row[i] * gamma_beta(static_cast<Eigen::Index>(i));
  return value;
}

std::array<AxisColumns, kErrorAxes> all_columns() {
  return {AxisColumns(0), AxisColumns(1), AxisColumns(2), AxisColumns(3), AxisColumns(4), AxisColumns(5)};
}

std::vector<AxisSums> all_sums(const std::array<AxisColumns, kErrorAxes>& columns) {
  std::vector<AxisSums> sums;
  for (const auto& axis : columns) sums.emplace_back(axis);
  return sums;
}

std::vector<AxisSums> ordinary_sums(ErrorRowSource& rows) {
  auto columns = all_columns();
  auto sums = all_sums(columns);
  rows.rewind();
  ErrorRow row{};
  while (rows.next(row)) {
    for (std::size_t axis = 0; axis < kErrorAxes; ++axis) {
      if (columns[axis].fill(row)) sums[axis].add(columns[axis].all());
    }
  }
  return sums;
}

std::vector<ResidualSeries> residuals(ErrorRowSource& rows, const std::vector<AxisSums>& sums) {
  auto columns = all_columns();
  std::vector<ResidualSeries> series(kErrorAxes);
  std::vector<Eigen::VectorXd> solutions;
  for (const auto& axis : sums) solutions.push_back(axis.projected().all_coefficients());
  const auto append = [&](std::size_t axis, double value, bool valid) {
    series[axis].values.push_back(value);
    series[axis].mask.push_back(valid ? 1 : 0);
  };
  for_each_counter(
      rows,
      [&](const ErrorRow& row) {
        for (std::size_t axis = 0; axis < kErrorAxes; ++axis) {
          const bool valid = columns[axis].fill(row);
          append(axis, valid ? residual_of(columns[axis].all(), solutions[axis]) : 0.0, valid);
        }
      },
      [&] {
        for (std::size_t axis = 0; axis < kErrorAxes; ++axis) append(axis, 0.0, false);
      });
  return series;
}

void fit_residual(const ResidualSeries& series, const DynamicsOptions& options, AxisDynamics& axis) {
  noise::WvOptions wv_options;
  wv_options.mask = series.mask;
  const auto wv = noise::haar_wavelet_variance(series.values, wv_options);
  if (!wv) {
    axis.no_gls_because = wv.error().what;
    return;
  }
  auto fit = noise::fit(*wv, options.noise_model, options.rate_hz);
  if (!fit) {
    axis.no_gls_because = fit.error().what;
    return;
  }
  // A Gauss-Markov process too many takes up chance fluctuations of the residual, always as more noise, and
  // the tests become too careful: it has to earn its place.
  for (noise::ModelSpec spec = fit->spec; spec.count(noise::ProcessKind::kGaussMarkov) > 1;) {
    spec.processes.erase(
        std::find(spec.processes.begin(), spec.processes.end(), noise::ProcessKind::kGaussMarkov));
    auto simpler = noise::fit(*wv, spec, options.rate_hz);
    if (!simpler || simpler->criterion > fit->criterion) break;
    fit = std::move(simpler);
  }
  axis.residual_noise = std::move(*fit);
}

/// Whitened rows of the axes whose noise is known.
void whitened_regressions(ErrorRowSource& rows, double confidence,
                          std::array<AxisDynamics, kErrorAxes>& result) {
  auto columns = all_columns();
  auto sums = all_sums(columns);
  std::array<std::optional<noise::Whitener>, kErrorAxes> whiteners;
  for (std::size_t axis = 0; axis < kErrorAxes; ++axis) {
    if (result[axis].residual_noise) {
      whiteners[axis].emplace(result[axis].residual_noise->model, columns[axis].size());
    }
  }
  const auto skip = [&](std::size_t axis) {
    if (whiteners[axis]) whiteners[axis]->skip();
  };
  for_each_counter(
      rows,
      [&](const ErrorRow& row) {
        for (std::size_t axis = 0; axis < kErrorAxes; ++axis) {
          if (!whiteners[axis]) continue;
          if (!columns[axis].fill(row)) {
            skip(axis);
          } else if (whiteners[axis]->push(columns[axis].all())) {
            sums[axis].add(columns[axis].all());
          }
        }
      },
      [&] {
        for (std::size_t axis = 0; axis < kErrorAxes; ++axis) skip(axis);
      });
  for (std::size_t axis = 0; axis < kErrorAxes; ++axis) {
    if (!whiteners[axis]) continue;
    result[axis].gls = sums[axis].raw().solve(confidence);
    result[axis].gls_projected = sums[axis].projected().solve(confidence);
  }
}

}  // namespace

std::array<AxisDynamics, kErrorAxes> study_dynamics(ErrorRowSource& rows, const DynamicsOptions& options) {
  std::array<AxisDynamics, kErrorAxes> result;
  const auto sums = ordinary_sums(rows);
  for (std::size_t axis = 0; axis < kErrorAxes; ++axis) {
    result[axis].ols = sums[axis].raw().solve(options.confidence);
    result[axis].ols_projected = sums[axis].projected().solve(options.confidence);
  }
  const auto series = residuals(rows, sums);
  for (std::size_t axis = 0; axis < kErrorAxes; ++axis) fit_residual(series[axis], options, result[axis]);
  whitened_regressions(rows, options.confidence, result);
  return result;
}

}  // namespace imuscope
