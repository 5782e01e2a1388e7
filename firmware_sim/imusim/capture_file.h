#pragma once

/// A recording as one capture: an LCM event log in which every read of every device is a message of type
/// imuscope.raw_t, ordered by arrival, after one of type imuscope.run_t that holds the configuration.
/// Written from the two types' description (the .lcm files) and from the log format:
///   uint32 0xEDA1DA01, int64 number, int64 utime, int32 channel length, int32 data length, channel, data
/// with every number big-endian.

#include <filesystem>
#include <string>
#include <vector>

#include "firmware_sim/devices/utc.h"
#include "firmware_sim/imusim/failure.h"

namespace imusim {

struct CaptureHeader {
  std::string run_name;
  std::string version;             ///< of the program that recorded
  Utc utc_begin{};                 ///< UTC at the scenario's time 0
  std::int64_t host_begin_ns = 0;  ///< the host's monotonic clock then
  std::string channel_prefix = "IMUSCOPE";
  std::string configuration;         ///< text
  std::vector<std::string> devices;  ///< names, in configuration order
};

/// Writes folder/capture.lcm from the NAME.bin and NAME.arrivals.csv, or the NAME.log, that lie there. Memory
/// does not grow with the recording.
Outcome<void> write_capture(const CaptureHeader& header, const std::filesystem::path& folder);

}  // namespace imusim
