#include "service/run/models_file.h"

#include <fmt/format.h>

#include "models/noise/json.h"
#include "service/pipeline/noise_series.h"
#include "service/run/run_folder.h"

namespace imuscope {

nlohmann::json model_json(const noise::FitResult& fit, const std::string& name, std::size_t axis,
                          const std::string& regime) {
  nlohmann::json model = noise::fit_to_json(fit);
  model["name"] = name;
  model["axis"] = axis_name(axis);
  model["regime"] = regime;
  model["unit"] = axis_unit(axis);
  return model;
}

Result<void> write_models(const OutputFolder& folder, const nlohmann::json& models) {
  return write_json(folder, "models.json", {{"schema", "imuscope.models/1"}, {"models", models}});
}

Result<noise::FitResult> read_model(const nlohmann::json& models, const std::string& name, std::size_t axis,
                                    const std::string& regime) {
  for (const nlohmann::json& entry : models) {
    if (entry.value("name", "") == name && entry.value("axis", "") == axis_name(axis) &&
        entry.value("regime", "") == regime)
      return noise::fit_from_json(entry);
  }
  return work_error(fmt::format("no model of {} in the regime “{}” in models.json", axis_name(axis), regime));
}

}  // namespace imuscope
