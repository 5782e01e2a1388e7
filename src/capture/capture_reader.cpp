#include "capture/capture_reader.h"

#include <algorithm>
#include <span>
#include <string_view>
#include <utility>

#include "base/text.h"
#include "capture/stamp_range.h"

namespace imuscope {
namespace {

/// A read of a device that is longer than any.
constexpr std::size_t kLongestRead = std::size_t{16} << 20U;
/// A configuration can name no more (DeviceIndex).
constexpr std::size_t kDevicesMax = 255;

/// Memory that a read takes while it is held.
std::size_t cost_of(const RawRead& read) {
  constexpr std::size_t kPlace = 192;  // in the row, and with the allocator
  return kPlace + read.device.size() + read.bytes.size();
}

/// Counts the records of each device, and what their sequence numbers show.
class DeviceCounts {
 public:
  /// False for a device that is one too many.
  bool add(const RawView& piece, std::vector<CaptureLoss>& losses) {
    auto place = counts_.find(piece.device);
    if (place == counts_.end()) {
      if (counts_.size() >= kDevicesMax) return false;
      place = counts_.emplace(piece.device, Count{}).first;
      place->second.last_arrival = piece.arrival;
    }
    Count& count = place->second;
    if (piece.sequence > count.next_sequence) {
      losses.push_back(
          {place->first, count.last_arrival, piece.arrival, piece.sequence - count.next_sequence});
    }
    count.next_sequence = piece.sequence + 1;
    count.last_arrival = piece.arrival;
    // Of a line nothing was read or written.
    if (piece.direction != Direction::kLine) add(piece, count.device);
    return true;
  }
  [[nodiscard]] std::map<std::string, CapturedDevice> devices() const {
    std::map<std::string, CapturedDevice> devices;
    for (const auto& [name, count] : counts_) {
      if (count.device) devices.emplace(name, *count.device);
    }
    return devices;
  }

 private:
  struct Count {
    std::int64_t next_sequence = 0;
    HostTime last_arrival{};
    std::optional<CapturedDevice> device{};
  };
  static void add(const RawView& piece, std::optional<CapturedDevice>& device) {
    if (!device) device.emplace().first = piece.arrival;
    device->last = piece.arrival;
    const bool is_write = piece.direction == Direction::kWrite;
    if (!is_write) device->bytes_read += piece.bytes.size();
    if (piece.continues) return;  // counted with its last piece
    (is_write ? device->writes : device->reads) += 1;
  }
  std::map<std::string, Count, std::less<>> counts_;
};

}  // namespace

LogHealth health_of(const std::vector<CapturedFile>& files) {
  LogHealth sum;
  for (const auto& [number, health] : files) {
    sum.bytes_skipped += health.bytes_skipped;
    sum.bytes_cut_off += health.bytes_cut_off;
    sum.records_damaged += health.records_damaged;
    sum.records_missing += health.records_missing;
    sum.records_unsealed += health.records_unsealed;
    sum.is_sealed = sum.is_sealed || health.is_sealed;
  }
  return sum;
}

Result<CaptureSummary> summarise_capture(const std::filesystem::path& path,
                                         const std::function<void(double share)>& progress,
                                         EventLogReader::Beginning beginning) {
  auto log = CaptureFiles::open(path, beginning);
  if (!log) return tl::unexpected(log.error());
  log->on_read(progress);
  CaptureSummary summary;
  DeviceCounts counts;
  LogEventView event;
  while (log->next(event)) {
    if (const auto piece = view_raw(event.data)) {
      if (!counts.add(*piece, summary.losses)) summary.other_messages += 1;
      continue;
    }
    auto record = decode_record(event.data);
    if (!record) {
      summary.other_messages += 1;
    } else if (auto* run = std::get_if<RunHeader>(&*record)) {
      summary.run = std::move(*run);  // the same in every file
      summary.has_run = true;
    } else if (auto* applied = std::get_if<applied_model_t>(&*record)) {
      summary.applied_models.push_back(std::move(*applied));
    } else if (const auto* marked = std::get_if<event_t>(&*record)) {
      summary.other_messages += 1;
      const RecordClock clock{summary.run.t0, summary.run.t0_wall};
      // Of the wall clock, which began in 1970: so no difference is beyond its type.
      if (summary.has_run && event.utime >= 0 && is_stamp_us(event.utime)) {
        const HostTime heard = clock.host_time(event.utime);
        if (is_stamp_ns(to_ns(heard))) summary.events.push_back({heard, one_line(marked->text)});
      }
    } else {
      summary.exceptions.push_back(std::move(std::get<StoredException>(*record)));
    }
  }
  summary.devices = counts.devices();
  summary.breaks = log->breaks();
  summary.files = log->files();
  if (summary.devices.empty()) {
    return work_error(path.string() + " is an LCM event log without device bytes (" +
                          std::to_string(summary.other_messages) + " other messages)",
                      "replay needs a capture, which 'imuscope run' records");
  }
  return summary;
}

std::optional<RunHeader> run_header_of(const std::filesystem::path& path) {
  auto log = CaptureFiles::open(path);
  LogEventView event;
  if (!log || !log->next(event)) return std::nullopt;
  auto record = decode_record(event.data);
  auto* run = record ? std::get_if<RunHeader>(&*record) : nullptr;
  return run != nullptr ? std::optional(std::move(*run)) : std::nullopt;
}

Result<CaptureReader> CaptureReader::open(const std::filesystem::path& path, std::string device) {
  auto log = CaptureFiles::open(path);
  if (!log) return tl::unexpected(log.error());
  if (!device.empty()) {
    log->pass_over([device](std::span<const std::uint8_t> data) {
      const std::string_view of = device_of_raw(data);
      return !of.empty() && of != device;
    });
  }
  return CaptureReader(std::move(*log), std::move(device));
}

std::optional<RawRead> CaptureReader::next() {
  RawRead read;
  return next(read) ? std::optional(std::move(read)) : std::nullopt;
}

bool CaptureReader::next(RawRead& read) {
  while (!ended_ && held_bytes_ < kHeldMax &&
         (held_.empty() || newest_ - held_.front().key.arrival < kReorderWindow)) {
    ended_ = !read_one();
    if (ended_) close_assemblies();
  }
  if (held_.empty()) return false;
  Held& oldest = held_.front();
  held_bytes_ -= cost_of(oldest.read);
  if (oldest.key.arrival < given_) disordered_ += 1;
  given_ = std::max(given_, oldest.key.arrival);
  std::swap(read, oldest.read);
  // What lines bring within the window; a read that is as long as a file is not kept.
  constexpr std::size_t kSparesMost = 4096;
  constexpr std::size_t kSpareBytesMost = 2048;
  if (spares_.size() < kSparesMost && oldest.read.bytes.capacity() <= kSpareBytesMost)
    spares_.push_back(std::move(oldest.read));
  held_.pop_front();
  return true;
}

RawRead CaptureReader::read_of(const RawView& piece) {
  RawRead read;
  if (!spares_.empty()) {
    read = std::move(spares_.back());
    spares_.pop_back();
  }
  read.device.assign(piece.device);
  read.direction = piece.direction;
  read.arrival = piece.arrival;
  read.bytes.assign(piece.bytes.begin(), piece.bytes.end());
  read.received = piece.received;
  return read;
}

/// Takes in one event. Returns false at the end of the file.
bool CaptureReader::read_one() {
  LogEventView event;
  if (!log_.next(event)) return false;
  if (const auto piece = view_raw(event.data)) {
    if (wanted_.empty() || piece->device == wanted_) add_piece(*piece);
    return true;
  }
  const auto record = decode_record(event.data);
  if (!record) return true;
  if (const auto* run = std::get_if<RunHeader>(&*record)) devices_ = run->devices;
  return true;
}

void CaptureReader::add_piece(const RawView& piece) {
  auto place = assemblies_.find(piece.device);
  if (place == assemblies_.end()) place = assemblies_.emplace(piece.device, Assembly{}).first;
  Assembly& assembly = place->second;
  const bool follows = piece.sequence == assembly.next_sequence;
  assembly.next_sequence = piece.sequence + 1;
  if (!assembly.open && !piece.continues) return add_whole(read_of(piece));
  if (assembly.open && follows) {
    auto& bytes = assembly.read.bytes;
    bytes.insert(bytes.end(), piece.bytes.begin(), piece.bytes.end());
  } else {
    if (assembly.open) add_whole(std::move(assembly.read));
    assembly.read = read_of(piece);
  }
  // A read that never ends is damage: it is given as far as it goes.
  assembly.open = piece.continues && assembly.read.bytes.size() < kLongestRead;
  if (!assembly.open) add_whole(std::move(assembly.read));
}

/// At the end of the file: reads whose last piece is missing are given as far as they go.
void CaptureReader::close_assemblies() {
  for (auto& [device, assembly] : assemblies_) {
    if (std::exchange(assembly.open, false)) add_whole(std::move(assembly.read));
  }
}

void CaptureReader::add_whole(RawRead&& read) {
  const Key key{read.arrival, index_of(read.device), completed_++};
  newest_ = std::max(newest_, read.arrival);
  held_bytes_ += cost_of(read);
  // Lines are read by turns, so that few have to be passed; damaged stamps may be of any time.
  constexpr std::ptrdiff_t kNear = 64;
  auto place = held_.end();
  const auto least = held_.end() - std::min<std::ptrdiff_t>(kNear, held_.end() - held_.begin());
  while (place != least && key < std::prev(place)->key) --place;
  if (place == least)
    place = std::lower_bound(held_.begin(), least, key,
                             [](const Held& held, const Key& k) { return held.key < k; });
  held_.insert(place, Held{key, std::move(read)});
}

/// Place of the device in the configuration; devices that the run header does not name follow in the order of
/// their appearance.
std::size_t CaptureReader::index_of(const std::string& device) {
  const auto place = std::find(devices_.begin(), devices_.end(), device);
  const auto index = static_cast<std::size_t>(place - devices_.begin());
  if (place == devices_.end()) devices_.push_back(device);
  return index;
}

}  // namespace imuscope
