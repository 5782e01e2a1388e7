#include "service/recording/recorded_look.h"

#include <algorithm>
#include <list>
#include <memory>
#include <optional>
#include <vector>

#include "check/check.h"
#include "service/pipeline/device_factory.h"
#include "service/recording/side_by_side.h"

namespace imuscope {

namespace {

/// Passes samples on, with their times shifted.
class Gatherer final : public SampleSink {
 public:
  Gatherer(check::Drive& drive, Duration shift) : drive_(drive), shift_(shift) {}
  void on_sample(const Sample& sample) noexcept override {
    Sample shifted = sample;
    shifted.time += shift_;
    drive_.add(shifted);
  }

 private:
  check::Drive& drive_;
  Duration shift_;
};

/// The first sample that has a UTC tag.
class UtcFinder final : public SampleSink {
 public:
  void on_sample(const Sample& sample) noexcept override {
    if (!difference_ && sample.has_utc) difference_ = Duration{to_ns(sample.utc) - to_ns(sample.time)};
  }
  [[nodiscard]] std::optional<Duration> difference() const { return difference_; }

 private:
  std::optional<Duration> difference_;
};

/// Decodes a device until `enough` says so, or the end.
template <typename Enough>
void decode(const Configuration& configuration, const Recording& recording, std::size_t device,
            SampleSink& sink, Enough enough) {
  const auto index = static_cast<DeviceIndex>(device);
  auto source = recording.open(index);
  if (!source) return;
  const auto decoder = make_decoder(configuration.devices[device], index, recording.clocks[device].map);
  while (!enough()) {
    const auto read = (*source)->next();
    if (!read) return;
    if (!*read) break;
    decoder->push((*read)->bytes, (*read)->arrival.value_or(HostTime{}), sink);
  }
  decoder->finish(HostTime{}, sink);
}

/// UTC minus the device's own time; a tag stands in the first minutes or nowhere.
std::optional<Duration> utc_of(const Configuration& configuration, const Recording& recording,
                               std::size_t device) {
  constexpr int kReadsMax = 4096;
  UtcFinder finder;
  int reads = 0;
  decode(configuration, recording, device, finder,
         [&] { return finder.difference() || reads++ == kReadsMax; });
  return finder.difference();
}

/// One device on its way into the drive.
struct Line {
  std::size_t device;
  std::unique_ptr<ByteSource> source;
  std::unique_ptr<DeviceDecoder> decoder;
  Gatherer gatherer;
  std::optional<RecordedRead> pending{};
  bool is_readable = true;  ///< further on

  void fetch() {
    const auto read = source->next();
    is_readable = read.has_value();
    pending = is_readable ? *read : std::nullopt;
  }
  /// Of what comes next; at its end it is the oldest, so that it is ended at once.
  [[nodiscard]] HostTime arrival() const {
    return pending ? pending->arrival.value_or(HostTime::min()) : HostTime::min();
  }
};

/// All devices into the drive, oldest arrival first, so that one pass over a capture serves them all. The
/// first device has the first sample: seconds of the drive count from there.
void gather(const Configuration& configuration, const Recording& recording,
            const std::vector<Duration>& shifts, check::Drive& drive) {
  auto sources = recording.open_side_by_side(reading_by_threads());
  if (!sources) return;
  std::list<Line> lines;
  for (std::size_t i = 0; i < sources->size(); ++i) {
    if (!(*sources)[i]) continue;
    const auto index = static_cast<DeviceIndex>(i);
    lines.push_back({i, std::move((*sources)[i]),
                     make_decoder(configuration.devices[i], index, recording.clocks[i].map),
                     Gatherer(drive, shifts[i])});
    lines.back().fetch();
  }
  const auto is_older = [](const Line& a, const Line& b) { return a.arrival() < b.arrival(); };
  while (!lines.empty()) {
    const auto next =
        drive.has_origin() ? std::min_element(lines.begin(), lines.end(), is_older) : lines.begin();
    if (next->pending && !drive.is_full(next->device)) {
      next->decoder->push(next->pending->bytes, next->pending->arrival.value_or(HostTime{}), next->gatherer);
      next->fetch();
      continue;
    }
    if (next->is_readable) next->decoder->finish(HostTime{}, next->gatherer);
    lines.erase(next);
  }
}

}  // namespace

std::vector<check::Finding> look_at_recording(const Configuration& configuration, const Recording& recording,
                                              const std::vector<bool>& has_own_clock, double longest_s) {
  check::Drive drive(configuration, longest_s);
  std::vector<Duration> shifts(configuration.devices.size());
  std::optional<Duration> utc_of_reference;
  for (std::size_t i = 0; i < configuration.devices.size(); ++i) {
    if (has_own_clock[i] && recording.present[i])
      utc_of_reference = utc_of(configuration, recording, configuration.reference_index());
  }
  for (std::size_t i = 0; i < configuration.devices.size(); ++i) {
    if (!recording.present[i]) continue;
    Duration shift{};
    if (has_own_clock[i]) {
      const auto utc = utc_of(configuration, recording, i);
      const bool tagged = utc && utc_of_reference;
      if (tagged) shift = *utc - *utc_of_reference;
      drive.set_time_scale(i, tagged ? check::TimeScale::kShared : check::TimeScale::kOwn);
    }
    shifts[i] = shift;
  }
  gather(configuration, recording, shifts, drive);
  return check::look_at(drive);
}

}  // namespace imuscope
