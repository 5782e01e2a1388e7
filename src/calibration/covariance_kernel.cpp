#include "calibration/covariance_kernel.h"

#include <algorithm>
#include <cmath>
#include <new>

#include "base/contracts.h"

// Plain loops, compiled once per instruction set; the loader picks the widest one that the CPU has. No loop
// adds up across lanes, and fused multiply-add is off, so that every version gives the same bits. The
// sanitizers do not stand a choice made before their own start.
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && !defined(__SANITIZE_ADDRESS__) && \
    !defined(__SANITIZE_THREAD__)
#define IMUSCOPE_VECTOR_VERSIONS \
  __attribute__((target_clones("arch=skylake-avx512", "arch=haswell", "default")))
#else
#define IMUSCOPE_VECTOR_VERSIONS
#endif

namespace imuscope {
namespace {

constexpr std::size_t kN = kNavigationStates;
constexpr std::size_t kC = kNavigationCoupledStates;
constexpr std::align_val_t kAlignment{64};

/// T = Phi P for the navigation rows: T is 15 rows of `padded`.
IMUSCOPE_VECTOR_VERSIONS
void transition_rows(const double* __restrict phi, const double* __restrict decay, const double* __restrict p,
                     double* __restrict t, std::size_t padded) {
  for (std::size_t i = 0; i < kC; ++i) {
    double* __restrict row = t + i * padded;
    const double* a = phi + i * kN;
    for (std::size_t c = 0; c < padded; c += kCovariancePadding) {
      double sum[kCovariancePadding] = {};
      for (std::size_t k = 0; k < kN; ++k) {
        const double* source = p + k * padded + c;
        for (std::size_t l = 0; l < kCovariancePadding; ++l) sum[l] += a[k] * source[l];
      }
      for (std::size_t l = 0; l < kCovariancePadding; ++l) row[c + l] = sum[l];
    }
  }
  for (std::size_t i = kC; i < kN; ++i) {
    double* __restrict row = t + i * padded;
    const double* source = p + i * padded;
    for (std::size_t c = 0; c < padded; ++c) row[c] = decay[i - kC] * source[c];
  }
}

/// out += h * row, all `padded` long.
IMUSCOPE_VECTOR_VERSIONS
void add_scaled_row(double h, const double* __restrict row, double* __restrict out, std::size_t padded) {
  for (std::size_t c = 0; c < padded; ++c) out[c] += h * row[c];
}

/// P -= W W^T with W^T given as `rows` rows.
IMUSCOPE_VECTOR_VERSIONS
void downdate(double* __restrict p, const double* __restrict w, std::size_t rows, std::size_t padded) {
  const double* __restrict w0 = w;
  const double* __restrict w1 = w + padded;
  const double* __restrict w2 = w + 2 * padded;
  if (rows == 3) {
    for (std::size_t i = 0; i < padded; ++i) {
      const double a = w0[i];
      const double b = w1[i];
      const double c = w2[i];
      double* __restrict row = p + i * padded;
      for (std::size_t j = 0; j < padded; ++j) row[j] -= (a * w0[j] + b * w1[j]) + c * w2[j];
    }
    return;
  }
  for (std::size_t r = 0; r < rows; ++r) {
    const double* __restrict wr = w + r * padded;
    for (std::size_t i = 0; i < padded; ++i) {
      const double a = wr[i];
      double* __restrict row = p + i * padded;
      for (std::size_t j = 0; j < padded; ++j) row[j] -= a * wr[j];
    }
  }
}

}  // namespace

MeasurementBlock& SparseMeasurement::append(std::size_t column, std::size_t width) noexcept {
  IMUSCOPE_EXPECTS(count < kMaxMeasurementBlocks);
  MeasurementBlock& block = blocks[count++];
  block = MeasurementBlock{};
  block.column = column;
  block.width = width;
  return block;
}

void CovarianceKernel::AlignedDelete::operator()(double* memory) const noexcept {
  ::operator delete[](memory, kAlignment);
}

CovarianceKernel::CovarianceKernel(std::size_t dimension)
    : dimension_(dimension),
      padded_((dimension + kCovariancePadding - 1) / kCovariancePadding * kCovariancePadding) {
  IMUSCOPE_EXPECTS(dimension > 0);
  // predict_navigation() reads and writes 15 rows, whatever the dimension.
  padded_ = std::max(padded_, (kN + kCovariancePadding - 1) / kCovariancePadding * kCovariancePadding);
  const std::size_t rows = padded_ + kN + 2 * kMaxMeasurementRows + 1;
  memory_.reset(static_cast<double*>(::operator new[](rows* padded_ * sizeof(double), kAlignment)));
  std::fill_n(memory_.get(), rows * padded_, 0.0);
  p_ = memory_.get();
  scratch_ = p_ + padded_ * padded_;
  pht_ = scratch_ + kN * padded_;
  w_ = pht_ + kMaxMeasurementRows * padded_;
  correction_ = w_ + kMaxMeasurementRows * padded_;
}

void CovarianceKernel::set(std::size_t i, std::size_t j, double value) noexcept {
  IMUSCOPE_EXPECTS(i < dimension_ && j < dimension_);
  p_[i * padded_ + j] = value;
  p_[j * padded_ + i] = value;
}

void CovarianceKernel::reset_state(std::size_t i, double variance) noexcept {
  for (std::size_t j = 0; j < dimension_; ++j) set(i, j, 0.0);
  set(i, i, variance);
}

void CovarianceKernel::predict_navigation(const KernelTransition& transition) noexcept {
  IMUSCOPE_EXPECTS(dimension_ >= kN);
  transition_rows(transition.coupled.data(), transition.decay.data(), p_, scratch_, padded_);
  // Against the states that do not move, T is the new cross-covariance already.
  for (std::size_t i = 0; i < kN; ++i) {
    const double* t = scratch_ + i * padded_;
    for (std::size_t c = kN; c < dimension_; ++c) {
      p_[i * padded_ + c] = t[c];
      p_[c * padded_ + i] = t[c];
    }
  }
  // T Phi^T, upper triangle, mirrored: symmetric by construction.
  for (std::size_t i = 0; i < kN; ++i) {
    const double* t = scratch_ + i * padded_;
    for (std::size_t j = i; j < kN; ++j) {
      double sum = transition.noise[i * kN + j];
      if (j < kC) {
        const double* a = transition.coupled.data() + j * kN;
        for (std::size_t k = 0; k < kN; ++k) sum += t[k] * a[k];
      } else {
        sum += t[j] * transition.decay[j - kC];
      }
      p_[i * padded_ + j] = sum;
      p_[j * padded_ + i] = sum;
    }
  }
}

void CovarianceKernel::predict_state(std::size_t i, double decay, double variance) noexcept {
  if (decay != 1.0) {
    double* row = p_ + i * padded_;
    for (std::size_t c = 0; c < dimension_; ++c) row[c] *= decay;
    for (std::size_t c = 0; c < dimension_; ++c) p_[c * padded_ + i] = row[c];
    row[i] *= decay;
  }
  p_[i * padded_ + i] += variance;
}

void CovarianceKernel::project(const SparseMeasurement& H, const std::array<double, 9>& R) noexcept {
  std::fill_n(pht_, kMaxMeasurementRows * padded_, 0.0);
  for (std::size_t b = 0; b < H.count; ++b) {
    const MeasurementBlock& block = H.blocks[b];
    for (std::size_t a = 0; a < kMaxMeasurementRows; ++a) {
      for (std::size_t c = 0; c < block.width; ++c) {
        if (block.h[a][c] == 0.0) continue;
        add_scaled_row(block.h[a][c], p_ + (block.column + c) * padded_, pht_ + a * padded_, padded_);
      }
    }
  }
  for (std::size_t a = 0; a < kMaxMeasurementRows; ++a) {
    for (std::size_t e = a; e < kMaxMeasurementRows; ++e) {
      double sum = R[a * 3 + e];
      for (std::size_t b = 0; b < H.count; ++b) {
        const MeasurementBlock& block = H.blocks[b];
        for (std::size_t c = 0; c < block.width; ++c)
          sum += block.h[a][c] * pht_[e * padded_ + block.column + c];
      }
      s_[a * 3 + e] = sum;
      s_[e * 3 + a] = sum;
    }
  }
}

bool CovarianceKernel::update(const std::array<double, 3>& innovation,
                              const std::array<bool, 3>& use) noexcept {
  std::array<std::size_t, 3> axes{};
  std::size_t rows = 0;
  for (std::size_t a = 0; a < kMaxMeasurementRows; ++a) {
    if (use[a]) axes[rows++] = a;
  }
  if (rows == 0) return false;

  std::array<std::array<double, 3>, 3> l{};
  std::array<double, 3> whitened{};  // L^-1 y
  for (std::size_t i = 0; i < rows; ++i) {
    double residual = innovation[axes[i]];
    for (std::size_t j = 0; j <= i; ++j) {
      double sum = s_[axes[i] * 3 + axes[j]];
      for (std::size_t k = 0; k < j; ++k) sum -= l[i][k] * l[j][k];
      if (i != j) {
        l[i][j] = sum / l[j][j];
        residual -= l[i][j] * whitened[j];
      } else {
        if (!(sum > 0.0) || !std::isfinite(sum)) return false;
        l[i][i] = std::sqrt(sum);
      }
    }
    whitened[i] = residual / l[i][i];
  }

  for (std::size_t i = 0; i < rows; ++i) {
    double* row = w_ + i * padded_;
    std::copy_n(pht_ + axes[i] * padded_, padded_, row);
    for (std::size_t k = 0; k < i; ++k) add_scaled_row(-l[i][k], w_ + k * padded_, row, padded_);
    const double inverse = 1.0 / l[i][i];
    for (std::size_t c = 0; c < padded_; ++c) row[c] *= inverse;
  }
  std::fill_n(correction_, padded_, 0.0);
  for (std::size_t i = 0; i < rows; ++i) add_scaled_row(whitened[i], w_ + i * padded_, correction_, padded_);
  downdate(p_, w_, rows, padded_);
  return true;
}

}  // namespace imuscope
