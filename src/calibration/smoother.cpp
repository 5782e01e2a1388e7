#include "calibration/smoother.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <bit>
#include <cmath>
#include <utility>

#include "base/contracts.h"

namespace imuscope {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using Matrix15 = Eigen::Matrix<double, 15, 15>;

constexpr std::size_t kNavigation = static_cast<std::size_t>(kNavigationErrorSize);
/// Of the memory, one part in eight is for the smoothed track.
constexpr std::size_t kTrackShare = 8;

/// Fills a record from its beginning.
class Writer {
 public:
  explicit Writer(std::span<double> record) : left_(record) {}
  void put(double value) {
    left_.front() = value;
    left_ = left_.subspan(1);
  }
  template <typename Derived>
  void put(const Eigen::DenseBase<Derived>& values) {
    for (Index j = 0; j < values.cols(); ++j) {
      for (Index i = 0; i < values.rows(); ++i) put(values(i, j));
    }
  }
  void put(std::span<const double> values) {
    for (const double value : values) put(value);
  }

 private:
  std::span<double> left_;
};

/// Reads a record in the order in which it was filled.
class Reader {
 public:
  explicit Reader(std::span<const double> record) : left_(record) {}
  double take() {
    const double value = left_.front();
    left_ = left_.subspan(1);
    return value;
  }
  template <typename Derived>
  void take(Eigen::DenseBase<Derived>& values) {
    for (Index j = 0; j < values.cols(); ++j) {
      for (Index i = 0; i < values.rows(); ++i) values(i, j) = take();
    }
  }

 private:
  std::span<const double> left_;
};

// A state in a record: time, which parts have a meaning, navigation, S-IMUs.
constexpr std::size_t kNavigationDoubles = 3 + 3 + 9 + 3 + 3;
constexpr std::size_t kStudyDoubles = 9 + 3 + 3 + 3 + 1 + 3 + 3;
constexpr std::size_t state_doubles(std::size_t studies) {
  return 2 + kNavigationDoubles + studies * (1 + kStudyDoubles);
}

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

void put_study(Writer& out, const StudyState& state) {
  out.put(state.C_b_s);
  out.put(state.r_bs_b_m);
  out.put(state.gyro_bias_s_radps);
  out.put(state.accel_bias_s_mps2);
  out.put(state.t_d_s);
  out.put(state.gyro_scale);
  out.put(state.accel_scale);
}

void take_study(Reader& in, StudyState& state) {
  in.take(state.C_b_s);
  in.take(state.r_bs_b_m);
  in.take(state.gyro_bias_s_radps);
  in.take(state.accel_bias_s_mps2);
  state.t_d_s = in.take();
  in.take(state.gyro_scale);
  in.take(state.accel_scale);
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

/// @param epoch  with its S-IMUs counted
void take_epoch(Reader& in, SmoothedEpoch& epoch) {
  epoch.time = host_time_from_ns(std::bit_cast<std::int64_t>(in.take()));
  epoch.navigating = in.take() != 0.0;
  take_navigation(in, epoch.navigation);
  for (std::size_t i = 0; i < epoch.studies.size(); ++i) {
    epoch.calibrating[i] = in.take() != 0.0;
    take_study(in, epoch.studies[i]);
  }
}

/// A record of the history: the filtered state, its covariance, and what led to it.
std::size_t history_doubles(std::size_t states, std::size_t studies) {
  return state_doubles(studies) + states * (states + 1) / 2 + 2 * kNavigation * kNavigation +
         2 * (states - kNavigation) + states;
}

/// A record of the smoothed track: the state, the sd of every state, the covariance of the attitude.
std::size_t smoothed_doubles(std::size_t states, std::size_t studies) {
  return state_doubles(studies) + states + 9;
}

/// A record of the history, unpacked.
struct Filtered {
  SmoothedEpoch state;
  MatrixXd P;
  Matrix15 transition;
  Matrix15 noise;
  VectorXd decay;
  VectorXd decay_noise;
  VectorXd injected;

  Filtered(std::size_t states, std::size_t studies)
      : P(static_cast<Index>(states), static_cast<Index>(states)),
        decay(static_cast<Index>(states - kNavigation)),
        decay_noise(static_cast<Index>(states - kNavigation)),
        injected(static_cast<Index>(states)) {
    state.studies.resize(studies);
    state.calibrating.resize(studies);
  }

  void unpack(std::span<const double> record) {
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
};

/// Solves X A = B for symmetric, positive semi-definite A, scaled to unit diagonal first: states differ by
/// ten orders of magnitude, and those without uncertainty stay without.
MatrixXd solve_right(const MatrixXd& A, const MatrixXd& B) {
  VectorXd scale(A.rows());
  for (Index i = 0; i < A.rows(); ++i) scale(i) = A(i, i) > 0.0 ? 1.0 / std::sqrt(A(i, i)) : 0.0;
  MatrixXd scaled = scale.asDiagonal() * A * scale.asDiagonal();
  for (Index i = 0; i < A.rows(); ++i) {
    if (scale(i) == 0.0) scaled(i, i) = 1.0;
  }
  MatrixXd right = scale.asDiagonal() * B.transpose();
  // Blocked and quick; pivoting is for the rare matrix that rounding has left without full rank.
  const Eigen::LLT<MatrixXd> factor(scaled);
  if (factor.info() == Eigen::Success) {
    factor.solveInPlace(right);
  } else {
    right = scaled.ldlt().solve(right).eval();
  }
  return (scale.asDiagonal() * right).transpose();
}

/// States that change by themselves between two epochs, or were set anew.
std::vector<Index> moving_states(const SmootherStep& step) {
  std::vector<Index> moving;
  for (Index i = 0; i < kNavigationErrorSize; ++i) moving.push_back(i);
  for (Index i = 0; i < step.decay.size(); ++i) {
    if (step.decay(i) != 1.0 || step.decay_noise(i) != 0.0) moving.push_back(kNavigationErrorSize + i);
  }
  return moving;
}

}  // namespace

void smooth_back(const SmootherStep& step, VectorXd& d, MatrixXd& P) {
  const Index n = step.P.rows();
  // P Phi', Phi being dense in the navigation and diagonal beyond.
  MatrixXd P_Phi = step.P;
  P_Phi.leftCols<15>() = step.P.leftCols<15>() * step.transition.transpose();
  P_Phi.rightCols(n - 15) = step.P.rightCols(n - 15) * step.decay.asDiagonal();
  // E-11
  MatrixXd predicted = P_Phi;
  predicted.topRows<15>() = step.transition * P_Phi.topRows<15>();
  predicted.bottomRows(n - 15) = step.decay.asDiagonal() * P_Phi.bottomRows(n - 15);
  predicted.topLeftCorner<15, 15>() += step.noise;
  predicted.diagonal().tail(n - 15) += step.decay_noise;

  // E-12, for the rows that are not those of a constant: a constant's row of A is that of the identity.
  const std::vector<Index> moving = moving_states(step);
  const MatrixXd A = solve_right(predicted, P_Phi(moving, Eigen::all));
  // E-13
  const VectorXd d_after = d + step.injected;
  d = d_after;
  d(moving) = A * d_after;
  // E-14, E-15
  const MatrixXd more = P - predicted;
  const MatrixXd A_more = A * more;
  const MatrixXd moving_rows = step.P(moving, Eigen::all) + A_more;
  P(moving, Eigen::all) = moving_rows;
  P(Eigen::all, moving) = moving_rows.transpose();
  const MatrixXd block = step.P(moving, moving) + A_more * A.transpose();
  P(moving, moving) = 0.5 * (block + block.transpose());
}

SmoothedTrack::SmoothedTrack(std::vector<StudyLayout> layouts, std::size_t states, RecordStorage storage)
    : layouts_(std::move(layouts)),
      states_(states),
      records_(smoothed_doubles(states_, layouts_.size()), std::move(storage)) {}

Result<SmoothedEpoch> SmoothedTrack::at(std::size_t index) const {
  IMUSCOPE_EXPECTS(index < size());
  std::vector<double> record(smoothed_doubles(states_, layouts_.size()));
  if (auto read = records_.read(size() - 1 - index, record); !read)
    return tl::unexpected<Error>(read.error());
  SmoothedEpoch epoch;
  epoch.studies.resize(layouts_.size());
  epoch.calibrating.resize(layouts_.size());
  epoch.sd.resize(static_cast<Index>(states_));
  Reader in(record);
  take_epoch(in, epoch);
  in.take(epoch.sd);
  in.take(epoch.P_phi);
  return epoch;
}

Smoother::Smoother(RecordStorage storage) : storage_(std::move(storage)) {}

void Smoother::on_history(const HistoryEpoch& epoch) noexcept {
  if (problem_) return;
  const FilterCore& core = epoch.core;
  if (!records_) {
    for (std::size_t i = 0; i < core.study_count(); ++i) layouts_.push_back(core.layout(i));
    states_ = core.covariance().dimension();
    record_.resize(history_doubles(states_, layouts_.size()));
    records_.emplace(
        record_.size(),
        RecordStorage{storage_.memory_bytes_max - storage_.memory_bytes_max / kTrackShare, storage_.folder});
  }
  Writer out(record_);
  SmoothedEpoch state;
  state.time = epoch.time;
  state.navigating = epoch.navigating;
  state.navigation = core.navigation();
  for (std::size_t i = 0; i < layouts_.size(); ++i) {
    state.studies.push_back(core.study(i));
    state.calibrating.push_back(epoch.calibrating[i]);
  }
  put_epoch(out, state);
  for (std::size_t i = 0; i < states_; ++i) {
    for (std::size_t j = 0; j <= i; ++j) out.put(core.covariance()(i, j));
  }
  out.put(epoch.since.transition);
  out.put(epoch.since.noise);
  out.put(epoch.since.decay);
  out.put(epoch.since.decay_noise);
  out.put(epoch.since.injected);
  if (auto appended = records_->append(record_); !appended) problem_ = appended.error();
}

Result<SmoothedTrack> Smoother::smooth() const {
  if (problem_) return tl::unexpected<Error>(*problem_);
  SmoothedTrack track(layouts_, states_ == 0 ? kNavigation : states_,
                      {storage_.memory_bytes_max / kTrackShare, storage_.folder});
  if (size() == 0) return track;

  Filtered now(states_, layouts_.size());
  Filtered after(states_, layouts_.size());
  std::vector<double> record(record_.size());
  std::vector<double> smoothed_record(smoothed_doubles(states_, layouts_.size()));
  VectorXd d = VectorXd::Zero(static_cast<Index>(states_));
  MatrixXd P;
  for (std::size_t k = size(); k-- > 0;) {
    if (auto read = records_->read(k, record); !read) return tl::unexpected<Error>(read.error());
    now.unpack(record);
    if (k + 1 == size()) {
      P = now.P;
    } else {
      smooth_back({now.P, after.transition, after.noise, after.decay, after.decay_noise, after.injected}, d,
                  P);
    }
    SmoothedEpoch smoothed = now.state;
    NavigationErrorVector navigation_error = d.head<kNavigationErrorSize>();
    // Without navigation the R biases alone have a meaning.
    if (!smoothed.navigating) navigation_error.head<kNavigationKinematicSize>().setZero();
    inject(smoothed.navigation, navigation_error);
    for (std::size_t i = 0; i < layouts_.size(); ++i)
      inject(smoothed.studies[i], layouts_[i], {d.data(), states_});
    Writer out(smoothed_record);
    put_epoch(out, smoothed);
    out.put(P.diagonal().cwiseMax(0.0).cwiseSqrt().eval());
    out.put(P.block<3, 3>(kAttitudeError, kAttitudeError));
    if (auto appended = track.records_.append(smoothed_record); !appended)
      return tl::unexpected<Error>(appended.error());
    std::swap(now, after);
  }
  return track;
}

}  // namespace imuscope
