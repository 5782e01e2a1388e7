#include "estimation/calibration/covariance_kernel.h"

#include <algorithm>
#include <cmath>
#include <new>

#include "base/contracts.h"

namespace imuscope {
namespace {

constexpr std::size_t kN = kNavigationStates;
constexpr std::align_val_t kAlignment{64};

const CovarianceLoops* loops_for(std::optional<InstructionSet> set) {
  if (!set) return &widest_covariance_loops();
  const CovarianceLoops* loops = covariance_loops(*set);
  IMUSCOPE_EXPECTS(loops != nullptr);
  return loops;
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

CovarianceKernel::CovarianceKernel(std::size_t dimension, std::optional<InstructionSet> instruction_set)
    : loops_(loops_for(instruction_set)),
      dimension_(dimension),
      padded_((dimension + kCovariancePadding - 1) / kCovariancePadding * kCovariancePadding) {
  IMUSCOPE_EXPECTS(dimension > 0);
  // predict_navigation() reads and writes 15 rows, whatever the dimension.
  padded_ = std::max(padded_, kLoopNavigationPadded);
  const std::size_t rows = 2 * padded_ + kLoopNavigationPadded + 2 * kMaxMeasurementRows + 3;
  memory_.reset(static_cast<double*>(::operator new[](rows* padded_ * sizeof(double), kAlignment)));
  std::fill_n(memory_.get(), rows * padded_, 0.0);
  p_ = memory_.get();
  scratch_ = p_ + padded_ * padded_;
  pht_ = scratch_ + kLoopNavigationPadded * padded_;
  w_ = pht_ + kMaxMeasurementRows * padded_;
  correction_ = w_ + kMaxMeasurementRows * padded_;
  factor_ = correction_ + padded_;
  per_sd_ = factor_ + padded_ * padded_;
  pivot_ = per_sd_ + padded_;
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

// K-1
void CovarianceKernel::predict_navigation(const KernelTransition& transition) noexcept {
  IMUSCOPE_EXPECTS(dimension_ >= kN);
  loops_->transition(transition.phi.data(), transition.noise.data(), p_, scratch_, padded_);
}

// K-2
void CovarianceKernel::predict_states(std::size_t first, std::span<const double> decay,
                                      std::span<const double> variance) noexcept {
  IMUSCOPE_EXPECTS(decay.size() == variance.size() && first + decay.size() <= dimension_);
  const bool decays = std::any_of(decay.begin(), decay.end(), [](double d) { return d != 1.0; });
  if (decays) {
    loops_->decay(p_, first, decay.size(), decay.data(), variance.data(), padded_);
    return;
  }
  for (std::size_t i = 0; i < variance.size(); ++i) p_[(first + i) * padded_ + first + i] += variance[i];
}

// K-3
void CovarianceKernel::project(const SparseMeasurement& H, const std::array<double, 9>& R) noexcept {
  std::array<std::size_t, 3 * kMaxMeasurementBlocks> columns{};
  std::array<double, 9 * kMaxMeasurementBlocks> h{};
  std::size_t n = 0;
  for (std::size_t b = 0; b < H.count; ++b) {
    const MeasurementBlock& block = H.blocks[b];
    for (std::size_t c = 0; c < block.width; ++c, ++n) {
      columns[n] = block.column + c;
      for (std::size_t a = 0; a < kMaxMeasurementRows; ++a) h[3 * n + a] = block.h[a][c];
    }
  }
  loops_->project(p_, columns.data(), h.data(), n, pht_, padded_);
  // Six sums side by side: one after the other, each would wait for its own additions.
  std::array<double, 6> sum{R[0], R[1], R[2], R[4], R[5], R[8]};
  for (std::size_t k = 0; k < n; ++k) {
    const double* const a = h.data() + 3 * k;
    const double* const row = pht_ + columns[k];
    const std::array<double, 3> b{row[0], row[padded_], row[2 * padded_]};
    sum[0] += a[0] * b[0];
    sum[1] += a[0] * b[1];
    sum[2] += a[0] * b[2];
    sum[3] += a[1] * b[1];
    sum[4] += a[1] * b[2];
    sum[5] += a[2] * b[2];
  }
  s_ = {sum[0], sum[1], sum[2], sum[1], sum[3], sum[4], sum[2], sum[4], sum[5]};
}

bool CovarianceKernel::update(const std::array<double, 3>& innovation, const std::array<bool, 3>& use,
                              Considered considered) noexcept {
  IMUSCOPE_EXPECTS(considered.count <= kMostConsidered);
  // K-4, with a zero row for an axis that is left out: M = L^-1 of the axes in use.
  std::array<double, 9> l{};
  std::array<double, 9> m{};
  std::array<double, 3> whitened{};
  bool any = false;
  for (std::size_t i = 0; i < kMaxMeasurementRows; ++i) {
    if (!use[i]) continue;
    any = true;
    double pivot = s_[4 * i];
    double residual = innovation[i];
    for (std::size_t j = 0; j < i; ++j) {
      if (!use[j]) continue;
      double sum = s_[3 * i + j];
      for (std::size_t k = 0; k < j; ++k) sum -= l[3 * i + k] * l[3 * j + k];
      l[3 * i + j] = sum / l[4 * j];
      pivot -= l[3 * i + j] * l[3 * i + j];
      residual -= l[3 * i + j] * whitened[j];
    }
    if (!(pivot > 0.0) || !std::isfinite(pivot)) return false;
    l[4 * i] = std::sqrt(pivot);
    whitened[i] = residual / l[4 * i];
    m[4 * i] = 1.0 / l[4 * i];
    for (std::size_t k = 0; k < i; ++k) {
      double sum = 0.0;
      for (std::size_t j = k; j < i; ++j) sum -= l[3 * i + j] * m[3 * j + k];
      m[3 * i + k] = sum / l[4 * i];
    }
  }
  if (!any) return false;
  if (!loops_->whiten(pht_, m.data(), whitened.data(), w_, correction_, padded_)) return false;
  // K-7
  std::array<double, kMostConsidered * kMostConsidered> kept{};
  const auto of_considered = [&](auto what) {
    for (std::size_t i = 0; i < considered.count; ++i) {
      for (std::size_t j = 0; j < considered.count; ++j)
        what(kept[kMostConsidered * i + j], p_[(considered.first + i) * padded_ + considered.first + j]);
    }
  };
  of_considered([](double& keep, double p) { keep = p; });
  loops_->downdate(p_, w_, padded_);
  of_considered([](double keep, double& p) { p = keep; });
  std::fill_n(correction_ + considered.first, considered.count, 0.0);
  return true;
}

// K-6
std::optional<std::size_t> CovarianceKernel::first_bad_state() noexcept {
  for (std::size_t i = 0; i < dimension_; ++i) {
    const double variance = p_[i * padded_ + i];
    per_sd_[i] = variance > 0.0 ? 1.0 / std::sqrt(variance) : 0.0;
  }
  const std::size_t bad = loops_->factorise(p_, per_sd_, kPivotMin, factor_, pivot_, dimension_, padded_);
  return bad == dimension_ ? std::nullopt : std::optional(bad);
}

}  // namespace imuscope
