#include "tools/trials/six_states.h"

#include <Eigen/Dense>
#include <cmath>

#include "estimation/calibration/s_imu_model.h"
#include "estimation/navigation/so3.h"

namespace standard_drive {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using Matrix6d = Eigen::Matrix<double, 6, 6>;
using Matrix63d = Eigen::Matrix<double, 6, 3>;

/// Cov(sum of H' b) of one triad, and its information.
class TriadSums {
 public:
  TriadSums(const imuscope::GaussMarkovConfig& slow, double turn_on_sd, double R, double dt_s)
      : slow_variance_(slow.sd * slow.sd),
        turn_on_variance_(turn_on_sd * turn_on_sd),
        decay_(std::exp(-dt_s / slow.time_constant_s)),
        R_(R) {}

  void add(const Matrix63d& Ht) {
    information_ += Ht * Ht.transpose() / R_;
    // sum over k, l of H_k' H_l phi^|k-l|, by the sum over l < k.
    const Matrix63d before = decay_ * decayed_;
    const Matrix6d cross = Ht * before.transpose();
    slow_ += Ht * Ht.transpose() + cross + cross.transpose();
    decayed_ = before + Ht;
    sum_ += Ht;
  }
  [[nodiscard]] const Matrix6d& information() const { return information_; }
  [[nodiscard]] Matrix6d bias_covariance() const {
    return (turn_on_variance_ * sum_ * sum_.transpose() + slow_variance_ * slow_) / (R_ * R_);
  }

 private:
  double slow_variance_;
  double turn_on_variance_;
  double decay_;
  double R_;
  Matrix6d information_ = Matrix6d::Zero();
  Matrix6d slow_ = Matrix6d::Zero();
  Matrix63d decayed_ = Matrix63d::Zero();
  Matrix63d sum_ = Matrix63d::Zero();
};

double variance_of(const imuscope::TriadNoise& noise, double dt_s) {
  return imuscope::inflated_variance(noise.white_sd[0], noise.fast_sd[0], noise.fast_time_constant_s[0],
                                     dt_s);
}

}  // namespace

SixStateErrors six_state_errors(const imusim::Motion& motion, double duration_s, const Vector3d& r_bs_b_m,
                                const imuscope::SImuConfig& study) {
  const double dt_s = 1.0 / study.rate_hz;
  constexpr auto kDynamic = static_cast<std::size_t>(imuscope::Regime::kDynamic);
  TriadSums gyro(study.noise.gyro_bias[0], study.turn_on_gyro_sd_radps[0],
                 variance_of(study.noise.gyro[kDynamic], dt_s), dt_s);
  TriadSums accel(study.noise.accel_bias[0], study.turn_on_accel_sd_mps2[0],
                  variance_of(study.noise.accel[kDynamic], dt_s), dt_s);
  const auto samples = static_cast<std::size_t>(std::lround(duration_s * study.rate_hz));
  for (std::size_t k = 0; k < samples; ++k) {
    const imusim::MotionState b = motion.state_at(static_cast<double>(k) * dt_s);
    const Matrix3d W = imuscope::skew(b.omega_ib_b_radps);
    const Matrix3d M = W * W + imuscope::skew(b.omega_dot_ib_b_radps2);
    Matrix63d Ht = Matrix63d::Zero();
    Ht.topRows<3>() = W.transpose();
    gyro.add(Ht);
    Ht.topRows<3>() = imuscope::skew(b.f_b_mps2 + M * r_bs_b_m).transpose();
    Ht.bottomRows<3>() = M.transpose();
    accel.add(Ht);
  }
  const Matrix6d N = gyro.information() + accel.information();
  const Matrix6d N_inverse = N.ldlt().solve(Matrix6d::Identity());
  const Matrix6d P =
      N_inverse + N_inverse * (gyro.bias_covariance() + accel.bias_covariance()) * N_inverse.transpose();
  const Eigen::Matrix<double, 6, 1> sd = P.diagonal().cwiseSqrt();
  return {sd.head<3>(), sd.tail<3>()};
}

}  // namespace standard_drive
