#pragma once

/// The measure that the filter's own covariance is held against: predict and update as a textbook writes
/// them, with dense matrices of dynamic size in Eigen and Joseph's form. One library per instruction set,
/// each compiled with the flags of the covariance loops of that set and nothing of Eigen shared between them.

#include <cstddef>

extern "C" {

/// One epoch: P <- Phi P Phi' + Q, then `updates` updates with H (3 x n) and R (3 x 3). All column-major.
/// @return trace of P, so that nothing can be optimised away
using DenseJosephEpoch = double (*)(double* P, const double* Phi, const double* Q, const double* H,
                                    const double* R, std::size_t n, std::size_t updates);

double dense_joseph_baseline(double* P, const double* Phi, const double* Q, const double* H, const double* R,
                             std::size_t n, std::size_t updates);
double dense_joseph_avx2(double* P, const double* Phi, const double* Q, const double* H, const double* R,
                         std::size_t n, std::size_t updates);
double dense_joseph_avx512(double* P, const double* Phi, const double* Q, const double* H, const double* R,
                           std::size_t n, std::size_t updates);
}
