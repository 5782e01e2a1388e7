#pragma once

/// What comes out of a log of messages, as text for answers that are held whole (recorded_answer.h).

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <map>
#include <string>

#include "logs/mcap/message_reader.h"
#include "logs/mcap/ros_messages.h"
#include "tests/support/temporary_file.h"

namespace imuscope::test {

/// "1_700_000_000_123_456_789": no group is longer than what a comparison of numbers holds.
inline std::string grouped_ns(std::int64_t ns) {
  std::string digits = std::to_string(ns);
  for (std::size_t at = digits.size(); at > 3 + (ns < 0 ? 1U : 0U); at -= 3) digits.insert(at - 3, "_");
  return digits;
}

/// The numbers that are not zero, with their places.
template <std::size_t N>
std::string numbers_text(const std::array<double, N>& values) {
  std::string text;
  for (std::size_t i = 0; i < N; ++i) {
    if (values[i] != 0.0) text += fmt::format(" {}={:.9g}", i, values[i]);
  }
  return text;
}

inline std::string content_text(const mcap::Imu& m) {
  return fmt::format("q{} Q{} w{} W{} f{} F{}", numbers_text(m.orientation),
                     numbers_text(m.orientation_covariance), numbers_text(m.angular_velocity),
                     numbers_text(m.angular_velocity_covariance), numbers_text(m.linear_acceleration),
                     numbers_text(m.linear_acceleration_covariance));
}
inline std::string content_text(const mcap::NavSatFix& m) {
  return fmt::format("status {} service {} {:.9g} {:.9g} {:.9g} P{} type {}", m.status, m.service,
                     m.latitude_deg, m.longitude_deg, m.altitude_m, numbers_text(m.position_covariance),
                     m.position_covariance_type);
}
inline std::string content_text(const mcap::Odometry& m) {
  return fmt::format("child {} p{} q{} P{} v{} w{} V{}", m.child_frame_id, numbers_text(m.position_m),
                     numbers_text(m.orientation), numbers_text(m.pose_covariance), numbers_text(m.linear_mps),
                     numbers_text(m.angular_radps), numbers_text(m.twist_covariance));
}
inline std::string content_text(const mcap::TwistStamped& m) {
  return fmt::format("v{} w{} V{}", numbers_text(m.linear_mps), numbers_text(m.angular_radps),
                     numbers_text(m.covariance));
}
inline std::string content_text(const mcap::TimeReference& m) {
  return fmt::format("utc {} of {}", grouped_ns(m.time_ref_ns), m.source);
}

template <typename Message>
std::string ros_text(mcap::Bytes data, mcap::Wire wire) {
  Message message;
  if (!mcap::read(data, message, wire)) return "no such message";
  return fmt::format("at {} of '{}' {}", grouped_ns(message.header.stamp_ns), message.header.frame_id,
                     content_text(message));
}

/// One line.
inline std::string message_text(const mcap::Message& message) {
  const std::string& schema = message.topic->schema;
  const mcap::Wire wire = message.topic->encoding == "ros1" ? mcap::Wire::kRos1 : mcap::Wire::kCdr;
  const auto is = [&](std::string_view name) { return schema.ends_with(name); };
  std::string content = fmt::format("{} bytes", message.data.size());
  if (is("/Imu")) content = ros_text<mcap::Imu>(message.data, wire);
  if (is("/NavSatFix")) content = ros_text<mcap::NavSatFix>(message.data, wire);
  if (is("/Odometry")) content = ros_text<mcap::Odometry>(message.data, wire);
  if (is("/TwistWithCovarianceStamped")) content = ros_text<mcap::TwistStamped>(message.data, wire);
  if (is("/TimeReference")) content = ros_text<mcap::TimeReference>(message.data, wire);
  return fmt::format("{} {} {} log {} publish {} {}", message.topic->name, message.topic->encoding, schema,
                     grouped_ns(static_cast<std::int64_t>(message.log_time)),
                     grouped_ns(static_cast<std::int64_t>(message.publish_time)), content);
}

inline std::string without_path(std::string text, const std::string& path) {
  for (std::size_t at = text.find(path); at != std::string::npos; at = text.find(path))
    text.replace(at, path.size(), "FILE");
  return text;
}

/// Every message of a log, then what was lost.
template <typename Reader>
std::string whole_log_text(const std::string& content) {
  const TemporaryFile file(content);
  const std::string path = file.path().string();
  auto reader = Reader::open(file.path());
  if (!reader) return without_path(reader.error().text(), path) + '\n';
  std::string text;
  while (const auto message = reader->next()) text += message_text(*message) + '\n';
  for (const auto& loss : reader->losses()) text += without_path(loss, path) + '\n';
  return text + fmt::format("read {} of {}\n", reader->bytes_read(), reader->bytes_total());
}

/// The same in one line: how many messages of each topic came, sums of their times and bytes, and what was lost.
template <typename Reader>
std::string short_log_text(const std::string& content) {
  const TemporaryFile file(content);
  const std::string path = file.path().string();
  auto reader = Reader::open(file.path());
  if (!reader) return without_path(reader.error().text(), path);
  struct Sums {
    int n = 0;
    std::uint64_t ms = 0;
    std::uint64_t bytes = 0;
  };
  std::map<std::string, Sums> topics;
  int n = 0;
  while (const auto message = reader->next()) {
    ++n;
    Sums& sums = topics[message->topic->name.substr(0, 20)];
    ++sums.n;
    sums.ms += static_cast<std::uint64_t>(n) * (message->log_time / 1'000'000 % 100'000);
    for (const std::uint8_t byte : message->data) sums.bytes = (3 * sums.bytes + byte) % 9973;
  }
  std::string text;
  for (const auto& [topic, sums] : topics)
    text += fmt::format("{} {} {} {}; ", topic, sums.n, sums.ms, sums.bytes);
  for (const auto& loss : reader->losses()) text += without_path(loss, path) + "; ";
  return text;
}

/// What becomes of a log with damage at each place: lines where it differs from that of the place before.
template <typename Reader, typename Damage>
std::string damaged_log_text(std::size_t places, std::size_t step, Damage&& damage) {
  std::string text;
  std::map<std::string, std::size_t> first_at;
  std::size_t before = places;
  for (std::size_t at = 0; at < places; at += step) {
    const auto [same, is_new] = first_at.emplace(short_log_text<Reader>(damage(at)), at);
    if (is_new) {
      text += fmt::format("{}: {}\n", at, same->first);
    } else if (same->second != before) {
      text += fmt::format("{} as {}\n", at, same->second);
    }
    before = same->second;
  }
  return text;
}

}  // namespace imuscope::test
