#include "service/recorded_look.h"

#include <optional>

#include "check/check.h"
#include "service/device_factory.h"

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

}  // namespace

std::vector<check::Finding> look_at_recording(const Configuration& configuration, const Recording& recording,
                                              const std::vector<bool>& has_own_clock, double longest_s) {
  check::Drive drive(configuration, longest_s);
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
    Gatherer gatherer(drive, shift);
    decode(configuration, recording, i, gatherer, [&] { return drive.is_full(i); });
  }
  return check::look_at(drive);
}

}  // namespace imuscope
