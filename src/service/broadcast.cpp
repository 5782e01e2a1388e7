#include "service/broadcast.h"

#include <utility>

#include "service/health.h"

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
  const std::string& name = configuration_.devices[study_devices_[record.study]].name;
  bus_->publish(error_message(record, name, anchor_), "ERROR", name);
}

void Broadcast::on_snapshot(const Snapshot& snapshot) {
  if (snapshot.has_utc && !anchored_by_device_) {
    anchor_ = {snapshot.first_reference_time, snapshot.first_reference_utc};
    anchored_by_device_ = true;
  }
  if (!bus_) return;
  if (snapshot.has_new_navigation) {
    bus_->publish(navigation_message(snapshot, anchor_), "NAVIGATION");
    if (bridge_) {
      if (!bridge_origin_) bridge_origin_ = snapshot;
      bus_->publish(pose_message(snapshot, *bridge_origin_, anchor_), "POSE");
      bus_->publish(ins_message(snapshot, *bridge_origin_, anchor_), "INS");
    }
  }
  if (snapshot.odometry.has_speed) bus_->publish(odometry_message(snapshot, anchor_), "ODOMETRY");
  for (std::size_t i = 0; i < snapshot.n_studies; ++i) {
    if (!has_estimate(snapshot.studies[i].status)) continue;
    const std::string& name = configuration_.devices[study_devices_[i]].name;
    bus_->publish(calibration_message(snapshot, i, name, anchor_), "CALIBRATION", name);
  }
}

void Broadcast::on_refit(const Refit& refit) {
  if (!bus_) return;
  bus_->publish(wavelet_variance_message(refit, anchor_), "WV", refit.name);
  bus_->publish(noise_model_message(refit, anchor_), "NOISE_MODEL", refit.name);
  bus_->publish(dynamics_message(refit, anchor_), "DYNAMICS", refit.name);
}

void Broadcast::on_status(status_t status) {
  if (!bus_) return;
  count_elements(status);
  bus_->publish(std::move(status), "STATUS");
}

}  // namespace imuscope
