#pragma once

/// Logs of flight controllers for tests, written from the descriptions of their formats.

#include <gtest/gtest.h>
#include <algorithm>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "logs/mcap/ros_messages.h"
#include "tests/support/temporary_file.h"

namespace imuscope::flight_log {

class Bytes {
 public:
  template <typename Number>
  Bytes& operator<<(Number value) {
    text.append(reinterpret_cast<const char*>(&value), sizeof value);
    return *this;
  }
  std::string text;
};

/// "name" in a field of so many characters.
inline std::string padded(std::string text, std::size_t size) {
  text.resize(size, '\0');
  return text;
}

using test::TemporaryFile;

/// What came of a log.
struct Taken {
  std::vector<std::pair<std::string, mcap::Imu>> imus;
  std::vector<std::pair<std::string, mcap::NavSatFix>> fixes;
  std::vector<std::pair<std::string, mcap::TwistStamped>> velocities;
  std::vector<std::pair<std::string, mcap::TimeReference>> times;
  std::vector<std::string> losses;
  std::string error;

  [[nodiscard]] std::size_t messages() const {
    return imus.size() + fixes.size() + velocities.size() + times.size();
  }
  [[nodiscard]] bool says(const std::string& words) const {
    return std::any_of(losses.begin(), losses.end(),
                       [&](const std::string& loss) { return loss.find(words) != std::string::npos; });
  }
};

template <typename Reader>
Taken take(const std::string& content) {
  const TemporaryFile file(content);
  Taken taken;
  auto reader = Reader::open(file.path());
  if (!reader) {
    taken.error = reader.error().text();
    return taken;
  }
  const auto add = [](const auto& message, auto& list) {
    list.emplace_back();
    list.back().first = message.topic->name;
    EXPECT_TRUE(mcap::read(message.data, list.back().second));
  };
  while (const auto message = reader->next()) {
    const std::string& type = message->topic->schema;
    if (type == "sensor_msgs/Imu") add(*message, taken.imus);
    if (type == "sensor_msgs/NavSatFix") add(*message, taken.fixes);
    if (type == "geometry_msgs/TwistWithCovarianceStamped") add(*message, taken.velocities);
    if (type == "sensor_msgs/TimeReference") add(*message, taken.times);
  }
  taken.losses = reader->losses();
  return taken;
}

}  // namespace imuscope::flight_log
