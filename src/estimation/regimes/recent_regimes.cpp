#include "estimation/regimes/recent_regimes.h"

#include <algorithm>
#include <chrono>
#include <cmath>

#include "base/contracts.h"

namespace imuscope {

bool RecentRegimes::follows(HostTime time) const {
  return !newest_ || std::abs(to_seconds(time - *newest_)) < kWindow_s;
}

void RecentRegimes::add(HostTime time, const Vector3& omega_ib_b_radps, const Vector3& f_b_mps2) {
  IMUSCOPE_EXPECTS(follows(time));
  levels_.add(time, omega_ib_b_radps, f_b_mps2);
  newest_ = newest_ ? std::max(*newest_, time) : time;
  if (!next_decision_) next_decision_ = time + from_seconds(kLookAhead_s);
  if (*newest_ < *next_decision_) return;
  decide(kLookAhead_s);
  next_decision_ = *newest_ + from_seconds(kStep_s);
}

void RecentRegimes::add_speed(HostTime time, double speed_mps, double sd_mps) {
  if (newest_ && std::abs(to_seconds(time - *newest_)) < kWindow_s)
    levels_.add_speed(time, speed_mps, sd_mps);
}

void RecentRegimes::settle() {
  if (newest_) decide(0.0);
}

void RecentRegimes::decide(double look_ahead_s) {
  levels_.forget_before(*newest_ - from_seconds(kWindow_s));
  const auto cells = levels_.cells();
  const CellNoise now = cell_noise(cells);
  noise_ =
      noise_ ? CellNoise{std::min(noise_->omega_radps, now.omega_radps), std::min(noise_->f_mps2, now.f_mps2)}
             : now;
  track_ = static_and_dynamic(levels_, cells, limits_, *noise_);
  settled_until_ =
      look_ahead_s > 0.0 ? *newest_ - from_seconds(look_ahead_s) : *newest_ + std::chrono::nanoseconds(1);
}

}  // namespace imuscope
