#pragma once

/// Rauch-Tung-Striebel smoothing of what moves: R navigation, R biases and S biases, from the history that an
/// estimator hands out five times a second. Constants of the mounting are not smoothed: the end value with
/// its covariance is their answer, so a study runs twice, the second time with the constants fixed at their
/// end values and only the biases left as states (kBiasStudyBlocks). EQUATIONS.md E-10 to E-14.
///
/// Soft world: allocates (33 states: 13 kB an epoch in memory, 59 MB for 15 min).

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "calibration/covariance_kernel.h"
#include "calibration/estimator.h"
#include "calibration/filter_core.h"

namespace imuscope {

/// State of the filter at one instant and what led to it from the epoch of the history before.
struct HistoryEpoch {
  HostTime time;
  bool connected = true;  ///< false: the navigation was started or stopped since the epoch before
  const FilterCore& core;
  /// Transition from the epoch before and its process noise: 15 x 15 for the navigation, diagonal beyond.
  const Eigen::Matrix<double, 15, 15>& navigation_transition;
  const Eigen::Matrix<double, 15, 15>& navigation_noise;
  std::span<const double> decay;     ///< of every state from 15 on
  std::span<const double> noise;     ///< variances of every state from 15 on
  std::span<const double> injected;  ///< corrections since the epoch before, carried to this one
};

/// Receives the history. Called on the estimator's thread by advance().
class HistorySink {
 public:
  virtual ~HistorySink() = default;
  virtual void on_history(const HistoryEpoch& epoch) noexcept = 0;
};

/// Smoothed values at one epoch of the history.
struct SmoothedEpoch {
  HostTime time;
  NavigationState navigation;
  Eigen::VectorXd sd;  ///< of every state of the filter
  struct Biases {
    Eigen::Vector3d gyro_radps = Eigen::Vector3d::Zero();
    Eigen::Vector3d accel_mps2 = Eigen::Vector3d::Zero();
  };
  std::vector<Biases> studies;
};

/// Keeps the history in memory and smooths it.
class Smoother final : public HistorySink {
 public:
  void on_history(const HistoryEpoch& epoch) noexcept override;
  [[nodiscard]] std::size_t size() const noexcept { return epochs_.size(); }
  [[nodiscard]] std::size_t memory_bytes() const noexcept;

  /// Backward pass over everything received; oldest first.
  [[nodiscard]] std::vector<SmoothedEpoch> smooth() const;

 private:
  struct Stored {
    HostTime time;
    bool connected;
    NavigationState navigation;
    std::vector<SmoothedEpoch::Biases> studies;
    std::vector<double> covariance;  ///< packed lower triangle
    Eigen::Matrix<double, 15, 15> transition;
    Eigen::Matrix<double, 15, 15> noise;
    Eigen::VectorXd decay;
    Eigen::VectorXd decay_noise;
    Eigen::VectorXd injected;
  };
  std::vector<Stored> epochs_;
  std::vector<StudyLayout> layouts_;
};

}  // namespace imuscope
