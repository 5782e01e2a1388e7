#pragma once

/// Conversions from user units to SI. Inside imuscope everything is SI and radians; these constants are used
/// only where numbers enter (configuration, decoders) or leave (files, messages for people).

#include <numbers>

namespace imuscope {

inline constexpr double kPi = std::numbers::pi;
inline constexpr double kRadPerDeg = kPi / 180.0;
inline constexpr double kDegPerRad = 180.0 / kPi;
/// Standard gravity, m/s^2 per g (3rd CGPM, 1901). A unit, not the local gravity.
inline constexpr double kMps2PerG = 9.80665;
inline constexpr double kMdegPerRad = 1e3 * kDegPerRad;
inline constexpr double kMmPerM = 1e3;
inline constexpr double kMsPerS = 1e3;
inline constexpr double kSecondsPerHour = 3600.0;
inline constexpr double kSecondsPerDay = 86400.0;
/// Data sheets give accelerometer noise and bias in micro-g.
inline constexpr double kMps2PerMicroG = kMps2PerG * 1e-6;

}  // namespace imuscope
