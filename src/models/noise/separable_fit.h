#pragma once

/// Global minimum of |W (y - model)| over all parameters of a model. The amplitudes are linear and never
/// negative; only the shapes (rates) are searched: a grid over their coordinates with the amplitudes solved
/// at each point, then a polish of the best few local minima of the grid. No random numbers.

#include <Eigen/Core>
#include <vector>

#include "models/noise/model.h"
#include "models/noise/nnls.h"

namespace imuscope::noise {

/// Interval of a search coordinate: log of a GM's a, of a SIN's b, of both of a RES, atanh of theta and phi
/// and of a PL's exponent less one.
struct CoordinateRange {
  double low = 0.0;
  double high = 0.0;
};

/// Coordinate of a shape value of a kind, its inverse, and d(shape)/d(coordinate).
double coordinate_of_shape(ProcessKind kind, double shape) noexcept;
double shape_of_coordinate(ProcessKind kind, double coordinate) noexcept;
double shape_slope(ProcessKind kind, double coordinate) noexcept;
/// What the levels 1..highest_level can tell apart from the process at the end of the range.
CoordinateRange coordinate_range(ProcessKind kind, int i, int highest_level) noexcept;

/// One model against the whitened wavelet variances of some levels.
struct SeparableProblem {
  ModelSpec spec;
  std::vector<int> levels;   ///< rows of y
  Eigen::VectorXd y;         ///< wavelet variances
  Eigen::MatrixXd whitener;  ///< W; the objective is |W (y - model)|^2
};

/// A minimum and the parameters that reach it.
struct SeparableSolution {
  Model model;  ///< components in the order of the spec, GM by falling rate
  double objective = 0.0;
};

SeparableSolution find_global_minimum(const SeparableProblem& problem);

/// Starts for polish(): the smaller model with one more term of `kind`, at the slowest rate and at those
/// where the amplitudes alone gain most from it; one start for kinds without a rate.
std::vector<Model> with_one_more(const SeparableProblem& problem, const Model& smaller, ProcessKind kind);

/// The local minimum that the shapes of `start` lead to.
SeparableSolution polish(const SeparableProblem& problem, const Model& start);

}  // namespace imuscope::noise
