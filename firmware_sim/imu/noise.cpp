#include "firmware_sim/imu/noise.h"

#include <algorithm>
#include <cmath>

namespace imusim {

NoiseSource::NoiseSource(const RegimeNoise& noise, RegimeSwitch regime_switch, Random random)
    : noise_(noise), regime_switch_(regime_switch), random_(random) {
  // A process that exists in one regime only has zero variance in the other.
  const std::size_t count = std::max(noise_.at_rest.processes.size(), noise_.in_motion.processes.size());
  noise_.at_rest.processes.resize(count);
  noise_.in_motion.processes.resize(count);
  states_.resize(count);
  motion_states_.resize(count);
}

void NoiseSource::start(Regime regime) {
  const AxisNoise& first = regime == Regime::kDynamic && regime_switch_ == RegimeSwitch::kContinuous
                               ? noise_.in_motion
                               : noise_.at_rest;
  for (std::size_t i = 0; i < states_.size(); ++i) {
    states_[i] = std::sqrt(first.processes[i].variance) * random_.normal();
    if (regime_switch_ == RegimeSwitch::kIndependent)
      motion_states_[i] = std::sqrt(noise_.in_motion.processes[i].variance) * random_.normal();
  }
  started_ = true;
}

void NoiseSource::advance(States& states, const AxisNoise& noise, double step_s) {
  for (std::size_t i = 0; i < states.size(); ++i) {
    const double phi = std::exp(-noise.processes[i].beta_per_s * step_s);
    const double driving = std::sqrt(noise.processes[i].variance * (1.0 - phi * phi));
    states[i] = phi * states[i] + driving * random_.normal();
  }
}

double NoiseSource::next(Regime regime, double step_s, double white_factor) {
  const bool moves = regime == Regime::kDynamic;
  const AxisNoise& now = moves ? noise_.in_motion : noise_.at_rest;
  if (!started_) {
    start(regime);
  } else if (regime_switch_ == RegimeSwitch::kContinuous) {
    advance(states_, now, step_s);
  } else {
    advance(states_, noise_.at_rest, step_s);
    advance(motion_states_, noise_.in_motion, step_s);
  }
  const bool own = moves && regime_switch_ == RegimeSwitch::kIndependent;
  double sum = std::sqrt(white_factor * now.white_variance) * random_.normal();
  for (const double state : own ? motion_states_ : states_) sum += state;
  return sum;
}

}  // namespace imusim
