#include "capture/capture_files.h"

#include <algorithm>
#include <string>
#include <system_error>
#include <utility>
#include <variant>

#include "capture/record_codec.h"

namespace imuscope {
namespace {

/// Files in a row that may be missing: a recording of a day in files of a minute has as many.
constexpr int kMissingMax = 1440;
constexpr double kSecondsPerMicrosecond = 1e-6;
/// A file whose header is damaged follows where its first record lies near the last one before: the recorder
/// writes rings after one another, and no break of a drive is longer.
constexpr double kDisorderMax_s = 10.0;
constexpr double kBreakMax_s = 24.0 * 3600.0;

/// When the first read came, by the recorder's clock, from this record on. A header and what was published do not
/// tell: the one has the time of the run's beginning, the others that of GNSS.
std::optional<std::int64_t> first_read_from(LogEventView& event, SealedLog& log) {
  // Minutes in which no device sends hold fewer.
  constexpr int kRecordsMost = 10000;
  for (int i = 0; i < kRecordsMost; ++i) {
    if (is_raw(event.data)) return event.utime;
    if (!log.next(event)) break;
  }
  return std::nullopt;
}

std::optional<HostTime> t0_of(const LogEventView& event) {
  const auto record = decode_record(event.data);
  if (!record) return std::nullopt;
  const auto* run = std::get_if<RunHeader>(&*record);
  return run != nullptr ? std::optional(run->t0) : std::nullopt;
}

}  // namespace

std::filesystem::path capture_file(const std::filesystem::path& first, int n) {
  if (n == 0) return first;
  constexpr std::size_t kDigits = 3;
  std::string number = std::to_string(n);
  number.insert(0, number.size() < kDigits ? kDigits - number.size() : 0, '0');
  auto path = first;
  path.replace_filename(first.stem().string() + "_" + number + first.extension().string());
  return path;
}

Result<CaptureFiles> CaptureFiles::open(const std::filesystem::path& first,
                                        EventLogReader::Beginning beginning) {
  auto log = SealedLog::open(first, beginning);
  if (!log) return tl::unexpected(log.error());
  return CaptureFiles(first, std::move(*log));
}

void CaptureFiles::on_read(const std::function<void(double share)>& listener) {
  on_read_ = listener;
  report_reads();
}

void CaptureFiles::report_reads() {
  if (!on_read_) return;
  std::error_code error;
  const auto size = std::filesystem::file_size(capture_file(first_, number_), error);
  if (error || size == 0) return;
  log_.on_read([tell = on_read_, size](std::uint64_t bytes) {
    tell(std::min(1.0, static_cast<double>(bytes) / static_cast<double>(size)));
  });
}

void CaptureFiles::pass_over(const SealedLog::Unwanted& unwanted) {
  unwanted_ = unwanted;
  log_.pass_over(unwanted_);
}

void CaptureFiles::begin_file(SealedLog log, int number) {
  log_ = std::move(log);
  log_.pass_over(unwanted_);
  number_ = number;
}

bool CaptureFiles::next(LogEventView& event) {
  while (!log_.next(event)) {
    if (!open_following()) return false;
  }
  if (std::exchange(at_beginning_, false)) {
    t0_ = t0_of(event);
    if (!t0_ && log_.health().is_sealed) t0_ = t0_of_others();
  }
  // Published messages have the time that they are valid at, by GNSS where there is one.
  if (is_raw(event.data)) last_read_utime_ = event.utime;
  return true;
}

std::optional<CaptureFiles::Place> CaptureFiles::place() const {
  const auto offset = log_.place();
  if (!offset || at_beginning_) return std::nullopt;
  return Place{number_, *offset};
}

Result<void> CaptureFiles::go_to(const Place& place) {
  if (place.number != number_) {
    auto log = SealedLog::open(capture_file(first_, place.number), EventLogReader::Beginning::kMayBeDamaged);
    if (!log) return tl::unexpected<Error>(log.error());
    begin_file(std::move(*log), place.number);
  }
  log_.go_to(place.offset);
  return {};
}

std::vector<CapturedFile> CaptureFiles::files() const {
  auto files = finished_;
  files.push_back({number_, log_.health()});
  return files;
}

/// Of a capture of our own whose first header is damaged: what the next file there says.
std::optional<HostTime> CaptureFiles::t0_of_others() const {
  for (int number = 1; number <= kMissingMax; ++number) {
    const auto path = capture_file(first_, number);
    std::error_code ignored;
    if (!std::filesystem::exists(path, ignored)) continue;
    auto log = EventLogReader::open(path);
    LogEventView event;
    if (log && log->next(event)) return t0_of(event);
  }
  return std::nullopt;
}

/// Whether file `number` goes on with this capture, and what is missing before it.
std::optional<CaptureBreak> CaptureFiles::joins(int number) const {
  const auto path = capture_file(first_, number);
  // Most of those that are asked for are not there: no error has to be made for them.
  std::error_code ignored;
  if (!std::filesystem::exists(path, ignored)) return std::nullopt;
  auto log = SealedLog::open(path, EventLogReader::Beginning::kMayBeDamaged);
  LogEventView event;
  if (!log || !log->next(event)) return std::nullopt;
  const auto t0 = t0_of(event);
  if (t0 && t0 != t0_) return std::nullopt;
  const auto begins = first_read_from(event, *log);
  // Without a header, what a device sent is all that tells whose it is.
  if (!t0 && !begins) return std::nullopt;
  // Where no device has sent anything yet, nothing is known to be missing.
  const double seconds =
      begins && last_read_utime_
          ? (static_cast<double>(*begins) - static_cast<double>(*last_read_utime_)) * kSecondsPerMicrosecond
          : 0.0;
  // Where the header is among what is damaged, the records say whether they follow.
  const LogHealth health = log->health();
  const bool is_damaged = health.bytes_skipped + health.records_damaged > 0;
  if (!t0 && !(is_damaged && seconds > -kDisorderMax_s && seconds < kBreakMax_s)) return std::nullopt;
  return CaptureBreak{number_ + 1, number - number_ - 1, number, !t0, seconds};
}

/// Goes on to the next file of the same run, if there is one.
bool CaptureFiles::open_following() {
  if (!t0_) return false;
  for (int number = number_ + 1; number <= number_ + 1 + kMissingMax; ++number) {
    const auto found = joins(number);
    if (!found) continue;
    auto log = SealedLog::open(capture_file(first_, number), EventLogReader::Beginning::kMayBeDamaged);
    if (!log) return false;
    finished_.push_back({number_, log_.health()});
    begin_file(std::move(*log), number);
    if (found->n_missing > 0 || found->beginning_is_damaged) breaks_.push_back(*found);
    report_reads();
    return true;
  }
  return false;
}

}  // namespace imuscope
