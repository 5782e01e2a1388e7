#pragma once

/// Run folders of several drives made into one mounting per S-IMU. Non-real-time: allocates, reads files.

#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "base/result.h"
#include "estimation/calibration/combine.h"

namespace imuscope {

/// What one finished run says of its mountings.
struct DriveMountings {
  std::filesystem::path run;
  std::vector<std::string> inputs;
  /// One S-IMU that the drive calibrated, by its name in the configuration.
  struct Study {
    std::string name;
    MountingEstimate estimate;
  };
  std::vector<Study> studies;                 ///< those that have an estimate
  std::vector<std::string> without_estimate;  ///< names of the others
};

/// Reads calibration.json and run.json of a run folder. Fails where it holds no finished run, or one that is
/// not understood; the message names file and field.
Result<DriveMountings> read_mountings(const std::filesystem::path& run);

/// One S-IMU over all drives that calibrated it.
struct CombinedStudy {
  std::string name;
  std::vector<std::size_t> drives;  ///< indices into the drives given
  CombinedMounting mounting;
};

struct Combination {
  CombineMethod method = CombineMethod::kInverseVariance;
  std::vector<std::filesystem::path> runs;
  std::vector<CombinedStudy> studies;
  std::vector<std::string> remarks;
};

/// Combines what the drives have in common. Without `method`, drives count as independent unless two of them
/// read the same files: then by covariance intersection, with a remark. Fails where no S-IMU was calibrated
/// in two drives.
Result<Combination> combine_drives(const std::vector<DriveMountings>& drives,
                                   std::optional<CombineMethod> method);

/// "inverse variance" or "covariance intersection".
const char* name_of(CombineMethod method);

/// schema imuscope.combined/1; per S-IMU the keys of calibration.json, the test and every drive's deviation.
nlohmann::json combination_json(const Combination& combination);

}  // namespace imuscope
