#include "estimation/calibration/history_record.h"

#include <algorithm>
#include <bit>
#include <cstdint>

namespace imuscope::history {
namespace {

using Eigen::Index;

constexpr auto kNavigation = static_cast<std::size_t>(kNavigationErrorSize);
constexpr std::size_t kNavigationDoubles = 3 + 3 + 9 + 3 + 3;
constexpr std::size_t kStudyDoubles = 9 + 3 + 3 + 3 + 1 + 3 + 3;

void put_navigation(Writer& out, const NavigationState& state) {
  out.put(state.position.latitude_rad);
  out.put(state.position.longitude_rad);
  out.put(state.position.height_m);
  out.put(state.v_n_mps);
  out.put(state.C_b_n);
  out.put(state.gyro_bias_b_radps);
  out.put(state.accel_bias_b_mps2);
}

void take_navigation(Reader& in, NavigationState& state) {
  state.position.latitude_rad = in.take();
  state.position.longitude_rad = in.take();
  state.position.height_m = in.take();
  in.take(state.v_n_mps);
  in.take(state.C_b_n);
  in.take(state.gyro_bias_b_radps);
  in.take(state.accel_bias_b_mps2);
}

void put_study(Writer& out, const SImuState& state) {
  out.put(state.C_b_s);
  out.put(state.r_bs_b_m);
  out.put(state.gyro_bias_s_radps);
  out.put(state.accel_bias_s_mps2);
  out.put(state.t_d_s);
  out.put(state.gyro_scale);
  out.put(state.accel_scale);
}

void take_study(Reader& in, SImuState& state) {
  in.take(state.C_b_s);
  in.take(state.r_bs_b_m);
  in.take(state.gyro_bias_s_radps);
  in.take(state.accel_bias_s_mps2);
  state.t_d_s = in.take();
  in.take(state.gyro_scale);
  in.take(state.accel_scale);
}

}  // namespace

std::size_t state_doubles(std::size_t studies) noexcept {
  return 2 + kNavigationDoubles + studies * (1 + kStudyDoubles);
}

void put_epoch(Writer& out, const SmoothedEpoch& epoch) {
  out.put(std::bit_cast<double>(to_ns(epoch.time)));
  out.put(epoch.navigating ? 1.0 : 0.0);
  put_navigation(out, epoch.navigation);
  for (std::size_t i = 0; i < epoch.studies.size(); ++i) {
    out.put(epoch.calibrating[i] ? 1.0 : 0.0);
    put_study(out, epoch.studies[i]);
  }
}

void take_epoch(Reader& in, SmoothedEpoch& epoch) {
  epoch.time = host_time_from_ns(std::bit_cast<std::int64_t>(in.take()));
  epoch.navigating = in.take() != 0.0;
  take_navigation(in, epoch.navigation);
  for (std::size_t i = 0; i < epoch.studies.size(); ++i) {
    epoch.calibrating[i] = in.take() != 0.0;
    take_study(in, epoch.studies[i]);
  }
}

std::size_t history_doubles(std::size_t states, std::size_t studies) noexcept {
  return state_doubles(studies) + states * (states + 1) / 2 + 2 * kNavigation * kNavigation +
         2 * (states - kNavigation) + states;
}

void pack(const HistoryEpoch& epoch, std::span<double> record) noexcept {
  const FilterCore& core = epoch.core;
  Writer out(record);
  out.put(std::bit_cast<double>(to_ns(epoch.time)));
  out.put(epoch.navigating ? 1.0 : 0.0);
  put_navigation(out, core.navigation());
  for (std::size_t i = 0; i < core.study_count(); ++i) {
    out.put(epoch.calibrating[i] ? 1.0 : 0.0);
    put_study(out, core.study(i));
  }
  for (std::size_t i = 0; i < core.covariance().dimension(); ++i) {
    for (std::size_t j = 0; j <= i; ++j) out.put(core.covariance()(i, j));
  }
  out.put(epoch.since.transition);
  out.put(epoch.since.noise);
  out.put(epoch.since.decay);
  out.put(epoch.since.decay_noise);
  out.put(epoch.since.injected);
}

Filtered::Filtered(std::size_t states, std::size_t studies)
    : P(static_cast<Index>(states), static_cast<Index>(states)),
      decay(static_cast<Index>(states - kNavigation)),
      decay_noise(static_cast<Index>(states - kNavigation)),
      injected(static_cast<Index>(states)) {
  state.studies.resize(studies);
  state.calibrating.resize(studies);
}

void Filtered::unpack(std::span<const double> record) {
  Reader in(record);
  take_epoch(in, state);
  for (Index i = 0; i < P.rows(); ++i) {
    for (Index j = 0; j <= i; ++j) P(i, j) = P(j, i) = in.take();
  }
  in.take(transition);
  in.take(noise);
  in.take(decay);
  in.take(decay_noise);
  in.take(injected);
}

void begin_back(const Filtered& newest, Eigen::VectorXd& d, Eigen::MatrixXd& P) {
  d = Eigen::VectorXd::Zero(newest.P.rows());
  P = newest.P;
}

SmoothedEpoch smoothed_epoch(const Filtered& now, const Eigen::VectorXd& d, const Eigen::MatrixXd& P,
                             std::span<const SImuLayout> layouts) {
  SmoothedEpoch smoothed = now.state;
  NavigationErrorVector navigation_error = d.head<kNavigationErrorSize>();
  // Without navigation the R biases alone have a meaning.
  if (!smoothed.navigating) navigation_error.head<kNavigationKinematicSize>().setZero();
  inject(smoothed.navigation, navigation_error);
  for (std::size_t i = 0; i < layouts.size(); ++i)
    inject(smoothed.studies[i], layouts[i], {d.data(), static_cast<std::size_t>(d.size())});
  smoothed.sd = P.diagonal().cwiseMax(0.0).cwiseSqrt();
  smoothed.P_phi = P.block<3, 3>(kAttitudeError, kAttitudeError);
  return smoothed;
}

}  // namespace imuscope::history
