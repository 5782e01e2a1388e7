#pragma once

/// The noise models of a run: every S-IMU and axis, over the whole run and per regime, and what differs
/// between the regimes (Table II). models.json, comparison.json, vibration.json, and
/// "left_out" of regimes.json.

#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "configuration/config.h"
#include "models/noise/fit.h"
#include "models/noise/lines.h"
#include "service/pipeline/noise_series.h"
#include "study/jobs.h"

namespace imuscope {

/// A model of models.json.
struct StudyModel {
  std::string name;  ///< of the S-IMU
  std::size_t axis = 0;
  std::string regime;                ///< "all", or a regime's name
  noise::FitResult fit;              ///< of what the sinusoids leave
  std::vector<noise::Line> lines{};  ///< sinusoids that belong to the model beside the fit
  bool parts_differ = false;         ///< by more than chance; intervals and warnings of the fit hold that
};

struct NoiseStudy {
  std::vector<StudyModel> models;
  nlohmann::json left_out = nlohmann::json::array();
  nlohmann::json lines = nlohmann::json::array();  ///< entries of vibration.json
  std::vector<std::string> remarks;                ///< what could not be fitted, levels that are left out
};

/// A sentence where an S-IMU has samples for less than kWholeRunShare of the run; empty otherwise.
inline constexpr double kWholeRunShare = 0.9;
std::string coverage_remark(const std::string& name, const NoiseSeries& series, double rate_hz, double run_s,
                            HostTime origin);

/// Vibration lines are looked for in every regime and taken out before models are fitted.
/// @param series    one an S-IMU, in the order of the configuration; regimes by their index in `regimes`
/// @param progress  called with the share that is done
/// @param longer    other work of the run, done beside: each takes longer than an axis, and they begin first
NoiseStudy study_noise(const Configuration& configuration, const std::vector<NoiseSeries>& series,
                       const std::vector<std::string>& regimes, const noise::ModelSpec& spec,
                       const std::function<void(double)>& progress, std::vector<Job> longer = {});

/// The content of models.json's "models": every entry holds its sinusoids, with intervals and with what they
/// add to each level, as "sinusoids".
nlohmann::json models_json(const NoiseStudy& study);

/// comparison.json: for every S-IMU and axis, every two regimes parameter by parameter and jointly. Holm's
/// correction holds over all parameters of one S-IMU, and over all its joint tests.
nlohmann::json comparison_json(const NoiseStudy& study, const std::vector<std::string>& regimes);

}  // namespace imuscope
