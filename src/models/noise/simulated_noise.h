#pragma once

/// Series of known noise models.

#include <cstddef>
#include <random>
#include <span>
#include <vector>

#include "models/noise/model.h"

namespace imuscope::noise {

/// The model's processes summed: GM and RES from their stationary distribution, RW and DR from zero, the
/// slope of DR of random sign, SIN of random phase. FN and PL are made in the frequency domain from their
/// spectrum, over twice the length. The same state of `random` gives the same series.
void simulate_noise(const Model& model, std::mt19937_64& random, std::span<double> x);

/// The same as a series of its own.
std::vector<double> simulated_noise(const Model& model, std::size_t n, std::mt19937_64& random);

}  // namespace imuscope::noise
