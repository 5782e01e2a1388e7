#include "service/recording/recorded_look.h"

#include <optional>
#include <vector>

#include "check/check.h"
#include "service/pipeline/device_factory.h"
#include "service/recording/decoded_lines.h"
#include "service/recording/side_by_side.h"

namespace imuscope {

namespace {

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

/// All devices into the drive. The first device that has a sample has the first one: seconds of the drive count from
/// there.
void gather(const Configuration& configuration, const Recording& recording,
            const std::vector<Duration>& shifts, check::Drive& drive) {
  auto lines = DecodedLines::open(configuration, recording, recording.present, reading_by_threads());
  if (!lines) return;
  const auto take = [&](const LineRead& read) {
    for (Sample sample : read.samples) {
      sample.time += shifts[read.device];
      drive.add(sample);
    }
    if (drive.is_full(read.device)) lines->leave(read.device);
  };
  for (std::size_t i = 0; i < recording.present.size(); ++i) {
    while (!drive.has_origin()) {
      const auto read = lines->next_of(i);
      if (!read || !*read) break;
      take(**read);
    }
  }
  for (;;) {
    const auto read = lines->next();
    if (!read) continue;  // told by those who need it
    if (!*read) return;
    take(**read);
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
  return check::look_at(drive, may_use_threads() ? std::launch::async : std::launch::deferred);
}

}  // namespace imuscope
