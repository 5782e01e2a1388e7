#pragma once

/// The Kalman filter of a noise model as a whitening filter: turns series that carry this noise into series
/// of independent values of variance 1, the same linear map for every column. Ordinary least squares on
/// whitened columns is generalised least squares on the columns, gaps included.

#include <Eigen/Core>
#include <span>

#include "models/noise/state_space.h"

namespace imuscope::noise {

class Whitener {
 public:
  /// @param columns  series that go through the same map; at least 1
  /// Precondition: the model has a component of positive amplitude.
  Whitener(const Model& model, std::size_t columns);

  /// Whitens one sample of every column in place. Returns false while an unknown start (random walk, ramp) is
  /// still being used up: such a row carries no information and is to be left out.
  bool push(std::span<double> row);
  /// Tells of a sample that is missing.
  void skip();

 private:
  void update_gain();

  StateSpace form_;
  Eigen::MatrixXd P_;       ///< of the state before the sample
  Eigen::MatrixXd states_;  ///< one column a series
  Eigen::VectorXd gain_;
  Eigen::RowVectorXd innovation_;
  double innovation_sd_ = 1.0;
  double diffuse_variance_ = 0.0;
  bool steady_ = false;  ///< the gain no longer changes
};

}  // namespace imuscope::noise
