#include "service/run/live_smoothing.h"

#include <fmt/format.h>

#include "base/text.h"
#include "estimation/calibration/filter_core.h"
#include "estimation/calibration/navigation_output.h"
#include "estimation/navigation/so3.h"

namespace imuscope {

void LiveHistory::on_history(const HistoryEpoch& epoch) noexcept {
  const std::size_t size =
      history::history_doubles(epoch.core.covariance().dimension(), epoch.core.study_count());
  if (size > HistoryRecord::kDoubles) return;
  scratch_->size = size;
  history::pack(epoch, {scratch_->values.data(), size});
  scratch_->continues = !refused_;
  refused_ = !ring_->try_push(*scratch_);
}

LiveSmoothing::LiveSmoothing(LiveHistory& history, const std::vector<std::uint32_t>& blocks)
    : history_(history) {
  std::size_t first = kNavigationStates;
  for (const std::uint32_t of_study : blocks) {
    layouts_.push_back(SImuLayout::make(of_study, first));
    first += layouts_.back().size;
  }
}

Result<void> LiveSmoothing::open(const OutputFolder& folder, std::vector<SImuFileInfo> infos) {
  infos_ = std::move(infos);
  studies_.resize(infos_.size());
  auto opened = navigation_.open(folder, "smoothed_navigation.csv", navigation_csv_header());
  for (std::size_t i = 0; i < infos_.size() && opened; ++i)
    opened = studies_[i].open(folder, device_file_name("smoothed", infos_[i].name, ".csv"),
                              calibration_csv_header());
  return opened;
}

void LiveSmoothing::drain(const Snapshot& last, const UtcTrack& utc) {
  while (const HistoryRecord* record = history_.ring().front()) {
    // Across a hole there is no transition: what the window holds is given up.
    if (!record->continues) smoother_.reset();
    if (!smoother_) {
      // The record's size tells how many states there are beyond those of the S-IMUs.
      std::size_t states = kNavigationStates;
      while (history::history_doubles(states, layouts_.size()) < record->size) ++states;
      smoother_.emplace(layouts_, states);
    }
    smoother_->add({record->values.data(), record->size},
                   [&](const SmoothedEpoch& epoch) { write(epoch, last, utc); });
    history_.ring().pop();
  }
}

void LiveSmoothing::write(const SmoothedEpoch& epoch, const Snapshot& last, const UtcTrack& utc) {
  if (!last.has_reference) return;
  const double time_s = to_seconds(epoch.time - last.first_reference_time);
  if (epoch.navigating) {
    NavigationOutput shown;
    write_state(epoch.navigation, {epoch.sd.data(), kNavigationStates}, epoch.P_phi, shown);
    navigation_.append(navigation_csv_row(shown, {time_s, utc.at(epoch.time)}));
  }
  for (std::size_t i = 0; i < studies_.size(); ++i) {
    if (!epoch.calibrating[i]) continue;
    const SImuOutput shown = smoothed_output(last.studies[i], epoch, i, layouts_[i]);
    studies_[i].append(
        calibration_csv_row(shown, infos_[i], {time_s, utc.at(epoch.time + from_seconds(shown.t_d_s))}));
  }
}

Result<void> LiveSmoothing::close() {
  auto result = navigation_.close();
  for (auto& file : studies_) {
    auto closed = file.close();
    if (result && !closed) result = closed;
  }
  return result;
}

SImuOutput smoothed_output(const SImuOutput& base, const SmoothedEpoch& epoch, std::size_t index,
                           const SImuLayout& layout) {
  SImuOutput out = base;
  const SImuState& state = epoch.studies[index];
  out.time = epoch.time;
  out.C_b_s = to_array(state.C_b_s);
  out.psi_rad = to_array(Eigen::Vector3d(-log_so3(to_eigen(out.C_prior).transpose() * state.C_b_s)));
  out.r_bs_b_m = to_array(state.r_bs_b_m);
  out.t_d_s = state.t_d_s;
  out.gyro_bias_radps = to_array(state.gyro_bias_s_radps);
  out.accel_bias_mps2 = to_array(state.accel_bias_s_mps2);
  out.gyro_scale = to_array(state.gyro_scale);
  out.accel_scale = to_array(state.accel_scale);
  const auto take_sd = [&epoch](std::size_t first, Vector3& sd) {
    if (first == SImuLayout::kAbsent) return;
    for (std::size_t i = 0; i < sd.size(); ++i) sd[i] = epoch.sd(static_cast<Eigen::Index>(first + i));
  };
  take_sd(layout.psi, out.sd_psi_rad);
  take_sd(layout.r, out.sd_r_bs_b_m);
  take_sd(layout.gyro_bias, out.sd_gyro_bias_radps);
  take_sd(layout.accel_bias, out.sd_accel_bias_mps2);
  take_sd(layout.gyro_scale, out.sd_gyro_scale);
  take_sd(layout.accel_scale, out.sd_accel_scale);
  if (layout.t_d != SImuLayout::kAbsent) out.sd_t_d_s = epoch.sd(static_cast<Eigen::Index>(layout.t_d));
  return out;
}

}  // namespace imuscope
