#pragma once

/// What a drive has shown of a mounting so far, in words for people: sd against goal per state, the direction
/// of which least is known, and the manoeuvre that would help. Non-real-time: allocates.

#include <array>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "estimation/calibration/estimator.h"

namespace imuscope {

/// psi_x, psi_y, psi_z, r_x, r_y, r_z, t_d.
inline constexpr std::size_t kObservedStates = 7;

/// Said in place of a number that the motion has not shown.
inline constexpr const char* kNotObservable = "not observable yet";

struct StateObservability {
  std::string name;   ///< as in calibration.json: "psi_x"
  std::string words;  ///< "boresight about forward"
  std::string unit;   ///< of sd and goal: "deg", "m", "s"
  double sd = 0.0;
  double goal = 0.0;
  bool observable = false;  ///< the motion has shown it: sd below half of what was assumed, or at its goal
  [[nodiscard]] bool reached() const { return observable && sd <= goal; }
};

/// What is known of one S-IMU's mounting at one moment.
struct Observability {
  std::array<StateObservability, kObservedStates> states;
  /// The direction of (psi, r) of which least has been learned: "boresight about an axis 30 deg from forward
  /// towards down".
  std::string weakest;
  double weakest_relative_sd = 1.0;  ///< sd left there, of what was assumed at the start
  std::string advice;                ///< the manoeuvre that would help most; empty when every goal is reached
};

/// Precondition: the S-IMU has an estimate (base/calibration_levels.h).
Observability observability_of(const SImuOutput& study);

/// calibration.json's "observability".
nlohmann::json observability_json(const Observability& observability);

/// Follows one S-IMU and says what a person should hear, when it changes.
class ObservabilityWatch {
 public:
  /// @return sentences; mostly none
  std::vector<std::string> update(const SImuOutput& study);

 private:
  bool started_ = false;
  std::array<bool, kObservedStates> observable_{};
  std::string advice_;
  HostTime next_advice_{};
};

}  // namespace imuscope
