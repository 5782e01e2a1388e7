#pragma once

/// How the noise parameters of every S-IMU and axis follow the dynamics: dependence.json.

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "configuration/config.h"
#include "estimation/regimes/motion_levels.h"
#include "estimation/regimes/regime_track.h"
#include "service/pipeline/noise_series.h"
#include "study/noise_study.h"
#include "study/temperature_track.h"

namespace imuscope {

struct DependenceStudy {
  nlohmann::json document;
  std::vector<std::string> remarks;
};

/// Over windows that lie wholly inside the dynamic part, against rms rate, rms vibration, mean speed and the
/// sensor's own temperature: each by itself, and all of them together ("beside_others"). Holm's correction
/// holds over all slopes of one S-IMU, each way.
/// @param temperatures  one an S-IMU, in the order of `series`
/// @param models        where the search begins: the dynamic model of the axis, or that of the whole run
DependenceStudy study_dependence(const Configuration& configuration, const std::vector<NoiseSeries>& series,
                                 const std::vector<TemperatureTrack>& temperatures,
                                 const MotionLevels& levels, const RegimeTrack& motion,
                                 const NoiseStudy& models, HostTime origin);

}  // namespace imuscope
