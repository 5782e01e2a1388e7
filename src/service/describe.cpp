#include "service/describe.h"

#include <fmt/format.h>
#include <cmath>

#include "base/units.h"
#include "calibration/state_name.h"
#include "service/estimator_setup.h"

namespace imuscope {

namespace {

std::string_view method_name(double value) {
  switch (static_cast<InitialisationMethod>(static_cast<int>(value))) {
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

}  // namespace

std::string describe(const Configuration& configuration, const EstimatorEvent& event) {
  const std::string& name = configuration.devices[event.device].name;
  switch (event.kind) {
    case EstimatorEventKind::kNavigationStarted:
      return fmt::format("navigation started from {}", method_name(event.value));
    case EstimatorEventKind::kNavigationStopped:
      return fmt::format(
          "navigation stopped: the reference was silent for {:.2f} s; it starts again by itself",
          event.value);
    case EstimatorEventKind::kReferenceGap:
      return fmt::format("{}: reference silent for {:.3f} s; check its cable and baud rate if this repeats",
                         name, event.value);
    case EstimatorEventKind::kReferenceGravityWrong:
      return fmt::format(
          "{}: at standstill its specific force along b's z axis is {:+.2f} m/s^2 and should be near -9.8: "
          "check `axes` in the configuration (b is forward-right-down)",
          name, event.value);
    case EstimatorEventKind::kCoarseAlignmentDone:
      return fmt::format("{}: mounting found, residual {:.2f} deg", name, event.value * kDegPerRad);
    case EstimatorEventKind::kCoarseAlignmentPoor:
      return fmt::format(
          "{}: motion does not fit one mounting (its rates correlate with the reference's to {:.2f}): loose "
          "mount, swapped sensor or mirrored axes?",
          name, event.value);
    case EstimatorEventKind::kMountingChanged:
      return fmt::format(
          "{}: it sits differently than before (mean NIS {:.1f}); its calibration starts again", name,
          event.value);
    case EstimatorEventKind::kStudyReturned:
      return fmt::format("{}: back after {:.2f} s of silence", name, event.value);
    case EstimatorEventKind::kGnssRejected:
      if (std::isinf(event.value))
        return fmt::format("{}: positions rejected, which are nowhere on Earth; is it still starting?", name);
      return fmt::format("{}: solutions rejected (NIS {:.0f})", name, event.value);
    case EstimatorEventKind::kGnssReacquired:
      return fmt::format("{}: solutions accepted again after {:.1f} s", name, event.value);
    case EstimatorEventKind::kOdometryLost:
      return fmt::format("{}: no wheel speed for {:.2f} s; the last one is not held; check the bus", name,
                         event.value);
    case EstimatorEventKind::kOdometryReturned:
      return fmt::format("{}: wheel speeds again after {:.2f} s", name, event.value);
    case EstimatorEventKind::kOdometryRejected:
      return fmt::format(
          "{}: the wheels contradict the motion by {:+.2f} m/s and are not used: slip, or a wrong unit, "
          "factor or "
          "direction in the configuration or its DBC file",
          name, event.value);
    case EstimatorEventKind::kOdometryAccepted:
      return fmt::format("{}: wheel speeds used again after {:.1f} s", name, event.value);
    case EstimatorEventKind::kCovarianceRepaired: {
      const EstimatorConfig estimator = estimator_config(configuration);
      const StateName state = state_name(estimator, static_cast<std::size_t>(event.value));
      const std::string& owner =
          configuration
              .devices[state.study ? estimator.studies[*state.study].device : estimator.reference.device]
              .name;
      return fmt::format(
          "{}: numerical trouble: the variance of {} was no longer positive and starts again; please keep "
          "the "
          "capture",
          owner, state.name);
    }
    case EstimatorEventKind::kGravityMagnitudeWrong:
      return fmt::format(
          "{}: at standstill it feels {:.2f} m/s^2 and should feel 9.8: check the unit of its specific force",
          name, event.value);
    case EstimatorEventKind::kBoresightPriorWrong:
      return fmt::format("{}: it sits {:.1f} deg from where [device.prior] says; check mounting and prior",
                         name, event.value * kDegPerRad);
    case EstimatorEventKind::kLeverArmPriorWrong:
      return fmt::format(
          "{}: its lever arm is {:.2f} m from what [device.prior] says; check mounting and prior", name,
          event.value);
    case EstimatorEventKind::kStudiesSwapped:
      return fmt::format(
          "{} and {} sit where the configuration has the other: swapped cables, ports or names?", name,
          configuration.devices[static_cast<std::size_t>(event.value)].name);
    case EstimatorEventKind::kGyroBiasChanged:
      return fmt::format("{}: its gyro bias changed by {:.3f} deg/s over the silence", name,
                         event.value * kDegPerRad);
    case EstimatorEventKind::kAccelBiasChanged:
      return fmt::format("{}: its accelerometer bias changed by {:.3f} m/s^2 over the silence", name,
                         event.value);
    case EstimatorEventKind::kGnssInconsistent:
      return fmt::format(
          "{}: {:.0f} % of its positions disagree with the motion: check antenna_lever_arm_b_m, the "
          "receiver's sd and whose clock its times are of (GPS time is 18 s ahead of UTC)",
          name, 100.0 * event.value);
    case EstimatorEventKind::kStudyInconsistent:
      return fmt::format(
          "{}: {:.0f} % of its samples contradict the reference; its numbers are not usable: check its axes, "
          "signs and units in the configuration, and that it is bolted to the reference's vehicle",
          name, 100.0 * event.value);
  }
  return "unknown event";
}

}  // namespace imuscope
