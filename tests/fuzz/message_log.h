#pragma once

/// A file from anywhere as one of many topics: all its messages, and what every role takes out of it.

#include "service/recording/message_log.h"
#include "service/recording/message_source.h"
#include "tests/fuzz/file_in_memory.h"

namespace imuscope::fuzz {

inline void read_message_log(const std::uint8_t* data, std::size_t size, Protocol protocol) {
  const FileInMemory file(data, size);
  auto reader = open_message_log(file.path(), protocol);
  if (!reader) {
    require(!reader.error().what.empty(), "an error says what is wrong");
    return;
  }
  while (const auto message = (*reader)->next()) require(message->topic != nullptr, "a message has a topic");
  require((*reader)->bytes_read() <= size + 1, "no more is read than there is");
  for (const auto role : {DeviceRole::kStudy, DeviceRole::kGnss, DeviceRole::kOdometry, DeviceRole::kTime}) {
    DeviceConfig device;
    device.name = "fuzz";
    device.role = role;
    device.protocol = protocol;
    const auto survey = survey_messages(file.path(), device);
    if (!survey) {
      require(!survey.error().what.empty(), "an error says what is wrong");
      continue;
    }
    require(survey->messages > 0, "what is taken is at least a message");
    auto source = open_messages(file.path(), device, *survey);
    require(source.has_value(), "what was surveyed can be read");
    while (*(*source)->next()) {
    }
  }
}

}  // namespace imuscope::fuzz
