#pragma once

/// The inner loops of the covariance (K-5): the same source compiled once per instruction set, each version
/// in a file of its own, and the widest that the processor has is chosen at start. Fused multiply-add is used
/// where the instruction set has it, so that results repeat to the bit on one model of processor and to
/// rounding (1e-12 of an sd) between models.
///
/// All matrices are row-major with rows of `padded` doubles, a multiple of 8, on 64-byte boundaries; the
/// padding holds zeros and keeps them. Equations K-1 to K-4.

#include <cstddef>
#include <cstdint>

namespace imuscope {

enum class InstructionSet : std::uint8_t { kBaseline, kAvx2, kAvx512 };

/// Sizes that the loops are written for.
inline constexpr std::size_t kLoopNavigationStates = 15;
inline constexpr std::size_t kLoopCoupledStates = 9;
inline constexpr std::size_t kLoopMeasurementRows = 3;
/// Doubles of one row of the small matrices below: 15 and a zero.
inline constexpr std::size_t kLoopNavigationPadded = 16;

struct CovarianceLoops {
  InstructionSet instruction_set;
  const char* name;

  /// P <- Phi P Phi' + Q in the navigation states. `phi_transposed` is 15 rows of 16, `noise` likewise;
  /// `scratch` is 16 rows of `padded`. K-1.
  void (*transition)(const double* phi_transposed, const double* noise, double* p, double* scratch,
                     std::size_t padded);
  /// Rows and columns [first, first + count) of P times `decay`; `variance` added to the diagonal. K-2.
  void (*decay)(double* p, std::size_t first, std::size_t count, const double* decay, const double* variance,
                std::size_t padded);
  /// Three rows: (P H')' from `n` columns of H, h[3 k + row] of column columns[k]. K-3.
  void (*project)(const double* p, const std::size_t* columns, const double* h, std::size_t n, double* pht,
                  std::size_t padded);
  /// P -= W W', W' three rows. K-4.
  void (*downdate)(double* p, const double* w, std::size_t padded);
  /// W' = M (P H')' with M 3 x 3 row-major, and correction = sum of whitened[i] W'_i. K-4.
  /// @return whether every correction is finite
  bool (*whiten)(const double* pht, const double* m, const double* whitened, double* w, double* correction,
                 std::size_t padded);
  /// Cholesky's factor of P's correlation matrix, rows of `padded`. K-6.
  /// @param per_sd  1 / sd of each state; 0 leaves it out
  /// @param pivot   room for n
  /// @return the first state whose pivot is not above `least` or whose variance is none, or `n`
  std::size_t (*factorise)(const double* p, const double* per_sd, double least, double* factor, double* pivot,
                           std::size_t n, std::size_t padded);
};

/// The loops for an instruction set; nullptr where this processor or this build has none.
[[nodiscard]] const CovarianceLoops* covariance_loops(InstructionSet set) noexcept;
/// The widest that this processor has.
[[nodiscard]] const CovarianceLoops& widest_covariance_loops() noexcept;

}  // namespace imuscope
