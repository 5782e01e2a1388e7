#pragma once

/// From a device's configuration to its driver. The one place that knows every protocol.

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "base/result.h"
#include "configuration/config.h"
#include "drivers/device/device.h"
#include "sample/clock_map.h"

namespace imuscope {

/// @param clock  online for live streams and stamped recordings, fixed for recordings without arrival stamps
std::unique_ptr<DeviceDecoder> make_decoder(const DeviceConfig& device, DeviceIndex index,
                                            const ClockMapConfig& clock);

/// For a device on a line of its own. Protocols that exist only as files have none: nullptr.
/// @param searching_baud  the line's baud rate is a guess
std::unique_ptr<DeviceSession> make_session(const DeviceConfig& device, bool searching_baud = false);

/// What a decoder has to say about its device beyond counts, in one sentence with the remedy; empty when all
/// is well. `decoder` must have been made for `device`.
std::string decoder_problem(const DeviceConfig& device, const DeviceDecoder& decoder);

/// Why a recording gave not one sample of `device`, with the file.
/// @param inputs   of the recording, as given: one capture, or NAME=FILE
/// @param decoder  made for `device`, after the recording's last byte
Error no_sample_error(const DeviceConfig& device, const std::vector<std::string>& inputs,
                      const DeviceDecoder& decoder);

/// Looks at a recorded file before it is used: protocols that are text name the line and column of a mistake.
Result<void> check_recorded_file(const DeviceConfig& device, const std::filesystem::path& file);

}  // namespace imuscope
