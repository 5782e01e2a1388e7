#pragma once

/// What a fleet wants to know of one run, taken from the files of its folder: small, and the same wherever
/// and whenever the study was made.

#include <filesystem>
#include <nlohmann/json_fwd.hpp>

#include "base/result.h"

namespace imuscope::fleet {

inline constexpr const char* kStudySchema = "imuscope.fleet-study/1";

/// {"t0_utc", "duration_s", "static_s", "dynamic_s", "gnss_used" (null without a receiver), "distance_m",
///  "track": [[lat_deg, lon_deg]], "findings": [{"harm", "check", "device", "text"}], "warnings", "devices":
///  [{"device", "role", "protocol", "samples", "samples_lost", "bad_frames", "late", "problem"}], "imus":
///  [{"device", "status", "usability", "temperature_degC", "data_sheet", "C_b_s", "boresight_sd_deg",
///  "r_bs_b_m", "r_bs_b_sd_m", "t_d_s", "t_d_sd_s", "measurements": [[quantity, regime, axis, unit, is_log,
///  value, sd]], "models": [{"axis", "regime", "model", "p_value", "identifiable", "simpler_model",
///  "seconds", "parameters": [[process, name, unit, value, sd, ci_low, ci_high]]}]}]}
/// Measurements are what a data sheet and a calibration have; parameters of models are read as such, too
/// (measurement_row.h). A measurement that is_log is the natural logarithm of its quantity. What is not known
/// is null. Errors: kWork, a file of the run that is missing or holds something else.
Result<nlohmann::json> summary_of_run(const std::filesystem::path& run);

}  // namespace imuscope::fleet
