#include "service/replay_broadcast.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <utility>

#include "rt/host_clock.h"
#include "service/estimator_setup.h"
#include "service/health.h"

namespace imuscope {

namespace {

constexpr std::int64_t kTicksPerStatus = 100;

}  // namespace

ReplayBroadcast::ReplayBroadcast(const Configuration& configuration, const Recording& recording,
                                 std::string version)
    : configuration_(configuration),
      recording_(recording),
      version_(std::move(version)),
      estimator_(estimator_config(configuration)),
      broadcast_(configuration, {host_now(), wall_clock_now()}) {}

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
  if (snapshot.tick % kTicksPerStatus == 0) broadcast_.publish(status(snapshot));
}

/// What only a running service has (lines, threads, rings, a capture being written) is left out.
StatusReport ReplayBroadcast::status(const Snapshot& snapshot) const {
  StatusReport report;
  report.utc = broadcast_.anchor().at(snapshot.cut);
  report.run = configuration_.run_name;
  report.version = version_;
  report.build = fmt::format("g++ {}", __VERSION__);
  report.configuration_hash = configuration_.sha256;
  report.state = "running";
  report.reason = fmt::format("a replay of {}", fmt::join(recording_.inputs, ", "));
  report.uptime_s = static_cast<double>(snapshot.tick) / kTickRate_hz;
  report.tick = snapshot.tick;
  report.refits = refits_;
  for (std::size_t i = 0; i < configuration_.devices.size(); ++i) {
    const auto& device = configuration_.devices[i];
    StatusReport::Device replayed;
    replayed.name = device.name;
    replayed.role = name_of(device.role);
    replayed.protocol = name_of(device.protocol);
    replayed.state = recording_.present[i] ? "replayed" : "absent";
    replayed.rate_hz = kUnknown;
    report.devices.push_back(std::move(replayed));
  }
  const auto studies = configuration_.study_indices();
  for (std::size_t i = 0; i < studies.size(); ++i) {
    report.studies.push_back(
        study_status(configuration_.devices[studies[i]].name, snapshot.studies[i], estimator_.studies[i]));
  }
  return report;
}

}  // namespace imuscope
