#pragma once

/// The [[device]] tables of a configuration. Thread: one, before a run.

#include <vector>

#include "configuration/config.h"

namespace imuscope {

class TomlReader;
struct AttachedFiles;
struct TomlProblem;

/// Reads the list, and checks what its devices are to each other: names, roles, shared lines.
/// @param files    text of files that devices name, read or attached
/// @param devices  in the order of the file
void read_devices(TomlReader& root, TomlProblem& problem, AttachedFiles& files,
                  std::vector<DeviceConfig>& devices);

}  // namespace imuscope
