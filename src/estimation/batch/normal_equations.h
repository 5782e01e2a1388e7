#pragma once

/// One step of the batch estimate: residuals with the true motion unknown, their derivatives, and the normal
/// equations, whitened by the noise that was learned. B-6 to B-15 in EQUATIONS.md.

#include <Eigen/Core>
#include <vector>

#include "estimation/batch/noise_bands.h"
#include "estimation/batch/reference_noise.h"
#include "estimation/batch/sensor_model.h"
#include "estimation/batch/spectra.h"
#include "estimation/batch/transfer.h"

namespace imuscope::batch {

using Residuals = Eigen::Matrix<std::complex<double>, Eigen::Dynamic, 6, Eigen::RowMajor>;

/// Everything one step is made from. Spectra of the reference less its means; of the S-IMU likewise.
struct Problem {
  WindowPlan plan;
  Bands bands;
  Spectra reference;              ///< kReferenceColumns
  Eigen::VectorXcd constant;      ///< window_spectrum()
  Eigen::VectorXd from_middle_s;  ///< of each window's middle, from the record's
  /// By band: second moment of what the reference's gyros show, as power. Along a direction in which much of it is
  /// their noise, accelerations at the lever arm are not known (B-12a).
  std::vector<Eigen::Matrix3d> gyro_moment;
};

/// The estimate of everything: sensor, and each band's deviation with the sd that such deviations have there.
struct Estimate {
  SensorState sensor;
  std::vector<DeviationVector> deviation;  ///< by band
  Eigen::MatrixX2d deviation_sd;           ///< by band: gyro, accelerometer
};

/// Residuals of all windows and frequencies (B-7, B-8).
[[nodiscard]] Residuals residuals(const Problem& problem, const Spectra& study, const Estimate& estimate);

/// Sums of one band over all windows, of the sensor's parameters and then the band's deviation.
struct BandSums {
  static constexpr Eigen::Index kColumns = kParameters + kDeviations;
  Eigen::Matrix<double, kColumns, kColumns> information = Eigen::Matrix<double, kColumns, kColumns>::Zero();
  Eigen::Matrix<double, kColumns, kColumns> of_gyros =
      Eigen::Matrix<double, kColumns, kColumns>::Zero();  ///< their share
  Eigen::Matrix<double, kColumns, kColumns> of_noise = Eigen::Matrix<double, kColumns, kColumns>::Zero();
  Eigen::Matrix<double, Eigen::Dynamic, kColumns> scores;  ///< a row a window
};

/// @param reference  what of the residual noise is the reference's
/// @param corrected  whether the motion in the derivatives is the estimated one (B-12)
[[nodiscard]] std::vector<BandSums> band_sums(const Problem& problem, const Spectra& study,
                                              const Residuals& residual, const Estimate& estimate,
                                              const NoiseBands& noise, const ReferenceNoise& reference,
                                              bool corrected);

/// B-13a: replaces what `of_noise` of every band supposes by what the records show of it, in some of the windows where there
/// are many.
/// @param sums  of the same records, corrected
void show_noise(const Problem& problem, const Spectra& study, const Residuals& residual,
                const Estimate& estimate, const NoiseBands& noise, const ReferenceNoise& reference,
                std::vector<BandSums>& sums);

/// Normal equations of the sensor's parameters; the bands' deviations are eliminated (B-14).
struct NormalEquations {
  Eigen::Matrix<double, kParameters, kParameters> information;
  /// What the reference's noise in the derivatives adds to `information` without being any (B-13).
  Eigen::Matrix<double, kParameters, kParameters> of_noise;
  ParameterVector gradient;
  Eigen::Matrix<double, Eigen::Dynamic, kParameters> window_scores;  ///< a row a window
  /// By band, for a correction d of the parameters: deviation <- deviation + own - coupling' d.
  struct Elimination {
    DeviationVector own = DeviationVector::Zero();
    Eigen::Matrix<double, kParameters, kDeviations> coupling =
        Eigen::Matrix<double, kParameters, kDeviations>::Zero();
    /// Of the deviation, the parameters known.
    Eigen::Matrix<double, kDeviations, kDeviations> covariance =
        Eigen::Matrix<double, kDeviations, kDeviations>::Zero();
  };
  std::vector<Elimination> bands;
};

using ReferenceSlopes = Eigen::Matrix<double, kParameters, kReferenceErrors>;

/// B-21: what each error of the reference's own axes, off by its sd, makes of the gradient.
/// @param equations  of the same estimate
[[nodiscard]] ReferenceSlopes reference_slopes(const Problem& problem, const Spectra& study,
                                               const Residuals& residual, const Estimate& estimate,
                                               const NoiseBands& noise, const ReferenceNoise& reference,
                                               const ReferenceGrade& grade, const NormalEquations& equations);

[[nodiscard]] NormalEquations normal_equations(const std::vector<BandSums>& sums, const Estimate& estimate);

/// B-11b: how many of a band's numbers the parameters and its deviation take, gyros' and accelerometers'.
/// @param covariance  of the parameters
[[nodiscard]] Eigen::Vector2d numbers_taken(
    const BandSums& sums, const NormalEquations::Elimination& elimination,
    const Eigen::Matrix<double, kParameters, kParameters>& covariance);

}  // namespace imuscope::batch
