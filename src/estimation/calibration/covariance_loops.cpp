#include "estimation/calibration/covariance_loops.h"

#include <initializer_list>

namespace imuscope {

extern const CovarianceLoops kBaselineLoops;
#if defined(IMUSCOPE_WIDE_LOOPS)
extern const CovarianceLoops kAvx2Loops;
extern const CovarianceLoops kAvx512Loops;
#endif

// K-5
const CovarianceLoops* covariance_loops(InstructionSet set) noexcept {
  if (set == InstructionSet::kBaseline) return &kBaselineLoops;
#if defined(IMUSCOPE_WIDE_LOOPS)
  const bool has_avx2 = __builtin_cpu_supports("avx2") != 0 && __builtin_cpu_supports("fma") != 0;
  if (set == InstructionSet::kAvx2) return has_avx2 ? &kAvx2Loops : nullptr;
  return has_avx2 && __builtin_cpu_supports("avx512f") != 0 ? &kAvx512Loops : nullptr;
#else
  return nullptr;
#endif
}

const CovarianceLoops& widest_covariance_loops() noexcept {
  for (const InstructionSet set : {InstructionSet::kAvx512, InstructionSet::kAvx2}) {
    if (const CovarianceLoops* loops = covariance_loops(set)) return *loops;
  }
  return kBaselineLoops;
}

}  // namespace imuscope
