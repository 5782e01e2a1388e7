#include "firmware_sim/devices/pulse_output.h"

#include "firmware_sim/devices/gnss_talker.h"

namespace imusim {

PulseOutput::PulseOutput(const Options& options) : grid_(first_epoch_s(options.utc_begin, 1.0), 1.0) {}

void PulseOutput::power_cycle(double t_s, double off_s) { skip_to(t_s + off_s + kWarmStart_s); }

void PulseOutput::run_until(double t_s, std::vector<Emission>& out) {
  for (; grid_.instant(next_index_) <= t_s; ++next_index_) out.push_back({grid_.instant(next_index_), {}});
}

}  // namespace imusim
