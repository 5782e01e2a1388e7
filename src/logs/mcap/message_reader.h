#pragma once

/// Messages of a recording one after the other, whatever the container is: MCAP files here, bags of ROS 1
/// (rosbag/), logs of flight controllers (flight_log/).

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "logs/mcap/records.h"

namespace imuscope::mcap {

/// A topic, and how its messages are written.
struct Topic {
  std::string name;
  std::string encoding;  ///< "cdr", "ros1", "json"
  std::string schema;    ///< "sensor_msgs/msg/Imu"
  std::string schema_encoding;
};

/// One message; its bytes are valid until the next call of next().
struct Message {
  const Topic* topic = nullptr;
  std::uint64_t log_time = 0;  ///< ns since 1970-01-01, or of another clock
  std::uint64_t publish_time = 0;
  Bytes data;
};

/// Non-real-time: allocates. Thread: one.
class MessageReader {
 public:
  virtual ~MessageReader() = default;
  /// The next message; nothing at the end.
  virtual std::optional<Message> next() = 0;
  /// What could not be read so far, in sentences; empty where nothing is missing.
  [[nodiscard]] virtual std::vector<std::string> losses() const = 0;
  [[nodiscard]] virtual std::uint64_t bytes_read() const noexcept = 0;
  [[nodiscard]] virtual std::uint64_t bytes_total() const noexcept = 0;

 protected:
  MessageReader() = default;
  MessageReader(const MessageReader&) = default;
  MessageReader(MessageReader&&) = default;
  MessageReader& operator=(const MessageReader&) = default;
  MessageReader& operator=(MessageReader&&) = default;
};

}  // namespace imuscope::mcap
