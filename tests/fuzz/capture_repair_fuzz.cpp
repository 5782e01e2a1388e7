/// A sealed capture that is damaged at will: nothing is given out that was not recorded, and a repaired copy
/// holds what the reader found.

#include <filesystem>
#include <fstream>
#include <iterator>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "capture/capture_repair.h"
#include "capture/capture_writer.h"
#include "capture/record_codec.h"
#include "capture/seal.h"
#include "tests/fuzz/choices.h"
#include "tests/fuzz/folder_in_memory.h"
#include "tests/fuzz/fuzz.h"

namespace imuscope::fuzz {
namespace {

namespace fs = std::filesystem;
using Bytes = std::vector<std::uint8_t>;

void record(const fs::path& path, Choices& choices) {
  RunHeader run;
  run.name = "fuzz";
  run.t0 = HostTime{std::chrono::seconds(100)};
  run.period = std::chrono::milliseconds(10);
  run.t0_wall = utc_time_from_ns(1'700'000'000'000'000'000);
  run.devices = {"airins"};
  const RecordClock clock{run.t0, run.t0_wall};
  auto writer = CaptureWriter::create(path);
  require(writer.has_value(), "a capture can be made");
  writer->append("IMUSCOPE_RUN", clock.utime(run.t0), encode(run, 0));
  const std::size_t n = choices.below(24);
  for (std::size_t i = 0; i < n; ++i) {
    const HostTime arrival = run.t0 + std::chrono::milliseconds(10 * i);
    const Bytes bytes(1 + choices.below(64), static_cast<std::uint8_t>(i));
    const RawChunk chunk{{static_cast<std::int64_t>(i), arrival, 0, Direction::kRead, false}, bytes};
    writer->append("IMUSCOPE_RAW_AIRINS", clock.utime(arrival), encode(chunk, "airins", clock));
    if (choices.byte() % 4 == 0) require(writer->flush().has_value(), "it can be flushed");
  }
  require(writer->close().has_value(), "it can be closed");
}

Bytes content_of(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

void damage(const fs::path& path, Choices& choices) {
  Bytes bytes = content_of(path);
  while (!choices.at_end() && !bytes.empty()) {
    const std::size_t place = choices.word() % bytes.size();
    switch (choices.byte() % 4) {
      case 0:
        bytes[place] = choices.byte();
        break;
      case 1:
        bytes.resize(place);
        break;
      case 2:
        bytes.erase(bytes.begin() + static_cast<std::ptrdiff_t>(place));
        break;
      default:
        bytes.insert(bytes.begin() + static_cast<std::ptrdiff_t>(place), choices.byte());
    }
  }
  std::ofstream(path, std::ios::binary)
      .write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
}

/// But for seals whose own place was damaged: those of the damaged file are of no use in the copy.
std::multiset<Bytes> records_of(const fs::path& path) {
  std::multiset<Bytes> records;
  auto log = SealedLog::open(path, EventLogReader::Beginning::kMayBeDamaged);
  if (!log) return records;
  for (LogEvent event; log->next(event);) {
    if (!decode_seal(event.data) && !decode_index(event.data)) records.insert(event.data);
  }
  return records;
}

void check_and_repair(const fs::path& damaged, const fs::path& out) {
  const auto check = check_capture(damaged);
  if (!check) return require(!check.error().what.empty(), "an error says what is wrong");
  const auto repaired = repair_capture(damaged, *check, out);
  require(repaired.has_value(), "what can be read can be repaired");
  const auto again = check_capture(out);
  require(again.has_value(), "a repaired capture can be read");
  for (const auto& file : again->files)
    require(file.index == IndexVerdict::kAgrees, "a repaired file is whole");
  auto found = records_of(damaged);
  for (const auto& record : records_of(out)) {
    const auto place = found.find(record);
    if (place != found.end()) found.erase(place);
  }
  require(found.empty(), "all that is whole is in the copy");
}

}  // namespace
}  // namespace imuscope::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace imuscope::fuzz;
  static const FolderInMemory folder;
  Choices choices(std::span(data, size));
  const auto path = folder.path() / "capture.lcm";
  const auto out = folder.path() / "repaired.lcm";
  std::filesystem::remove(path);
  std::filesystem::remove(out);
  record(path, choices);
  damage(path, choices);
  check_and_repair(path, out);
  return 0;
}
