#pragma once

/// A log of candump as the recording of a device: its frames as the reads of a CAN interface, brought to the
/// time scale of the run.

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "base/result.h"
#include "configuration/config.h"
#include "sample/clock_map.h"
#include "service/recording/byte_source.h"

namespace imuscope {

/// What a log holds for one device.
struct CandumpSurvey {
  std::string interface;  ///< whose frames are the device's; empty: all
  std::uint64_t frames = 0;
  bool stamps_are_utc = false;       ///< otherwise times since a boot, or since the log's beginning
  std::vector<std::string> remarks;  ///< for the log of the run: lines passed over, frames that candump lost
};

/// Goes through a log once. A configured interface must be in it; without one, and with frames of one
/// interface only, that one is meant.
/// Errors name the file and what is wrong.
Result<CandumpSurvey> survey_candump(
    const std::filesystem::path& file, const DeviceConfig& device,
    const std::function<void(const std::string& what, double share)>& progress = {});

/// The frames of a log, one per read, stamped and arriving at `clock` of the log's stamp.
/// @param interface  empty: of every interface
/// @param clock      of mode kFixed: host time of the log's time
Result<std::unique_ptr<ByteSource>> open_candump(const std::filesystem::path& file,
                                                 const std::string& interface, const ClockMapConfig& clock);

}  // namespace imuscope
