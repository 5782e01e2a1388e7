#include "tools/trials/dense_joseph.h"

#include <Eigen/Dense>

namespace {

using Matrix = Eigen::MatrixXd;

double epoch(double* P_data, const double* Phi_data, const double* Q_data, const double* H_data,
             const double* R_data, std::size_t size, std::size_t updates) {
  const auto n = static_cast<Eigen::Index>(size);
  Eigen::Map<Matrix> P(P_data, n, n);
  const Matrix Phi = Eigen::Map<const Matrix>(Phi_data, n, n);
  const Matrix Q = Eigen::Map<const Matrix>(Q_data, n, n);
  const Matrix H = Eigen::Map<const Matrix>(H_data, 3, n);
  const Matrix R = Eigen::Map<const Matrix>(R_data, 3, 3);
  P = Phi * P * Phi.transpose() + Q;
  for (std::size_t i = 0; i < updates; ++i) {
    const Matrix S = H * P * H.transpose() + R;
    const Matrix K = P * H.transpose() * S.inverse();
    const Matrix I_KH = Matrix::Identity(n, n) - K * H;
    P = I_KH * P * I_KH.transpose() + K * R * K.transpose();
  }
  return P.trace();
}

}  // namespace

extern "C" __attribute__((visibility("default"))) double IMUSCOPE_JOSEPH(double* P, const double* Phi,
                                                                         const double* Q, const double* H,
                                                                         const double* R, std::size_t n,
                                                                         std::size_t updates) {
  return epoch(P, Phi, Q, H, R, n, updates);
}
