/// A file that claims to be a capture: read as an event log, summarised, and read device by device.

#include <string>

#include "capture/capture_reader.h"
#include "capture/event_log_reader.h"
#include "tests/fuzz/file_in_memory.h"

namespace imuscope::fuzz {
namespace {

void read_events(const std::string& path, std::size_t size) {
  auto log = EventLogReader::open(path);
  if (!log) return require(!log.error().what.empty(), "an error says what is wrong");
  LogEvent event;
  std::size_t whole = 0;
  while (log->next(event)) whole += event.data.size();
  require(whole + log->bytes_skipped() + log->bytes_cut_off() <= size, "no byte is given out twice");
}

void read_capture(const std::string& path) {
  const auto summary = summarise_capture(path);
  if (!summary) return require(!summary.error().what.empty(), "an error says what is wrong");
  auto reader = CaptureReader::open(path);
  if (!reader) return;
  while (reader->next()) {
  }
}

}  // namespace
}  // namespace imuscope::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace imuscope;
  const fuzz::FileInMemory file(data, size);
  fuzz::read_events(file.path(), size);
  fuzz::read_capture(file.path());
  return 0;
}
