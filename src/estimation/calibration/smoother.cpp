#include "estimation/calibration/smoother.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <condition_variable>
#include <future>
#include <mutex>
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

/// E-11 and E-12 of one step, which need nothing that is smoothed: the predicted covariance, and A's rows that are not
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

/// Epochs of the history with their gains, the newest first, made when they are asked for or ahead of that. A gain takes
/// longer than what is done with it: two threads make them, each the next that nobody makes.
class WayBack {
 public:
  struct Epoch {
    history::Filtered filtered;
    Gain gain;  ///< from the epoch after; empty of the newest
    std::optional<Error> problem{};
    std::optional<std::size_t> made{};  ///< which it is, once it is made
  };

  /// @param record_size  doubles of a record
  /// @param ahead        by threads of their own
  WayBack(const RecordStore& records, std::size_t record_size, const history::Filtered& empty, bool ahead)
      : records_(records),
        record_(record_size),
        // The one that is worked on, the one after it, and those that are made ahead.
        epochs_(2 + kAhead, Epoch{empty, {}, {}, {}}),
        left_(records.size()) {
    for (std::size_t i = 0; ahead && i < kMakers; ++i)
      makers_.push_back(std::async(std::launch::async, [this] { make_all(); }));
  }
  ~WayBack() {
    {
      const std::lock_guard lock(mutex_);
      left_ = 0;
    }
    changed_.notify_all();
  }
  WayBack(const WayBack&) = delete;
  WayBack& operator=(const WayBack&) = delete;

  /// Epoch k, which has to be the next; it and the one after stay until the next is asked for.
  Result<void> wait_for(std::size_t k) {
    if (makers_.empty()) {
      if (take(k)) make(k);
    } else {
      std::unique_lock lock(mutex_);
      asked_for_ = k;
      changed_.notify_all();
      changed_.wait(lock, [&] { return at(k).made == k; });
    }
    if (at(k).problem) return tl::unexpected<Error>(*at(k).problem);
    return {};
  }
  [[nodiscard]] const Epoch& at(std::size_t k) const { return epochs_[k % epochs_.size()]; }
  [[nodiscard]] SmootherStep step_to(std::size_t k) const {
    return history::step_from(at(k).filtered, at(k + 1).filtered);
  }

 private:
  static constexpr std::size_t kMakers = 2;
  static constexpr std::size_t kAhead = 6;

  Epoch& epoch(std::size_t k) { return epochs_[k % epochs_.size()]; }
  /// The epoch as it was filtered; false where it cannot be read.
  bool take(std::size_t k) {
    Epoch& of = epoch(k);
    if (auto read = records_.read(k, record_); !read) {
      of.problem = read.error();
      return false;
    }
    of.filtered.unpack(record_);
    return true;
  }
  void make(std::size_t k) {
    if (k + 1 < records_.size()) epoch(k).gain = gain_of(step_to(k));
  }
  void make_all() {
    std::unique_lock lock(mutex_);
    while (true) {
      // The next one's place in the ring holds the epoch epochs_.size() later, until that is no longer needed.
      changed_.wait(lock, [this] { return left_ == 0 || left_ + kAhead > asked_for_; });
      if (left_ == 0) return;
      const std::size_t k = --left_;
      // In order, one after the other: the gain of an epoch needs the one after as it was filtered.
      const bool is_read = take(k);
      if (!is_read) left_ = 0;
      lock.unlock();
      if (is_read) make(k);
      lock.lock();
      epoch(k).made = k;
      changed_.notify_all();
    }
  }

  const RecordStore& records_;
  std::vector<double> record_;
  std::vector<Epoch> epochs_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::size_t left_;                         ///< epochs that nobody makes yet, the oldest ones
  std::size_t asked_for_ = records_.size();  ///< the epoch that was last asked for
  std::vector<std::future<void>> makers_;    ///< end before all that they use
};

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

Result<SmoothedTrack> Smoother::smooth(bool ahead) const {
  if (problem_) return tl::unexpected<Error>(*problem_);
  SmoothedTrack track(layouts_, states_ == 0 ? kNavigation : states_,
                      {storage_.memory_bytes_max / kTrackShare, storage_.folder});
  if (size() == 0) return track;

  WayBack way(*records_, record_.size(), history::Filtered(states_, layouts_.size()), ahead);
  std::vector<double> smoothed_record(smoothed_doubles(states_, layouts_.size()));
  VectorXd d;
  MatrixXd P;
  for (std::size_t k = size(); k-- > 0;) {
    if (auto made = way.wait_for(k); !made) return tl::unexpected<Error>(made.error());
    const history::Filtered& now = way.at(k).filtered;
    if (k + 1 == size()) {
      history::begin_back(now, d, P);
    } else {
      smooth_by(way.at(k).gain, way.step_to(k), d, P);
    }
    const SmoothedEpoch smoothed = history::smoothed_epoch(now, d, P, layouts_);
    history::Writer out(smoothed_record);
    history::put_epoch(out, smoothed);
    out.put(smoothed.sd);
    out.put(smoothed.P_phi);
    if (auto appended = track.records_.append(smoothed_record); !appended)
      return tl::unexpected<Error>(appended.error());
  }
  return track;
}

}  // namespace imuscope
