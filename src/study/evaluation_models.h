#pragma once

/// The noise models that outages are played with, from what a run found and from the data sheet.

#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "configuration/config.h"
#include "study/evaluation/coasting_model.h"
#include "study/evaluation_drive.h"

namespace imuscope {

/// A model, or why there is none.
struct EvaluationModel {
  std::string name;  ///< "static", "dynamic", "by dynamics", "data sheet"
  std::optional<CoastingModel> model;
  std::string absent_because;  ///< where there is no model
};

/// The four models of one S-IMU.
///
/// Of a fitted model, a Gauss-Markov process slower than a second becomes a state; what is faster acts on a
/// coasting filter as white noise of its density at low frequencies. "by dynamics": slow processes of the
/// dynamic model, white noise that follows the vehicle: per axis the dependence with the smallest corrected p
/// value below 5 % in dependence.json, else the static or the dynamic model's as the regime is.
///
/// @param models      models.json
/// @param dependence  dependence.json; null where absent
/// @param turn_on_sd  sd of the constant part of the biases, per axis
std::vector<EvaluationModel> evaluation_models(const StudyDrive& drive, const DataSheetConfig& sheet,
                                               const std::array<double, kImuAxes>& turn_on_sd,
                                               const nlohmann::json& models,
                                               const nlohmann::json& dependence);

}  // namespace imuscope
