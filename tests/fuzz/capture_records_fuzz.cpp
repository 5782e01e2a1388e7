/// A capture whose records are valid in form and hostile in content, through replay, study and what reads
/// their results. Begins with the first seconds of the golden capture; an input changes fields of its
/// records, takes some out, puts some in twice, and adds records that a run may write: messages of a person,
/// exceptions, noise models.

#include <cstdio>
#include <fstream>
#include <imuscope/applied_model_t.hpp>
#include <imuscope/event_t.hpp>
#include <imuscope/exception_t.hpp>
#include <imuscope/raw_t.hpp>
#include <imuscope/run_t.hpp>

#include "capture/capture_writer.h"
#include "capture/event_log_reader.h"
#include "publish/message_codec.h"
#include "tests/fuzz/choices.h"
#include "tests/fuzz/command_line.h"
#include "tests/fuzz/folder_in_memory.h"

namespace imuscope::fuzz {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kForgeriesMax = 8;
/// What is made of a capture is at most so many times as large, and this, which a report has of itself.
constexpr std::uintmax_t kGrowthMax = 20;
constexpr std::uintmax_t kFixedMax = 4U << 20U;

std::vector<LogEvent> golden_events(const FolderInMemory& folder) {
  const fs::path file = folder.path() / "golden.lcm";
  const std::string unpack =
      std::string("gzip -dc '") + IMUSCOPE_GOLDEN_CAPTURE + "' > '" + file.string() + "'";
  require(std::system(unpack.c_str()) == 0, "the golden capture can be unpacked");
  auto log = EventLogReader::open(file);
  require(log.has_value(), "the golden capture can be read");
  std::vector<LogEvent> events;
  constexpr std::int64_t kTaken_us = 12'000'000;
  for (LogEvent event; log->next(event);) {
    if (!events.empty() && event.utime - events.front().utime > kTaken_us) break;
    events.push_back(event);
  }
  fs::remove(file);
  return events;
}

void forge(raw_t& raw, Choices& choices) {
  switch (choices.below(8)) {
    case 0:
      raw.arrival_ns = choices.integer();
      break;
    case 1:
      raw.arrival_ns += choices.integer() % 100'000'000'000'000;
      break;
    case 2:
      raw.sequence = choices.integer();
      break;
    case 3:
      raw.device = choices.text();
      break;
    case 4:
      raw.continues = static_cast<std::int8_t>(choices.byte() % 2);
      break;
    case 5:
      raw.direction = static_cast<std::int8_t>(choices.byte());
      break;
    default:
      if (!raw.bytes.empty()) raw.bytes[choices.below(raw.bytes.size())] = choices.byte();
  }
}

/// Another value after one '=' of the configuration, or another key.
void forge(run_t& run, Choices& choices) {
  switch (choices.below(4)) {
    case 0:
      run.t0_ns = choices.integer();
      break;
    case 1:
      run.t0_utime = choices.integer();
      break;
    case 2:
      run.configuration +=
          "\n[regimes]\nby = \"" + std::string(choices.byte() % 2 == 0 ? "labels" : "intensity") + "\"\n";
      break;
    default: {
      const std::size_t at = run.configuration.find('=', choices.word() % (run.configuration.size() + 1));
      if (at == std::string::npos) return;
      const std::size_t end = std::min(run.configuration.find('\n', at), run.configuration.size());
      const std::string value =
          choices.byte() % 2 == 0 ? nlohmann::json(choices.real()).dump() : "\"" + choices.text() + "\"";
      run.configuration.replace(at + 1, end - at - 1, value);
    }
  }
}

template <typename Message>
bool forge_as(LogEvent& event, Choices& choices) {
  auto message = decode_message<Message>(event.data);
  if (!message) return false;
  forge(*message, choices);
  event.data = encode_message(*message);
  return true;
}

LogEvent added_event(std::int64_t utime, Choices& choices) {
  LogEvent event{0, utime, "IMUSCOPE_EXTRA", {}};
  switch (choices.below(3)) {
    case 0: {
      event_t message{};
      message.utime = utime;
      message.text = "regime " + choices.text();
      event.data = encode_message(message);
      break;
    }
    case 1: {
      exception_t message{};
      message.utime = utime;
      message.kind = static_cast<std::int8_t>(choices.below(4));
      message.device = choices.byte() % 4 == 0 ? choices.text() : "mtx1";
      message.sample_sequence = choices.integer();
      message.tick =
          choices.byte() % 2 == 0 ? static_cast<std::int64_t>(choices.below(2'000)) : choices.integer();
      message.count =
          choices.byte() % 2 == 0 ? static_cast<std::int64_t>(choices.below(2'000)) : choices.integer();
      event.data = encode_message(message);
      break;
    }
    default: {
      applied_model_t message{};
      message.utime = utime;
      message.device = "mtx1";
      message.tick = static_cast<std::int64_t>(choices.below(2'000));
      event.data = encode_message(message);
    }
  }
  return event;
}

void forge(std::vector<LogEvent>& events, Choices& choices) {
  // The header at the beginning is one record among a thousand, and holds most.
  const std::size_t which = choices.byte() % 4 == 0 ? 0 : choices.word() % events.size();
  const auto at = events.begin() + static_cast<std::ptrdiff_t>(which);
  switch (choices.below(8)) {
    case 0:
      events.erase(at);
      break;
    case 1:
      events.insert(at, LogEvent(*at));
      break;
    case 2:
      events.insert(at + 1, added_event(at->utime, choices));
      break;
    case 3:
      at->utime = choices.integer();
      break;
    default:
      if (!forge_as<raw_t>(*at, choices)) (void)forge_as<run_t>(*at, choices);
  }
}

std::uintmax_t size_of(const fs::path& folder) {
  std::uintmax_t size = 0;
  std::error_code gone;
  for (const auto& entry : fs::recursive_directory_iterator(folder, gone)) {
    if (entry.is_regular_file()) size += entry.file_size();
  }
  return size;
}

}  // namespace
}  // namespace imuscope::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace imuscope;
  using namespace imuscope::fuzz;
  static const FolderInMemory folder;
  static const std::vector<LogEvent> golden = golden_events(folder);
  const std::string capture = (folder.path() / "forged.lcm").string();
  const std::string out = (folder.path() / "out").string();
  Choices choices({data, size});
  const bool is_study = choices.byte() % 4 == 0;
  std::vector<LogEvent> events = golden;
  for (std::size_t i = 0; i < kForgeriesMax && !choices.at_end() && !events.empty(); ++i)
    forge(events, choices);
  {
    auto writer = CaptureWriter::create(capture);
    require(writer.has_value(), "the forged capture can be written");
    for (const LogEvent& event : events) writer->append(event.channel, event.utime, event.data);
    require(writer->close().has_value(), "the forged capture is whole");
  }
  const std::uintmax_t allowed = kGrowthMax * fs::file_size(capture) + kFixedMax;
  const bool done = run_command({is_study ? "process" : "replay", capture, "--out", out});
  require(size_of(out) <= allowed, "what is made of a capture is bounded by its size");
  if (done) {
    run_command({"report", out});
    run_command({"tables", out});
    run_command({"evaluate", out});
  }
  fs::remove_all(out);
  fs::remove(capture);
  return 0;
}
