#pragma once

/// Series of known noise models.

#include <cstddef>
#include <random>
#include <vector>

#include "noise/model.h"

namespace imuscope {

/// WN, QN, RW and GM of the model summed; GM from its stationary distribution, RW from zero.
/// Precondition: no other processes.
std::vector<double> simulated_noise(const noise::Model& model, std::size_t n, std::mt19937_64& random);

}  // namespace imuscope
