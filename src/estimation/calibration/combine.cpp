#include "estimation/calibration/combine.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <boost/math/distributions/chi_squared.hpp>
#include <cmath>
#include <string>

#include "base/contracts.h"
#include "estimation/calibration/drive_scatter.h"
#include "estimation/calibration/filter_core.h"
#include "estimation/navigation/so3.h"

namespace imuscope {
namespace {

using Vector6 = Eigen::Matrix<double, 6, 1>;
using Matrix6 = Eigen::Matrix<double, 6, 6>;

constexpr int kWeightSteps = 2000;
constexpr double kWeightTolerance = 1e-10;

using RowFactor = Eigen::Matrix<double, 6, Eigen::Dynamic, Eigen::RowMajor>;

struct Information {
  Vector6 x;  ///< (psi, r) about the first drive's mounting
  Matrix6 covariance;
  Matrix6 information;
  RowFactor shared;  ///< E-20; no column where nothing is shared
};

/// Sum of w I and its weighted mean. E-22.
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

/// Drives whose errors have something in common, and their best mean. E-20.
struct SharingDrives {
  Eigen::VectorXd x;           ///< (psi, r) one after the other
  Eigen::MatrixXd covariance;  ///< of x
  Vector6 mean;
  Matrix6 P;  ///< of the mean

  explicit SharingDrives(const std::vector<const Information*>& drives)
      : x(6 * static_cast<Eigen::Index>(drives.size())), covariance(x.size(), x.size()) {
    for (std::size_t i = 0; i < drives.size(); ++i) {
      const auto row = 6 * static_cast<Eigen::Index>(i);
      x.segment<6>(row) = drives[i]->x;
      for (std::size_t j = 0; j < drives.size(); ++j) {
        covariance.block<6, 6>(row, 6 * static_cast<Eigen::Index>(j)) =
            i == j ? drives[i]->covariance : Matrix6(drives[i]->shared * drives[j]->shared.transpose());
      }
    }
    Eigen::MatrixXd ones(x.size(), 6);
    for (Eigen::Index row = 0; row < x.size(); row += 6) ones.block<6, 6>(row, 0).setIdentity();
    const Eigen::MatrixXd whitened = covariance.ldlt().solve(ones);
    P = (ones.transpose() * whitened).ldlt().solve(Matrix6::Identity());
    mean = P * (whitened.transpose() * x);
  }

  /// E-21.
  [[nodiscard]] double chi2() const {
    Eigen::VectorXd apart = x;
    for (Eigen::Index row = 0; row < x.size(); row += 6) apart.segment<6>(row) -= mean;
    return apart.dot(covariance.ldlt().solve(apart));
  }
};

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

/// Whether what the drives share is told of each of them in the same terms.
bool share_errors(std::span<const MountingEstimate> estimates) {
  const std::size_t n = estimates.front().shared_psi_r.size();
  return n > 0 && n % 6 == 0 && std::all_of(estimates.begin(), estimates.end(), [n](const auto& estimate) {
           return estimate.shared_psi_r.size() == n;
         });
}

}  // namespace

Result<CombinedMounting> combine(std::span<const MountingEstimate> estimates, CombineMethod method) {
  if (estimates.empty()) return usage_error("there is no mounting to combine", "name at least one run");
  const Eigen::Matrix3d C_first = to_eigen(estimates.front().C_b_s);
  const bool sharing = share_errors(estimates);
  std::vector<Information> all;
  for (std::size_t i = 0; i < estimates.size(); ++i) {
    const Eigen::Map<const Matrix6> P(estimates[i].covariance_psi_r.data());
    const Eigen::LLT<Matrix6> factor(P);
    if (!P.allFinite() || factor.info() != Eigen::Success) {
      return work_error("covariance of mounting " + std::to_string(i + 1) + " is not positive definite",
                        "leave that run out");
    }
    Information one;
    // E-20: the mounting as a vector about the first drive's
    one.x.head<3>() = -log_so3(C_first.transpose() * to_eigen(estimates[i].C_b_s));
    one.x.tail<3>() = to_eigen(estimates[i].r_bs_b_m);
    one.covariance = P;
    one.information = factor.solve(Matrix6::Identity());
    one.shared.resize(6, 0);
    if (sharing) {
      const auto& shared = estimates[i].shared_psi_r;
      one.shared =
          Eigen::Map<const RowFactor>(shared.data(), 6, static_cast<Eigen::Index>(shared.size() / 6));
    }
    all.push_back(one);
  }

  CombinedMounting out;
  std::vector<const Information*> drives;
  for (const Information& one : all) drives.push_back(&one);
  const SharingDrives together(drives);
  Vector6 x = together.mean;
  Matrix6 P = together.P;
  out.homogeneity_chi2 = together.chi2();
  out.homogeneity_dof = 6 * (all.size() - 1);
  if (out.homogeneity_dof > 0)
    out.homogeneity_p_value = upper_tail(out.homogeneity_chi2, static_cast<double>(out.homogeneity_dof));
  out.drives.resize(all.size());
  out.weights.assign(all.size(), 1.0);
  if (all.size() > 1) {
    const DriveScatter scatter = drive_scatter(together.x, together.covariance);
    for (std::size_t i = 0; i < all.size(); ++i) {
      Eigen::Map<Vector6>(out.drives[i].deviation.data()) = scatter.drives[i].deviation;
      Eigen::Map<Vector6>(out.drives[i].deviation_sd.data()) = scatter.drives[i].sd;
      out.drives[i].p_value = scatter.drives[i].p_value;
    }
    if (method == CombineMethod::kInverseVariance) {
      x = scatter.mean;
      P = scatter.covariance;
      out.between_drives_psi_sd_rad = scatter.psi_sd_rad;
      out.between_drives_r_sd_m = scatter.r_sd_m;
    }
  }
  if (method == CombineMethod::kCovarianceIntersection) {
    out.weights = intersection_weights(all);
    x = weighted_mean(all, out.weights, P);
  }
  out.estimate.C_b_s = to_array(reorthonormalized(C_first * exp_so3(-x.head<3>())));
  out.estimate.r_bs_b_m = to_array(Eigen::Vector3d(x.tail<3>()));
  Eigen::Map<Matrix6>(out.estimate.covariance_psi_r.data()) = 0.5 * (P + P.transpose());
  return out;
}

double CombinedMounting::one_mounting_p_value() const {
  double least = 1.0;
  for (const DriveDeviation& drive : drives) least = std::min(least, drive.p_value);
  return std::min(1.0, least * static_cast<double>(drives.size()));
}

// E-23
void WeightedMean::add(double value, double sd) noexcept {
  IMUSCOPE_EXPECTS(sd > 0.0);
  const double weight = 1.0 / (sd * sd);
  sum_ += weight * value;
  weight_ += weight;
}

double WeightedMean::claimed_sd() const noexcept { return weight_ > 0.0 ? 1.0 / std::sqrt(weight_) : 0.0; }

}  // namespace imuscope
