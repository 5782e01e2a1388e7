#pragma once

/// A configuration for devices that were found, as a text to begin with.

#include <optional>
#include <string>
#include <vector>

#include "base/result.h"
#include "configuration/config.h"

namespace imuscope {

/// What is known of one device.
struct FoundDevice {
  std::string name;  ///< empty: named by its role
  Protocol protocol{};
  std::optional<double> rate_hz;       ///< of its samples; the protocol's default where absent
  std::optional<SerialConfig> serial;  ///< absent for a device that is only a file
  std::string remark;                  ///< for a comment above its table; may be empty
  /// Of a topic in a file of many (is_message_log()): its name, what it holds, and whether its bodies are
  /// forward-left-up.
  std::string topic{};
  std::optional<SampleKind> purpose{};
  bool is_flu = false;
};

/// Roles: GNSS protocols are gnss; of the IMUs the first StdBin unit, else the first of any kind, is
/// the reference, the others are under study.
/// @return TOML that load_configuration() takes
/// Errors (kWork): fewer than two IMUs, more of a kind than a run can have
Result<std::string> draft_configuration(const std::string& run_name, const std::vector<FoundDevice>& devices);

}  // namespace imuscope
