#pragma once

/// Fits from files: what `imuscope fit --json` printed, or the models.json of a run.

#include <filesystem>
#include <string>
#include <vector>

#include "base/result.h"
#include "models/noise/fit.h"
#include "models/noise/quantities.h"

namespace imuscope::cli {

struct StoredFit {
  std::string name;    ///< of the S-IMU; empty in the output of fit
  std::string axis;    ///< "gyro_x"; the file's stem in the output of fit
  std::string regime;  ///< empty in the output of fit
  noise::SignalUnit unit = noise::SignalUnit::kNone;
  noise::FitResult fit;
  std::string source;  ///< noise::fitted_to_words()
};

/// Errors (kWork): a file that cannot be read, is not JSON or holds no fit; each with the file's name.
Result<std::vector<StoredFit>> read_fits(const std::filesystem::path& file);

}  // namespace imuscope::cli
