#pragma once

/// The reference of the configuration: every key that the readers ask for, what may stand there, what holds
/// without it, and a sentence on what it is. Values and presets come from the readers themselves, so that
/// they cannot drift.

#include <string>
#include <string_view>
#include <vector>

namespace imuscope {

/// One key of the configuration, as the reference shows it.
struct KeyReference {
  std::string name;    ///< with its tables, such as "device.noise.gyro_bias_sd_degps"
  std::string values;  ///< what may stand there
  /// What holds without the key; several where it depends on the device. Empty: nothing in particular.
  std::vector<std::string> presets;
  bool required = false;   ///< of at least one kind of device
  std::string_view about;  ///< empty where nobody has written it yet
};

/// In the order of the readers. Non-real-time.
[[nodiscard]] std::vector<KeyReference> configuration_reference();

/// Sentences whose key no reader asks for.
[[nodiscard]] std::vector<std::string_view> sentences_without_key();

}  // namespace imuscope
