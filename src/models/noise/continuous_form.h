#pragma once

/// What state_space.h leaves open of a model's linear form: the names of its states, and its continuous-time
/// twin.

#include <Eigen/Core>
#include <string>
#include <vector>

#include "base/result.h"
#include "models/noise/model.h"

namespace imuscope::noise {

/// One name a state of state_space(): "GM1", "RW", "DR", "DR slope", ...
std::vector<std::string> state_names(const Model& model);

/// dx/dt = A x + u, Qc the density of u, such that sampling at the rate gives F and Q of state_space().
struct ContinuousForm {
  Eigen::MatrixXd a;
  Eigen::MatrixXd qc;
};

/// Errors (kWork): a component that remembers samples (QN, MA1, ARMA11) has no continuous form.
Result<ContinuousForm> continuous_form(const Model& model, double rate_hz);

}  // namespace imuscope::noise
