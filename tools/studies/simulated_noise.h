#pragma once

/// Series of known noise models.

#include <cstddef>
#include <random>
#include <vector>

#include "noise/model.h"

namespace imuscope {

/// The model's processes summed: GM and RES from their stationary distribution, RW and DR from zero, the
/// slope of DR of random sign. FN and PL are made in the frequency domain from their spectrum, over twice the
/// length. Precondition: no MA1, ARMA11 or SIN.
std::vector<double> simulated_noise(const noise::Model& model, std::size_t n, std::mt19937_64& random);

}  // namespace imuscope
