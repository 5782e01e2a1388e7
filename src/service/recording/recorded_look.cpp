#include "service/recording/recorded_look.h"

#include <optional>
#include <utility>
#include <vector>

#include "check/check.h"
#include "service/pipeline/device_factory.h"
#include "service/recording/decoded_lines.h"
#include "service/recording/decoded_reads.h"
#include "service/recording/side_by_side.h"

namespace imuscope {

namespace {

/// UTC minus the device's own time; a tag stands in the first minutes or nowhere.
std::optional<Duration> utc_of(const Configuration& configuration, const Recording& recording,
                               std::size_t device) {
  constexpr int kReadsMax = 4096;
  const auto index = static_cast<DeviceIndex>(device);
  auto source = recording.open(index);
  if (!source) return std::nullopt;
  DecodedReads reads(std::move(*source),
                     make_decoder(configuration.devices[device], index, recording.clocks[device].map), false);
  for (int n = 0; n < kReadsMax; ++n) {
    const auto read = reads.next();
    if (!read || !*read) return std::nullopt;
    for (const Sample& sample : (*read)->samples) {
      if (sample.has_utc) return Duration{to_ns(sample.utc) - to_ns(sample.time)};
    }
  }
  return std::nullopt;
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
