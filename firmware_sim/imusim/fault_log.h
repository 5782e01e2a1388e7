#pragma once

/// What the faults of a script did, as the simulator knows it: beside it can be laid what a program counted.

#include <filesystem>

#include "firmware_sim/imusim/configuration.h"
#include "firmware_sim/imusim/failure.h"

namespace imusim {

/// fault_log.json: `{"schema", "faults": [{"device", "kind", "begin_s", "end_s", "messages" (sent while it
/// lasted), "hit" (of them, that it changed, repeated, followed with garbage or kept from the host),
/// "bytes_hit", "silent_s" (of a restart: from the last message before to the first after which it sends
/// on)}]}`
Outcome<void> write_fault_log(const Configuration& configuration, const std::filesystem::path& folder);

}  // namespace imusim
