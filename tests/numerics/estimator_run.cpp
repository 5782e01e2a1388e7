#include "estimator_run.h"

using imuscope::SImuOutput;

extern "C" __attribute__((visibility("default"))) void IMUSCOPE_ESTIMATOR_RUN(
    const imuscope::EstimatorConfig& config, const std::vector<imuscope::Sample>& samples,
    imuscope::test::KeepOutputs keep, void* context) {
  constexpr imuscope::Duration kTick{10'000'000};
  constexpr std::size_t kTicksPerOutput = 10;
  imuscope::Estimator estimator(config);
  std::vector<SImuOutput> studies(config.studies.size());
  std::size_t next = 0;
  std::size_t tick = 0;
  for (imuscope::HostTime cut = samples.front().arrival; next < samples.size(); cut += kTick, ++tick) {
    while (next < samples.size() && samples[next].arrival <= cut) estimator.add(samples[next++]);
    estimator.advance(cut);
    if (tick % kTicksPerOutput != 0) continue;
    for (std::size_t i = 0; i < studies.size(); ++i) studies[i] = estimator.study(i);
    keep(context, estimator.navigation(), studies.data(), studies.size());
  }
}
