#pragma once

/// Covariance of the whole filter: a symmetric matrix in one plain array, rows padded to a multiple of 8
/// doubles (one 512-bit register), dimension known at run time, allocated once. The loops over it come from
/// covariance_loops.h, for the widest instruction set of the processor unless another is asked for.
///
/// Only what the models of this filter need: a prediction that is dense in the 15 navigation states and
/// diagonal elsewhere, and a measurement update of up to three rows that are sparse in blocks of three
/// columns. Every update is symmetric by construction. EQUATIONS.md, K-1 to K-4. Thread: one. Allocates:
/// constructor only.

#include <array>
#include <cstddef>
#include <memory>
#include <optional>
#include <span>

#include "estimation/calibration/covariance_loops.h"

namespace imuscope {

inline constexpr std::size_t kNavigationStates = kLoopNavigationStates;
/// Rows of the navigation transition that are not a plain decay: position, velocity, attitude.
inline constexpr std::size_t kNavigationCoupledStates = kLoopCoupledStates;
inline constexpr std::size_t kCovariancePadding = 8;
inline constexpr std::size_t kMaxMeasurementRows = kLoopMeasurementRows;
inline constexpr std::size_t kMaxMeasurementBlocks = 13;

/// Up to three consecutive columns of a three-row measurement matrix.
struct MeasurementBlock {
  std::size_t column = 0;
  std::size_t width = 3;                     ///< 1 to 3
  std::array<std::array<double, 3>, 3> h{};  ///< [row][column - first]
};

/// Three-row measurement matrix as a list of column blocks.
struct SparseMeasurement {
  std::size_t count = 0;
  std::array<MeasurementBlock, kMaxMeasurementBlocks> blocks{};
  /// The next block, zeroed. Precondition: count < kMaxMeasurementBlocks.
  MeasurementBlock& append(std::size_t column, std::size_t width) noexcept;
};

/// Transition of the navigation states over one R epoch: 9 dense rows over 15 columns, then 6 decays. Both
/// matrices stand column by column, each column of 15 followed by a zero.
struct KernelTransition {
  static constexpr std::size_t kStride = kLoopNavigationPadded;
  alignas(64) std::array<double, kNavigationStates * kStride> phi{};
  alignas(64) std::array<double, kNavigationStates * kStride> noise{};  ///< symmetric
};

class CovarianceKernel {
 public:
  /// Zero matrix. Precondition: dimension > 0; the processor has `instruction_set`, where one is asked for.
  explicit CovarianceKernel(std::size_t dimension, std::optional<InstructionSet> instruction_set = {});

  [[nodiscard]] std::size_t dimension() const noexcept { return dimension_; }
  [[nodiscard]] std::size_t padded_dimension() const noexcept { return padded_; }
  [[nodiscard]] double operator()(std::size_t i, std::size_t j) const noexcept { return p_[i * padded_ + j]; }
  void set(std::size_t i, std::size_t j, double value) noexcept;

  /// Makes state i uncorrelated with everything, of the given variance.
  void reset_state(std::size_t i, double variance) noexcept;

  /// P <- Phi P Phi^T + Q in the 15 navigation states, which are the first ones. K-1.
  void predict_navigation(const KernelTransition& transition) noexcept;

  /// States first, first + 1, ... <- decay * state + white noise of the given variance. K-2.
  void predict_states(std::size_t first, std::span<const double> decay,
                      std::span<const double> variance) noexcept;

  /// First half of an update: P H^T and S = H P H^T + R. `R` is row-major 3 x 3, symmetric. K-3.
  void project(const SparseMeasurement& H, const std::array<double, 9>& R) noexcept;
  /// S of the last project(), row-major.
  [[nodiscard]] const std::array<double, 9>& innovation_covariance() const noexcept { return s_; }

  /// States that a measurement depends on, and is to tell nothing of: Schmidt's.
  struct Considered {
    std::size_t first = 0;
    std::size_t count = 0;  ///< at most kMostConsidered
  };
  static constexpr std::size_t kMostConsidered = 3;

  /// Second half: takes the rows with use[a] into account. K-4, K-7.
  /// @return false, with nothing changed, where S of the used rows is not positive definite, the correction
  /// is not finite or no row is used.
  [[nodiscard]] bool update(const std::array<double, 3>& innovation, const std::array<bool, 3>& use,
                            Considered considered) noexcept;
  [[nodiscard]] bool update(const std::array<double, 3>& innovation,
                            const std::array<bool, 3>& use) noexcept {
    return update(innovation, use, {});
  }
  /// Correction of the error state by the last successful update(): P H^T S^-1 y, nothing of what was considered.
  [[nodiscard]] std::span<const double> correction() const noexcept { return {correction_, dimension_}; }

  /// First state that has become a combination of the ones before it, by its pivot in Cholesky's factor of the
  /// correlation matrix, or whose variance is negative or no number; none where all is well. States of zero
  /// variance (known exactly, or not in use) are passed over. Costs n^3 / 6 multiplications. K-6.
  [[nodiscard]] std::optional<std::size_t> first_bad_state() noexcept;
  /// Of a correlation matrix, whose diagonal is 1.
  static constexpr double kPivotMin = 1e-12;

 private:
  struct AlignedDelete {
    void operator()(double* memory) const noexcept;
  };

  const CovarianceLoops* loops_;
  std::size_t dimension_;
  std::size_t padded_;
  std::unique_ptr<double[], AlignedDelete> memory_;
  double* p_;           ///< padded_ rows
  double* scratch_;     ///< rows of a transition
  double* pht_;         ///< kMaxMeasurementRows rows: (P H^T)^T
  double* w_;           ///< kMaxMeasurementRows rows: (P H^T L^-T)^T
  double* correction_;  ///< one row
  double* factor_;      ///< as many rows as p_
  double* per_sd_;      ///< one row: 1 / sd of each state; 0 where it has none
  double* pivot_;       ///< one row
  std::array<double, 9> s_{};
};

}  // namespace imuscope
