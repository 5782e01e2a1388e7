#pragma once

/// Messages of a file of many topics (service/recording/message_log.h) as the recording of a device.

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "base/result.h"
#include "configuration/config.h"
#include "service/recording/byte_source.h"

namespace imuscope {

/// What a file holds for one device.
struct MessageSurvey {
  std::uint64_t messages = 0;       ///< taken
  std::vector<std::string> losses;  ///< of the file and of the topic, in sentences
  /// What was taken, as the decoder reads it, where it is so little that it is kept; else null.
  std::shared_ptr<const std::vector<std::uint8_t>> frames;
};

/// Goes through a file once.
/// Errors name the file: it is none, it lacks the topic (those that it has are listed), the topic holds
/// another type than the role needs or none of the frame, there is a choice of topics (kUsage), no message
/// can be used (kWork).
Result<MessageSurvey> survey_messages(
    const std::filesystem::path& file, const DeviceConfig& device,
    const std::function<void(const std::string& what, double share)>& progress = {});

/// The messages of a device, without arrival stamps.
Result<std::unique_ptr<ByteSource>> open_messages(const std::filesystem::path& file,
                                                  const DeviceConfig& device, const MessageSurvey& survey);

}  // namespace imuscope
