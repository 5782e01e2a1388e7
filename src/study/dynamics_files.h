#pragma once

/// regression.json and scatter_NAME.csv: how the errors of a run depend on the dynamics.

#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "base/output_folder.h"
#include "base/result.h"
#include "configuration/config.h"
#include "estimation/regimes/regime_track.h"
#include "models/noise/model.h"
#include "study/jobs.h"
#include "study/row_spool.h"

namespace imuscope {

/// The entries of regression.json, and sentences about what could not be studied.
struct DynamicsRegressions {
  nlohmann::json regressions = nlohmann::json::array();
  std::vector<std::string> remarks;
};

/// For every S-IMU, over the dynamic part of the run: at rest there are no dynamics, and the noise is
/// different.
class Regressions {
 public:
  /// What is handed in must outlive this.
  Regressions(const Configuration& configuration, std::vector<RowSpool>& rows, const RegimeTrack& motion,
              const noise::ModelSpec& residual_model);

  /// One an S-IMU, each for any thread; none where the run has no dynamic part. They must not outlive this.
  [[nodiscard]] std::vector<Job> jobs();
  /// Once all of them are done.
  [[nodiscard]] DynamicsRegressions result() &&;

 private:
  const Configuration& configuration_;
  std::vector<RowSpool>& rows_;
  const RegimeTrack& motion_;
  const noise::ModelSpec& residual_model_;
  std::optional<std::size_t> dynamic_;  ///< regime; absent: no dynamic part
  std::vector<DynamicsRegressions> of_device_;
};

/// Writes scatter_NAME.csv for every S-IMU: time_s, utc_s, the fifteen covariates and the six errors of at
/// most kScatterRows rows, evenly spaced over the drive, at rest and in motion alike.
inline constexpr std::size_t kScatterRows = 3000;
Result<void> write_scatter(const Configuration& configuration, std::vector<RowSpool>& rows,
                           HostTime first_reference_time, const OutputFolder& folder);

}  // namespace imuscope
