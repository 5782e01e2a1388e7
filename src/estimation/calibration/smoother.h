#pragma once

/// Rauch-Tung-Striebel smoothing of the whole filter, from the history that an estimator hands out a few
/// times a second: R navigation, R biases and S biases with the uncertainty of the mounting carried along. A
/// constant without process noise has one smoothed value, the filter's last. EQUATIONS.md E-10 to E-15.
///
/// Non-real-time: allocates, and writes a file where the memory that it was given does not suffice.

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "estimation/calibration/covariance_kernel.h"
#include "estimation/calibration/estimator.h"
#include "estimation/calibration/filter_core.h"
#include "estimation/calibration/record_store.h"

namespace imuscope {

/// State of the filter at one instant and what led to it from the epoch of the history before.
struct HistoryEpoch {
  HostTime time;
  bool navigating;                          ///< the navigation's state has a meaning
  std::array<bool, kMaxSImus> calibrating;  ///< the S-IMU's state has a meaning
  const FilterCore& core;
  const FilterCore::Accumulated& since;
};

/// Receives the history. Called on the estimator's thread by advance().
class HistorySink {
 public:
  virtual ~HistorySink() = default;
  virtual void on_history(const HistoryEpoch& epoch) noexcept = 0;
  /// Wanted between two epochs. Measurements in between are treated as if they stood at their end, which
  /// costs nothing as long as the process noise of one interval is far below the covariance (E-10).
  [[nodiscard]] virtual Duration interval() const noexcept { return std::chrono::milliseconds{200}; }
};

/// Smoothed state at one epoch of the history.
struct SmoothedEpoch {
  HostTime time;
  bool navigating = false;
  NavigationState navigation;
  Eigen::VectorXd sd;                               ///< of every state of the filter, in its order
  Eigen::Matrix3d P_phi = Eigen::Matrix3d::Zero();  ///< covariance of the attitude error, NED
  std::vector<SImuState> studies;
  std::vector<bool> calibrating;  ///< per S-IMU
};

/// Smoothed states over a whole run, oldest first.
class SmoothedTrack {
 public:
  [[nodiscard]] std::size_t size() const noexcept { return records_.size(); }
  /// Precondition: index < size(). Fails where the disk does.
  [[nodiscard]] Result<SmoothedEpoch> at(std::size_t index) const;
  [[nodiscard]] const SImuLayout& layout(std::size_t study) const noexcept { return layouts_[study]; }
  [[nodiscard]] std::size_t study_count() const noexcept { return layouts_.size(); }
  [[nodiscard]] std::size_t memory_bytes() const noexcept { return records_.memory_bytes(); }

 private:
  friend class Smoother;
  SmoothedTrack(std::vector<SImuLayout> layouts, std::size_t states, RecordStorage storage);

  std::vector<SImuLayout> layouts_;
  std::size_t states_;
  RecordStore records_;  ///< newest first, as smoothing makes them
};

/// Keeps the history and smooths it.
class Smoother final : public HistorySink {
 public:
  /// History and smoothed track together stay below this; what is beyond it goes to the disk.
  static constexpr std::size_t kMemory_bytes = std::size_t{56} << 20U;

  explicit Smoother(RecordStorage storage = {kMemory_bytes, std::filesystem::temp_directory_path()});
  void on_history(const HistoryEpoch& epoch) noexcept override;
  [[nodiscard]] std::size_t size() const noexcept { return records_ ? records_->size() : 0; }
  [[nodiscard]] std::size_t memory_bytes() const noexcept { return records_ ? records_->memory_bytes() : 0; }
  [[nodiscard]] std::size_t file_bytes() const noexcept { return records_ ? records_->file_bytes() : 0; }

  /// Backward pass over everything received. Fails where the disk could not take the history.
  /// @param ahead  two more threads read the next epochs and make their gains; same result
  [[nodiscard]] Result<SmoothedTrack> smooth(bool ahead = false) const;

 private:
  RecordStorage storage_;
  std::vector<SImuLayout> layouts_;
  std::size_t states_ = 0;
  std::optional<RecordStore> records_;
  std::optional<Error> problem_;
  std::vector<double> record_;
};

/// One step of the backward pass, in terms of matrices alone.
struct SmootherStep {
  const Eigen::MatrixXd& P;                         ///< filtered, of this epoch
  const Eigen::Matrix<double, 15, 15>& transition;  ///< of the navigation, to the epoch after
  const Eigen::Matrix<double, 15, 15>& noise;       ///< of the navigation, on the way there
  Eigen::Ref<const Eigen::VectorXd> decay;          ///< of the states from 15 on
  Eigen::Ref<const Eigen::VectorXd> decay_noise;
  Eigen::Ref<const Eigen::VectorXd> injected;  ///< corrections on the way, carried to its end
};

/// E-11 to E-15: from the smoothed error and covariance of the epoch after to those of this epoch.
/// @param[in,out] d  smoothed minus filtered state
/// @param[in,out] P  smoothed covariance
void smooth_back(const SmootherStep& step, Eigen::VectorXd& d, Eigen::MatrixXd& P);

}  // namespace imuscope
