#include "calibration/combine.h"

#include <Eigen/Cholesky>
#include <boost/math/distributions/chi_squared.hpp>
#include <cmath>
#include <string>

#include "base/contracts.h"
#include "calibration/filter_core.h"
#include "navigation/so3.h"

namespace imuscope {
namespace {

using Vector6 = Eigen::Matrix<double, 6, 1>;
using Matrix6 = Eigen::Matrix<double, 6, 6>;

constexpr int kWeightSteps = 2000;
constexpr double kWeightTolerance = 1e-10;

struct Information {
  Vector6 x;  ///< (psi, r) about the first drive's mounting
  Matrix6 information;
};

/// Sum of w I and its weighted mean.
Vector6 weighted_mean(const std::vector<Information>& all, const std::vector<double>& weights,
                      Matrix6& covariance) {
  Matrix6 sum = Matrix6::Zero();
  Vector6 right = Vector6::Zero();
  for (std::size_t i = 0; i < all.size(); ++i) {
    sum += weights[i] * all[i].information;
    right += weights[i] * (all[i].information * all[i].x);
  }
  covariance = sum.ldlt().solve(Matrix6::Identity());
  return covariance * right;
}

/// Weights that minimise log det P of the intersection: w_i <- w_i tr(P I_i) / 6, which keeps the sum at one
/// and never increases det P (Titterington 1976). E-22.
std::vector<double> intersection_weights(const std::vector<Information>& all) {
  std::vector<double> weights(all.size(), 1.0 / static_cast<double>(all.size()));
  for (int step = 0; step < kWeightSteps; ++step) {
    Matrix6 P;
    weighted_mean(all, weights, P);
    double moved = 0.0;
    for (std::size_t i = 0; i < all.size(); ++i) {
      const double next = weights[i] * (P * all[i].information).trace() / 6.0;
      moved = std::max(moved, std::abs(next - weights[i]));
      weights[i] = next;
    }
    if (moved < kWeightTolerance) break;
  }
  return weights;
}

double upper_tail(double chi2, double dof) {
  return boost::math::cdf(boost::math::complement(boost::math::chi_squared(dof), chi2));
}

/// Drive i against the inverse-variance mean of all others: their errors are independent, so that the
/// difference has the sum of the covariances. E-24.
DriveDeviation deviation_of(const std::vector<Information>& all, std::size_t i) {
  DriveDeviation out;
  if (all.size() < 2) return out;
  std::vector<double> others(all.size(), 1.0);
  others[i] = 0.0;
  Matrix6 P;
  const Vector6 mean = weighted_mean(all, others, P);
  P += all[i].information.ldlt().solve(Matrix6::Identity());
  const Vector6 difference = all[i].x - mean;
  Eigen::Map<Vector6>(out.deviation.data()) = difference;
  Eigen::Map<Vector6>(out.deviation_sd.data()) = P.diagonal().cwiseSqrt();
  out.chi2 = difference.dot(P.ldlt().solve(difference));
  out.p_value = upper_tail(out.chi2, 6.0);
  return out;
}

}  // namespace

Result<CombinedMounting> combine(std::span<const MountingEstimate> estimates, CombineMethod method) {
  if (estimates.empty()) return usage_error("there is no mounting to combine", "name at least one run");
  const Eigen::Matrix3d C_first = to_eigen(estimates.front().C_b_s);
  std::vector<Information> all;
  for (std::size_t i = 0; i < estimates.size(); ++i) {
    const Eigen::Map<const Matrix6> P(estimates[i].covariance_psi_r.data());
    const Eigen::LLT<Matrix6> factor(P);
    if (!P.allFinite() || factor.info() != Eigen::Success) {
      return work_error("covariance of mounting " + std::to_string(i + 1) + " is not positive definite",
                        "leave that run out");
    }
    Information one;
    one.x.head<3>() = -log_so3(C_first.transpose() * to_eigen(estimates[i].C_b_s));
    one.x.tail<3>() = to_eigen(estimates[i].r_bs_b_m);
    one.information = factor.solve(Matrix6::Identity());
    all.push_back(one);
  }

  CombinedMounting out;
  const std::vector<double> ones(all.size(), 1.0);
  Matrix6 P;
  Vector6 x = weighted_mean(all, ones, P);
  for (const Information& one : all) out.homogeneity_chi2 += (one.x - x).dot(one.information * (one.x - x));
  out.homogeneity_dof = 6 * (all.size() - 1);
  if (out.homogeneity_dof > 0)
    out.homogeneity_p_value = upper_tail(out.homogeneity_chi2, static_cast<double>(out.homogeneity_dof));
  for (std::size_t i = 0; i < all.size(); ++i) out.drives.push_back(deviation_of(all, i));
  out.weights = ones;
  if (method == CombineMethod::kCovarianceIntersection) {
    out.weights = intersection_weights(all);
    x = weighted_mean(all, out.weights, P);
  }
  out.estimate.C_b_s = to_array(orthonormalised(C_first * exp_so3(-x.head<3>())));
  out.estimate.r_bs_b_m = to_array(Eigen::Vector3d(x.tail<3>()));
  Eigen::Map<Matrix6>(out.estimate.covariance_psi_r.data()) = 0.5 * (P + P.transpose());
  return out;
}

void WeightedMean::add(double value, double sd) noexcept {
  IMUSCOPE_EXPECTS(sd > 0.0);
  const double weight = 1.0 / (sd * sd);
  sum_ += weight * value;
  weight_ += weight;
}

double WeightedMean::claimed_sd() const noexcept { return weight_ > 0.0 ? 1.0 / std::sqrt(weight_) : 0.0; }

}  // namespace imuscope
