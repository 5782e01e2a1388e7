#include "estimation/batch/normal_equations.h"

#include <tbb/parallel_for.h>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>

#include "estimation/alignment/accelerometer_places.h"
#include "estimation/navigation/so3.h"

namespace imuscope::batch {

namespace {

using std::complex;
using Matrix6c = Eigen::Matrix<complex<double>, 6, 6>;
using Vector6 = Eigen::Matrix<double, 6, 1>;
constexpr Eigen::Index kColumns = BandSums::kColumns;
using Jacobian = Eigen::Matrix<complex<double>, 6, kColumns>;

/// Share that the reference's noise may have in the covariance of a residual, for it to stay one.
constexpr double kLargestWeight = 0.9;
/// Shares of the reference's noise in what its gyros show along a direction: up to the first their derivative is a
/// motion, from the second on it is none.
constexpr double kMotion = 0.1;
constexpr double kNoMotion = 0.3;
/// Share of its weight that leaves a residual none.
constexpr double kNoWeight = 1e-6;
/// Windows, evenly over the record, that tell its noise: a band's numbers in them are some thousand.
constexpr Eigen::Index kWindowsOfShownNoise = 24;

/// B-9: derivatives of predicted() in every parameter, then in the band's deviation.
void jacobian(const SensorState& sensor, const Transfer& t, const Motion& motion, const Vector3c& study_f,
              complex<double> constant, double frequency_hz, double from_middle_s, Jacobian& J) {
  J.setZero();
  const Vector3c force = motion.force_at(t.arm_b_m);
  const Vector3c omega_s = t.C * motion.omega;
  const Vector3c force_s = t.C * force;
  const Vector3c force_a = t.C_accel_rotated * force;
  const Eigen::Matrix3d accel_shape = sensor.accel_shape();
  J.block<3, 3>(0, kPsi) = t.gyro * skew_c(motion.omega);
  J.block<3, 3>(3, kPsi) = t.accel * skew_c(force);
  J.block<3, 3>(3, kLeverArm) = t.accel * motion.arm;
  J.block<3, 3>(3, kShaking) = t.accel * motion.shaking;
  const Vector3c shown = gyros(t, motion, frequency_hz);
  J.block<3, 1>(0, kTimeOffset) = derivative(frequency_hz) * shown;
  J.block<3, 1>(0, kDispersion) = dispersed(frequency_hz) * shown;
  const Vector3c felt = accelerometers(t, motion);
  J.block<3, 1>(3, kTimeOffset) = derivative(frequency_hz) * felt;
  J.block<3, 1>(3, kDispersion + 1) = dispersed(frequency_hz) * felt;
  J.col(kClockRate) = from_middle_s * J.col(kTimeOffset);
  J.block<3, 1>(3, kAccelDelay) = J.block<3, 1>(3, kTimeOffset);
  const Vector3c of_arms = of_lever_arms(t, motion);
  J.block<3, 1>(3, kReferenceAccelDelay) = derivative(frequency_hz) * of_arms;
  J.block<3, 1>(3, kReferenceAccelDelay + 1) = dispersed(frequency_hz) * of_arms;
  J.block<3, 3>(3, kAlpha) = accel_shape * skew_c(force_a);
  for (Eigen::Index j = 0; j < 6; ++j) {
    const Eigen::Matrix3d d = shape_derivative(j, sensor.above);
    J.block<3, 1>(0, kGyroShape + j) = d * omega_s;
    J.block<3, 1>(3, kAccelShape + j) = d * force_a;
    for (Eigen::Index i = 0; i < 3; ++i) {
      const Eigen::Vector3d place_b = t.C.transpose() * place_basis(i, j);
      J(3 + i, kPlaces + j) =
          (t.accel.row(i).cast<complex<double>>() * (motion.arm * place_b.cast<complex<double>>())).value();
    }
  }
  const double flex = flexure_gain(frequency_hz);
  for (Eigen::Index j = 0; j < 6; ++j)
    J(3 + flexure_row(j), kAccelFlexure + j) = flex * felt[flexure_column(j)];
  for (Eigen::Index i = 0; i < 3; ++i) {
    J(i, kGyroBias + i) = constant;
    J(3 + i, kAccelBias + i) = constant;
    J(3 + i, kAccelFade + i) = flex * felt[i];
    J.block<1, 3>(i, kCompliance + 3 * i) = derivative(frequency_hz) * force_s.transpose();
    for (Eigen::Index j = 0; j < 3; ++j) {
      // B-8a
      const Vector3c product = motion.force_products * t.C.row(j).transpose();
      J.block<3, 1>(3, kCompliance + 3 * i + j) = -(t.accel * skew(t.C.row(i).transpose())) * product;
    }
    J.block<1, 3>(i, kGSensitivity + 3 * i) = study_f.transpose();
    J.block<1, 3>(i, kFlexure + 3 * i) = flex * omega_s.transpose();
    J.block<1, 3>(i, kParameters + 3 * i) = omega_s.transpose();
    J.block<1, 3>(3 + i, kParameters + 9 + 3 * i) = force_s.transpose();
  }
}

/// Covariance of a residual at one frequency, and how the reference's noise enters it (B-10, B-12).
struct Weight {
  Matrix6c of_reference;  ///< D: residual = S noise - D (reference's noise)
  Vector6 reference_power;
  Matrix6c gain;                ///< R D^H, scaled as the covariance's blocks are
  Eigen::LLT<Matrix6c> factor;  ///< of the covariance
  Vector6 power;
};

/// Power of the reference's noise at one frequency, mean over axes, where both triads agree on it (B-10c).
struct ReferencePower {
  double gyro;
  double accel;
};
/// @param of_gyros   as the gyros' residual tells it
/// @param of_accels  as the accelerometers' does, with what the gyros' noise makes of accelerations at the
///                   lever arm
ReferencePower reference_power(const Transfer& t, double of_gyros, double of_accels, double frequency_hz) {
  const double omega = std::abs(derivative(frequency_hz));
  const double arm_gain = omega * omega * (t.accel * skew(t.arm_b_m)).squaredNorm() / 3.0;
  if (arm_gain * of_gyros > of_accels) return {of_accels / arm_gain, 0.0};
  return {of_gyros, of_accels - arm_gain * of_gyros};
}

/// @param power  of the residual, by axis
/// @param forces_tell  B-12a: share of their weight that forces have
Weight weight_of(const Transfer& t, const Vector6& power, double of_gyros, double of_accels,
                 double forces_tell, double frequency_hz) {
  Weight weight;
  weight.power = power;
  const ReferencePower agreed = reference_power(t, of_gyros, of_accels, frequency_hz);
  weight.reference_power.head<3>().setConstant(agreed.gyro);
  weight.reference_power.tail<3>().setConstant(agreed.accel);
  // B-10: D
  weight.of_reference.setZero();
  weight.of_reference.topLeftCorner<3, 3>() = t.gyro.cast<complex<double>>();
  weight.of_reference.bottomRightCorner<3, 3>() = t.accel.cast<complex<double>>();
  // [omega' x] r = -[r x] omega'
  weight.of_reference.bottomLeftCorner<3, 3>() = -derivative(frequency_hz) * (t.accel * skew(t.arm_b_m));
  // B-10: the covariance; B-12: the gain
  const Matrix6c gain = weight.reference_power.asDiagonal() * weight.of_reference.adjoint();
  Matrix6c covariance = weight.of_reference * gain;
  // The total is what was learned; the reference's part is held below it.
  Vector6 scale;
  for (Eigen::Index i = 0; i < 6; ++i) {
    const double of_reference = covariance(i, i).real();
    scale[i] = of_reference > 0.0 ? std::min(1.0, std::sqrt(kLargestWeight * power[i] / of_reference)) : 1.0;
  }
  covariance = (scale.asDiagonal() * covariance * scale.asDiagonal()).eval();
  for (Eigen::Index i = 0; i < 6; ++i) covariance(i, i) = power[i];
  covariance.diagonal().tail<3>() /= std::max(forces_tell, kNoWeight);
  weight.gain = gain * scale.cwiseProduct(scale).asDiagonal();
  weight.factor.compute(covariance);
  return weight;
}

/// The motion that both IMUs together make most likely (B-12).
Motion estimated_motion(Motion motion, const Weight& weight, const Vector6c& weighted_residual,
                        double frequency_hz) {
  const Vector6c correction = weight.gain * weighted_residual;
  motion.omega += correction.head<3>();
  motion.f += correction.tail<3>();
  motion.arm += skew_c(derivative(frequency_hz) * correction.head<3>());
  return motion;
}

/// The motion as the S-IMU alone shows it (B-13a): with what of the residual the reference would have to have missed.
Motion motion_of_study(Motion motion, const Transfer& t, const Weight& weight, const Vector6c& residual,
                       double frequency_hz) {
  const Vector3c omega = t.gyro.cast<complex<double>>().partialPivLu().solve(residual.head<3>());
  const Vector3c of_arm = weight.of_reference.bottomLeftCorner<3, 3>() * omega;
  motion.omega += omega;
  motion.f += t.accel.cast<complex<double>>().partialPivLu().solve(residual.tail<3>() - of_arm);
  motion.arm += skew_c(derivative(frequency_hz) * omega);
  return motion;
}

using Rows = Eigen::Matrix<double, Eigen::Dynamic, kColumns + 1, Eigen::RowMajor>;
/// One-sided: every frequency but zero stands for its negative, too.
double sides(double frequency_hz) { return frequency_hz > 0.0 ? 2.0 : 1.0; }

/// B-21: each error by itself, off by its sd.
std::array<ReferenceError, kReferenceErrors> reference_errors(const ReferenceGrade& grade) {
  std::array<ReferenceError, kReferenceErrors> errors;
  for (Eigen::Index i = 0; i < 3; ++i) {
    const Eigen::Index j = (i + 1) % 3;
    const auto k = 5 * static_cast<std::size_t>(i);
    errors[k].gyro(i, i) = grade.scale_sd;
    errors[k + 1].accel(i, i) = grade.scale_sd;
    // b is what the reference's gyros say: what turns all three together turns b, and what turns the accelerometers
    // against it is the triads'.
    errors[k + 2].gyro(i, j) = errors[k + 2].gyro(j, i) = grade.lean_sd_rad;
    errors[k + 3].accel(i, j) = errors[k + 3].accel(j, i) = grade.lean_sd_rad;
    errors[k + 4].accel = skew(grade.triad_sd_rad * Eigen::Vector3d::Unit(i));
  }
  return errors;
}

/// Whitened derivatives and, in the last column, residuals of both triads: of each frequency three real and
/// three imaginary rows. Each triad has rows of its own, as its share of the information is asked for, too.
struct WhitenedRows {
  explicit WhitenedRows(Eigen::Index n_frequencies)
      : gyros(6 * n_frequencies, kColumns + 1), accels(6 * n_frequencies, kColumns + 1) {}

  /// @param k  place of the frequency
  void put(Eigen::Index k, const Jacobian& J, const Vector6c& e, double frequency_hz) {
    const double weight = std::sqrt(sides(frequency_hz));
    put_triad(J.topRows<3>(), e.head<3>(), weight, gyros.middleRows<6>(6 * k));
    put_triad(J.bottomRows<3>(), e.tail<3>(), weight, accels.middleRows<6>(6 * k));
  }

  Rows gyros;
  Rows accels;

 private:
  template <typename Derivatives, typename Residual, typename Target>
  static void put_triad(const Derivatives& J, const Residual& e, double weight, Target&& rows) {
    rows.template topLeftCorner<3, kColumns>() = weight * J.real();
    rows.template bottomLeftCorner<3, kColumns>() = weight * J.imag();
    rows.col(kColumns).template head<3>() = weight * e.real();
    rows.col(kColumns).template tail<3>() = weight * e.imag();
  }
};

/// Lower triangle: the information of these rows, added.
template <typename Sum>
void add_information(const Rows& rows, Sum& sum) {
  sum.template selfadjointView<Eigen::Lower>().rankUpdate(rows.leftCols<kColumns>().transpose());
}

class BandSummer {
 public:
  BandSummer(const Problem& problem, const Spectra& study, const Residuals& residual,
             const Estimate& estimate, const NoiseBands& noise, const ReferenceNoise& reference,
             bool corrected)
      : problem_(problem),
        study_(study),
        residual_(residual),
        estimate_(estimate),
        noise_(noise),
        reference_(reference),
        corrected_(corrected) {}

  using Slopes = Eigen::Matrix<double, kColumns, kReferenceErrors>;
  /// B-21
  Slopes slopes(Eigen::Index band, const std::array<ReferenceError, kReferenceErrors>& errors) {
    const Transfer t(estimate_.sensor, estimate_.deviation[static_cast<std::size_t>(band)]);
    set_known_turns(band);
    Slopes sum = Slopes::Zero();
    for (Eigen::Index w = 0; w < static_cast<Eigen::Index>(problem_.plan.starts.size()); ++w) {
      for (Eigen::Index k = problem_.bands.first(band); k < problem_.bands.end(band); ++k) {
        const double f_hz = problem_.plan.frequency_hz(k);
        const auto [weight, motion, e] = whitened(t, band, w, k);
        for (Eigen::Index i = 0; i < kReferenceErrors; ++i) {
          Vector6c excess = predicted(t, excess_motion(errors[static_cast<std::size_t>(i)], motion),
                                      Vector3c::Zero(), 0.0, f_hz);
          weight.factor.matrixL().solveInPlace(excess);
          sum.col(i) -= sides(f_hz) * (J_.adjoint() * excess).real();
        }
      }
    }
    return sum;
  }

  BandSums sum(Eigen::Index band) {
    const Transfer t(estimate_.sensor, estimate_.deviation[static_cast<std::size_t>(band)]);
    const auto n_windows = static_cast<Eigen::Index>(problem_.plan.starts.size());
    BandSums sums;
    sums.scores.resize(n_windows, kColumns);
    decltype(sums.information) of_accels = sums.information;
    WhitenedRows rows(problem_.bands.width(band));
    const Eigen::Vector2d share = set_known_turns(band);
    for (Eigen::Index w = 0; w < n_windows; ++w) {
      for (Eigen::Index k = problem_.bands.first(band); k < problem_.bands.end(band); ++k)
        fill(t, band, w, k, rows, k - problem_.bands.first(band));
      // B-13: I by triad, and the windows' scores
      add_information(rows.gyros, sums.of_gyros);
      add_information(rows.accels, of_accels);
      sums.scores.row(w).setZero();
      for (const Rows* triad : {&rows.gyros, &rows.accels})
        sums.scores.row(w) += triad->col(kColumns).transpose() * triad->leftCols<kColumns>();
    }
    sums.of_gyros = sums.of_gyros.selfadjointView<Eigen::Lower>();
    sums.information = of_accels.selfadjointView<Eigen::Lower>();
    sums.information += sums.of_gyros;
    if (corrected_) add_noise(t, band, share, sums);
    return sums;
  }

  /// B-13a: the information, less what of it both IMUs have in common.
  Eigen::Matrix<double, kColumns, kColumns> shown_noise(Eigen::Index band) {
    const Transfer t(estimate_.sensor, estimate_.deviation[static_cast<std::size_t>(band)]);
    set_known_turns(band);
    Eigen::Matrix<double, kColumns, kColumns> all = Eigen::Matrix<double, kColumns, kColumns>::Zero();
    Eigen::Matrix<double, kColumns, kColumns> common = Eigen::Matrix<double, kColumns, kColumns>::Zero();
    const Eigen::Index width = problem_.bands.width(band);
    WhitenedRows of_both(width);
    WhitenedRows of_reference(width);
    WhitenedRows of_study(width);
    const auto n_windows = static_cast<Eigen::Index>(problem_.plan.starts.size());
    const Eigen::Index step = (n_windows - 1) / kWindowsOfShownNoise + 1;
    Eigen::Index looked_at = 0;
    for (Eigen::Index w = step / 2; w < n_windows; w += step, ++looked_at) {
      for (Eigen::Index k = problem_.bands.first(band); k < problem_.bands.end(band); ++k) {
        const double f_hz = problem_.plan.frequency_hz(k);
        const Eigen::Index place = k - problem_.bands.first(band);
        const Weight weight = fill(t, band, w, k, of_both, place);
        const Motion motion = motion_of(problem_.reference, w, k);
        const Vector6c e = residual_.row(w * problem_.plan.n_frequencies + k).transpose();
        differentiate(t, weight, motion, w, k);
        of_reference.put(place, J_, Vector6c::Zero(), f_hz);
        differentiate(t, weight, motion_of_study(motion, t, weight, e, f_hz), w, k);
        of_study.put(place, J_, Vector6c::Zero(), f_hz);
      }
      for (const auto triad : {&WhitenedRows::gyros, &WhitenedRows::accels}) {
        add_information(of_both.*triad, all);
        common.noalias() +=
            (of_reference.*triad).leftCols<kColumns>().transpose() * (of_study.*triad).leftCols<kColumns>();
      }
    }
    all = all.selfadjointView<Eigen::Lower>();
    const double share = static_cast<double>(n_windows) / static_cast<double>(looked_at);
    return share * (all - 0.5 * (common + common.transpose()));
  }

 private:
  /// B-12a
  /// @return  the reference's mean share of the band's noise
  Eigen::Vector2d set_known_turns(Eigen::Index band) {
    Eigen::Vector2d share = reference_.mean_share(noise_, band);
    const double noise = share[0] * noise_.power(band).head<3>().mean();
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> moment(
        problem_.gyro_moment[static_cast<std::size_t>(band)]);
    const Eigen::Array3d of_noise = noise / moment.eigenvalues().array().max(noise);
    const Eigen::Array3d known = ((kNoMotion - of_noise) / (kNoMotion - kMotion)).max(0.0).min(1.0);
    forces_tell_ = known.maxCoeff();
    known_turns_ = moment.eigenvectors() * known.matrix().asDiagonal() * moment.eigenvectors().transpose();
    return share;
  }

  /// B-12a
  void leave_known_turns(Motion& motion) const {
    const Vector3c omega_dot = omega_dot_of(motion);
    motion.arm += skew_c(known_turns_ * omega_dot - omega_dot);
  }

  struct Whitened {
    Weight weight;
    Motion motion;
    Vector6c e;
  };
  /// Residual and, in J_, derivatives of one window at one frequency.
  Whitened whitened(const Transfer& t, Eigen::Index band, Eigen::Index w, Eigen::Index k) {
    const double f_hz = problem_.plan.frequency_hz(k);
    const Weight weight = weight_at(t, band, w, k);
    Vector6c e = residual_.row(w * problem_.plan.n_frequencies + k).transpose();
    weight.factor.matrixL().solveInPlace(e);
    Motion motion = motion_of(problem_.reference, w, k);
    if (corrected_) motion = estimated_motion(motion, weight, weight.factor.matrixU().solve(e), f_hz);
    differentiate(t, weight, motion, w, k);
    return {weight, motion, e};
  }

  [[nodiscard]] Weight weight_at(const Transfer& t, Eigen::Index band, Eigen::Index w, Eigen::Index k) const {
    const Eigen::Vector2d of_reference = reference_.power(noise_, w, band);
    return weight_of(t, noise_.window_power(w, band), of_reference[0], of_reference[1], forces_tell_,
                     problem_.plan.frequency_hz(k));
  }

  /// Whitened derivatives, in J_.
  void differentiate(const Transfer& t, const Weight& weight, Motion motion, Eigen::Index w, Eigen::Index k) {
    leave_known_turns(motion);
    const Vector3c study_f = study_.row(w, k).tail<3>().transpose();
    jacobian(estimate_.sensor, t, motion, study_f, problem_.constant[k], problem_.plan.frequency_hz(k),
             problem_.from_middle_s[w], J_);
    weight.factor.matrixL().solveInPlace(J_);
  }

  Weight fill(const Transfer& t, Eigen::Index band, Eigen::Index w, Eigen::Index k, WhitenedRows& rows,
              Eigen::Index place) {
    const Whitened at = whitened(t, band, w, k);
    rows.put(place, J_, at.e, problem_.plan.frequency_hz(k));
    return at.weight;
  }

  /// B-13: derivatives that the motion's own uncertainty alone would have. What counts is the reference's
  /// share of the noise, so that all windows are as one whose share is their mean.
  void add_noise(const Transfer& t, Eigen::Index band, const Eigen::Vector2d& share, BandSums& sums) {
    const Vector6 power = noise_.power(band);
    const double of_gyros = share[0] * power.head<3>().mean();
    const double of_accels = share[1] * power.tail<3>().mean();
    const double root_n = std::sqrt(static_cast<double>(problem_.plan.starts.size()));
    WhitenedRows rows(6);
    for (Eigen::Index k = problem_.bands.first(band); k < problem_.bands.end(band); ++k) {
      const double f_hz = problem_.plan.frequency_hz(k);
      const Weight weight = weight_of(t, power, of_gyros, of_accels, forces_tell_, f_hz);
      const Matrix6c W_inverse = weight.factor.solve(Matrix6c::Identity());
      Matrix6c motion_covariance = -weight.gain * W_inverse * weight.gain.adjoint();
      for (Eigen::Index i = 0; i < 6; ++i) motion_covariance(i, i) += weight.reference_power[i];
      motion_covariance /=
          kWindowsPerInstant;  // the transforms' mean square is that much smaller than the power
      const Eigen::LLT<Matrix6c> root(motion_covariance);
      if (root.info() != Eigen::Success) continue;
      const Matrix6c L = root.matrixL();
      for (Eigen::Index j = 0; j < 6; ++j) {
        Motion motion{L.col(j).head<3>(), L.col(j).tail<3>(), Matrix3c::Zero(), Matrix3c::Zero()};
        motion.arm = skew_c(derivative(f_hz) * motion.omega);
        leave_known_turns(motion);
        jacobian(estimate_.sensor, t, motion, Vector3c::Zero(), 0.0, f_hz, 0.0, J_);
        J_ *= root_n;
        weight.factor.matrixL().solveInPlace(J_);
        rows.put(j, J_, Vector6c::Zero(), f_hz);
      }
      add_information(rows.gyros, sums.of_noise);
      add_information(rows.accels, sums.of_noise);
    }
    sums.of_noise = sums.of_noise.selfadjointView<Eigen::Lower>();
  }

  const Problem& problem_;
  const Spectra& study_;
  const Residuals& residual_;
  const Estimate& estimate_;
  const NoiseBands& noise_;
  const ReferenceNoise& reference_;
  bool corrected_;
  double forces_tell_ = 1.0;                                   ///< in the band
  Eigen::Matrix3d known_turns_ = Eigen::Matrix3d::Identity();  ///< of the band
  Jacobian J_;
};

/// B-14: the band's deviation eliminated, as a random effect of known sd.
void eliminate(const BandSums& sums, const DeviationVector& deviation, double gyro_sd, double accel_sd,
               NormalEquations& equations, NormalEquations::Elimination& elimination) {
  DeviationVector precision;
  precision.head<9>().setConstant(1.0 / (gyro_sd * gyro_sd));
  precision.tail<9>().setConstant(1.0 / (accel_sd * accel_sd));
  Eigen::Matrix<double, kDeviations, kDeviations> own =
      sums.information.bottomRightCorner<kDeviations, kDeviations>();
  own.diagonal() += precision;
  const Eigen::Matrix<double, kDeviations, kDeviations> covariance =
      own.llt().solve(Eigen::Matrix<double, kDeviations, kDeviations>::Identity());
  const auto cross = sums.information.topRightCorner<kParameters, kDeviations>();
  elimination.coupling = cross * covariance;
  elimination.covariance = covariance;
  const DeviationVector gradient =
      sums.scores.rightCols<kDeviations>().colwise().sum().transpose() - precision.cwiseProduct(deviation);
  elimination.own = covariance * gradient;
  equations.information +=
      sums.information.topLeftCorner<kParameters, kParameters>() - elimination.coupling * cross.transpose();
  // How the elimination combines the rows holds for the noise in them as well.
  Eigen::Matrix<double, kColumns, kParameters> combine;
  combine.topRows<kParameters>().setIdentity();
  combine.bottomRows<kDeviations>() = -elimination.coupling.transpose();
  equations.of_noise += combine.transpose() * sums.of_noise * combine;
  equations.gradient +=
      sums.scores.leftCols<kParameters>().colwise().sum().transpose() - elimination.coupling * gradient;
  equations.window_scores += sums.scores.leftCols<kParameters>() -
                             sums.scores.rightCols<kDeviations>() * elimination.coupling.transpose();
}

}  // namespace

// B-7, B-8: residuals
Residuals residuals(const Problem& problem, const Spectra& study, const Estimate& estimate) {
  const auto n_windows = static_cast<Eigen::Index>(problem.plan.starts.size());
  Residuals all(n_windows * problem.plan.n_frequencies, 6);
  for (Eigen::Index band = 0; band < problem.bands.size(); ++band) {
    const Transfer t(estimate.sensor, estimate.deviation[static_cast<std::size_t>(band)]);
    for (Eigen::Index w = 0; w < n_windows; ++w) {
      for (Eigen::Index k = problem.bands.first(band); k < problem.bands.end(band); ++k) {
        const auto measured = study.row(w, k);
        const Vector3c study_f = measured.tail<3>().transpose();
        all.row(w * problem.plan.n_frequencies + k) =
            measured - predicted(t, motion_of(problem.reference, w, k), study_f, problem.constant[k],
                                 problem.plan.frequency_hz(k))
                           .transpose();
      }
    }
  }
  return all;
}

std::vector<BandSums> band_sums(const Problem& problem, const Spectra& study, const Residuals& residual,
                                const Estimate& estimate, const NoiseBands& noise,
                                const ReferenceNoise& reference, bool corrected) {
  std::vector<BandSums> sums(static_cast<std::size_t>(problem.bands.size()));
  tbb::parallel_for(std::size_t{0}, sums.size(), [&](std::size_t band) {
    BandSummer summer(problem, study, residual, estimate, noise, reference, corrected);
    sums[band] = summer.sum(static_cast<Eigen::Index>(band));
  });
  return sums;
}

// B-13a
void show_noise(const Problem& problem, const Spectra& study, const Residuals& residual,
                const Estimate& estimate, const NoiseBands& noise, const ReferenceNoise& reference,
                std::vector<BandSums>& sums) {
  tbb::parallel_for(std::size_t{0}, sums.size(), [&](std::size_t band) {
    BandSummer summer(problem, study, residual, estimate, noise, reference, true);
    sums[band].of_noise = summer.shown_noise(static_cast<Eigen::Index>(band));
  });
}

// B-21, B-14
ReferenceSlopes reference_slopes(const Problem& problem, const Spectra& study, const Residuals& residual,
                                 const Estimate& estimate, const NoiseBands& noise,
                                 const ReferenceNoise& reference, const ReferenceGrade& grade,
                                 const NormalEquations& equations) {
  const auto errors = reference_errors(grade);
  std::vector<BandSummer::Slopes> of_bands(static_cast<std::size_t>(problem.bands.size()));
  tbb::parallel_for(std::size_t{0}, of_bands.size(), [&](std::size_t band) {
    BandSummer summer(problem, study, residual, estimate, noise, reference, true);
    of_bands[band] = summer.slopes(static_cast<Eigen::Index>(band), errors);
  });
  ReferenceSlopes sum = of_bands.front().topRows<kParameters>();
  for (std::size_t band = 1; band < of_bands.size(); ++band) {
    sum += of_bands[band].topRows<kParameters>() -
           equations.bands[band].coupling * of_bands[band].bottomRows<kDeviations>();
  }
  return sum;
}

// B-11b: the trace, by triad
Eigen::Vector2d numbers_taken(const BandSums& sums, const NormalEquations::Elimination& elimination,
                              const Eigen::Matrix<double, kParameters, kParameters>& covariance) {
  Eigen::Matrix<double, kColumns, kColumns> joint;
  joint.topLeftCorner<kParameters, kParameters>() = covariance;
  joint.topRightCorner<kParameters, kDeviations>() = -covariance * elimination.coupling;
  joint.bottomLeftCorner<kDeviations, kParameters>() =
      joint.topRightCorner<kParameters, kDeviations>().transpose();
  joint.bottomRightCorner<kDeviations, kDeviations>() =
      elimination.covariance + elimination.coupling.transpose() * covariance * elimination.coupling;
  const double gyros = sums.of_gyros.cwiseProduct(joint).sum();
  return {gyros, sums.information.cwiseProduct(joint).sum() - gyros};
}

NormalEquations normal_equations(const std::vector<BandSums>& sums, const Estimate& estimate) {
  NormalEquations equations;
  equations.information.setZero();
  equations.of_noise.setZero();
  equations.gradient.setZero();
  equations.window_scores.setZero(sums.front().scores.rows(), kParameters);
  equations.bands.resize(sums.size());
  // At zero frequency a deviation is a bias.
  equations.information += sums.front().information.topLeftCorner<kParameters, kParameters>();
  equations.of_noise += sums.front().of_noise.topLeftCorner<kParameters, kParameters>();
  equations.gradient += sums.front().scores.leftCols<kParameters>().colwise().sum().transpose();
  equations.window_scores += sums.front().scores.leftCols<kParameters>();
  for (std::size_t band = 1; band < sums.size(); ++band) {
    const auto i = static_cast<Eigen::Index>(band);
    eliminate(sums[band], estimate.deviation[band], estimate.deviation_sd(i, 0), estimate.deviation_sd(i, 1),
              equations, equations.bands[band]);
  }
  return equations;
}

}  // namespace imuscope::batch
