#include "study/smoothing.h"

#include <fmt/format.h>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>

#include "base/contracts.h"
#include "base/text.h"
#include "base/units.h"
#include "estimation/calibration/combine.h"
#include "estimation/calibration/filter_core.h"
#include "estimation/calibration/navigation_output.h"
#include "estimation/navigation/so3.h"
#include "service/recording/side_by_side.h"
#include "service/run/live_smoothing.h"

namespace imuscope {

namespace {

using Eigen::Vector3d;

/// The history is all that this pass is for.
class NoSink final : public CoreSink {
 public:
  void on_error(const ErrorRecord&) noexcept override {}
  void on_event(const EstimatorEvent&) noexcept override {}
  void on_snapshot(const Snapshot&) noexcept override {}
  void on_late_sample(const LateSample&) noexcept override {}
};

Vector3 interpolated(const Vector3& a, const Vector3& b, double share) {
  Vector3 out{};
  for (std::size_t i = 0; i < out.size(); ++i) out[i] = a[i] + share * (b[i] - a[i]);
  return out;
}

/// Priors stay as wide as they were; only where the filter is linearised changes.
EstimatorConfig relinearised(EstimatorConfig config, const std::vector<SImuOutput>& finals,
                             const FormerMountings& former) {
  for (std::size_t i = 0; i < config.studies.size(); ++i) {
    const SImuOutput& at_start = former[i].empty() ? finals[i] : former[i].front().estimate;
    if (!has_estimate(at_start.status)) continue;
    SImuConfig& study = config.studies[i];
    // Linearised about the answer, what crooked axes add is below the noise of what is smoothed.
    study.blocks &= ~kSensorSImuBlocks;
    study.prior_C_b_s = at_start.C_b_s;
    study.prior_r_bs_b_m = at_start.r_bs_b_m;
    study.prior_t_d_s = at_start.t_d_s;
  }
  return config;
}

/// The end values, with the biases of one smoothed epoch.
SImuOutput with_smoothed_biases(SImuOutput study, const SmoothedEpoch& epoch, std::size_t index,
                                const SImuLayout& layout) {
  study.time = epoch.time;
  study.gyro_bias_radps = to_array(epoch.studies[index].gyro_bias_s_radps);
  study.accel_bias_mps2 = to_array(epoch.studies[index].accel_bias_s_mps2);
  const auto take_sd = [&](std::size_t first, Vector3& sd) {
    if (first == SImuLayout::kAbsent) return;
    for (std::size_t i = 0; i < sd.size(); ++i) sd[i] = epoch.sd(static_cast<Eigen::Index>(first + i));
  };
  take_sd(layout.gyro_bias, study.sd_gyro_bias_radps);
  take_sd(layout.accel_bias, study.sd_accel_bias_mps2);
  return study;
}

/// The former mounting at a time; null where it was the final one already.
const FormerMounting* in_force(const std::vector<FormerMounting>& former, HostTime time) noexcept {
  const auto found = std::find_if(former.begin(), former.end(),
                                  [time](const FormerMounting& mounting) { return time <= mounting.until; });
  return found == former.end() ? nullptr : &*found;
}

/// Means of (psi, r) of one S-IMU; psi relative to its end value.
class MountingMean {
 public:
  void add(const SmoothedEpoch& epoch, std::size_t study, const SImuLayout& layout, const SImuOutput& final) {
    const SImuState& state = epoch.studies[study];
    const Vector3d psi = -log_so3(to_eigen(final.C_b_s).transpose() * state.C_b_s);
    for (std::size_t i = 0; i < 3; ++i) {
      const auto k = static_cast<Eigen::Index>(i);
      add_one(means_[i], psi(k), layout.psi, i, epoch.sd);
      add_one(means_[i + 3], state.r_bs_b_m(k), layout.r, i, epoch.sd);
    }
    ++n_;
  }

  [[nodiscard]] nlohmann::json json(const SImuOutput& final) const {
    if (n_ == 0) return nullptr;
    Vector3d psi = Vector3d::Zero();
    std::array<double, 3> r{};
    std::array<double, 3> psi_sd_deg{};
    std::array<double, 3> r_sd{};
    for (std::size_t i = 0; i < 3; ++i) {
      psi(static_cast<Eigen::Index>(i)) = means_[i].mean();
      psi_sd_deg[i] = means_[i].claimed_sd() * kDegPerRad;
      r[i] = means_[i + 3].mean();
      r_sd[i] = means_[i + 3].claimed_sd();
    }
    return {
        {"C_b_s", to_array(Eigen::Matrix3d(to_eigen(final.C_b_s) * exp_so3(-psi)))},
        {"claimed_boresight_sd_deg", psi_sd_deg},
        {"r_bs_b_m", r},
        {"claimed_r_bs_b_sd_m", r_sd},
        {"n", n_},
        {"note",
         "the paper's mean of the smoothed values weighted by 1/sd^2; its sd takes values that are one and "
         "the same for independent ones, and is too small"}};
  }

 private:
  static void add_one(WeightedMean& mean, double value, std::size_t first, std::size_t i,
                      const Eigen::VectorXd& sd) {
    if (first == SImuLayout::kAbsent) return;
    const double sd_i = sd(static_cast<Eigen::Index>(first + i));
    if (sd_i > 0.0) mean.add(value, sd_i);
  }

  std::array<WeightedMean, 6> means_;
  std::size_t n_ = 0;
};

}  // namespace

Result<ReferenceBiasTrack> ReferenceBiasTrack::of(const SmoothedTrack& track) {
  ReferenceBiasTrack biases;
  for (std::size_t k = 0; k < track.size(); ++k) {
    const auto epoch = track.at(k);
    if (!epoch) return tl::unexpected<Error>(epoch.error());
    biases.times_.push_back(epoch->time);
    biases.biases_.push_back(
        {to_array(epoch->navigation.gyro_bias_b_radps), to_array(epoch->navigation.accel_bias_b_mps2)});
  }
  return biases;
}

ReferenceBias ReferenceBiasTrack::at(HostTime time) const noexcept {
  IMUSCOPE_EXPECTS(!empty());
  const auto after = std::upper_bound(times_.begin(), times_.end(), time);
  if (after == times_.begin()) return biases_.front();
  if (after == times_.end()) return biases_.back();
  const auto k = static_cast<std::size_t>(after - times_.begin());
  const double share = to_seconds(time - times_[k - 1]) / to_seconds(times_[k] - times_[k - 1]);
  return {interpolated(biases_[k - 1].gyro_radps, biases_[k].gyro_radps, share),
          interpolated(biases_[k - 1].accel_mps2, biases_[k].accel_mps2, share)};
}

bool is_final_mounting(const std::vector<FormerMounting>& former, HostTime time) noexcept {
  return in_force(former, time) == nullptr;
}

Result<SmoothedTrack> smooth_drive(const Configuration& configuration, const EstimatorConfig& estimator,
                                   const Recording& recording, const std::vector<SImuOutput>& finals,
                                   const FormerMountings& former, Smoother& history,
                                   const std::function<void(double)>& progress,
                                   const std::atomic<bool>* is_given_up) {
  NoSink sink;
  ReplayOptions options;
  options.history = &history;
  options.progress = progress;
  options.reading = reading_by_threads();
  options.is_given_up = is_given_up;
  const auto replayed =
      replay(configuration, relinearised(estimator, finals, former), recording, sink, options);
  if (!replayed) return tl::unexpected<Error>(replayed.error());
  return history.smooth(may_use_threads());
}

Result<void> write_smoothed(const SmoothedTrack& track, const Snapshot& last, const UtcTrack& utc,
                            const FormerMountings& former, const std::vector<SImuFileInfo>& infos,
                            const OutputFolder& folder) {
  CsvFile navigation;
  if (auto opened = navigation.open(folder, "smoothed_navigation.csv", navigation_csv_header()); !opened)
    return opened;
  std::vector<CsvFile> files(infos.size());
  for (std::size_t i = 0; i < infos.size(); ++i) {
    auto opened =
        files[i].open(folder, device_file_name("smoothed", infos[i].name, ".csv"), calibration_csv_header());
    if (!opened) return opened;
  }
  for (std::size_t k = 0; k < track.size(); ++k) {
    const auto epoch = track.at(k);
    if (!epoch) return tl::unexpected<Error>(epoch.error());
    const double time_s = to_seconds(epoch->time - last.first_reference_time);
    if (epoch->navigating) {
      NavigationOutput shown;
      const auto sd = static_cast<std::size_t>(kNavigationErrorSize);
      write_state(epoch->navigation, {epoch->sd.data(), sd}, epoch->P_phi, shown);
      navigation.append(navigation_csv_row(shown, {time_s, utc.at(epoch->time)}));
    }
    for (std::size_t i = 0; i < files.size(); ++i) {
      if (!epoch->calibrating[i]) continue;
      SImuOutput shown;
      if (const FormerMounting* then = in_force(former[i], epoch->time)) {
        shown = smoothed_output(then->estimate, *epoch, i, track.layout(i));
      } else {
        if (!has_estimate(last.studies[i].status)) continue;
        shown = with_smoothed_biases(last.studies[i], *epoch, i, track.layout(i));
      }
      files[i].append(
          calibration_csv_row(shown, infos[i], {time_s, utc.at(epoch->time + from_seconds(shown.t_d_s))}));
    }
  }
  auto result = navigation.close();
  for (auto& file : files) {
    auto closed = file.close();
    if (result && !closed) result = closed;
  }
  return result;
}

Result<std::vector<nlohmann::json>> weighted_means(const SmoothedTrack& track,
                                                   const std::vector<SImuOutput>& finals,
                                                   const FormerMountings& former) {
  std::vector<MountingMean> means(finals.size());
  for (std::size_t k = 0; k < track.size(); ++k) {
    const auto epoch = track.at(k);
    if (!epoch) return tl::unexpected<Error>(epoch.error());
    for (std::size_t i = 0; i < finals.size(); ++i) {
      if (epoch->calibrating[i] && is_final_mounting(former[i], epoch->time))
        means[i].add(*epoch, i, track.layout(i), finals[i]);
    }
  }
  std::vector<nlohmann::json> documents;
  for (std::size_t i = 0; i < finals.size(); ++i) documents.push_back(means[i].json(finals[i]));
  return documents;
}

}  // namespace imuscope
