#include "service/recording/candump_source.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include "drivers/transport/candump.h"

namespace imuscope {

namespace {

/// 2000-01-01: a PC that believes in an earlier date has no date.
constexpr std::int64_t kEarliestUtc_ns = 946'684'800'000'000'000;

/// Frames of several interfaces are logged as they are read: by so much their stamps may be out of order.
constexpr Duration kOutOfOrder = std::chrono::milliseconds{20};

/// Frames after which a pause counts for little: some groups of a device.
constexpr int kPauseForgotten = 16;

/// How often, and by how much in all, the stamps of a log go back.
struct PutBack {
  std::uint64_t times = 0;
  Duration by{};
  HostTime last{HostTime::min()};

  void look_at(HostTime stamp) {
    if (last != HostTime::min() && stamp < last - kOutOfOrder) {
      ++times;
      by += last - stamp;
      last = stamp;
    }
    last = std::max(last, stamp);
  }
};

class CandumpSource final : public ByteSource {
 public:
  CandumpSource(CandumpLog log, std::string interface, const ClockMapConfig& clock, std::uint64_t total)
      : log_(std::move(log)), interface_(std::move(interface)), clock_(clock), total_(total) {}

  Result<std::optional<RecordedRead>> next() override {
    while (const CandumpFrame* entry = log_.next()) {
      if (!interface_.empty() && entry->interface != interface_) continue;
      CanFrame frame = entry->frame;
      frame.stamp = going_on(host_time(frame.stamp));
      const std::size_t n = write_can_record(frame, record_);
      return std::optional<RecordedRead>{RecordedRead{last_, std::span(record_).first(n)}};
    }
    return std::optional<RecordedRead>{};
  }
  [[nodiscard]] std::uint64_t bytes_read() const override { return log_.bytes_read(); }
  [[nodiscard]] std::uint64_t bytes_total() const override { return total_; }

 private:
  /// A wall clock that was put back must not turn the run's time back: from there on its stamps go on from
  /// where they were, a usual pause later. Too late by a part of that: clock maps pass over what is late.
  [[nodiscard]] HostTime going_on(HostTime stamp) {
    if (last_ == HostTime::min()) return last_ = stamp;
    if (stamp + put_back_ < last_ - kOutOfOrder) put_back_ = last_ + pause_ - stamp;
    const HostTime time = std::max(last_, stamp + put_back_);
    pause_ = std::clamp(time - last_, pause_ - pause_ / kPauseForgotten, kOutOfOrder);
    return last_ = time;
  }
  [[nodiscard]] HostTime host_time(HostTime logged) const {
    const double gained_ns = (clock_.rate_ratio - 1.0) * static_cast<double>(to_ns(logged));
    return logged + clock_.origin.time_since_epoch() + Duration{std::llround(gained_ns)};
  }

  CandumpLog log_;
  std::string interface_;
  ClockMapConfig clock_;
  std::uint64_t total_;
  HostTime last_{HostTime::min()};
  Duration put_back_{};
  Duration pause_{};  ///< the longest of late between two frames
  std::array<std::uint8_t, kCanRecordMaxBytes> record_{};
};

Result<std::string> interface_of(const std::filesystem::path& file, const DeviceConfig& device,
                                 const std::map<std::string, std::uint64_t>& found) {
  std::vector<std::string> names;
  for (const auto& [name, frames] : found) names.push_back(name);
  if (names.size() == 1) return names.front();
  if (device.can && found.contains(device.can->interface)) return device.can->interface;
  return usage_error(
      fmt::format("{}: the log holds the interfaces {}, and '{}' {}", file.string(), fmt::join(names, ", "),
                  device.name, device.can ? "hangs on " + device.can->interface : "names none"),
      fmt::format("set transport = {{ kind = \"can\", interface = \"{}\" }}", names.front()));
}

}  // namespace

Result<CandumpSurvey> survey_candump(
    const std::filesystem::path& file, const DeviceConfig& device,
    const std::function<void(const std::string& what, double share)>& progress) {
  auto log = CandumpLog::open(file);
  if (!log) return tl::unexpected<Error>(log.error());
  CandumpSurvey survey;
  std::map<std::string, std::uint64_t> found;
  survey.stamps_are_utc = true;
  PutBack put_back;
  std::error_code code;
  const auto size = static_cast<double>(std::filesystem::file_size(file, code));
  constexpr std::uint64_t kFramesPerProgress = 65536;
  for (std::uint64_t frames = 0; const CandumpFrame* entry = log->next(); ++frames) {
    if (progress && !code && frames % kFramesPerProgress == 0)
      progress("looking through", static_cast<double>(log->bytes_read()) / size);
    ++found[entry->interface];
    put_back.look_at(entry->frame.stamp);
    if (to_ns(entry->frame.stamp) < kEarliestUtc_ns) survey.stamps_are_utc = false;
  }
  auto interface = interface_of(file, device, found);
  if (!interface) return tl::unexpected<Error>(interface.error());
  survey.interface = std::move(*interface);
  survey.frames = found[survey.interface];
  if (log->bad_lines() > 0) {
    survey.remarks.push_back(fmt::format("{}: {} lines are no frames and were passed over; the first: {}",
                                         file.string(), log->bad_lines(), log->first_problem()));
  }
  if (put_back.times > 0) {
    survey.remarks.push_back(
        fmt::format("{}: the stamps go back {} times, by {:.3f} s in all: the PC's clock was set while "
                    "candump ran; they are taken to go on from where they were",
                    file.string(), put_back.times, to_seconds(put_back.by)));
  }
  if (log->drops_total() > 0) {
    survey.remarks.push_back(
        fmt::format("{}: candump itself lost {} frames", file.string(), log->drops_total()));
  }
  return survey;
}

Result<std::unique_ptr<ByteSource>> open_candump(const std::filesystem::path& file,
                                                 const std::string& interface, const ClockMapConfig& clock) {
  auto log = CandumpLog::open(file);
  if (!log) return tl::unexpected<Error>(log.error());
  std::error_code code;
  const auto size = std::filesystem::file_size(file, code);
  return std::make_unique<CandumpSource>(std::move(*log), interface, clock, code ? 0 : size);
}

}  // namespace imuscope
