/// A file from anywhere as an MCAP file: all its messages, and what every role takes out of it.

#include "mcap/reader.h"
#include "service/mcap_source.h"
#include "tests/fuzz/file_in_memory.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace imuscope;
  const fuzz::FileInMemory file(data, size);
  auto reader = mcap::Reader::open(file.path());
  if (!reader) return 0;
  std::uint64_t messages = 0;
  while (const auto message = reader->next()) {
    ++messages;
    fuzz::require(message->topic != nullptr, "a message has a topic");
  }
  fuzz::require(reader->bytes_read() <= size + 1, "no more is read than there is");
  for (const auto role : {DeviceRole::kStudy, DeviceRole::kGnss, DeviceRole::kOdometry, DeviceRole::kTime}) {
    DeviceConfig device;
    device.name = "fuzz";
    device.role = role;
    device.protocol = Protocol::kMcap;
    const auto survey = survey_mcap(file.path(), device);
    if (!survey) {
      fuzz::require(!survey.error().what.empty(), "an error says what is wrong");
      continue;
    }
    fuzz::require(survey->messages > 0, "what is taken is at least a message");
    auto source = open_mcap(file.path(), device, *survey);
    fuzz::require(source.has_value(), "what was surveyed can be read");
    while (*(*source)->next()) {
    }
  }
  return 0;
}
