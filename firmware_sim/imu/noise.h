#pragma once

/// Random errors of one sensor axis: white noise and Gauss-Markov processes, with one set of parameters at
/// rest and another one in motion.

#include <array>
#include <vector>

#include "firmware_sim/motion/motion.h"
#include "firmware_sim/random/random.h"

namespace imusim {

/// First-order Gauss-Markov process: exp(-beta |tau|) correlation, and a stationary variance.
struct GaussMarkov {
  double variance = 0.0;  ///< squared unit of the signal
  double beta_per_s = 0.0;
};

struct AxisNoise {
  double white_variance = 0.0;  ///< of one sample, whatever the rate
  std::vector<GaussMarkov> processes;
};

struct RegimeNoise {
  AxisNoise at_rest;
  AxisNoise in_motion;
};

/// The same parameters in both regimes.
inline RegimeNoise same_in_both(const AxisNoise& noise) { return {noise, noise}; }

/// What happens to a Gauss-Markov process when the regime changes.
enum class RegimeSwitch {
  kContinuous,   ///< its value stays and relaxes towards the new parameters, as a bias does
  kIndependent,  ///< each regime has a process of its own, so that every stretch is stationary
};

/// Draws the noise of one axis, sample after sample. Gauss-Markov processes are discretised exactly and start
/// from their stationary distribution.
class NoiseSource {
 public:
  NoiseSource(const RegimeNoise& noise, RegimeSwitch regime_switch, Random random);

  /// @param step_s        time since the last sample; of no account for the first
  /// @param white_factor  by which the white noise's variance is larger than that of the regime
  double next(Regime regime, double step_s, double white_factor = 1.0);

 private:
  using States = std::vector<double>;
  void start(Regime regime);
  void advance(States& states, const AxisNoise& noise, double step_s);

  RegimeNoise noise_;
  RegimeSwitch regime_switch_;
  Random random_;
  bool started_ = false;
  States states_;         ///< continuous: the only ones; independent: those of the regime at rest
  States motion_states_;  ///< independent: those of the regime in motion
};

}  // namespace imusim
