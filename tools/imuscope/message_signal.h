#pragma once

/// Axes of an IMU in an MCAP file as signals: sensor_msgs/Imu of one topic, rad/s and m/s^2.

#include <array>
#include <filesystem>
#include <string>
#include <vector>

#include "base/result.h"
#include "sample_axes.h"
#include "signal_file.h"

namespace imuscope::cli {

[[nodiscard]] bool is_message_log(const std::filesystem::path& file);

/// What a file holds, sample by sample; times left out are gaps. In the order of kMessageAxes.
struct MessageAxes {
  std::array<Signal, kMessageAxes.size()> axes;
  std::vector<std::string> warnings;  ///< what is missing of the file
};

/// @param topic  may be empty where there is one IMU only
/// Errors: those of the file and the topic (service/recording/message_source.h), too few messages, times that go back,
/// a rate that contradicts them.
Result<MessageAxes> read_message_axes(const std::filesystem::path& file, const std::string& topic,
                                      std::optional<double> rate_hz);

/// A signal of any kind of file: `choice.column` is an axis of an MCAP file; see read_signal() for the
/// others.
/// @param warnings  receives what is missing of the file
Result<Signal> read_any_signal(const std::filesystem::path& file, const SignalChoice& choice,
                               std::vector<std::string>& warnings);

}  // namespace imuscope::cli
