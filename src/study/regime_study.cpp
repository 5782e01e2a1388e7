#include "study/regime_study.h"

#include <fmt/format.h>
#include <algorithm>
#include <cmath>

#include "service/pipeline/noise_series.h"
#include "service/pipeline/vehicle_speed.h"

namespace imuscope {

namespace {

constexpr std::size_t kStatic = 0;
constexpr std::size_t kDynamic = 1;

constexpr const char* kByNames[] = {"motion", "intensity", "labels"};

/// What is said where the run has no static or no dynamic part.
std::vector<std::string> missing_parts(const RegimeTrack& motion, const MotionLimits& limits,
                                       bool has_speed) {
  std::vector<std::string> remarks;
  if (motion.total_s(kStatic) <= 0.0) {
    remarks.push_back(fmt::format(
        "there is no static part: the vehicle never stood for {:.0f} s; no static noise model is made "
        "and there is nothing to compare the dynamic one with",
        limits.shortest_static_s));
  }
  if (motion.total_s(kDynamic) <= 0.0) {
    remarks.emplace_back(
        "there is no dynamic part: the vehicle stood all the time; no dynamic noise model and no "
        "regression on the dynamics is made");
  }
  if (!has_speed) {
    remarks.emplace_back(
        "no speed was known: static and dynamic were told apart by the reference's "
        "rates, forces and vibration alone");
  }
  return remarks;
}

}  // namespace

void MotionWatch::add(const SImuEpoch& epoch, const ReferenceBias& bias) {
  Vector3 omega{};
  Vector3 f{};
  for (std::size_t i = 0; i < 3; ++i) {
    omega[i] = epoch.omega_ib_b_radps[i] + epoch.reference_gyro_bias_radps[i] - bias.gyro_radps[i];
    f[i] = epoch.f_b_mps2[i] + epoch.reference_accel_bias_mps2[i] - bias.accel_mps2[i];
  }
  levels_.add(epoch.time, omega, f);
}

void MotionWatch::add(const Snapshot& snapshot) {
  const auto speed = vehicle_speed(snapshot.navigation, snapshot.odometry, snapshot.counters);
  if (!speed) return;
  levels_.add_speed(speed->time, speed->speed_mps, speed->sd_mps);
  has_speed_ = true;
}

Result<RunRegimes> find_regimes(const RegimeOptions& options, const MotionWatch& watch,
                                const std::vector<Label>& labels, const std::vector<MarkedMoment>& moments,
                                HostTime origin) {
  RunRegimes regimes;
  regimes.by = labels.empty() ? options.by : RegimesBy::kLabels;
  regimes.motion = static_and_dynamic(watch.levels(), options.limits);
  regimes.remarks = missing_parts(regimes.motion, options.limits, watch.has_speed());
  switch (regimes.by) {
    case RegimesBy::kMotion:
      regimes.chosen = regimes.motion;
      break;
    case RegimesBy::kIntensity:
      regimes.chosen =
          intensity_bins(watch.levels(), regimes.motion, options.intensity, options.bins, options.block_s);
      break;
    case RegimesBy::kLabels: {
      const HostTime end = watch.levels().begin_of(watch.levels().cells().size());
      auto named = labels.empty() ? labels_of_moments(moments, origin, end) : labels;
      if (named.empty()) {
        return usage_error(
            "the regimes are to be those that a person named, and there are none",
            "give --labels FILE.csv, or send 'regime NAME' on IMUSCOPE_EVENT while recording, or "
            "choose another `by` in [regimes]");
      }
      if (const auto n_left_out = keep_first_names(named, kMaxRegimes); n_left_out > 0) {
        regimes.remarks.push_back(
            fmt::format("{} different regimes are named and a run can have {}: what the last {} "
                        "names hold for belongs to no regime",
                        kMaxRegimes + n_left_out, kMaxRegimes, n_left_out));
      }
      regimes.chosen = labelled_regimes(named, origin);
      break;
    }
  }
  return regimes;
}

nlohmann::json regimes_json(const RunRegimes& regimes, HostTime origin) {
  nlohmann::json document{{"schema", "imuscope.regimes/1"},
                          {"by", kByNames[static_cast<std::size_t>(regimes.by)]},
                          {"regimes", nlohmann::json::array()},
                          {"left_out", nlohmann::json::array()},
                          {"remarks", regimes.remarks}};
  for (std::size_t i = 0; i < regimes.chosen.names().size(); ++i) {
    nlohmann::json stretches = nlohmann::json::array();
    for (const auto& stretch : regimes.chosen.stretches()) {
      if (stretch.regime != i) continue;
      stretches.push_back(
          {{"begin_s", to_seconds(stretch.begin - origin)}, {"end_s", to_seconds(stretch.end - origin)}});
    }
    document["regimes"].push_back({{"name", regimes.chosen.names()[i]},
                                   {"total_s", regimes.chosen.total_s(i)},
                                   {"longest_s", regimes.chosen.longest_s(i)},
                                   {"stretches", stretches}});
  }
  return document;
}

}  // namespace imuscope
