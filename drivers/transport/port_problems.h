#pragma once

/// Why a port does not open, in words for the person who started the program, with the remedy.

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/result.h"

namespace imuscope {

/// @param error  errno of the failed open; EBUSY also for a port that another program has locked
Error explain_open_failure(const std::string& path, int error);

/// Of a port that opens, though another program has it open without a lock: each would get a part of the
/// bytes, and one set the other's baud rate. Sees the programs that this user may look into.
std::optional<Error> shared_with_others(const std::string& path);

/// How long a USB adapter holds bytes back to send them together, ms, where its driver tells (FTDI: 16 unless
/// it is told otherwise). A udev rule shortens it: see kLatencyRule.
/// @param adapters  folder of the adapters' settings
std::optional<int> latency_timer_ms(const std::string& port,
                                    const std::string& adapters = "/sys/bus/usb-serial/devices");

inline constexpr std::string_view kLatencyRule =
    "udev rule: SUBSYSTEM==\"usb-serial\", ATTR{latency_timer}=\"1\"";

/// Serial ports of this PC: stable names (/dev/serial/by-id) first, then USB ports without one.
std::vector<std::string> serial_ports();

}  // namespace imuscope
