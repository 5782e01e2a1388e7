#include "fleet/study_summary.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <optional>

#include "base/calibration_levels.h"
#include "base/units.h"
#include "models/noise/json.h"
#include "models/noise/quantities.h"
#include "results/tables/csv_reader.h"
#include "results/tables/json_fields.h"
#include "results/tables/json_file.h"

namespace imuscope::fleet {
namespace {

using nlohmann::json;
using tables::field;
using tables::number_at;
using tables::numbers_at;
using tables::text_at;

constexpr std::array<const char*, 3> kXyz{"x", "y", "z"};
/// Points of a track on the map.
constexpr std::size_t kTrackPoints = 40;
/// A metre or so.
constexpr double kTrackStep_deg = 1e-5;
constexpr double kEarthRadius_m = 6371008.8;  ///< mean (IUGG 1980); for lengths of drives alone
/// Half the width of an interval of 95 % in sd.
constexpr double kSdOf95 = 1.959964;

json or_null(std::optional<double> value) { return value ? json(*value) : json(nullptr); }

/// Rows of numbers that a population can be made of.
class Measurements {
 public:
  void linear(const std::string& quantity, const std::string& regime, const std::string& axis,
              const char* unit, double value, double sd) {
    if (std::isfinite(value) && std::isfinite(sd) && sd > 0.0)
      rows_.push_back({quantity, regime, axis, unit, false, value, sd});
  }
  /// @param sd_log  of the logarithm
  void logarithm(const std::string& quantity, const std::string& regime, const std::string& axis,
                 const std::string& unit, double value, double sd_log) {
    if (value > 0.0 && std::isfinite(value) && std::isfinite(sd_log) && sd_log > 0.0)
      rows_.push_back({quantity, regime, axis, unit, true, std::log(value), sd_log});
  }
  /// Three axes of calibration.json.
  void triad(const json& imu, const char* key, const char* sd_key, const std::string& quantity,
             const std::string& stem, const char* unit, double factor) {
    const auto values = numbers_at<3>(imu, key);
    const auto sd = numbers_at<3>(imu, sd_key);
    if (!values || !sd) return;
    for (std::size_t i = 0; i < kXyz.size(); ++i)
      linear(quantity, "", stem + kXyz[i], unit, factor * (*values)[i], factor * (*sd)[i]);
  }
  [[nodiscard]] json take() { return std::move(rows_); }

 private:
  json rows_ = json::array();
};

void measure_calibration(const json& imu, Measurements& out) {
  constexpr double kMilli = 1e3;
  constexpr double kPercent = 100.0;
  out.triad(imu, "gyro_bias_radps", "gyro_bias_sd_radps", "gyro bias", "", "deg/s", kDegPerRad);
  out.triad(imu, "accel_bias_mps2", "accel_bias_sd_mps2", "accelerometer bias", "", "m/s^2", 1.0);
  out.triad(imu, "gyro_scale", "gyro_scale_sd", "gyro scale error", "", "%", kPercent);
  out.triad(imu, "accel_scale", "accel_scale_sd", "accelerometer scale error", "", "%", kPercent);
  out.triad(imu, "accel_boresight_deg", "accel_boresight_sd_deg", "accelerometers against gyros", "", "deg",
            1.0);
  const auto t_d = number_at(imu, "t_d_s");
  const auto t_d_sd = number_at(imu, "t_d_sd_s");
  if (t_d && t_d_sd) out.linear("time offset", "", "", "ms", kMilli * *t_d, kMilli * *t_d_sd);
}

/// What a data sheet has becomes a measurement; parameters stand with their model.
json measure_model(const json& entry, Measurements& out) {
  const std::string axis = text_at(entry, "axis");
  const std::string regime = text_at(entry, "regime");
  const auto fit = noise::fit_from_json(entry);
  const auto unit = noise::parse_unit(text_at(entry, "unit"));
  if (fit && unit) {
    for (const noise::Quantity& q : noise::filter_quantities(*fit, *unit)) {
      if (q.process != "model" || q.knowledge != noise::Knowledge::kFitted || !q.ci_low || !q.ci_high)
        continue;
      if (*q.ci_low > 0.0)
        out.logarithm(q.name, regime, axis, q.unit, q.value,
                      std::log(*q.ci_high / *q.ci_low) / (2.0 * kSdOf95));
    }
  }
  json parameters = json::array();
  for (const json& p : field(entry, "parameters")) {
    const auto value = number_at(p, "value");
    const auto sd = number_at(p, "sd");
    const std::string process = text_at(p, "process");
    const std::string name = text_at(p, "name");
    parameters.push_back({process, name, text_at(p, "unit"), or_null(value), or_null(sd),
                          or_null(number_at(p, "ci_low")), or_null(number_at(p, "ci_high"))});
  }
  return {{"axis", axis},
          {"regime", regime},
          {"model", text_at(entry, "model")},
          {"p_value", or_null(number_at(field(entry, "j_test"), "p_value"))},
          {"identifiable", field(entry, "identifiable")},
          {"simpler_model", text_at(entry, "simpler_model")},
          {"seconds", or_null(number_at(field(entry, "fitted_to"), "seconds"))},
          {"parameters", std::move(parameters)}};
}

/// Mean over the drive, where the sensor's messages carry it.
json temperature_of(const json& dependence, const std::string& device) {
  double sum = 0.0;
  std::size_t n = 0;
  for (const json& point : field(dependence, "points")) {
    const auto degC = number_at(field(point, "driver"), "temperature");
    if (!degC || text_at(point, "name") != device) continue;
    sum += *degC;
    ++n;
  }
  return n == 0 ? json(nullptr) : json(sum / static_cast<double>(n));
}

std::string usability_words(const json& imu) {
  const auto psi = numbers_at<3>(imu, "boresight_sd_deg");
  const auto r = numbers_at<3>(imu, "r_bs_b_sd_m");
  const auto t_d = number_at(imu, "t_d_sd_s");
  if (!has_estimate(text_at(imu, "status")) || !psi || !r || !t_d)
    return std::string(words_of(Usability::kNotUsable));
  return std::string(words_of(usability_of(*std::max_element(psi->begin(), psi->end()) * kRadPerDeg,
                                           *std::max_element(r->begin(), r->end()), *t_d)));
}

json imu_of(const json& imu, const json& run, const json& models, const json& dependence) {
  const std::string device = text_at(imu, "name");
  Measurements measurements;
  json fits = json::array();
  if (has_estimate(text_at(imu, "status"))) measure_calibration(imu, measurements);
  for (const json& entry : field(models, "models")) {
    if (text_at(entry, "name") == device) fits.push_back(measure_model(entry, measurements));
  }
  json out{{"device", device},
           {"status", text_at(imu, "status")},
           {"usability", usability_words(imu)},
           {"temperature_degC", temperature_of(dependence, device)},
           {"data_sheet", field(tables::named(field(run, "devices"), device), "data_sheet")},
           {"measurements", measurements.take()},
           {"models", std::move(fits)}};
  for (const char* key : {"C_b_s", "boresight_sd_deg", "r_bs_b_m", "r_bs_b_sd_m", "t_d_s", "t_d_sd_s"})
    out[key] = field(imu, key);
  return out;
}

json devices_of(const json& run) {
  json out = json::array();
  for (const json& device : field(run, "devices")) {
    const double bad = number_at(device, "bad_checksums").value_or(0.0) +
                       number_at(device, "bad_lengths").value_or(0.0) +
                       number_at(device, "bad_contents").value_or(0.0);
    out.push_back({{"device", text_at(device, "name")},
                   {"role", text_at(device, "role")},
                   {"protocol", text_at(device, "protocol")},
                   {"samples", or_null(number_at(device, "samples"))},
                   {"samples_lost", or_null(number_at(device, "samples_lost"))},
                   {"bad_frames", bad},
                   {"late", or_null(number_at(device, "late"))},
                   {"problem", text_at(device, "problem")}});
  }
  return out;
}

json findings_of(const json& run) {
  json out = json::array();
  for (const json& finding : field(run, "findings")) {
    json row = json::object();
    for (const char* key : {"harm", "check", "device", "text"}) row[key] = text_at(finding, key);
    out.push_back(std::move(row));
  }
  return out;
}

struct Track {
  json points = json::array();
  double distance_m = 0.0;
};

/// Where the drive went, in few points; empty without a position.
Track track_of(const std::filesystem::path& run) {
  Track track;
  std::error_code error;
  const auto smoothed = run / "smoothed_navigation.csv";
  const bool is_smoothed = std::filesystem::exists(smoothed, error);
  auto reader =
      tables::CsvReader::open(is_smoothed ? smoothed : run / "navigation.csv", {"lat_deg", "lon_deg"});
  if (!reader) return track;
  std::vector<std::array<double, 2>> all;
  while (reader->next()) {
    const std::array<double, 2> at{reader->number(0), reader->number(1)};
    if (std::isfinite(at[0]) && std::isfinite(at[1])) all.push_back(at);
  }
  for (std::size_t i = 1; i < all.size(); ++i) {
    const double north = (all[i][0] - all[i - 1][0]) * kRadPerDeg;
    const double east = (all[i][1] - all[i - 1][1]) * kRadPerDeg * std::cos(all[i][0] * kRadPerDeg);
    track.distance_m += kEarthRadius_m * std::hypot(north, east);
  }
  const std::size_t n = std::min(all.size(), kTrackPoints);
  for (std::size_t k = 0; k < n; ++k) {
    const auto& at = all[n == 1 ? 0 : k * (all.size() - 1) / (n - 1)];
    const auto rounded = [](double degrees) { return std::round(degrees / kTrackStep_deg) * kTrackStep_deg; };
    track.points.push_back({rounded(at[0]), rounded(at[1])});
  }
  return track;
}

Result<json> document(const std::filesystem::path& run, const char* name) {
  json out = tables::read_json_file(run / name);
  if (!out.is_object()) return work_error(fmt::format("{} is no document of a run", (run / name).string()));
  return out;
}

}  // namespace

Result<json> summary_of_run(const std::filesystem::path& folder) {
  return tables::with_documents_of(folder, [&]() -> Result<json> {
    const auto run = document(folder, "run.json");
    if (!run) return tl::unexpected<Error>(run.error());
    const auto calibration = document(folder, "calibration.json");
    if (!calibration) return tl::unexpected<Error>(calibration.error());
    const json models = tables::read_json_file(folder / "models.json");
    const json dependence = tables::read_json_file(folder / "dependence.json");
    Track track = track_of(folder);
    const json& regimes = field(*run, "regimes");
    json out{{"t0_utc", text_at(*run, "t0_utc")},
             {"duration_s", or_null(number_at(*run, "duration_s"))},
             {"static_s", or_null(number_at(regimes, "static_s"))},
             {"dynamic_s", or_null(number_at(regimes, "dynamic_s"))},
             {"gnss_used", or_null(number_at(field(*run, "gnss"), "used"))},
             {"distance_m", std::round(track.distance_m)},
             {"track", std::move(track.points)},
             {"findings", findings_of(*run)},
             {"warnings", field(*run, "warnings").size()},
             {"devices", devices_of(*run)},
             {"imus", json::array()}};
    for (const json& imu : field(*calibration, "imus"))
      out["imus"].push_back(imu_of(imu, *run, models, dependence));
    return out;
  });
}

}  // namespace imuscope::fleet
