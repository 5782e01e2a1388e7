#pragma once

/// Things that a person should hear about, each with what it has to say. Trivially copyable: they cross the
/// ring out of the core.

#include <cstddef>
#include <cstdint>
#include <type_traits>
#include <variant>

#include "base/time.h"
#include "sample/sample.h"

namespace imuscope {

/// How the navigation's attitude was started.
enum class InitialisationMethod : std::uint8_t {
  kNone,
  kConfigured,
  kReferenceAttitude,
  kGyrocompass,
  kInMotion
};

namespace event {

struct NavigationStarted {
  InitialisationMethod method;
};
/// After which the state could not be carried on.
struct NavigationStopped {
  double gap_s;
};
struct ReferenceGap {
  double length_s;
};
/// Nobody said what noise the reference has; this is what it shows at rest, and what it is taken for from now on.
struct ReferenceNoiseSeen {
  double gyro_radps_per_sqrt_hz;
  double accel_mps2_per_sqrt_hz;
};
/// At standstill the specific force along b's z axis is not -g: axes or sign convention.
struct ReferenceGravityWrong {
  double f_z_b_mps2;
};
/// At standstill a device feels another force than gravity: its unit.
struct GravityMagnitudeWrong {
  double f_mps2;
};
struct CoarseAlignmentDone {
  double residual_rad;  ///< of the vectors
};
/// Enough motion but no consistent rotation.
struct CoarseAlignmentPoor {
  double rate_correlation;  ///< of the rates, to 1
};
/// Innovations say that the S-IMU sits differently; it starts again.
struct MountingChanged {
  double mean_nis;
};
/// After a gap; its biases are uncertain again.
struct SImuReturned {
  double gap_s;
};
/// Start of a streak of rejected solutions.
struct GnssRejected {
  double nis;  ///< infinite for a place that is none
};
/// End of a streak.
struct GnssReacquired {
  double streak_s;
};
/// Positions disagree with the motion more than their sd say.
struct GnssInconsistent {
  double share;  ///< of them
};
/// No speed for a while; the last one is not held.
struct OdometryLost {
  double silence_s;
};
struct OdometryReturned {
  double silence_s;
};
/// The wheels contradict the navigation: slip, wrong unit or scale.
struct OdometryRejected {
  double excess_mps;
};
/// End of a streak of rejected speeds.
struct OdometryAccepted {
  double streak_s;
};
/// A state's variance was no longer positive.
struct CovarianceRepaired {
  std::size_t state;  ///< see state_name.h
};
/// The mounting found contradicts the configured one.
struct BoresightPriorWrong {
  double angle_rad;
};
/// The lever arm found contradicts the configured one.
struct LeverArmPriorWrong {
  double distance_m;
};
/// Two S-IMUs sit where the configuration has the other.
struct SImusSwapped {
  DeviceIndex other;
};
/// Since before a silence.
struct GyroBiasChanged {
  double change_radps;
};
/// Since before a silence.
struct AccelBiasChanged {
  double change_mps2;
};
/// An S-IMU's samples keep contradicting the reference whatever the mounting: axes, signs, unit or range.
/// Nothing of it is called observable until they have fitted for minutes.
struct SImuInconsistent {
  double share;  ///< of its samples
};

/// An S-IMU and the reference differ by more than their configured noise, in the mean over a minute of
/// motion. Nothing of it is called calibrated or observable while that lasts.
struct NoiseTooSmall {
  bool gyro;        ///< or accelerometer
  double factor;    ///< sd of the innovations over the predicted one, of the worst axis
  double white_sd;  ///< of a sample, with which they would agree; rad/s, m/s^2
};

}  // namespace event

using EventPayload =
    std::variant<event::NavigationStarted, event::NavigationStopped, event::ReferenceGap,
                 event::ReferenceGravityWrong, event::GravityMagnitudeWrong, event::CoarseAlignmentDone,
                 event::CoarseAlignmentPoor, event::MountingChanged, event::SImuReturned, event::GnssRejected,
                 event::GnssReacquired, event::GnssInconsistent, event::OdometryLost, event::OdometryReturned,
                 event::OdometryRejected, event::OdometryAccepted, event::CovarianceRepaired,
                 event::BoresightPriorWrong, event::LeverArmPriorWrong, event::SImusSwapped,
                 event::GyroBiasChanged, event::AccelBiasChanged, event::SImuInconsistent,
                 event::NoiseTooSmall, event::ReferenceNoiseSeen>;

/// What happened, to which device, at which time on the host's scale.
struct EstimatorEvent {
  EventPayload what;
  DeviceIndex device = 0;
  HostTime time;
};
static_assert(std::is_trivially_copyable_v<EstimatorEvent>);

/// Whether an event is of this kind.
template <typename Kind>
[[nodiscard]] constexpr bool is(const EstimatorEvent& event) noexcept {
  return std::holds_alternative<Kind>(event.what);
}

}  // namespace imuscope
