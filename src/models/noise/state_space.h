#pragma once

/// A composite noise model as a linear Gaussian state-space form, in sample terms: what a Kalman filter, a
/// whitening filter or another tool needs of it.
///
///   x_{k+1} = F x_k + w_k, w ~ N(0, Q)       y_k = H x_k + v_k, v ~ N(0, R)       x_0 ~ N(0, P0)
///
///   WN      R = sigma2, no state
///   QN      x = (e_k, e_{k-1}), y = e_k - e_{k-1}, variance of e = q2
///   MA1     x = (e_k, e_{k-1}), y = e_k + theta e_{k-1}
///   ARMA11  x = (y_k, theta e_k)
///   SIN     x = (alpha sin, alpha cos) of a uniform phase: turns by b radians a sample, no noise
///   RES     x = (x, x' a sample), F = exp of ((0, 1), (-(a^2 + b^2), -2 a)), P0 = sigma2 diag(1, a^2 + b^2)
///   FN, PL  the sum of power_law.h, one state a Gauss-Markov process
///   GM      F = e^-a, Q = sigma2 (1 - e^-2a), P0 = sigma2
///   RW      F = 1, Q = gamma2; its start is unknown (diffuse)
///   DR      x = (ramp, slope), variance of the slope omega^2; its start is unknown (diffuse)

#include <Eigen/Core>
#include <vector>

#include "models/noise/model.h"

namespace imuscope::noise {

struct StateSpace {
  Eigen::MatrixXd F;
  Eigen::MatrixXd Q;
  Eigen::RowVectorXd H;
  double R = 0.0;
  Eigen::MatrixXd P0;         ///< zero where diffuse
  std::vector<bool> diffuse;  ///< per state: nothing is known of its start
};

/// States in the order of the model's components; components of amplitude zero have none.
StateSpace state_space(const Model& model);

}  // namespace imuscope::noise
