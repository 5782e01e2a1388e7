#include "models/certificate/candidate_models.h"

#include <vector>

#include "models/noise/select.h"

namespace imuscope::certificate {

Result<noise::GrownModel> select_model(const noise::WaveletVariance& wv, double rate_hz, bool has_resonance,
                                       const noise::FitOptions& options) {
  using noise::ProcessKind;
  std::vector<ProcessKind> terms{ProcessKind::kWhiteNoise, ProcessKind::kGaussMarkov,
                                 ProcessKind::kRandomWalk, ProcessKind::kQuantization,
                                 ProcessKind::kFlicker,    ProcessKind::kRamp};
  if (has_resonance) terms.push_back(ProcessKind::kResonance);
  return noise::grow_model(wv, terms, rate_hz, options);
}

}  // namespace imuscope::certificate
