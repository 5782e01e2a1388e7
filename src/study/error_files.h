#pragma once

/// Third step of the error process (error_pass.h has the first two): the rows under the names of the regimes, as files
/// and as what the noise models and all that follows are made of.

#include <vector>

#include "base/time.h"
#include "service/pipeline/noise_series.h"
#include "service/run/run_folder.h"
#include "study/regime_study.h"
#include "study/row_spool.h"

namespace imuscope {

/// What the rows become beside the files.
struct StudiedRows {
  std::vector<RowSpool> rows;  ///< one spool an S-IMU; empty: takes the rows without the scale error
  std::vector<NoiseSeries> series;
};

/// Writes errors_NAME.csv of every S-IMU, and gathers the rows without the scale error and the series for the noise
/// models in `studied`.
/// @param scales  one an S-IMU, in the order of the run folder's
/// @param rows    likewise
void write_errors(HostTime origin, const RunRegimes& regimes, const std::vector<ScaleError>& scales,
                  std::vector<RowSpool>& rows, RunFolder& folder, StudiedRows& studied);

}  // namespace imuscope
