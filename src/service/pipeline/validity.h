#pragma once

/// Whether a result may be used, and how old what it rests on was when it was made. Pure functions; any
/// thread.

#include <cstdint>

#include "estimation/calibration/estimator.h"

namespace imuscope {

/// As the messages have it; of several reasons the last one counts.
enum class Validity : std::int8_t {
  kUsable = 0,
  kConverging = 1,  ///< of a calibration, and of what is made with it: not usable yet (calibration_levels.h)
  kCoasting = 2,    ///< of a navigation: without GNSS for a while; the sd say what is left
  kContradicted = 3,  ///< GNSS or the S-IMU's samples do not fit the motion
  kStale = 4,         ///< the reference went silent, or what it said came late
};

/// Ages at the cut of the tick that made a result.
struct DataAges {
  double reference_s = 0.0;  ///< of the newest R-IMU sample; NaN: there was none
  double gnss_s = 0.0;       ///< of the newest solution that the navigation took in; NaN: none
};

/// A reference of 1 Hz is none; lines and clock maps take hundredths of a second.
inline constexpr double kStaleReference_s = 0.5;
/// Receivers say something every second at the least.
inline constexpr double kCoasting_s = 5.0;

/// @param has_reference  there was a first sample of the R-IMU
[[nodiscard]] DataAges data_ages(const NavigationOutput& navigation, bool has_reference,
                                 HostTime cut) noexcept;
[[nodiscard]] Validity validity_of(const NavigationOutput& navigation, const DataAges& ages) noexcept;
[[nodiscard]] Validity validity_of(const SImuOutput& study, const DataAges& ages) noexcept;

}  // namespace imuscope
