#include "service/broadcast.h"

#include <utility>

namespace imuscope {

Broadcast::Broadcast(const Configuration& configuration, const UtcAnchor& anchor)
    : configuration_(configuration), study_devices_(configuration.study_indices()), anchor_(anchor) {}

void Broadcast::open(LcmPublisher bus, bool bridge) {
  bus_.emplace(std::move(bus));
  bridge_ = bridge;
}

void Broadcast::set_tap(LcmPublisher::Tap tap) {
  if (bus_) bus_->set_tap(std::move(tap));
}

void Broadcast::on_error(const ErrorRecord& record) {
  if (!bus_) return;
  const auto device = study_devices_[record.study];
  bus_->publish(error_report(record, static_cast<DeviceIndex>(device), anchor_),
                configuration_.devices[device].name);
}

void Broadcast::on_snapshot(const Snapshot& snapshot) {
  if (snapshot.has_utc && !anchored_by_device_) {
    anchor_ = {snapshot.first_reference_time, snapshot.first_reference_utc};
    anchored_by_device_ = true;
  }
  if (!bus_) return;
  if (snapshot.navigation.status == NavigationStatus::kNavigating) {
    bus_->publish(navigation_report(snapshot, anchor_));
    if (bridge_) {
      if (!bridge_origin_) bridge_origin_ = snapshot;
      bus_->publish(bridge_report(snapshot, *bridge_origin_, anchor_));
    }
  }
  if (snapshot.odometry.has_speed) bus_->publish(odometry_report(snapshot, anchor_));
  for (std::size_t i = 0; i < snapshot.n_studies; ++i) {
    const auto state = snapshot.studies[i].status;
    if (state != StudyStatus::kConverging && state != StudyStatus::kCalibrated) continue;
    const auto device = study_devices_[i];
    bus_->publish(calibration_report(snapshot, i, static_cast<DeviceIndex>(device), anchor_),
                  configuration_.devices[device].name);
  }
}

void Broadcast::on_refit(const Refit& refit) {
  if (!bus_) return;
  Refit stamped = refit;
  const auto stamp = [&](auto& report) {
    report.utc = anchor_.at(refit.time);
    report.time_s = to_seconds(refit.time - refit.first_reference_time);
  };
  stamp(stamped.wavelet_variance);
  stamp(stamped.noise_model);
  stamp(stamped.dynamics);
  bus_->publish(stamped.wavelet_variance);
  bus_->publish(stamped.noise_model);
  bus_->publish(stamped.dynamics);
}

void Broadcast::publish(const StatusReport& report) {
  if (bus_) bus_->publish(report);
}

}  // namespace imuscope
