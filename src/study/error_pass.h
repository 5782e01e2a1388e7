#pragma once

/// The error process of a whole drive, in two steps. The recording goes through the filter with every
/// mounting known, and its epochs are kept; then they become rows, with the reference compensated by its
/// smoothed biases. The first step does not wait for the smoothing, so that both may run side by side.

#include <utility>
#include <vector>

#include "base/output_folder.h"
#include "base/result.h"
#include "configuration/config.h"
#include "estimation/calibration/estimator.h"
#include "service/pipeline/core.h"
#include "study/regime_study.h"
#include "study/row_spool.h"
#include "study/smoothing.h"
#include "study/temperature_track.h"

namespace imuscope {

/// What is kept of an epoch: all that its row needs once the biases are known.
struct KeptEpoch {
  std::size_t study;
  HostTime time;
  double t_d_s;
  UtcStamp utc;
  ImuData sample;
  Vector3 omega_ib_b_radps;
  Vector3 omega_dot_ib_b_radps2;
  Vector3 omega_ddot_ib_b_radps3;
  Vector3 f_b_mps2;
  Vector3 f_dot_b_mps3;
  Vector3 reference_gyro_bias_radps;
  Vector3 reference_accel_bias_mps2;
  Matrix3 C_b_s;
  Vector3 r_bs_b_m;
  Regime regime;
};

/// First step: gathers the epochs of all S-IMUs, their temperatures and the vehicle's speed.
class EpochGatherer final : public CoreSink {
 public:
  /// Errors (kWork): no file can be made in `folder`.
  static Result<EpochGatherer> create(const OutputFolder& folder, std::size_t n_studies);

  void on_epoch(const SImuEpoch& epoch, const TickFacts&) noexcept override;
  void on_error(const ErrorRecord&) noexcept override {}
  void on_event(const EstimatorEvent&) noexcept override {}
  void on_snapshot(const Snapshot& snapshot) noexcept override { watch_.add(snapshot); }
  void on_late_sample(const LateSample&) noexcept override {}

  [[nodiscard]] const std::vector<TemperatureTrack>& temperatures() const { return temperatures_; }
  /// Complete once rows were made.
  [[nodiscard]] const MotionWatch& watch() const { return watch_; }

  /// Second step: the rows of each S-IMU from its last mounting on, and the motion of the whole drive.
  /// @param former  mountings that the rows leave out
  /// @param rows    one spool an S-IMU
  /// Errors (kWork): the disk had no room for the epochs.
  [[nodiscard]] Result<void> make_rows(const Configuration& configuration, const FormerMountings& former,
                                       const ReferenceBiasTrack& biases, std::vector<RowSpool>& rows);
  /// What was kept, once rows were made: it is of no further use here.
  [[nodiscard]] Spool<KeptEpoch> take_kept() { return std::move(epochs_); }

 private:
  EpochGatherer(Spool<KeptEpoch> epochs, std::size_t n_studies)
      : epochs_(std::move(epochs)), temperatures_(n_studies) {}

  Spool<KeptEpoch> epochs_;
  MotionWatch watch_;
  std::vector<TemperatureTrack> temperatures_;
};

}  // namespace imuscope
