#include "estimation/calibration/smoother.h"

#include <tbb/parallel_pipeline.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <utility>

#include "base/contracts.h"
#include "estimation/calibration/history_record.h"

namespace imuscope {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr auto kNavigation = static_cast<std::size_t>(kNavigationErrorSize);
/// Of the memory, one part in eight is for the smoothed track.
constexpr std::size_t kTrackShare = 8;

/// Doubles of a record of the smoothed track: the state, the sd of every state, the covariance of the
/// attitude.
std::size_t smoothed_doubles(std::size_t states, std::size_t studies) {
  return history::state_doubles(studies) + states + 9;
}

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

/// E-11 and E-12 of one step, which need nothing of the epoch after: the predicted covariance, and A's rows that are not
/// those of a constant. A constant's row is that of the identity.
struct Gain {
  std::vector<Index> moving;
  MatrixXd predicted;
  MatrixXd A;
};

Gain gain_of(const SmootherStep& step) {
  const Index n = step.P.rows();
  Gain gain;
  // P Phi', Phi being dense in the navigation and diagonal beyond.
  MatrixXd P_Phi = step.P;
  P_Phi.leftCols<15>() = step.P.leftCols<15>() * step.transition.transpose();
  P_Phi.rightCols(n - 15) = step.P.rightCols(n - 15) * step.decay.asDiagonal();
  // E-11
  MatrixXd& predicted = gain.predicted;
  predicted = P_Phi;
  predicted.topRows<15>() = step.transition * P_Phi.topRows<15>();
  predicted.bottomRows(n - 15) = step.decay.asDiagonal() * P_Phi.bottomRows(n - 15);
  predicted.topLeftCorner<15, 15>() += step.noise;
  predicted.diagonal().tail(n - 15) += step.decay_noise;
  // E-12
  gain.moving = moving_states(step);
  gain.A = solve_right(predicted, P_Phi(gain.moving, Eigen::all));
  return gain;
}

/// E-13 to E-15.
void smooth_by(const Gain& gain, const SmootherStep& step, VectorXd& d, MatrixXd& P) {
  const auto& [moving, predicted, A] = gain;
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

}  // namespace

void smooth_back(const SmootherStep& step, VectorXd& d, MatrixXd& P) { smooth_by(gain_of(step), step, d, P); }

SmoothedTrack::SmoothedTrack(std::vector<SImuLayout> layouts, std::size_t states, RecordStorage storage)
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
  history::Reader in(record);
  history::take_epoch(in, epoch);
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
    record_.resize(history::history_doubles(states_, layouts_.size()));
    records_.emplace(
        record_.size(),
        RecordStorage{storage_.memory_bytes_max - storage_.memory_bytes_max / kTrackShare, storage_.folder});
  }
  history::pack(epoch, record_);
  if (auto appended = records_->append(record_); !appended) problem_ = appended.error();
}

Result<SmoothedTrack> Smoother::smooth() const {
  if (problem_) return tl::unexpected<Error>(*problem_);
  SmoothedTrack track(layouts_, states_ == 0 ? kNavigation : states_,
                      {storage_.memory_bytes_max / kTrackShare, storage_.folder});
  if (size() == 0) return track;

  // Epoch by epoch through three stages: reading, the gain, and what needs the epoch after. While the last is at work
  // on one, others may be in the first two.
  constexpr std::size_t kInFlight = 4;
  struct Place {
    history::Filtered epoch;
    Gain gain;
  };
  // One more, as an epoch's step is told by the epoch after.
  std::vector<Place> places(kInFlight + 1, Place{history::Filtered(states_, layouts_.size()), {}});
  const auto place_of = [&](std::size_t k) -> Place& { return places[k % places.size()]; };
  const std::size_t newest = size() - 1;
  std::size_t left = size();
  std::vector<double> record(record_.size());
  std::vector<double> smoothed_record(smoothed_doubles(states_, layouts_.size()));
  VectorXd d;
  MatrixXd P;
  // Each is written by one stage alone, which takes one epoch at a time.
  std::optional<Error> unread;
  std::optional<Error> unwritten;
  const auto read = [&](tbb::flow_control& flow) -> std::size_t {
    if (left > 0 && !unread) {
      if (auto got = records_->read(left - 1, record)) {
        --left;
        place_of(left).epoch.unpack(record);
        return left;
      } else {
        unread = got.error();
      }
    }
    flow.stop();
    return 0;
  };
  const auto find_gain = [&](std::size_t k) {
    if (k != newest) place_of(k).gain = gain_of(history::step_from(place_of(k).epoch, place_of(k + 1).epoch));
    return k;
  };
  const auto step_back = [&](std::size_t k) {
    const auto& [now, gain] = place_of(k);
    if (k == newest) {
      history::begin_back(now, d, P);
    } else {
      smooth_by(gain, history::step_from(now, place_of(k + 1).epoch), d, P);
    }
    const SmoothedEpoch smoothed = history::smoothed_epoch(now, d, P, layouts_);
    history::Writer out(smoothed_record);
    history::put_epoch(out, smoothed);
    out.put(smoothed.sd);
    out.put(smoothed.P_phi);
    if (unwritten) return;
    if (auto appended = track.records_.append(smoothed_record); !appended) unwritten = appended.error();
  };
  using tbb::filter_mode;
  tbb::parallel_pipeline(kInFlight,
                         tbb::make_filter<void, std::size_t>(filter_mode::serial_in_order, read) &
                             tbb::make_filter<std::size_t, std::size_t>(filter_mode::parallel, find_gain) &
                             tbb::make_filter<std::size_t, void>(filter_mode::serial_in_order, step_back));
  if (unread) return tl::unexpected<Error>(*unread);
  if (unwritten) return tl::unexpected<Error>(*unwritten);
  return track;
}

}  // namespace imuscope
