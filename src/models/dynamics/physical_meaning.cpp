#include "models/dynamics/physical_meaning.h"

#include <fmt/format.h>

#include "base/units.h"
#include "models/dynamics/covariates.h"

namespace imuscope {
namespace {

constexpr double kMillidegreesPerRad = 1e3 * kDegPerRad;
constexpr double kPartsPerMillion = 1e6;
constexpr double kMicrosecondsPerSecond = 1e6;
constexpr double kMillimetresPerMetre = 1e3;
constexpr double kMillisecondsSquared = 1e6;  ///< per s^2

PhysicalMeaning of_gyro(Covariate kind, bool same_axis) {
  switch (kind) {
    case Covariate::kOmega:
      if (same_axis) return {"scale error", "ppm", kPartsPerMillion};
      return {"misalignment", "mdeg", kMillidegreesPerRad};
    case Covariate::kOmegaDot:
      if (same_axis) return {"time offset", "us", kMicrosecondsPerSecond};
      return {"delay from another axis", "us", kMicrosecondsPerSecond};
    case Covariate::kOmegaDdot:
      return {"difference of bandwidth", "ms^2", kMillisecondsSquared};
    case Covariate::kForce:
      return {"g-sensitivity", "deg/s per g", kDegPerRad * kMps2PerG};
    case Covariate::kForceDot:
      return {"sensitivity to jerk", "deg/s per g/s", kDegPerRad * kMps2PerG};
  }
  return {};
}

PhysicalMeaning of_accel(Covariate kind, bool same_axis) {
  switch (kind) {
    case Covariate::kOmega:
      return {"sensitivity to rotation", "mg per deg/s", 1e3 / kMps2PerG / kDegPerRad};
    case Covariate::kOmegaDot:
      if (same_axis)
        return {"sensitivity to angular acceleration", "mg per deg/s^2", 1e3 / kMps2PerG / kDegPerRad};
      return {"lever arm", "mm", kMillimetresPerMetre};
    case Covariate::kOmegaDdot:
      return {"lever arm times delay", "mm s", kMillimetresPerMetre};
    case Covariate::kForce:
      if (same_axis) return {"scale error", "ppm", kPartsPerMillion};
      return {"misalignment", "mdeg", kMillidegreesPerRad};
    case Covariate::kForceDot:
      if (same_axis) return {"time offset", "us", kMicrosecondsPerSecond};
      return {"delay from another axis", "us", kMicrosecondsPerSecond};
  }
  return {};
}

}  // namespace

PhysicalMeaning physical_meaning(std::size_t axis, std::size_t covariate) {
  const auto kind = static_cast<Covariate>(covariate / 3);
  const bool same_axis = axis % 3 == covariate % 3;
  return axis < 3 ? of_gyro(kind, same_axis) : of_accel(kind, same_axis);
}

std::string describe_coefficient(std::size_t axis, std::size_t covariate, double value) {
  const PhysicalMeaning meaning = physical_meaning(axis, covariate);
  return fmt::format("{} of {:.3g} {}", meaning.what, meaning.factor * value, meaning.unit);
}

}  // namespace imuscope
