#include "tools/trials/s_imu_score.h"

#include <fmt/format.h>
#include <Eigen/Dense>
#include <cmath>

#include "base/units.h"
#include "estimation/calibration/filter_core.h"
#include "estimation/navigation/so3.h"
#include "tools/trials/own_sd.h"

namespace s_imu_score {
namespace {

using Eigen::Vector3d;

constexpr double kTwoSided95 = 1.96;
constexpr double kNeesLow = 5.4;
constexpr double kNeesHigh = 6.6;
constexpr double kCoverageLow = 0.93;
constexpr double kCoverageHigh = 0.97;

enum KindIndex : std::size_t { kPsi, kLeverArm, kTimeOffset, kGyroScale, kAccelScale, kAlpha, kAccelTime };

}  // namespace

void StateScore::add(double error, double sd) {
  if (!(sd > 0.0)) return;
  ++n_;
  inside_ += std::abs(error) <= kTwoSided95 * sd ? 1 : 0;
  error2_ += error * error;
  sd2_ += sd * sd;
  z2_ += error * error / (sd * sd);
}

void StateScore::add(const imuscope::Vector3& estimate, const imuscope::Vector3& sd, const Vector3d& truth) {
  for (std::size_t i = 0; i < 3; ++i) add(truth(static_cast<Eigen::Index>(i)) - estimate[i], sd[i]);
}

void StateScore::add(const StateScore& other) {
  n_ += other.n_;
  inside_ += other.inside_;
  error2_ += other.error2_;
  sd2_ += other.sd2_;
  z2_ += other.z2_;
}

double StateScore::rms() const { return std::sqrt(error2_ / n_); }
double StateScore::rms_sd() const { return std::sqrt(sd2_ / n_); }
double StateScore::mean_z2() const { return z2_ / n_; }
double StateScore::coverage() const { return static_cast<double>(inside_) / n_; }

Eigen::Matrix<double, 6, 1> mounting_error(const imuscope::SImuOutput& out, const SImuTruth& truth) {
  Eigen::Matrix<double, 6, 1> error;
  error.head<3>() = -imuscope::log_so3(imuscope::to_eigen(out.C_b_s).transpose() * truth.C_b_s);
  error.tail<3>() = truth.r_bs_b_m - imuscope::to_eigen(out.r_bs_b_m);
  return error;
}

double mounting_nees(const imuscope::SImuOutput& out, const SImuTruth& truth) {
  const Eigen::Matrix<double, 6, 1> error = mounting_error(out, truth);
  const Eigen::Map<const Eigen::Matrix<double, 6, 6>> P(out.covariance_psi_r.data());
  return error.dot(P.ldlt().solve(error));
}

std::vector<SImuScore::Kind> SImuScore::all_kinds() {
  constexpr double kMdeg = 1e3 * imuscope::kDegPerRad;
  constexpr double kMilli = 1e3;
  constexpr double kMicro = 1e6;
  return {{"psi", "mdeg", kMdeg, {}},         {"r", "mm", kMilli, {}},
          {"t_d", "us", kMicro, {}},          {"gyro scale", "ppm", kMicro, {}},
          {"accel scale", "ppm", kMicro, {}}, {"accel boresight", "mdeg", kMdeg, {}},
          {"accel t_d", "us", kMicro, {}}};
}

void SImuScore::add(const imuscope::SImuOutput& out, const SImuTruth& truth) {
  ++n_;
  nees6_ += mounting_nees(out, truth);
  const Eigen::Matrix<double, 6, 1> error = mounting_error(out, truth);
  for (std::size_t i = 0; i < 3; ++i) {
    kinds_[kPsi].score.add(error(static_cast<Eigen::Index>(i)), out.sd_psi_rad[i]);
    kinds_[kLeverArm].score.add(error(static_cast<Eigen::Index>(3 + i)), out.sd_r_bs_b_m[i]);
  }
  kinds_[kTimeOffset].score.add(truth.t_d_s - out.t_d_s, out.sd_t_d_s);
  kinds_[kGyroScale].score.add(out.gyro_scale, out.sd_gyro_scale, truth.gyro_scale);
  kinds_[kAccelScale].score.add(out.accel_scale, out.sd_accel_scale, truth.accel_scale);
  // C_accel = C_b_s Exp(-alpha): C_s_accel C_b_s = C_b_s Exp(-alpha).
  const Vector3d alpha = -imuscope::log_so3(truth.C_b_s.transpose() * truth.C_s_accel * truth.C_b_s);
  kinds_[kAlpha].score.add(out.accel_boresight_rad, out.sd_accel_boresight_rad, alpha);
  kinds_[kAccelTime].score.add(truth.accel_t_d_s - out.accel_t_d_s, out.sd_accel_t_d_s);
}

void SImuScore::add(const SImuScore& other) {
  n_ += other.n_;
  nees6_ += other.nees6_;
  for (std::size_t i = 0; i < kinds_.size(); ++i) kinds_[i].score.add(other.kinds_[i].score);
}

std::string SImuScore::table() const {
  std::string text;
  for (const Kind& kind : kinds_) {
    if (kind.score.n() == 0) continue;
    text += fmt::format(
        "   {:15} {:5} rms {:10.3f}  sd {:10.3f}  mean z2 {:8.2f}  within 95 % interval {:5.1f} %\n",
        kind.name, kind.unit, kind.per_si * kind.score.rms(), kind.per_si * kind.score.rms_sd(),
        kind.score.mean_z2(), 1e2 * kind.score.coverage());
  }
  return text;
}

bool SImuScore::honest() const {
  if (n_ == 0) return false;
  // A sensor's components share a drive: they count as one.
  const double nees_off = imuscope::kOwnSd * std::sqrt(12.0 / n_);
  const double coverage_off = imuscope::kOwnSd * std::sqrt(0.95 * 0.05 / n_);
  if (nees6() < kNeesLow - nees_off || nees6() > kNeesHigh + nees_off) return false;
  for (const Kind& kind : kinds_) {
    if (kind.score.n() == 0) continue;
    const double inside = kind.score.coverage();
    if (inside < kCoverageLow - coverage_off || inside > kCoverageHigh + coverage_off) return false;
  }
  return true;
}

}  // namespace s_imu_score
