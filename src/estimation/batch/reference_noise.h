#pragma once

/// How much of the noise that is left is the reference's (B-10a). Nobody says so, and it decides: taken for
/// too little, the reference's noise counts as motion and pulls the lever arm towards zero; taken for too
/// much, the estimate runs the other way.
///
/// The reference's own readings tell: where they are motion, the S-IMU shows the same, and where they are
/// noise, the residual shows it with the opposite sign.

#include <Eigen/Core>
#include <complex>

#include "estimation/batch/noise_bands.h"
#include "estimation/batch/spectra.h"
#include "estimation/batch/transfer.h"

namespace imuscope::batch {

class ReferenceNoise {
 public:
  /// The same share of every band, known exactly; 0: the reference is taken as the motion itself.
  static ReferenceNoise even(const Bands& bands, double share);

  /// @param reference, study  spectra; of the reference as `ReferenceColumn` has them
  /// @param residual          of the sensor without any band's deviation, rows as in Spectra
  ReferenceNoise(const WindowPlan& plan, const Bands& bands, const Spectra& reference,
                 const Eigen::Matrix<std::complex<double>, Eigen::Dynamic, 6, Eigen::RowMajor>& residual,
                 const SensorState& sensor, const NoiseBands& noise);

  /// The same with the shares of one triad larger by their sd: by how much an estimate moves with them is how
  /// much it is unsure of for their sake.
  [[nodiscard]] ReferenceNoise shifted(Eigen::Index triad) const;

  /// Power of the reference's noise in a window's residual, gyros and accelerometers, mean over axes.
  [[nodiscard]] Eigen::Vector2d power(const NoiseBands& noise, Eigen::Index window, Eigen::Index band) const;
  /// Share of the residual's power that it is, mean over all windows.
  [[nodiscard]] Eigen::Vector2d mean_share(const NoiseBands& noise, Eigen::Index band) const;

 private:
  ReferenceNoise() = default;

  /// By band, gyro and accelerometer: share of what the record always shows, and of what a window shows
  /// beyond that.
  Eigen::MatrixX2d of_record_;
  Eigen::MatrixX2d of_excess_;
  Eigen::MatrixX2d of_record_sd_;
  Eigen::MatrixX2d of_excess_sd_;
  /// Window by window, band by band: what the reference shows, which its noise is no more than. Empty: no bound.
  Eigen::MatrixX2d shown_;
};

}  // namespace imuscope::batch
