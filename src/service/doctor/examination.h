#pragma once

/// Everything that on this PC stands between the service and its deadlines.

#include <filesystem>
#include <optional>
#include <vector>

#include "configuration/config.h"
#include "service/doctor/finding.h"

namespace imuscope::doctor {

struct Examination {
  std::optional<Configuration> configuration;  ///< absent: the PC alone, default settings
  std::filesystem::path root = "/";            ///< where /proc and /sys lie
};

/// Takes about a second. Opens every configured line for a moment, but where a run of this configuration has
/// them: there it asks that run. One of another user answers root alone.
[[nodiscard]] std::vector<Finding> examine(const Examination& examination);

}  // namespace imuscope::doctor
