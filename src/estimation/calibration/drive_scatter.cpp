#include "estimation/calibration/drive_scatter.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <boost/math/distributions/chi_squared.hpp>
#include <cmath>
#include <limits>

#include "base/contracts.h"

namespace imuscope {
namespace {

using Vector6 = DriveScatter::Vector6;
using Matrix6 = DriveScatter::Matrix6;

/// What a mounting that was not taken apart may do between drives, as the sd of half a normal distribution:
/// axes of an industrial MEMS move by up to its 0.1 deg with temperature (data sheet of the MTx), a sensor
/// moves by the play of its screws, half a millimetre (ISO 273, medium series, M4: holes of 4.5 mm).
constexpr double kGive_rad = 1.75e-3;
constexpr double kGive_m = 5e-4;
/// Before the drives are seen, that a mounting repeats exactly is as likely as that it does not.
constexpr double kRepeats = 0.5;
/// Sizes that are tried, in kGive: from what no drive shows to what is no give any more.
constexpr int kSizes = 10;
constexpr double kSmallest = 0.02;
constexpr double kLargest = 3.0;

/// A size of the scatter, in kGive, and what is believed of it.
struct Size {
  double share = 0.0;
  double prior = kRepeats;
};

/// E-25: sizes of the scatter, and what is believed of each before the drives.
std::vector<Size> sizes() {
  std::vector<Size> all{Size{}};
  const double ratio = std::pow(kLargest / kSmallest, 1.0 / (kSizes - 1));
  double sum = 0.0;
  for (int i = 0; i < kSizes; ++i) {
    const double share = kSmallest * std::pow(ratio, i);
    // Density times the width of the cell.
    all.push_back({share, share * std::exp(-0.5 * share * share)});
    sum += all.back().prior;
  }
  for (std::size_t i = 1; i < all.size(); ++i) all[i].prior *= (1.0 - kRepeats) / sum;
  return all;
}

/// All that follows from one size of the scatter in rotation and one in place.
struct Case {
  double psi_sd_rad = 0.0;
  double r_sd_m = 0.0;
  double log_weight = 0.0;  ///< prior and likelihood, but for a constant
  Vector6 mean;
  Matrix6 covariance;
  struct Drive {
    Vector6 deviation;  ///< from the mean of the others
    Matrix6 covariance;
    double chi2 = 0.0;
    double log_weight = 0.0;  ///< by the others alone
  };
  std::vector<Drive> drives;
};

double log_determinant(const Matrix6& m) {
  const Eigen::LLT<Matrix6> factor(m);
  return 2.0 * factor.matrixLLT().diagonal().array().log().sum();
}

Case weigh(const Eigen::VectorXd& x, Eigen::MatrixXd S, const Size& psi, const Size& r) {
  Case out;
  out.psi_sd_rad = psi.share * kGive_rad;
  out.r_sd_m = r.share * kGive_m;
  const Eigen::Index n = x.size() / 6;
  // E-25: more of S by what the mounting does between drives.
  Eigen::MatrixXd ones(x.size(), 6);
  for (Eigen::Index i = 0; i < n; ++i) {
    ones.middleRows<6>(6 * i).setIdentity();
    S.diagonal().segment<3>(6 * i).array() += out.psi_sd_rad * out.psi_sd_rad;
    S.diagonal().segment<3>(6 * i + 3).array() += out.r_sd_m * out.r_sd_m;
  }
  const Eigen::LLT<Eigen::MatrixXd> factor(S);
  const Eigen::MatrixXd inverse = factor.solve(Eigen::MatrixXd::Identity(x.size(), x.size()));
  const Eigen::MatrixXd whitened = inverse * ones;
  const Matrix6 information = ones.transpose() * whitened;
  // E-20, with that S
  out.covariance = information.ldlt().solve(Matrix6::Identity());
  out.mean = out.covariance * (whitened.transpose() * x);
  // What is left of the weights once the mean is free (E-26).
  const Eigen::MatrixXd Q = inverse - whitened * out.covariance * whitened.transpose();
  const Eigen::VectorXd pull = Q * x;
  const double log_det_S = 2.0 * factor.matrixLLT().diagonal().array().log().sum();
  out.log_weight =
      std::log(psi.prior * r.prior) - 0.5 * (log_det_S + log_determinant(information) + x.dot(pull));
  for (Eigen::Index i = 0; i < n; ++i) {
    const Matrix6 own = Q.block<6, 6>(6 * i, 6 * i);
    Case::Drive drive;
    // E-24, E-27: from the mean of the others
    drive.covariance = own.ldlt().solve(Matrix6::Identity());
    drive.deviation = drive.covariance * pull.segment<6>(6 * i);
    drive.chi2 = drive.deviation.dot(pull.segment<6>(6 * i));
    // That others agree by chance does not make this drive an odd one: here every mounting gives way.
    drive.log_weight = psi.share > 0.0 && r.share > 0.0
                           ? out.log_weight - 0.5 * log_determinant(own) + 0.5 * drive.chi2
                           : -std::numeric_limits<double>::infinity();
    out.drives.push_back(drive);
  }
  return out;
}

double upper_tail(double chi2) {
  return boost::math::cdf(boost::math::complement(boost::math::chi_squared(6.0), std::max(0.0, chi2)));
}

/// Weights that add up to one, of logarithms.
template <typename Log>
std::vector<double> normalised(const std::vector<Case>& cases, Log log_weight) {
  double largest = -std::numeric_limits<double>::infinity();
  for (const Case& one : cases) largest = std::max(largest, log_weight(one));
  std::vector<double> weights;
  double sum = 0.0;
  for (const Case& one : cases) {
    weights.push_back(std::exp(log_weight(one) - largest));
    sum += weights.back();
  }
  for (double& weight : weights) weight /= sum;
  return weights;
}

/// E-27: over all sizes, by what the others say of them.
DriveScatter::Drive against_others(const std::vector<Case>& cases, std::size_t i) {
  DriveScatter::Drive out;
  const auto weights = normalised(cases, [i](const Case& one) { return one.drives[i].log_weight; });
  Vector6 square = Vector6::Zero();
  out.p_value = 0.0;
  for (std::size_t k = 0; k < cases.size(); ++k) {
    const Case::Drive& drive = cases[k].drives[i];
    out.deviation += weights[k] * drive.deviation;
    square += weights[k] * drive.covariance.diagonal();
    out.p_value += weights[k] * upper_tail(drive.chi2);
  }
  out.sd = square.cwiseMax(0.0).cwiseSqrt();
  return out;
}

}  // namespace

DriveScatter drive_scatter(const Eigen::VectorXd& x, const Eigen::MatrixXd& covariance) {
  IMUSCOPE_EXPECTS(x.size() >= 12 && x.size() % 6 == 0);
  std::vector<Case> cases;
  for (const Size& psi : sizes())
    for (const Size& r : sizes()) cases.push_back(weigh(x, covariance, psi, r));
  // E-26: over all sizes
  const auto weights = normalised(cases, [](const Case& one) { return one.log_weight; });
  DriveScatter out;
  double psi_square = 0.0;
  double r_square = 0.0;
  for (std::size_t k = 0; k < cases.size(); ++k) {
    out.mean += weights[k] * cases[k].mean;
    psi_square += weights[k] * cases[k].psi_sd_rad * cases[k].psi_sd_rad;
    r_square += weights[k] * cases[k].r_sd_m * cases[k].r_sd_m;
  }
  out.psi_sd_rad = std::sqrt(psi_square);
  out.r_sd_m = std::sqrt(r_square);
  for (std::size_t k = 0; k < cases.size(); ++k) {
    const Vector6 apart = cases[k].mean - out.mean;
    out.covariance += weights[k] * (cases[k].covariance + apart * apart.transpose());
  }
  for (std::size_t i = 0; i < cases.front().drives.size(); ++i)
    out.drives.push_back(against_others(cases, i));
  return out;
}

}  // namespace imuscope
