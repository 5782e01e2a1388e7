#pragma once

/// A run folder with the files that the service promises, made up from formulas: what a report is tested on
/// without a run. Same options, same bytes.

#include <filesystem>
#include <string>
#include <vector>

namespace imuscope::test {

struct SyntheticRun {
  double duration_s = 60.0;
  std::vector<std::string> names{"mtx1", "mtx2"};
  double boresight_sd_deg = 0.012;  ///< at the end, the largest axis
  double j_p_value = 0.4;           ///< of every fit
  bool psi_z_observable = true;
  bool with_truth = true;
  bool with_regression = true;
  bool with_findings = true;  ///< regimes, comparison, dependence, vibration and evaluation
  double gap_begin_s = -1.0;  ///< error signals have no sample from here ...
  double gap_end_s = -1.0;    ///< ... to here
};

/// Fills `folder`, which exists.
void write_synthetic_run(const std::filesystem::path& folder, const SyntheticRun& options);

}  // namespace imuscope::test
