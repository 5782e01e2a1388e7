#include "service/run/broadcast.h"

#include <utility>

#include "service/run/health.h"

namespace imuscope {

Broadcast::Broadcast(const Configuration& configuration)
    : configuration_(configuration), study_devices_(configuration.study_indices()) {
  for (const auto index : study_devices_) errors_.emplace_back(configuration.devices[index].name);
  if (!configuration.virtual_imu.empty()) virtual_imu_.emplace(configuration);
}

void Broadcast::open(LcmPublisher bus, bool bridge) {
  bus_.emplace(std::move(bus));
  bridge_ = bridge;
}

void Broadcast::set_tap(LcmPublisher::Tap tap) {
  if (bus_) bus_->set_tap(std::move(tap));
}

void Broadcast::send(std::optional<error_t> rows) {
  if (!rows) return;
  const std::string name = rows->name;
  bus_->publish(std::move(*rows), "ERROR", name);
}

void Broadcast::send(std::optional<virtual_imu_t> rows) {
  if (rows) bus_->publish(std::move(*rows), "VIRTUAL");
}

void Broadcast::on_error(const ErrorRecord& record) {
  if (!bus_) return;
  send(errors_[record.study].add(record));
  if (!virtual_imu_) return;
  for (auto& rows : virtual_imu_->add(record)) send(std::move(rows));
}

void Broadcast::finish() {
  if (!bus_) return;
  for (auto& rows : errors_) send(rows.take());
  if (virtual_imu_) send(virtual_imu_->take());
}

void Broadcast::on_snapshot(const Snapshot& snapshot) {
  scale_ = snapshot.time_scale;
  if (!bus_) return;
  if (snapshot.has_reference) {
    const double time_s = to_seconds(snapshot.cut - snapshot.first_reference_time);
    for (auto& rows : errors_) send(rows.take_old(time_s));
    if (virtual_imu_) send(virtual_imu_->take_old(time_s));
  }
  if (snapshot.has_new_navigation) {
    bus_->publish(navigation_message(snapshot), "NAVIGATION");
    if (bridge_) {
      if (!bridge_origin_) bridge_origin_ = snapshot;
      bus_->publish(pose_message(snapshot, *bridge_origin_), "POSE");
      bus_->publish(ins_message(snapshot, *bridge_origin_), "INS");
    }
  }
  if (snapshot.odometry.has_speed) bus_->publish(odometry_message(snapshot), "ODOMETRY");
  for (std::size_t i = 0; i < snapshot.n_studies; ++i) {
    if (!snapshot.has_new_study[i]) continue;
    const std::string& name = configuration_.devices[study_devices_[i]].name;
    bus_->publish(calibration_message(snapshot, i, name), "CALIBRATION", name);
  }
}

void Broadcast::on_refit(const Refit& refit) {
  if (!bus_) return;
  bus_->publish(wavelet_variance_message(refit), "WV", refit.name);
  bus_->publish(noise_model_message(refit), "NOISE_MODEL", refit.name);
  bus_->publish(dynamics_message(refit), "DYNAMICS", refit.name);
}

void Broadcast::on_pc_clock(const PcClockLog::News& news, UtcTime utc) {
  if (bus_) bus_->publish(pc_clock_message(news, utc), "PC_CLOCK");
}

void Broadcast::on_status(status_t status) {
  if (!bus_) return;
  count_elements(status);
  bus_->publish(std::move(status), "STATUS");
}

}  // namespace imuscope
