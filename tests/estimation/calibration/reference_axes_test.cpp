// What the reference's own axes make of a mounting (C-27) against mountings that are found with references whose axes
// are drawn, by estimates that know nothing of it.

#include "estimation/calibration/reference_axes.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <random>
#include <vector>

#include "estimation/navigation/so3.h"

namespace imuscope {
namespace {

using Eigen::Index;
using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

constexpr ReferenceGrade kGrade{5e-3, 1e-3, 2e-3};

class Draw {
 public:
  double normal(double sd) { return sd * normal_(generator_); }
  Vector3d vector(const Vector3d& sd) { return {normal(sd.x()), normal(sd.y()), normal(sd.z())}; }
  /// I + E, of a triad of this grade
  Matrix3d axes(const ReferenceGrade& grade) {
    Matrix3d out = Matrix3d::Identity();
    for (Index i = 0; i < 3; ++i) {
      out(i, i) += normal(grade.scale_sd);
      for (Index j = i + 1; j < 3; ++j) {
        out(i, j) = normal(grade.lean_sd_rad);
        out(j, i) = out(i, j);
      }
    }
    return out;
  }

 private:
  std::mt19937 generator_{7};
  std::normal_distribution<double> normal_;
};

/// A = L C, L lower triangular with a positive diagonal: the frame along the x gyro, y in the plane of the x and y gyros.
Matrix3d along_the_axes(const Matrix3d& A) {
  Matrix3d C;
  C.row(0) = A.row(0).normalized();
  C.row(1) = (A.row(1) - A.row(1).dot(C.row(0)) * C.row(0)).normalized();
  C.row(2) = C.row(0).cross(C.row(1));
  return C;
}

/// d psi / d e of the frame along the S-IMU's axes, C-22
Matrix3d by_leaning(const Matrix3d& C_b_s) {
  return C_b_s.transpose() * Vector3d(1.0, -1.0, 1.0).asDiagonal();
}

TEST(ReferenceAxes, TurnAMountingThatIsKnownElseAsFarAsSaidAndThatWay) {
  Draw draw;
  for (const Vector3d& turn :
       {Vector3d(0.0, 0.0, 0.0), Vector3d(0.3, -0.7, 1.2), Vector3d(0.02, 3.1, 0.01)}) {
    const Matrix3d C_b_s = exp_so3(turn);
    const Matrix3d crooked = draw.axes(kGrade);
    const Matrix3d C_true = along_the_axes(crooked * C_b_s);
    Matrix3d seen = Matrix3d::Zero();
    constexpr int kReferences = 20000;
    for (int n = 0; n < kReferences; ++n) {
      // Rates of rank three determine the S-IMU's rates over the reference's: G C (I + E)^-1.
      const Matrix3d found = along_the_axes(crooked * C_b_s * draw.axes(kGrade).inverse());
      const Vector3d psi_rad = -log_so3(C_true.transpose() * found);
      seen += psi_rad * psi_rad.transpose() / kReferences;
    }
    const ReferenceColumns F =
        reference_columns(AffectedCovariance::Zero(), TakenUpSd::Constant(0.01), C_b_s, kGrade);
    const Eigen::Matrix<double, 3, kAxesErrors> F_psi =
        F.middleRows<3>(affected::kPsi) + by_leaning(C_b_s) * F.middleRows<3>(affected::kGyroAxes);
    const Matrix3d said = F_psi * F_psi.transpose();
    EXPECT_LT((seen - said).norm(), 0.04 * said.norm()) << turn << '\n' << seen << '\n' << said;
  }
}

/// Errors of a reference's axes as they look in s: E_s of gyros and accelerometers, and of the triads.
TakenUpSd drawn_in_s(Draw& draw, const Matrix3d& C_b_s) {
  TakenUpSd out;
  for (const Index triad : {affected::kGyroScale, affected::kAccelScale}) {
    const Matrix3d E_s = C_b_s * (draw.axes(kGrade) - Matrix3d::Identity()) * C_b_s.transpose();
    out.segment<3>(triad - affected::kGyroScale) = E_s.diagonal();
    out.segment<3>(triad - affected::kGyroScale + 3) = Vector3d(E_s(1, 2), E_s(0, 2), E_s(0, 1));
  }
  out.tail<3>() = draw.vector(Vector3d::Constant(kGrade.triad_sd_rad));
  return out;
}

TEST(ReferenceAxes, WidenAnEstimateThatLearnsOnlyAPartOfThemByWhatItIsOff) {
  using State = Eigen::Matrix<double, affected::kSize, 1>;
  Draw draw;
  const Matrix3d C_b_s = exp_so3(Vector3d(0.3, -0.7, 1.2));
  State prior_sd;
  prior_sd << Vector3d::Constant(0.1), Vector3d::Constant(0.2), Vector3d::Constant(4e-3),
      Vector3d::Constant(1e-3), Vector3d::Constant(4e-3), Vector3d::Constant(1e-3), Vector3d::Constant(2e-3);
  const TakenUpSd of_class = prior_sd.tail<kTakenUp>();
  // Fewer measurements than states, of unit noise: most of what the reference does remains hidden in other states.
  constexpr Index kMeasurements = 14;
  MatrixXd H(kMeasurements, affected::kSize);
  for (Index i = 0; i < H.size(); ++i) H(i) = draw.normal(1.0) * 3.0 / prior_sd(i / kMeasurements);
  H.leftCols<6>() *= 30.0;
  const AffectedCovariance P =
      (H.transpose() * H + AffectedCovariance(prior_sd.cwiseAbs2().cwiseInverse().asDiagonal())).inverse();
  AffectedCovariance seen = AffectedCovariance::Zero();
  constexpr int kReferences = 20000;
  for (int n = 0; n < kReferences; ++n) {
    State truth;
    for (Index i = 0; i < truth.size(); ++i) truth(i) = draw.normal(prior_sd(i));
    State apparent = truth;
    apparent.tail<kTakenUp>() -= drawn_in_s(draw, C_b_s);
    VectorXd z = H * apparent;
    for (Index i = 0; i < z.size(); ++i) z(i) += draw.normal(1.0);
    const State error = P * H.transpose() * z - truth;
    seen += error * error.transpose() / kReferences;
  }
  const ReferenceColumns F = reference_columns(P, of_class, C_b_s, kGrade);
  const AffectedCovariance said = P + F * F.transpose();
  // Each element within five sd of a sample's.
  for (Index i = 0; i < seen.rows(); ++i) {
    for (Index j = 0; j <= i; ++j) {
      const double sd = std::sqrt((said(i, i) * said(j, j) + said(i, j) * said(i, j)) / kReferences);
      EXPECT_NEAR(seen(i, j), said(i, j), 5.0 * sd) << i << ' ' << j;
    }
  }
  // That the bound above can fail: without F the scales would.
  EXPECT_GT(F.row(affected::kGyroScale).squaredNorm(), 0.2 * P(affected::kGyroScale, affected::kGyroScale));
  EXPECT_GT(F.row(affected::kPsi).squaredNorm(), 0.1 * P(affected::kPsi, affected::kPsi));
}

TEST(ReferenceAxes, MakeNothingOfStatesThatAreAbsent) {
  const ReferenceColumns F =
      reference_columns(AffectedCovariance::Zero(), TakenUpSd::Zero(), Matrix3d::Identity(), kGrade);
  EXPECT_TRUE(F.isZero(0.0));
}

/// Forces and rates of a vehicle that turns about its vertical axis far more than about the others.
struct Motion {
  Vector3d omega_radps;
  Vector3d omega_dot_radps2;
  Vector3d f_mps2;
};

std::vector<Motion> a_drive(Draw& draw) {
  std::vector<Motion> motion;
  const Vector3d gravity(0.0, 0.0, 9.8);
  for (int i = 0; i < 500; ++i)
    motion.push_back({draw.vector({0.05, 0.05, 0.3}), draw.vector({0.1, 0.1, 0.6}),
                      gravity + draw.vector({1.5, 1.5, 0.5})});
  return motion;
}

Matrix3d arm_matrix(const Motion& m) {
  return skew(m.omega_radps) * skew(m.omega_radps) + skew(m.omega_dot_radps2);
}

/// Least squares of the S-IMU's forces: a matrix of any shape, the lever arm, a bias.
Vector3d lever_arm_by_least_squares(const std::vector<Motion>& reference,
                                    const std::vector<Vector3d>& forces) {
  Matrix3d A = Matrix3d::Identity();
  Vector3d r = Vector3d::Zero();
  Vector3d bias = Vector3d::Zero();
  for (int step = 0; step < 6; ++step) {
    MatrixXd H(3 * static_cast<Index>(forces.size()), 15);
    VectorXd e(H.rows());
    for (std::size_t i = 0; i < forces.size(); ++i) {
      const auto row = 3 * static_cast<Index>(i);
      const Matrix3d M = arm_matrix(reference[i]);
      const Vector3d g = reference[i].f_mps2 + M * r;
      e.segment<3>(row) = forces[i] - A * g - bias;
      for (Index k = 0; k < 3; ++k) H.block<3, 3>(row, 3 * k) = g(k) * Matrix3d::Identity();
      H.block<3, 3>(row, 9) = A * M;
      H.block<3, 3>(row, 12).setIdentity();
    }
    const VectorXd x = H.householderQr().solve(e);
    for (Index k = 0; k < 3; ++k) A.col(k) += x.segment<3>(3 * k);
    r += x.segment<3>(9);
    bias += x.tail<3>();
  }
  return r;
}

TEST(ReferenceAxes, MakeALeverArmWrongByWhatIsSaid) {
  Draw draw;
  const Vector3d r_bs_b_m(0.3, -0.25, 0.15);
  const std::vector<Motion> motion = a_drive(draw);
  std::vector<Vector3d> forces;
  for (const Motion& m : motion) forces.emplace_back(m.f_mps2 + arm_matrix(m) * r_bs_b_m);
  Vector3d square = Vector3d::Zero();
  constexpr int kReferences = 300;
  for (int n = 0; n < kReferences; ++n) {
    const Matrix3d gyros = draw.axes(kGrade);
    const Matrix3d accels = draw.axes(kGrade) * exp_so3(draw.vector(Vector3d::Constant(kGrade.triad_sd_rad)));
    std::vector<Motion> reference = motion;
    for (Motion& m : reference) m = {gyros * m.omega_radps, gyros * m.omega_dot_radps2, accels * m.f_mps2};
    square += (lever_arm_by_least_squares(reference, forces) - r_bs_b_m).cwiseAbs2() / kReferences;
  }
  const Vector3d said = r_by_scale_m2(r_bs_b_m, kGrade);
  for (Index i = 0; i < 3; ++i) {
    const double ratio = std::sqrt(square(i) / said(i));
    EXPECT_GT(ratio, 0.75) << i;
    EXPECT_LT(ratio, 1.2) << i;
  }
}

TEST(ReferenceAxes, OfAnIdealReferenceMakeNothing) {
  EXPECT_TRUE(reference_columns(AffectedCovariance::Identity(), TakenUpSd::Ones(), Matrix3d::Identity(), {})
                  .isZero(0.0));
  EXPECT_TRUE(r_by_scale_m2(Vector3d(0.3, 0.2, 0.1), {}).isZero(0.0));
}

}  // namespace
}  // namespace imuscope
