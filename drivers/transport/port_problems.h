#pragma once

/// Why a port does not open, in words for the person who started the program, with the remedy.

#include <string>
#include <vector>

#include "base/result.h"

namespace imuscope {

/// @param error  errno of the failed open; EBUSY also for a port that another program has locked
Error explain_open_failure(const std::string& path, int error);

/// Serial ports of this PC: stable names (/dev/serial/by-id) first, then USB ports without one.
std::vector<std::string> serial_ports();

}  // namespace imuscope
