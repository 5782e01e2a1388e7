#include "service/recording/message_source.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <tuple>
#include <utility>

#include "base/nearest_word.h"
#include "base/text.h"
#include "base/units.h"
#include "drivers/ros_message/wire.h"
#include "logs/mcap/ros_messages.h"
#include "service/recording/message_log.h"

namespace imuscope {
namespace {

/// What is taken of a file is kept up to this size: two and a half hours at 100 Hz.
constexpr std::size_t kKeptMost = std::size_t{64} << 20U;
constexpr std::size_t kPiece = 4096;
constexpr std::uint64_t kMessagesPerProgress = 4096;
constexpr std::int64_t kNsPerS = 1'000'000'000;
/// Messages of one device are mixed by less than this, and no more of them are held for it.
constexpr double kDisorder_ns = 0.1 * kNsPerS;
constexpr std::size_t kEarlyMost = 1024;
/// A velocity belongs to the position of the same instant.
constexpr std::int64_t kSameInstant_ns = 1'000'000;
/// sensor_msgs/NavSatStatus: ground-based augmentation is what receivers with fixed and with float
/// ambiguities report.
constexpr int kSbas = 1;
constexpr int kGbas = 2;
constexpr double kFixedSd_m = 0.1;

/// Types that a role takes, without "msg" in them.
std::string_view type_of(DeviceRole role) {
  switch (role) {
    case DeviceRole::kGnss:
      return "sensor_msgs/NavSatFix";
    case DeviceRole::kOdometry:
      return "nav_msgs/Odometry";
    case DeviceRole::kTime:
      return "sensor_msgs/TimeReference";
    default:
      return "sensor_msgs/Imu";
  }
}

bool is_readable(const mcap::Topic& topic) {
  return topic.encoding == "cdr" || topic.encoding == "ros1" || topic.encoding == "json";
}

template <typename Message>
bool read_message(const mcap::Topic& topic, mcap::Bytes data, Message& message) {
  if (topic.encoding == "json") return mcap::read_json(data, message);
  return mcap::read(data, message, topic.encoding == "ros1" ? mcap::Wire::kRos1 : mcap::Wire::kCdr);
}

/// Square roots of a covariance's diagonal, east-north-up to north, east, down; false, and `sd` as it was, where they are
/// no sd.
template <std::size_t N>
bool sd_ned(const std::array<double, N>& covariance, std::size_t side, double* sd) {
  const std::array<double, 3> ned{std::sqrt(covariance[side + 1]), std::sqrt(covariance[0]),
                                  std::sqrt(covariance[2 * side + 2])};
  const auto is_sd = [](double value) { return value > 0.0 && std::isfinite(value); };
  if (!std::ranges::all_of(ned, is_sd)) return false;
  std::ranges::copy(ned, sd);
  return true;
}

GnssSolution solution_of(const mcap::NavSatFix& fix, bool has_sd, double sd_m) {
  if (fix.status < 0) return GnssSolution::kNone;
  if (fix.status == kSbas) return GnssSolution::kDifferential;
  if (fix.status < kGbas) return GnssSolution::kSingle;
  return has_sd && sd_m < kFixedSd_m ? GnssSolution::kFixed : GnssSolution::kFloat;
}

/// Velocity and its instant.
struct Velocity {
  std::int64_t time_ns = 0;
  std::array<double, 3> ned_mps{};
  std::array<double, 3> sd_mps{};
  bool has_sd = false;
};

/// Takes the messages of one device out of a file. Recorders write what comes on several connections as it comes:
/// messages that are a little out of order are put back.
class Extractor {
 public:
  Extractor(std::unique_ptr<mcap::MessageReader> reader, const DeviceConfig& device)
      : reader_(std::move(reader)), device_(device) {}

  /// The next content; nothing at the end.
  std::optional<ros_message::Content> next() {
    for (;;) {
      while (!held_ && !ended_ && early_.size() < kEarlyMost && spread_ns() < kDisorder_ns) read_on();
      if (!early_.empty()) return early_.extract(early_.begin()).mapped();
      if (!held_) return std::nullopt;
      take_in();
    }
  }

  [[nodiscard]] const mcap::MessageReader& reader() const { return *reader_; }
  /// Topics of the file and their types.
  [[nodiscard]] const std::map<std::string, std::string>& topics() const { return topics_; }
  [[nodiscard]] const std::set<std::string>& frames() const { return frames_; }
  [[nodiscard]] std::uint64_t bad() const { return bad_; }
  [[nodiscard]] std::uint64_t unreadable() const { return unreadable_; }
  [[nodiscard]] std::uint64_t out_of_order() const { return out_of_order_; }

 private:
  /// In doubles, as times of a stranger may be anything.
  [[nodiscard]] double spread_ns() const {
    if (early_.empty()) return 0.0;
    return static_cast<double>(early_.rbegin()->first) - static_cast<double>(early_.begin()->first);
  }
  void read_on() {
    held_ = next_of_file();
    ended_ = !held_;
    if (ended_) return;
    const double ahead_ns =
        early_.empty() ? 0.0
                       : static_cast<double>(held_->time_ns) - static_cast<double>(early_.rbegin()->first);
    // Farther back its clock was set: what is there goes out before.
    if (ahead_ns <= -kDisorder_ns) return;
    if (ahead_ns < 0.0) ++out_of_order_;
    take_in();
  }
  void take_in() {
    early_.emplace(held_->time_ns, *held_);
    held_.reset();
  }
  std::optional<ros_message::Content> next_of_file() {
    while (const auto message = reader_->next()) {
      if (auto content = take(*message)) return content;
    }
    return std::exchange(waiting_, std::nullopt);
  }

  std::optional<ros_message::Content> take(const mcap::Message& message) {
    const mcap::Topic& topic = *message.topic;
    if (&topic != last_topic_) {
      last_topic_ = &topic;
      topics_.emplace(topic.name, plain_type(topic.schema));
      is_velocity_ = has_velocity() && is_velocity_topic(topic);
      is_wanted_ = topic.name == device_.messages.topic;
      if (device_.messages.topic.empty()) is_wanted_ = plain_type(topic.schema) == type_of(device_.role);
    }
    if (!is_wanted_ && !is_velocity_) return std::nullopt;
    if (!is_readable(topic)) {
      ++unreadable_;
      return std::nullopt;
    }
    if (is_velocity_) return take_velocity(message);
    switch (device_.role) {
      case DeviceRole::kGnss:
        return take_fix(message);
      case DeviceRole::kOdometry:
        return take_odometry(message);
      case DeviceRole::kTime:
        return take_time_reference(message);
      default:
        return take_imu(message);
    }
  }

  /// A flight controller's velocities stand beside its positions.
  [[nodiscard]] bool has_velocity() const {
    const bool is_beside = device_.protocol == Protocol::kUlog || device_.protocol == Protocol::kDataflash;
    return device_.role == DeviceRole::kGnss && (is_beside || !device_.messages.velocity_topic.empty());
  }
  [[nodiscard]] bool is_velocity_topic(const mcap::Topic& topic) const {
    const auto& [wanted, velocity] = std::tie(device_.messages.topic, device_.messages.velocity_topic);
    if (!velocity.empty()) return topic.name == velocity;
    constexpr std::string_view kBeside = "/velocity";
    return topic.name.ends_with(kBeside) && (wanted.empty() || topic.name == wanted + std::string(kBeside));
  }

  /// Whether a message is of the frame, and its time.
  bool is_ours(const mcap::RosHeader& header) {
    constexpr std::size_t kFramesMost = 32;
    if (frames_.size() < kFramesMost) frames_.insert(header.frame_id);
    return device_.messages.frame_id.empty() || header.frame_id == device_.messages.frame_id;
  }
  [[nodiscard]] std::int64_t time_of(const mcap::Message& message, const mcap::RosHeader& header) const {
    switch (device_.messages.time) {
      case MessageTime::kLog:
        return static_cast<std::int64_t>(message.log_time);
      case MessageTime::kPublish:
        return static_cast<std::int64_t>(message.publish_time);
      default:
        return header.stamp_ns;
    }
  }
  std::optional<ros_message::Content> damaged() {
    ++bad_;
    return std::nullopt;
  }

  std::optional<ros_message::Content> take_imu(const mcap::Message& message) {
    mcap::Imu& imu = imu_;
    if (!read_message(*message.topic, message.data, imu)) return damaged();
    if (!is_ours(imu.header)) return std::nullopt;
    ros_message::Content content;
    content.kind = ros_message::Kind::kImu;
    content.time_ns = time_of(message, imu.header);
    if (imu.angular_velocity_covariance[0] != mcap::kNotMeasured) content.flags |= ros_message::kHasGyro;
    if (imu.linear_acceleration_covariance[0] != mcap::kNotMeasured) content.flags |= ros_message::kHasAccel;
    std::copy(imu.angular_velocity.begin(), imu.angular_velocity.end(), content.values.begin());
    std::copy(imu.linear_acceleration.begin(), imu.linear_acceleration.end(), content.values.begin() + 3);
    return content;
  }

  std::optional<ros_message::Content> take_fix(const mcap::Message& message) {
    mcap::NavSatFix fix;
    if (!read_message(*message.topic, message.data, fix)) return damaged();
    if (!is_ours(fix.header)) return std::nullopt;
    ros_message::Content content;
    content.kind = ros_message::Kind::kGnss;
    content.time_ns = time_of(message, fix.header);
    content.values[0] = fix.latitude_deg * kRadPerDeg;
    content.values[1] = fix.longitude_deg * kRadPerDeg;
    content.values[2] = fix.altitude_m;
    const bool has_sd =
        fix.position_covariance_type != 0 && sd_ned(fix.position_covariance, 3, &content.values[3]);
    if (has_sd) content.flags |= ros_message::kHasSdPosition;
    const auto solution = solution_of(fix, has_sd, std::max(content.values[3], content.values[4]));
    content.flags |= static_cast<std::uint8_t>(solution);
    // A receiver without a fix writes no number.
    if (solution == GnssSolution::kNone) {
      for (double& value : content.values) value = std::isfinite(value) ? value : 0.0;
    }
    if (!has_velocity()) return content;
    join(content, velocity_);
    return std::exchange(waiting_, content);
  }

  std::optional<ros_message::Content> take_velocity(const mcap::Message& message) {
    mcap::TwistStamped twist;
    if (!read_message(*message.topic, message.data, twist)) return damaged();
    Velocity velocity;
    velocity.time_ns = time_of(message, twist.header);
    velocity.ned_mps = {twist.linear_mps[1], twist.linear_mps[0], -twist.linear_mps[2]};
    velocity.has_sd = sd_ned(twist.covariance, 6, velocity.sd_mps.data());
    velocity_ = velocity;
    if (!waiting_) return std::nullopt;
    join(*waiting_, velocity_);
    return std::exchange(waiting_, std::nullopt);
  }

  static void join(ros_message::Content& fix, const std::optional<Velocity>& velocity) {
    if (!velocity || std::abs(velocity->time_ns - fix.time_ns) > kSameInstant_ns) return;
    fix.flags |= ros_message::kHasVelocity;
    if (velocity->has_sd) fix.flags |= ros_message::kHasSdVelocity;
    std::copy(velocity->ned_mps.begin(), velocity->ned_mps.end(), fix.values.begin() + 6);
    std::copy(velocity->sd_mps.begin(), velocity->sd_mps.end(), fix.values.begin() + 9);
  }

  std::optional<ros_message::Content> take_odometry(const mcap::Message& message) {
    mcap::Odometry odometry;
    if (!read_message(*message.topic, message.data, odometry)) return damaged();
    if (!is_ours(odometry.header)) return std::nullopt;
    ros_message::Content content;
    content.kind = ros_message::Kind::kSpeed;
    content.time_ns = time_of(message, odometry.header);
    content.values[0] = odometry.linear_mps[0];
    return content;
  }

  std::optional<ros_message::Content> take_time_reference(const mcap::Message& message) {
    mcap::TimeReference reference;
    if (!read_message(*message.topic, message.data, reference)) return damaged();
    if (!is_ours(reference.header)) return std::nullopt;
    ros_message::Content content;
    content.kind = ros_message::Kind::kTimeReference;
    content.time_ns = time_of(message, reference.header);
    const std::int64_t half = reference.time_ref_ns >= 0 ? kNsPerS / 2 : -kNsPerS / 2;
    const std::int64_t seconds = (reference.time_ref_ns + half) / kNsPerS;
    content.values[0] = static_cast<double>(reference.time_ref_ns - seconds * kNsPerS) * 1e-9;
    content.values[1] = static_cast<double>(seconds);
    return content;
  }

  std::unique_ptr<mcap::MessageReader> reader_;
  const DeviceConfig device_;
  const mcap::Topic* last_topic_ = nullptr;
  bool is_wanted_ = false;
  bool is_velocity_ = false;
  mcap::Imu imu_;                                ///< kept for its memory
  std::optional<ros_message::Content> waiting_;  ///< a position whose velocity may still come
  std::optional<Velocity> velocity_;
  std::map<std::string, std::string> topics_;
  std::set<std::string> frames_;
  std::uint64_t bad_ = 0;
  std::uint64_t unreadable_ = 0;
  std::multimap<std::int64_t, ros_message::Content> early_;  ///< equal times in the order of the file
  std::optional<ros_message::Content> held_;                 ///< after what is early
  bool ended_ = false;
  std::uint64_t out_of_order_ = 0;
};

void append_frame(const ros_message::Content& content, std::vector<std::uint8_t>& frames) {
  std::array<std::uint8_t, ros_message::kFrameMost> frame{};
  const auto n = ros_message::write_frame(content, frame);
  frames.insert(frames.end(), frame.begin(), frame.begin() + static_cast<std::ptrdiff_t>(n));
}

/// What was kept of a file.
class KeptSource final : public ByteSource {
 public:
  explicit KeptSource(std::shared_ptr<const std::vector<std::uint8_t>> frames) : frames_(std::move(frames)) {}
  Result<std::optional<RecordedRead>> next() override {
    const auto piece = std::span(*frames_).subspan(at_, std::min(kPiece, frames_->size() - at_));
    if (piece.empty()) return std::optional<RecordedRead>{};
    at_ += piece.size();
    return std::optional<RecordedRead>{RecordedRead{std::nullopt, piece}};
  }
  [[nodiscard]] std::uint64_t bytes_read() const override { return at_; }
  [[nodiscard]] std::uint64_t bytes_total() const override { return frames_->size(); }

 private:
  std::shared_ptr<const std::vector<std::uint8_t>> frames_;
  std::size_t at_ = 0;
};

/// A file that holds too much to be kept, again.
class FileSource final : public ByteSource {
 public:
  explicit FileSource(Extractor extractor) : extractor_(std::move(extractor)) {}
  Result<std::optional<RecordedRead>> next() override {
    piece_.clear();
    while (piece_.size() < kPiece) {
      const auto content = extractor_.next();
      if (!content) break;
      append_frame(*content, piece_);
    }
    if (piece_.empty()) return std::optional<RecordedRead>{};
    return std::optional<RecordedRead>{RecordedRead{std::nullopt, piece_}};
  }
  [[nodiscard]] std::uint64_t bytes_read() const override { return extractor_.reader().bytes_read(); }
  [[nodiscard]] std::uint64_t bytes_total() const override { return extractor_.reader().bytes_total(); }

 private:
  Extractor extractor_;
  std::vector<std::uint8_t> piece_;
};

std::string list_of_topics(const std::map<std::string, std::string>& topics) {
  constexpr std::size_t kShown = 40;
  std::vector<std::string> words;
  for (const auto& [name, type] : topics) {
    if (words.size() == kShown) {
      words.push_back(fmt::format("and {} more", topics.size() - kShown));
      break;
    }
    words.push_back(one_line(fmt::format("{} ({})", name, type.empty() ? "no schema" : type), 200));
  }
  return words.empty() ? std::string("it has no messages")
                       : fmt::format("its topics are {}", fmt::join(words, ", "));
}

/// Whether what was found is one topic of the right type.
Result<void> check_topics(const std::string& file, const DeviceConfig& device, const Extractor& found) {
  const std::string_view type = type_of(device.role);
  const auto& topics = found.topics();
  if (device.messages.topic.empty()) {
    const auto n =
        std::count_if(topics.begin(), topics.end(), [&](const auto& topic) { return topic.second == type; });
    if (n == 1) return {};
    std::map<std::string, std::string> choice = topics;
    if (n > 0) std::erase_if(choice, [&](const auto& topic) { return topic.second != type; });
    return usage_error(
        fmt::format("{}: {} has {} topics of {}", device.name, file, n == 0 ? "no" : std::to_string(n), type),
        fmt::format("give topic in its [device.messages]; {}", list_of_topics(choice)));
  }
  for (const std::string& wanted : {device.messages.topic, device.messages.velocity_topic}) {
    if (wanted.empty() || topics.contains(wanted)) continue;
    std::vector<std::string> names;
    for (const auto& topic : topics) names.push_back(topic.first);
    const auto near = nearest_word(wanted, names);
    return usage_error(
        fmt::format("{}: {} has no topic {}", device.name, file, wanted),
        (near.empty() ? "" : fmt::format("did you mean {}? ", one_line(near, 200))) + list_of_topics(topics));
  }
  const std::string& is = topics.at(device.messages.topic);
  // JSON may come with a schema of any name, or with none.
  if (is == type || found.unreadable() == 0) return {};
  return usage_error(
      fmt::format("{}: topic {} of {} holds {}", device.name, device.messages.topic, file, one_line(is, 200)),
      fmt::format("a {} device is {}", name_of(device.role), type));
}

Error no_message_error(const std::string& file, const DeviceConfig& device, const Extractor& found) {
  const std::string topic =
      device.messages.topic.empty() ? std::string(type_of(device.role)) : device.messages.topic;
  if (found.unreadable() > 0) {
    return {ErrorKind::kWork,
            fmt::format("{}: the messages of {} in {} are neither CDR nor ROS 1 nor JSON", device.name, topic,
                        file),
            "convert the file to ROS 2 (rosbags-convert does)"};
  }
  if (!found.frames().empty()) {
    std::vector<std::string> frames;
    for (const auto& frame : found.frames()) frames.push_back(one_line(frame, 64));
    return {ErrorKind::kUsage,
            fmt::format("{}: no message of {} in {} has frame_id '{}'", device.name, topic, file,
                        device.messages.frame_id),
            fmt::format("there is {}", fmt::join(frames, ", "))};
  }
  return {ErrorKind::kWork,
          fmt::format("{}: no message of {} in {} can be read as {}", device.name, topic, file,
                      type_of(device.role)),
          "check that the topic is this device's"};
}

}  // namespace

Result<MessageSurvey> survey_messages(
    const std::filesystem::path& file, const DeviceConfig& device,
    const std::function<void(const std::string& what, double share)>& progress) {
  auto reader = open_message_log(file, device.protocol);
  if (!reader) return tl::unexpected<Error>(reader.error());
  Extractor extractor(std::move(*reader), device);
  MessageSurvey survey;
  std::vector<std::uint8_t> frames;
  bool keeps = true;
  std::uint64_t without_rates = 0;
  std::uint64_t without_forces = 0;
  while (const auto content = extractor.next()) {
    ++survey.messages;
    if (content->kind == ros_message::Kind::kImu) {
      if ((content->flags & ros_message::kHasGyro) == 0) ++without_rates;
      if ((content->flags & ros_message::kHasAccel) == 0) ++without_forces;
    }
    if (keeps) append_frame(*content, frames);
    if (frames.size() > kKeptMost) {
      keeps = false;
      frames = {};
    }
    if (progress && survey.messages % kMessagesPerProgress == 0) {
      const auto& read = extractor.reader();
      progress("messages of " + device.name,
               static_cast<double>(read.bytes_read()) / static_cast<double>(read.bytes_total()));
    }
  }
  const std::string name = file.string();
  survey.losses = extractor.reader().losses();
  for (auto& loss : survey.losses) loss = fmt::format("{}: {}", device.name, loss);
  if (auto checked = check_topics(name, device, extractor); !checked) {
    // A file of which little can be read may have lost the topic.
    Error error = checked.error();
    for (const auto& loss : survey.losses) error.what += "; " + loss;
    return tl::unexpected<Error>(error);
  }
  if (survey.messages == 0) return tl::unexpected<Error>(no_message_error(name, device, extractor));
  if (extractor.bad() > 0)
    survey.losses.push_back(
        fmt::format("{}: {} messages in {} are not what their schema says, and were left out", device.name,
                    extractor.bad(), name));
  if (extractor.out_of_order() > 0)
    survey.losses.push_back(fmt::format("{}: {} messages in {} were out of order, and were put in order",
                                        device.name, extractor.out_of_order(), name));
  const auto say_missing = [&](std::uint64_t messages, const char* what) {
    if (messages == 0) return;
    survey.losses.push_back(
        fmt::format("{}: {} of {} messages in {} say that they hold no {}, as its covariance begins with -1",
                    device.name, messages, survey.messages, name, what));
  };
  say_missing(without_rates, "angular velocity");
  say_missing(without_forces, "linear acceleration");
  if (keeps) survey.frames = std::make_shared<const std::vector<std::uint8_t>>(std::move(frames));
  return survey;
}

Result<std::unique_ptr<ByteSource>> open_messages(const std::filesystem::path& file,
                                                  const DeviceConfig& device, const MessageSurvey& survey) {
  if (survey.frames) return std::make_unique<KeptSource>(survey.frames);
  auto reader = open_message_log(file, device.protocol);
  if (!reader) return tl::unexpected<Error>(reader.error());
  return std::make_unique<FileSource>(Extractor(std::move(*reader), device));
}

}  // namespace imuscope
