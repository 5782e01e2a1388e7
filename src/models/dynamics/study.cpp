#include "models/dynamics/study.h"

#include <algorithm>
#include <numeric>
#include <span>

#include "models/dynamics/column_wavelets.h"
#include "models/dynamics/covariates.h"
#include "models/dynamics/noise_uncertainty.h"
#include "models/noise/wavelet_variance.h"
#include "models/noise/whitener.h"

namespace imuscope {
namespace {

constexpr std::size_t kTriadAxes = 3;
/// A hole in the counters longer than this (10 min at 100 Hz) starts the whitening filter's prediction no
/// further: by then nothing is known of the noise.
constexpr std::int64_t kLongestHole = 60'000;
/// Of the residual's wavelet variance; the fit does not use them.
constexpr double kIntervals = 0.95;

/// D-4: layout of one axis' row: intercept, calibration columns, covariates, error.
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
  for_each_counter(
      rows,
      [&](const ErrorRow& row) {
        for (std::size_t axis = 0; axis < kErrorAxes; ++axis) {
          if (columns[axis].fill(row)) sums[axis].add(columns[axis].all());
        }
      },
      [] {});
  return sums;
}

/// Of the three axes from `first` on. A triad at a time: those of all six would be the most that a study of a
/// long drive keeps, and its rows are read twice in less time than they are worked on.
std::array<ResidualSeries, kTriadAxes> residuals(ErrorRowSource& rows, const std::vector<AxisSums>& sums,
                                                 std::size_t first) {
  auto columns = all_columns();
  std::array<ResidualSeries, kTriadAxes> series;
  std::array<Eigen::VectorXd, kTriadAxes> solutions;
  for (std::size_t k = 0; k < kTriadAxes; ++k) solutions[k] = sums[first + k].projected().all_coefficients();
  const auto append = [&](std::size_t k, double value, bool valid) {
    series[k].values.push_back(value);
    series[k].mask.push_back(valid ? 1 : 0);
  };
  for_each_counter(
      rows,
      [&](const ErrorRow& row) {
        for (std::size_t k = 0; k < kTriadAxes; ++k) {
          AxisColumns& of_axis = columns[first + k];
          const bool valid = of_axis.fill(row);
          append(k, valid ? residual_of(of_axis.all(), solutions[k]) : 0.0, valid);
        }
      },
      [&] {
        for (std::size_t k = 0; k < kTriadAxes; ++k) append(k, 0.0, false);
      });
  return series;
}

/// The columns of every axis, without the error.
std::vector<std::vector<ColumnLevel>> column_levels(ErrorRowSource& rows) {
  auto columns = all_columns();
  std::vector<ColumnWavelets> wavelets;
  for (const auto& axis : columns) wavelets.emplace_back(axis.size() - 1);
  for_each_counter(
      rows,
      [&](const ErrorRow& row) {
        for (std::size_t axis = 0; axis < kErrorAxes; ++axis) {
          if (columns[axis].fill(row)) {
            wavelets[axis].add(columns[axis].all().first(columns[axis].size() - 1));
          } else {
            wavelets[axis].skip();
          }
        }
      },
      [&] {
        for (auto& axis : wavelets) axis.skip();
      });
  std::vector<std::vector<ColumnLevel>> levels;
  for (const auto& axis : wavelets) levels.push_back(axis.levels());
  return levels;
}

/// A noise model, and the wavelet variance that it was fitted to.
struct ResidualNoise {
  noise::WaveletVariance wv;
  noise::FitResult fit;
};

/// A regression takes some of the noise along: what it took is given back (D-7).
void give_back(const std::vector<ColumnLevel>& columns, const Eigen::MatrixXd& phi,
               noise::WaveletVariance& wv) {
  for (const ColumnLevel& column : columns) {
    for (noise::WvLevel& level : wv.levels) {
      if (level.level == column.level) level.value += column.products.cwiseProduct(phi).sum();
    }
  }
  noise::set_intervals(wv.levels, wv.efficiency, kIntervals);
}

std::optional<ResidualNoise> fit_residual(noise::WaveletVariance wv, const DynamicsOptions& options,
                                          std::string& why_not) {
  auto fit = noise::fit(wv, options.noise_model, options.rate_hz);
  if (!fit) {
    why_not = fit.error().what;
    return std::nullopt;
  }
  return ResidualNoise{std::move(wv), std::move(*fit)};
}

using AllNoise = std::array<std::optional<ResidualNoise>, kErrorAxes>;

/// D-6: sums of the whitened rows, of the axes whose noise is known.
std::vector<AxisSums> whitened_sums(ErrorRowSource& rows, const AllNoise& noises) {
  auto columns = all_columns();
  auto sums = all_sums(columns);
  std::array<std::optional<noise::Whitener>, kErrorAxes> whiteners;
  for (std::size_t axis = 0; axis < kErrorAxes; ++axis) {
    if (noises[axis]) whiteners[axis].emplace(noises[axis]->fit.model, columns[axis].size());
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
  return sums;
}

/// What the rows were whitened with for a regression, and the columns of it.
struct Whitened {
  const AllNoise& noises;
  const std::vector<std::vector<ColumnLevel>>& columns;
};

/// The noise of every axis from what its regression left.
/// @param by  null where the rows of the regression were not whitened
AllNoise fit_residuals(ErrorRowSource& rows, const std::vector<AxisSums>& sums, const Whitened* by,
                       const DynamicsOptions& options, std::array<AxisDynamics, kErrorAxes>& result) {
  AllNoise noises;
  for (std::size_t first = 0; first < kErrorAxes; first += kTriadAxes) {
    const auto series = residuals(rows, sums, first);
    for (std::size_t axis = first; axis < first + kTriadAxes; ++axis) {
      if (by != nullptr && !by->noises[axis]) continue;  // why is said already
      const ResidualSeries& left = series[axis - first];
      noise::WvOptions wv_options;
      wv_options.mask = left.mask;
      auto wv = noise::haar_wavelet_variance(left.values, wv_options);
      if (!wv) {
        result[axis].no_gls_because = wv.error().what;
        continue;
      }
      if (by != nullptr) give_back(by->columns[axis], sums[axis].projected().all_covariances(), *wv);
      noises[axis] = fit_residual(std::move(*wv), options, result[axis].no_gls_because);
    }
  }
  return noises;
}

/// Of the columns with those of the calibration, the intercept and the covariates.
std::vector<Eigen::Index> raw_columns(std::size_t calibration) {
  std::vector<Eigen::Index> kept(1 + kCovariates);
  std::iota(kept.begin() + 1, kept.end(), static_cast<Eigen::Index>(1 + calibration));
  return kept;
}

}  // namespace

std::array<AxisDynamics, kErrorAxes> study_dynamics(ErrorRowSource& rows, const DynamicsOptions& options) {
  std::array<AxisDynamics, kErrorAxes> result;
  const auto sums = ordinary_sums(rows);
  for (std::size_t axis = 0; axis < kErrorAxes; ++axis) {
    result[axis].ols = sums[axis].raw().solve(options.confidence);
    result[axis].ols_projected = sums[axis].projected().solve(options.confidence);
  }
  const auto columns = column_levels(rows);
  AllNoise noises = fit_residuals(rows, sums, nullptr, options, result);
  const Whitened by{noises, columns};
  noises = fit_residuals(rows, whitened_sums(rows, noises), &by, options, result);
  const auto whitened = whitened_sums(rows, noises);
  for (std::size_t axis = 0; axis < kErrorAxes; ++axis) {
    if (!noises[axis]) continue;
    const NoiseUncertainty noise(columns[axis], noises[axis]->fit, noises[axis]->wv);
    const NoiseUncertainty of_raw = noise.of(raw_columns(calibration_column_count(axis)));
    result[axis].gls = whitened[axis].raw().solve(options.confidence, &of_raw);
    result[axis].gls_projected = whitened[axis].projected().solve(options.confidence, &noise);
    result[axis].residual_noise = std::move(noises[axis]->fit);
  }
  return result;
}

}  // namespace imuscope
