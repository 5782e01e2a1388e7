#pragma once

/// A certificate as JSON: what `imuscope characterize` writes, and what its page is made from.

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "models/certificate/axis_certificate.h"
#include "models/certificate/joint_axes.h"

namespace imuscope::certificate {

/// Where a certificate comes from.
struct Origin {
  std::string sensor;              ///< name for people
  std::vector<std::string> files;  ///< without folders
  std::string selection;           ///< "regime static of a run"; empty: whole files
  std::string made_utc;            ///< ISO 8601
  std::string version;             ///< of the program
};

/// {"schema": "imuscope.certificate/1", "sensor", "files", "selection", "made_utc", "version", "rate_hz",
///  "duration_s", "confidence", "axes": [{"name", "unit", "n_samples", "n_missing", "mean", "sd", "resolution",
///  "terms": [{"symbol", "name", "unit", "value", "ci_low", "ci_high", "known", "note"}], "lines", "resonances",
///  "low_pass_hz", "largest_miss", "models_as_good", "fit" (as noise::fit_to_json()), "allan": [{"tau_s",
///  "deviation", "ci_low", "ci_high", "model"}], "density": [{"frequency_hz", "density", "ci_low",
///  "ci_high"}], "halves", "spikes", "temperature", "warnings", "limits"}]}. What is not known is null.
nlohmann::json to_json(const Origin& origin, const std::vector<AxisCertificate>& axes);

/// [{"signals": [one, the other], "tau_s", "coherence", "ci_low", "ci_high", "p_holm", "shows"}]
/// @param names  of the signals of `joint`
nlohmann::json pairs_json(const JointAxes& joint, const std::vector<std::string>& names);

}  // namespace imuscope::certificate
