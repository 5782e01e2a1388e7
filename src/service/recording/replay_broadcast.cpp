#include "service/recording/replay_broadcast.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <utility>

#include "publish/message_values.h"
#include "service/run/health.h"

namespace imuscope {

namespace {

constexpr std::int64_t kTicksPerStatus = 100;

}  // namespace

ReplayBroadcast::ReplayBroadcast(const Configuration& configuration, const Recording& recording,
                                 std::string version)
    : configuration_(configuration),
      recording_(recording),
      version_(std::move(version)),
      broadcast_(configuration) {}

Result<void> ReplayBroadcast::open(const std::string& url) {
  auto bus = LcmPublisher::open(url, configuration_.lcm.channel_prefix);
  if (!bus) return tl::unexpected<Error>(bus.error());
  broadcast_.open(std::move(*bus), configuration_.lcm.bridge);
  return {};
}

void ReplayBroadcast::on_refit(const Refit& refit) {
  ++refits_;
  broadcast_.on_refit(refit);
}

void ReplayBroadcast::on_snapshot(const Snapshot& snapshot) {
  broadcast_.on_snapshot(snapshot);
  if (snapshot.tick % kTicksPerStatus == 0) broadcast_.on_status(status(snapshot));
}

/// What only a running service has (lines, threads, rings, a capture being written) is left out.
status_t ReplayBroadcast::status(const Snapshot& snapshot) const {
  status_t status = status_of(configuration_, version_);
  status.utime = utime_of(snapshot.time_scale.at(snapshot.cut));
  set_time_scale(snapshot.time_scale, status);
  status.state = "running";
  status.reason = fmt::format("a replay of {}", fmt::join(recording_.inputs, ", "));
  status.uptime_s = static_cast<double>(snapshot.tick) / kTickRate_hz;
  status.tick = snapshot.tick;
  status.refits = refits_;
  for (std::size_t i = 0; i < status.devices.size(); ++i) {
    status.devices[i].state = recording_.present[i] ? "replayed" : "absent";
    status.devices[i].rate_hz = kUnknown;
  }
  const auto studies = configuration_.study_indices();
  for (std::size_t i = 0; i < studies.size(); ++i) {
    status.studies.push_back(study_status(configuration_.devices[studies[i]].name, snapshot.studies[i]));
  }
  return status;
}

}  // namespace imuscope
