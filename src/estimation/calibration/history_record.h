#pragma once

/// Records in which the smoothers keep the filter's history: plain doubles, so that they cross rings and
/// files.

#include <Eigen/Core>
#include <cstddef>
#include <span>

#include "estimation/calibration/smoother.h"

namespace imuscope::history {

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
    for (Eigen::Index j = 0; j < values.cols(); ++j) {
      for (Eigen::Index i = 0; i < values.rows(); ++i) put(values(i, j));
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
    for (Eigen::Index j = 0; j < values.cols(); ++j) {
      for (Eigen::Index i = 0; i < values.rows(); ++i) values(i, j) = take();
    }
  }

 private:
  std::span<const double> left_;
};

/// Doubles of a state in a record: time, which parts have a meaning, navigation, S-IMUs.
std::size_t state_doubles(std::size_t studies) noexcept;
void put_epoch(Writer& out, const SmoothedEpoch& epoch);
/// @param epoch  with its S-IMUs counted
void take_epoch(Reader& in, SmoothedEpoch& epoch);

/// Doubles of one epoch of the history: the filtered state, its covariance, and what led to it.
std::size_t history_doubles(std::size_t states, std::size_t studies) noexcept;

/// Writes one epoch of the history. Core: no allocation. Precondition: record.size() == history_doubles(...).
void pack(const HistoryEpoch& epoch, std::span<double> record) noexcept;

/// One epoch of the history, unpacked.
struct Filtered {
  SmoothedEpoch state;
  Eigen::MatrixXd P;
  Eigen::Matrix<double, 15, 15> transition;
  Eigen::Matrix<double, 15, 15> noise;
  Eigen::VectorXd decay;
  Eigen::VectorXd decay_noise;
  Eigen::VectorXd injected;

  Filtered(std::size_t states, std::size_t studies);
  void unpack(std::span<const double> record);
};

/// Where the way back begins: the newest epoch's smoothed error and covariance.
void begin_back(const Filtered& newest, Eigen::VectorXd& d, Eigen::MatrixXd& P);
/// From `after` to `now`; both outlive it.
inline SmootherStep step_from(const Filtered& now, const Filtered& after) {
  return {now.P, after.transition, after.noise, after.decay, after.decay_noise, after.injected};
}
/// The filtered state with the smoothed error added, sd and P_phi with it.
SmoothedEpoch smoothed_epoch(const Filtered& now, const Eigen::VectorXd& d, const Eigen::MatrixXd& P,
                             std::span<const SImuLayout> layouts);

}  // namespace imuscope::history
