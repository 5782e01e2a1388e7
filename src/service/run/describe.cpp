#include "service/run/describe.h"

#include <fmt/format.h>
#include <cmath>
#include <variant>

#include "base/units.h"
#include "estimation/calibration/state_name.h"
#include "service/pipeline/estimator_setup.h"

namespace imuscope {

namespace {

std::string_view method_name(InitialisationMethod method) {
  switch (method) {
    case InitialisationMethod::kConfigured:
      return "the configured attitude";
    case InitialisationMethod::kReferenceAttitude:
      return "the R-IMU's own attitude";
    case InitialisationMethod::kGyrocompass:
      return "levelling and gyrocompassing at rest";
    case InitialisationMethod::kInMotion:
      return "levelling at rest and heading from the motion";
    case InitialisationMethod::kNone:
      break;
  }
  return "nothing";
}

/// One sentence a kind.
struct EventSentence {
  const Configuration& configuration;
  const std::string& name;  ///< of the device

  std::string operator()(const event::NavigationStarted& e) const {
    return fmt::format("navigation started from {}", method_name(e.method));
  }
  std::string operator()(const event::NavigationStopped& e) const {
    return fmt::format("navigation stopped: the reference was silent for {:.2f} s; it starts again by itself",
                       e.gap_s);
  }
  std::string operator()(const event::ReferenceGap& e) const {
    return fmt::format("{}: reference silent for {:.3f} s; check its cable and baud rate if this repeats",
                       name, e.length_s);
  }
  std::string operator()(const event::ReferenceNoiseSeen& e) const {
    return fmt::format(
        "{}: no [device.noise] says how good it is; at rest it shows {:.2g} deg/sqrt(h) and {:.0f} ug/sqrt(Hz), and "
        "mountings are found with that",
        name, e.gyro_radps_per_sqrt_hz * kDegPerRad * std::sqrt(kSecondsPerHour),
        e.accel_mps2_per_sqrt_hz / kMps2PerMicroG);
  }
  std::string operator()(const event::ReferenceGravityWrong& e) const {
    return fmt::format(
        "{}: at standstill its specific force along b's z axis is {:+.2f} m/s^2 and should be near -9.8: "
        "check `axes` in the configuration (b is forward-right-down)",
        name, e.f_z_b_mps2);
  }
  std::string operator()(const event::CoarseAlignmentDone& e) const {
    return fmt::format("{}: mounting found, residual {:.2f} deg", name, e.residual_rad * kDegPerRad);
  }
  std::string operator()(const event::CoarseAlignmentPoor& e) const {
    return fmt::format(
        "{}: motion does not fit one mounting (its rates correlate with the reference's to {:.2f}): loose "
        "mount, swapped sensor or mirrored axes?",
        name, e.rate_correlation);
  }
  std::string operator()(const event::MountingChanged& e) const {
    return fmt::format("{}: it sits differently than before (mean NIS {:.1f}); its calibration starts again",
                       name, e.mean_nis);
  }
  std::string operator()(const event::SImuReturned& e) const {
    return fmt::format("{}: back after {:.2f} s of silence", name, e.gap_s);
  }
  std::string operator()(const event::GnssRejected& e) const {
    if (std::isinf(e.nis))
      return fmt::format("{}: positions rejected, which are nowhere on Earth; is it still starting?", name);
    return fmt::format("{}: solutions rejected (NIS {:.0f})", name, e.nis);
  }
  std::string operator()(const event::GnssReacquired& e) const {
    return fmt::format("{}: solutions accepted again after {:.1f} s", name, e.streak_s);
  }
  std::string operator()(const event::OdometryLost& e) const {
    return fmt::format("{}: no wheel speed for {:.2f} s; the last one is not held; check the bus", name,
                       e.silence_s);
  }
  std::string operator()(const event::OdometryReturned& e) const {
    return fmt::format("{}: wheel speeds again after {:.2f} s", name, e.silence_s);
  }
  std::string operator()(const event::OdometryRejected& e) const {
    return fmt::format(
        "{}: the wheels contradict the motion by {:+.2f} m/s and are not used: slip, or a wrong unit, "
        "factor or direction in the configuration or its DBC file",
        name, e.excess_mps);
  }
  std::string operator()(const event::OdometryAccepted& e) const {
    return fmt::format("{}: wheel speeds used again after {:.1f} s", name, e.streak_s);
  }
  std::string operator()(const event::CovarianceRepaired& e) const {
    const EstimatorConfig estimator = estimator_config(configuration);
    const StateName state = state_name(estimator, e.state);
    const std::string& owner =
        configuration
            .devices[state.study ? estimator.studies[*state.study].device : estimator.reference.device]
            .name;
    return fmt::format(
        "{}: numerical trouble: the variance of {} was no longer positive and starts "
        "again; please keep the capture",
        owner, state.name);
  }
  std::string operator()(const event::GravityMagnitudeWrong& e) const {
    return fmt::format(
        "{}: at standstill it feels {:.2f} m/s^2 and should feel 9.8: check the unit of its specific force",
        name, e.f_mps2);
  }
  std::string operator()(const event::BoresightPriorWrong& e) const {
    return fmt::format("{}: it sits {:.1f} deg from where [device.prior] says; check mounting and prior",
                       name, e.angle_rad * kDegPerRad);
  }
  std::string operator()(const event::LeverArmPriorWrong& e) const {
    return fmt::format(
        "{}: its lever arm is {:.2f} m from what [device.prior] says; check mounting and prior", name,
        e.distance_m);
  }
  std::string operator()(const event::SImusSwapped& e) const {
    return fmt::format("{} and {} sit where the configuration has the other: swapped cables, ports or names?",
                       name, configuration.devices[e.other].name);
  }
  std::string operator()(const event::GyroBiasChanged& e) const {
    return fmt::format("{}: its gyro bias changed by {:.3f} deg/s over the silence", name,
                       e.change_radps * kDegPerRad);
  }
  std::string operator()(const event::AccelBiasChanged& e) const {
    return fmt::format("{}: its accelerometer bias changed by {:.3f} m/s^2 over the silence", name,
                       e.change_mps2);
  }
  std::string operator()(const event::GnssInconsistent& e) const {
    return fmt::format(
        "{}: {:.0f} % of its positions disagree with the motion: check antenna_lever_arm_b_m, the "
        "receiver's sd and whose clock its times are of (GPS time is 18 s ahead of UTC)",
        name, 100.0 * e.share);
  }
  std::string operator()(const event::SImuInconsistent& e) const {
    return fmt::format(
        "{}: {:.0f} % of its samples contradict the reference; its numbers are not usable: check its axes, "
        "signs and units in the configuration, and that it is bolted to the reference's vehicle",
        name, 100.0 * e.share);
  }
  std::string operator()(const event::NoiseTooSmall& e) const {
    const std::string line = e.gyro ? fmt::format("gyro_white_sd_degps = {:.2g}", e.white_sd * kDegPerRad)
                                    : fmt::format("accel_white_sd_mps2 = {:.2g}", e.white_sd);
    return fmt::format(
        "{}: its {} differ from the reference's by {:.1f} times the configured noise, so that its sd are "
        "too small; [device.noise] {} would fit",
        name, e.gyro ? "rates" : "forces", e.factor, line);
  }
};

}  // namespace

std::string describe(const Configuration& configuration, const EstimatorEvent& event) {
  return std::visit(EventSentence{configuration, configuration.devices[event.device].name}, event.what);
}

}  // namespace imuscope
