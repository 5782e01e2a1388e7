#pragma once

/// Fitted noise models on their way back to the estimator, and into captures. Non-real-time.

#include <imuscope/applied_model_t.hpp>
#include <optional>
#include <vector>

#include "service/pipeline/core.h"
#include "service/pipeline/refit.h"

namespace imuscope {

/// `current` with what a refit says of it. Per axis and regime, of the processes that are identifiable: WN
/// becomes the white noise, the fastest GM of at most one second the fast process, the slowest GM beyond that
/// the bias process (of the dynamic regime where there is one). Without its white noise a model says nothing
/// of the noise. A variance more than a hundred times, or less than a hundredth, of the present one is not
/// believed: the filter keeps what it has for that axis.
[[nodiscard]] SImuNoise updated_noise(const SImuNoise& current, const std::vector<AxisRefit>& axes);

/// Decides, refit by refit, what goes back to the filter of one S-IMU. Four rules keep the loop from talking
/// the filter into confidence:
///
/// - validated: what updated_noise() takes, nothing else;
/// - floor: no white noise and no bias process below `floor_share` of the configured sd, no bias slower than
///   the configured one by more than 1 / floor_share, however small the residuals are: they are the filter's
///   own;
/// - hysteresis: the first model that passes replaces the configured guess; a later one goes back only where
///   some axis has moved by kVarianceStep in its noise or kBiasStep in its bias process, so that the filter
///   does not follow the scatter of the fits;
/// - version: every model that goes back counts one up; the capture records it with the tick that took it.
///
/// The tick boundary is the core's to keep: it takes a model over before anything of a tick is computed.
class NoiseFeedback {
 public:
  NoiseFeedback(const SImuNoise& configured, double floor_share);

  /// What the estimator shall be given after this refit; nothing where what it has may stay.
  [[nodiscard]] std::optional<NewNoise> consider(const Refit& refit);

  /// Given out last, the configured one before that.
  [[nodiscard]] const SImuNoise& in_force() const { return in_force_; }
  [[nodiscard]] std::int64_t version() const { return version_; }

  static constexpr double kVarianceStep = 1.2;
  static constexpr double kBiasStep = 2.0;

 private:
  [[nodiscard]] SImuNoise floored(SImuNoise noise) const;

  SImuNoise configured_;
  SImuNoise in_force_;
  double floor_share_;
  std::int64_t version_ = 0;
};

/// The capture's record of an applied model. utime and sequence are left to the caller.
[[nodiscard]] applied_model_t applied_model_record(const AppliedNoise& applied, const std::string& device);
/// @param study  index of the S-IMU that the record names
[[nodiscard]] AppliedNoise applied_noise_of(const applied_model_t& record, std::size_t study);

}  // namespace imuscope
