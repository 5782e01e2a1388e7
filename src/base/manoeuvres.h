#pragma once

/// What a person is told to drive, and what it shows: the same words live, in health and in the report.

namespace imuscope {

/// Level boresight looks like an accelerometer bias until the yaw rate shows it through the gyroscopes; a first
/// mounting comes from the rates of both IMUs about more than one axis.
inline constexpr const char* kTurnBothWays =
    "turn in both directions, figures of eight or roundabouts at 20 to 30 deg/s";
/// Heading boresight shows in the direction of horizontal acceleration.
inline constexpr const char* kBrakeFirmly =
    "brake and accelerate firmly half a dozen times, and take some corners";
/// The level lever arm.
inline constexpr const char* kTurnTightly =
    "turn tightly in both directions with quick changes of the steering: yaw rate and yaw acceleration";
/// The vertical lever arm.
inline constexpr const char* kRoughRoad =
    "drive a rough piece of road or over bumps: roll and pitch acceleration";
/// The time offset.
inline constexpr const char* kChangeQuickly = "change the motion quickly: a slalom, abrupt braking, bumps";

}  // namespace imuscope
