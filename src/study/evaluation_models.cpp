#include "study/evaluation_models.h"

#include <fmt/format.h>
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "models/noise/filter_form.h"
#include "models/noise/holm.h"
#include "service/pipeline/noise_series.h"
#include "service/run/models_file.h"

namespace imuscope {
namespace {

using nlohmann::json;

double number_or(const json& object, const char* key, double fallback) {
  const auto found = object.find(key);
  return found != object.end() && found->is_number() ? found->get<double>() : fallback;
}

AxisNoise axis_noise(const noise::FilterTerms& terms) {
  AxisNoise noise;
  noise.white_density = terms.white_density() + terms.short_memory_density;
  noise.walk_density = terms.walk_density;
  for (const auto& process : terms.gauss_markov) {
    if (!(process.rate_per_s > 0.0) || !(process.variance > 0.0)) continue;
    // V-3: what is fast enters the density; V-1: what is slow is a state.
    if (process.is_fast() || noise.slow.size() == kSlowMax) {
      noise.white_density += terms.low_frequency_density(process);
    } else {
      noise.slow.push_back({process.variance, process.rate_per_s});
    }
  }
  return noise;
}

void set_turn_on(CoastingModel& model, const std::array<double, kImuAxes>& turn_on_sd) {
  for (std::size_t axis = 0; axis < kImuAxes; ++axis)
    model.axes[axis].turn_on_variance = turn_on_sd[axis] * turn_on_sd[axis];
}

EvaluationModel of_regime(const json& models, const std::string& name, const std::string& regime) {
  EvaluationModel out{regime, std::nullopt, {}};
  CoastingModel model;
  model.name = regime;
  model.source = "fitted to the error process of this run";
  for (std::size_t axis = 0; axis < kImuAxes; ++axis) {
    const auto fit = read_model(models, name, axis, regime);
    if (!fit) {
      out.absent_because = fit.error().text();
      return out;
    }
    model.axes[axis] = axis_noise(noise::filter_terms(*fit));
  }
  out.model = std::move(model);
  return out;
}

EvaluationModel of_data_sheet(const DataSheetConfig& sheet) {
  EvaluationModel out{"data sheet", std::nullopt, {}};
  if (!sheet.gyro_density_radps_per_sqrt_hz || !sheet.accel_density_mps2_per_sqrt_hz ||
      !sheet.gyro_bias_stability_radps || !sheet.accel_bias_stability_mps2) {
    out.absent_because = "the configuration gives no [device.data_sheet] for this sensor";
    return out;
  }
  CoastingModel model;
  model.name = out.name;
  model.source =
      fmt::format("densities and bias stability of the data sheet, bias time {:g} s", sheet.bias_time_s);
  for (std::size_t axis = 0; axis < kImuAxes; ++axis) {
    const bool gyro = axis < 3;
    const double density =
        gyro ? *sheet.gyro_density_radps_per_sqrt_hz : *sheet.accel_density_mps2_per_sqrt_hz;
    const double bias_sd = gyro ? *sheet.gyro_bias_stability_radps : *sheet.accel_bias_stability_mps2;
    model.axes[axis].white_density = density * density;
    model.axes[axis].slow.push_back({bias_sd * bias_sd, 1.0 / sheet.bias_time_s});
  }
  out.model = std::move(model);
  return out;
}

/// White density of one axis over time.
struct DensityTrack {
  std::vector<std::pair<double, double>> from;  ///< time, density
  std::string driver;                           ///< what it follows; empty: the regime
};

/// The dependence that an axis's white noise has shown most clearly; nullptr where it has shown none.
const json* clearest_dependence(const json& dependence, const std::string& name, std::size_t axis) {
  const auto found = dependence.find("dependences");
  if (found == dependence.end()) return nullptr;
  const json* best = nullptr;
  double best_p = noise::kSignificance;
  for (const json& entry : *found) {
    const double p = number_or(entry, "p_holm", 1.0);
    if (entry.value("name", "") != name || entry.value("axis", "") != axis_name(axis) ||
        entry.value("process", "") != noise::short_name(noise::ProcessKind::kWhiteNoise) || p >= best_p) {
      continue;
    }
    best_p = p;
    best = &entry;
  }
  return best;
}

/// The fast processes beside the white noise keep their share.
DensityTrack following(const json& found, const json& dependence, const std::string& name, std::size_t axis,
                       const AxisNoise& dynamic, const noise::FilterTerms& terms) {
  DensityTrack track;
  track.driver = found.value("driver", "");
  const double mean = number_or(found, "mean_driver", 0.0);
  const double slope = number_or(found, "slope", 0.0);
  const double at_mean = number_or(found, "at_mean_driver", 0.0) / terms.rate_hz;
  const double beside = dynamic.white_density - terms.white_density();
  for (const json& point : dependence.value("points", json::array())) {
    if (point.value("name", "") != name || point.value("axis", "") != axis_name(axis)) continue;
    const double driver = number_or(point.value("driver", json::object()), track.driver.c_str(), NAN);
    const double time_s = number_or(point, "time_s", NAN);
    if (!std::isfinite(driver) || !std::isfinite(time_s)) continue;
    track.from.emplace_back(time_s, at_mean * std::exp(slope * (driver - mean)) + beside);
  }
  std::sort(track.from.begin(), track.from.end());
  // Points stand in the middle of their windows: each holds from halfway since the one before.
  for (std::size_t i = track.from.size(); i-- > 1;)
    track.from[i].first = 0.5 * (track.from[i].first + track.from[i - 1].first);
  return track;
}

/// Every axis's track as one list of changes.
std::vector<CoastingModel::Change> merged(const std::array<DensityTrack, kImuAxes>& tracks) {
  std::map<double, std::vector<std::pair<std::size_t, double>>> by_time;
  for (std::size_t axis = 0; axis < kImuAxes; ++axis) {
    for (const auto& [time_s, density] : tracks[axis].from) by_time[time_s].emplace_back(axis, density);
  }
  std::array<double, kImuAxes> now{};
  for (std::size_t axis = 0; axis < kImuAxes; ++axis) now[axis] = tracks[axis].from.front().second;
  std::vector<CoastingModel::Change> changes{{-std::numeric_limits<double>::infinity(), now}};
  for (const auto& [time_s, of_axes] : by_time) {
    for (const auto& [axis, density] : of_axes) now[axis] = density;
    changes.push_back({time_s, now});
  }
  return changes;
}

EvaluationModel by_dynamics(const StudyDrive& drive, const EvaluationModel& at_rest,
                            const EvaluationModel& moving, const json& models, const json& dependence) {
  EvaluationModel out{"by dynamics", std::nullopt, {}};
  if (!moving.model) {
    out.absent_because = moving.absent_because;
    return out;
  }
  CoastingModel model = *moving.model;
  model.name = out.name;
  std::array<DensityTrack, kImuAxes> tracks;
  std::size_t n_following = 0;
  for (std::size_t axis = 0; axis < kImuAxes; ++axis) {
    const noise::FilterTerms terms = noise::filter_terms(*read_model(models, drive.name, axis, "dynamic"));
    if (const json* found = clearest_dependence(dependence, drive.name, axis)) {
      tracks[axis] = following(*found, dependence, drive.name, axis, model.axes[axis], terms);
    }
    if (!tracks[axis].from.empty()) {
      ++n_following;
      continue;
    }
    if (!at_rest.model) {
      out.absent_because = at_rest.absent_because + ", and no dependence on the motion was found";
      return out;
    }
    for (const auto& [time_s, regime] : drive.regimes) {
      const CoastingModel& in_force = regime == Regime::kStatic ? *at_rest.model : *moving.model;
      tracks[axis].from.emplace_back(time_s, in_force.axes[axis].white_density);
    }
  }
  model.changes = merged(tracks);
  model.source = n_following == 0
                     ? "white noise of the static or the dynamic model, as the vehicle stands or moves"
                     : fmt::format(
                           "white noise follows the motion on {} of 6 axes (dependence.json), the "
                           "regime on the others; slow processes of the dynamic model",
                           n_following);
  out.model = std::move(model);
  return out;
}

}  // namespace

std::vector<EvaluationModel> evaluation_models(const StudyDrive& drive, const DataSheetConfig& sheet,
                                               const std::array<double, kImuAxes>& turn_on_sd,
                                               const json& models, const json& dependence) {
  const json& fits = models.at("models");
  const EvaluationModel at_rest = of_regime(fits, drive.name, "static");
  const EvaluationModel moving = of_regime(fits, drive.name, "dynamic");
  std::vector<EvaluationModel> all{at_rest, moving, by_dynamics(drive, at_rest, moving, fits, dependence),
                                   of_data_sheet(sheet)};
  for (EvaluationModel& one : all) {
    if (one.model) set_turn_on(*one.model, turn_on_sd);
  }
  return all;
}

}  // namespace imuscope
