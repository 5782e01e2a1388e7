#pragma once

/// Files of many topics, whatever their kind: MCAP files, folders of rosbag2 with such files, bags of ROS 1,
/// logs of PX4 (ULog) and ArduPilot (DataFlash).

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/result.h"
#include "configuration/protocols.h"
#include "logs/mcap/message_reader.h"

namespace imuscope {

/// What a file or folder is by its first bytes; nothing where it is none of them.
[[nodiscard]] std::optional<Protocol> find_message_log(const std::filesystem::path& file);

/// Errors: those of the reader of that kind; where the file is of another kind, which (kUsage); a folder
/// whose files are in SQLite or packed (kWork).
Result<std::unique_ptr<mcap::MessageReader>> open_message_log(const std::filesystem::path& file,
                                                              Protocol protocol);

/// "sensor_msgs/msg/Imu", "sensor_msgs.Imu" and "sensor_msgs/Imu" are the same: the last of these.
[[nodiscard]] std::string plain_type(std::string_view schema);

/// What a topic holds.
struct FoundTopic {
  std::string name;
  std::string type;  ///< plain
  std::uint64_t messages = 0;
  double rate_hz = 0.0;  ///< over the times of their recording; 0: not known
};

/// All topics of a file, in the order in which they come.
/// Errors: those of open_message_log().
Result<std::vector<FoundTopic>> find_topics(const std::filesystem::path& file, Protocol protocol);

}  // namespace imuscope
