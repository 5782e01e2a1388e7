#include "capture/capture_files.h"

#include <algorithm>
#include <string>
#include <system_error>
#include <utility>
#include <variant>

#include "capture/record_codec.h"

namespace imuscope {
namespace {

std::optional<HostTime> t0_of(const LogEvent& event) {
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

Result<CaptureFiles> CaptureFiles::open(const std::filesystem::path& first) {
  auto log = EventLogReader::open(first);
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

bool CaptureFiles::next(LogEvent& event) {
  if (!log_.next(event)) {
    if (!open_following()) return false;
    return next(event);
  }
  if (std::exchange(at_beginning_, false)) t0_ = t0_of(event);
  return true;
}

/// Goes on to the next file of the same run, if there is one.
bool CaptureFiles::open_following() {
  if (!t0_) return false;
  const auto path = capture_file(first_, number_ + 1);
  LogEvent event;
  auto probe = EventLogReader::open(path);
  if (!probe || !probe->next(event) || t0_of(event) != t0_) return false;
  auto log = EventLogReader::open(path);
  if (!log) return false;
  bytes_skipped_ += log_.bytes_skipped();
  bytes_cut_off_ += log_.bytes_cut_off();
  log_ = std::move(*log);
  number_ += 1;
  report_reads();
  return true;
}

}  // namespace imuscope
