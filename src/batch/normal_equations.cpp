#include "batch/normal_equations.h"

#include <tbb/parallel_for.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "alignment/accelerometer_places.h"
#include "navigation/so3.h"

namespace imuscope::batch {

namespace {

using std::complex;
using Vector3c = Eigen::Vector3cd;
using Matrix3c = Eigen::Matrix3cd;
using Vector6c = Eigen::Matrix<complex<double>, 6, 1>;
using Matrix6c = Eigen::Matrix<complex<double>, 6, 6>;
constexpr Eigen::Index kColumns = BandSums::kColumns;
using Jacobian = Eigen::Matrix<complex<double>, 6, kColumns>;

/// Weight that the reference's noise may have in the covariance of a residual, for it to stay one.
constexpr double kLargestShare = 0.9;
/// Share of what the reference's gyros show that may be their noise, for their derivative to be a motion.
constexpr double kNoisyMotion = 0.2;
/// Factor of a variance that leaves no weight.
constexpr double kTellsNothing = 1e6;
/// Share of the accelerometers' residual noise that is theirs at least, whatever the gyros' may make of it.
constexpr double kLeastLeftToAccels = 0.05;

/// The body's motion in one window at one frequency.
struct Motion {
  Vector3c omega;
  Vector3c f;
  Matrix3c arm;  ///< acceleration of a point of the body per metre of its lever arm: [omega' x] + omega
                 ///< omega' - |omega|^2

  [[nodiscard]] Vector3c force_at(const Eigen::Vector3d& lever_arm_m) const {
    return f + arm * lever_arm_m.cast<complex<double>>();
  }
};

Matrix3c skew_c(const Vector3c& v) {
  Matrix3c m;
  m << 0.0, -v.z(), v.y(), v.z(), 0.0, -v.x(), -v.y(), v.x(), 0.0;
  return m;
}

Motion motion_of(const Spectra& reference, Eigen::Index window, Eigen::Index k) {
  const auto row = reference.row(window, k);
  Motion motion;
  motion.omega = row.segment<3>(kOmega).transpose();
  motion.f = row.segment<3>(kForce).transpose();
  motion.arm = skew_c(row.segment<3>(kOmegaDot).transpose());
  const auto p = row.segment<6>(kProducts);
  const complex<double> square = p[0] + p[1] + p[2];
  Matrix3c outer;
  outer << p[0], p[3], p[4], p[3], p[1], p[5], p[4], p[5], p[2];
  motion.arm += outer - square * Matrix3c::Identity();
  return motion;
}

/// What does not change from window to window, worked out once a step.
struct Transfer {
  Eigen::Matrix3d gyro, accel, C, C_accel_rotated, g_sensitivity, flexure, gyro_deviation, accel_deviation;
  Eigen::Vector3d arm_b_m;
  std::array<Eigen::Vector3d, 3> place_b_m;
  Eigen::Vector3d gyro_bias, accel_bias;
  Eigen::Vector3d fade;
  double delay_s;

  Transfer(const SensorState& sensor, const DeviationVector& deviation)
      : gyro(sensor.C_b_gyro()),
        accel(sensor.C_b_accel()),
        C(sensor.C_b_s),
        C_accel_rotated(sensor.C_s_accel() * sensor.C_b_s),
        g_sensitivity(sensor.g_sensitivity()),
        flexure(sensor.flexure()),
        arm_b_m(sensor.lever_arm_b_m()),
        gyro_bias(sensor.x.segment<3>(kGyroBias)),
        accel_bias(sensor.x.segment<3>(kAccelBias)),
        fade(sensor.x.segment<3>(kAccelFade)),
        delay_s(sensor.x[kAccelDelay]) {
    for (Eigen::Index i = 0; i < 3; ++i) {
      place_b_m[static_cast<std::size_t>(i)] = C.transpose() * sensor.place_s_m(i);
      gyro_deviation.row(i) = deviation.segment<3>(3 * i).transpose();
      accel_deviation.row(i) = deviation.segment<3>(9 + 3 * i).transpose();
    }
  }
};

double flexure_gain(double frequency_hz) {
  const double ratio = frequency_hz / kFlexure_hz;
  return ratio * ratio;
}

complex<double> derivative(double frequency_hz) { return {0.0, 2.0 * std::numbers::pi * frequency_hz}; }

/// B-8 without the delay: what the three accelerometers feel, each at its place.
Vector3c accelerometers(const Transfer& t, const Motion& motion) {
  const Vector3c middle = motion.force_at(t.arm_b_m);
  Vector3c felt;
  for (Eigen::Index i = 0; i < 3; ++i) {
    const Vector3c there =
        middle + motion.arm * t.place_b_m[static_cast<std::size_t>(i)].cast<complex<double>>();
    felt[i] = (t.accel.row(i).cast<complex<double>>() * there).value();
  }
  return felt;
}

/// B-7: rates as the gyros show them, less bias and what forces add.
Vector3c gyros(const Transfer& t, const Motion& motion, double frequency_hz) {
  const Vector3c in_s = t.C * motion.omega;
  return t.gyro * motion.omega + flexure_gain(frequency_hz) * (t.flexure * in_s) + t.gyro_deviation * in_s;
}

Vector6c predicted(const Transfer& t, const Motion& motion, const Vector3c& study_f, complex<double> constant,
                   double frequency_hz) {
  Vector6c y;
  y.head<3>() = gyros(t, motion, frequency_hz) + t.g_sensitivity * study_f + constant * t.gyro_bias;
  const Vector3c felt = accelerometers(t, motion);
  y.tail<3>() = felt * (1.0 + derivative(frequency_hz) * t.delay_s) +
                flexure_gain(frequency_hz) * t.fade.cast<complex<double>>().cwiseProduct(felt) +
                t.accel_deviation * (t.C * motion.force_at(t.arm_b_m)) + constant * t.accel_bias;
  return y;
}

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
  J.block<3, 1>(0, kTimeOffset) = derivative(frequency_hz) * gyros(t, motion, frequency_hz);
  const Vector3c felt = accelerometers(t, motion);
  J.block<3, 1>(3, kTimeOffset) = derivative(frequency_hz) * felt;
  J.col(kClockRate) = from_middle_s * J.col(kTimeOffset);
  J.block<3, 1>(3, kAccelDelay) = J.block<3, 1>(3, kTimeOffset);
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
  for (Eigen::Index i = 0; i < 3; ++i) {
    J(i, kGyroBias + i) = constant;
    J(3 + i, kAccelBias + i) = constant;
    J(3 + i, kAccelFade + i) = flex * felt[i];
    J.block<1, 3>(i, kGSensitivity + 3 * i) = study_f.transpose();
    J.block<1, 3>(i, kFlexure + 3 * i) = flex * omega_s.transpose();
    J.block<1, 3>(i, kParameters + 3 * i) = omega_s.transpose();
    J.block<1, 3>(3 + i, kParameters + 9 + 3 * i) = force_s.transpose();
  }
}

/// Covariance of a residual at one frequency, and how the reference's noise enters it (B-10, B-12).
struct Weight {
  Matrix6c of_reference;  ///< D: residual = S noise - D (reference's noise)
  Eigen::Matrix<double, 6, 1> reference_power;
  Matrix6c gain;                ///< R D^H, scaled as the covariance's blocks are
  Eigen::LLT<Matrix6c> factor;  ///< of the covariance where every window is as the record
  Eigen::Matrix<double, 6, 1> power;
};

Weight weight_at(const Transfer& t, const NoiseBands& noise, const Problem& problem, Eigen::Index band,
                 double frequency_hz, double share) {
  Weight weight;
  for (Eigen::Index i = 0; i < 6; ++i) weight.power[i] = noise.power(band, i);
  const double of_gyros = std::min(share * weight.power.head<3>().mean(), problem.quietest_power(band, 0));
  // What its gyros' noise makes of accelerations at the lever arm is not its accelerometers'.
  const double omega = std::abs(derivative(frequency_hz));
  const double at_arm = omega * omega * (t.accel * skew(t.arm_b_m)).squaredNorm() / 3.0 * of_gyros;
  const double accel_power = weight.power.tail<3>().mean();
  const double left = std::max(accel_power - at_arm, kLeastLeftToAccels * accel_power);
  weight.reference_power.head<3>().setConstant(of_gyros);
  weight.reference_power.tail<3>().setConstant(std::min(share * left, problem.quietest_power(band, 1)));
  weight.of_reference.setZero();
  weight.of_reference.topLeftCorner<3, 3>() = t.gyro.cast<complex<double>>();
  weight.of_reference.bottomRightCorner<3, 3>() = t.accel.cast<complex<double>>();
  // [omega' x] r = -[r x] omega'
  weight.of_reference.bottomLeftCorner<3, 3>() = -derivative(frequency_hz) * (t.accel * skew(t.arm_b_m));
  Matrix6c gain = weight.reference_power.asDiagonal() * weight.of_reference.adjoint();
  Matrix6c covariance = weight.of_reference * gain;
  // The total is what was learned; the reference's part is held below it.
  Eigen::Matrix<double, 6, 1> scale;
  for (Eigen::Index i = 0; i < 6; ++i)
    scale[i] = std::min(1.0, std::sqrt(kLargestShare * weight.power[i] / covariance(i, i).real()));
  covariance = (scale.asDiagonal() * covariance * scale.asDiagonal()).eval();
  for (Eigen::Index i = 0; i < 6; ++i) covariance(i, i) = weight.power[i];
  if (of_gyros > kNoisyMotion * problem.mean_gyro_power[band])
    covariance.diagonal().tail<3>() *= kTellsNothing;
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

using Rows = Eigen::Matrix<double, Eigen::Dynamic, kColumns + 1, Eigen::RowMajor>;

/// Real and imaginary rows of a whitened derivative and its residual.
void put_rows(const Jacobian& J, const Vector6c& e, double frequency_hz, Eigen::Ref<Rows> rows) {
  // One-sided: every frequency but zero stands for its negative, too.
  const double weight = frequency_hz > 0.0 ? std::numbers::sqrt2 : 1.0;
  rows.topLeftCorner<6, kColumns>() = weight * J.real();
  rows.bottomLeftCorner(6, kColumns) = weight * J.imag();
  rows.col(kColumns).head<6>() = weight * e.real();
  rows.col(kColumns).tail<6>() = weight * e.imag();
}

class BandSummer {
 public:
  BandSummer(const Problem& problem, const Spectra& study, const Residuals& residual,
             const Estimate& estimate, const NoiseBands& noise, double share, bool corrected)
      : problem_(problem),
        study_(study),
        residual_(residual),
        estimate_(estimate),
        noise_(noise),
        share_(share),
        corrected_(corrected) {}

  BandSums sum(Eigen::Index band) {
    const Transfer t(estimate_.sensor, estimate_.deviation[static_cast<std::size_t>(band)]);
    const auto n_windows = static_cast<Eigen::Index>(problem_.plan.starts.size());
    std::vector<Weight> weights;
    for (Eigen::Index k = problem_.bands.first(band); k < problem_.bands.end(band); ++k)
      weights.push_back(weight_at(t, noise_, problem_, band, problem_.plan.frequency_hz(k), share_));
    BandSums sums;
    sums.scores.resize(n_windows, kColumns);
    Rows rows(12 * problem_.bands.width(band), kColumns + 1);
    Rows of_gyros(6 * problem_.bands.width(band), kColumns + 1);
    Eigen::Matrix<double, 6, 1> mean_weight = Eigen::Matrix<double, 6, 1>::Zero();
    for (Eigen::Index w = 0; w < n_windows; ++w) {
      const Eigen::Matrix<double, 6, 1> scale = window_scale(w, band, weights.front());
      mean_weight += scale.cwiseProduct(scale);
      for (Eigen::Index k = problem_.bands.first(band); k < problem_.bands.end(band); ++k) {
        const Eigen::Index i = k - problem_.bands.first(band);
        fill(t, weights[static_cast<std::size_t>(i)], scale, w, k, rows, 12 * i);
      }
      const auto J = rows.leftCols<kColumns>();
      sums.information.selfadjointView<Eigen::Lower>().rankUpdate(J.transpose());
      for (Eigen::Index i = 0; i < 2 * problem_.bands.width(band); ++i)
        of_gyros.middleRows<3>(3 * i) = rows.middleRows<3>(6 * i);
      sums.of_gyros.selfadjointView<Eigen::Lower>().rankUpdate(of_gyros.leftCols<kColumns>().transpose());
      sums.scores.row(w) = (J.transpose() * rows.col(kColumns)).transpose();
    }
    sums.information = sums.information.selfadjointView<Eigen::Lower>();
    sums.of_gyros = sums.of_gyros.selfadjointView<Eigen::Lower>();
    if (corrected_) add_noise(t, weights, band, mean_weight.cwiseSqrt(), sums);
    return sums;
  }

 private:
  /// Square root of the record's power over the window's, by axis.
  [[nodiscard]] Eigen::Matrix<double, 6, 1> window_scale(Eigen::Index window, Eigen::Index band,
                                                         const Weight& weight) const {
    Eigen::Matrix<double, 6, 1> scale;
    for (Eigen::Index i = 0; i < 6; ++i)
      scale[i] = std::sqrt(weight.power[i] / noise_.window_power(window, band, i));
    return scale;
  }

  void fill(const Transfer& t, const Weight& weight, const Eigen::Matrix<double, 6, 1>& scale, Eigen::Index w,
            Eigen::Index k, Rows& rows, Eigen::Index first_row) {
    const double f_hz = problem_.plan.frequency_hz(k);
    Vector6c e = residual_.row(w * problem_.plan.n_frequencies + k).transpose();
    e = weight.factor.matrixL().solve((scale.asDiagonal() * e).eval());
    Motion motion = motion_of(problem_.reference, w, k);
    if (corrected_) {
      const Vector6c weighted = scale.asDiagonal() * weight.factor.matrixU().solve(e);
      motion = estimated_motion(motion, weight, weighted, f_hz);
    }
    const Vector3c study_f = study_.row(w, k).tail<3>().transpose();
    jacobian(estimate_.sensor, t, motion, study_f, problem_.constant[k], f_hz, problem_.from_middle_s[w], J_);
    for (Eigen::Index i = 0; i < 6; ++i) J_.row(i) *= scale[i];
    weight.factor.matrixL().solveInPlace(J_);
    put_rows(J_, e, f_hz, rows.middleRows<12>(first_row));
  }

  /// B-13: derivatives that the motion's own uncertainty alone would have, all windows in one.
  void add_noise(const Transfer& t, const std::vector<Weight>& weights, Eigen::Index band,
                 const Eigen::Matrix<double, 6, 1>& scale, BandSums& sums) {
    Rows rows(12 * 6, kColumns + 1);
    for (Eigen::Index k = problem_.bands.first(band); k < problem_.bands.end(band); ++k) {
      const Weight& weight = weights[static_cast<std::size_t>(k - problem_.bands.first(band))];
      const double f_hz = problem_.plan.frequency_hz(k);
      const Matrix6c W_inverse = weight.factor.solve(Matrix6c::Identity());
      Matrix6c motion_covariance = -weight.gain * W_inverse * weight.gain.adjoint();
      for (Eigen::Index i = 0; i < 6; ++i) motion_covariance(i, i) += weight.reference_power[i];
      motion_covariance /=
          kWindowsPerInstant;  // the transforms' mean square is that much smaller than the power
      const Eigen::LLT<Matrix6c> root(motion_covariance);
      if (root.info() != Eigen::Success) continue;
      const Matrix6c L = root.matrixL();
      for (Eigen::Index j = 0; j < 6; ++j) {
        Motion motion{L.col(j).head<3>(), L.col(j).tail<3>(), Matrix3c::Zero()};
        motion.arm = skew_c(derivative(f_hz) * motion.omega);
        jacobian(estimate_.sensor, t, motion, Vector3c::Zero(), 0.0, f_hz, 0.0, J_);
        for (Eigen::Index i = 0; i < 6; ++i) J_.row(i) *= scale[i];
        weight.factor.matrixL().solveInPlace(J_);
        put_rows(J_, Vector6c::Zero(), f_hz, rows.middleRows<12>(12 * j));
      }
      sums.of_noise.selfadjointView<Eigen::Lower>().rankUpdate(rows.leftCols<kColumns>().transpose());
    }
    sums.of_noise = sums.of_noise.selfadjointView<Eigen::Lower>();
  }

  const Problem& problem_;
  const Spectra& study_;
  const Residuals& residual_;
  const Estimate& estimate_;
  const NoiseBands& noise_;
  double share_;
  bool corrected_;
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
                                const Estimate& estimate, const NoiseBands& noise, double reference_share,
                                bool corrected) {
  std::vector<BandSums> sums(static_cast<std::size_t>(problem.bands.size()));
  tbb::parallel_for(std::size_t{0}, sums.size(), [&](std::size_t band) {
    BandSummer summer(problem, study, residual, estimate, noise, reference_share, corrected);
    sums[band] = summer.sum(static_cast<Eigen::Index>(band));
  });
  return sums;
}

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
