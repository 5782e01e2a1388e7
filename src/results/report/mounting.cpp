#include "results/report/mounting.h"

#include <fmt/format.h>
#include <algorithm>
#include <cmath>

#include "base/units.h"

namespace imuscope::report {
namespace {

constexpr std::size_t kSide = 3;

double at(const Rotation& C, std::size_t row, std::size_t column) { return C[row * kSide + column]; }

/// A^T B.
Rotation relative(const Rotation& A, const Rotation& B) {
  Rotation C{};
  for (std::size_t i = 0; i < kSide; ++i) {
    for (std::size_t j = 0; j < kSide; ++j) {
      for (std::size_t k = 0; k < kSide; ++k) C[i * kSide + j] += at(A, k, i) * at(B, k, j);
    }
  }
  return C;
}

double determinant(const Rotation& C) {
  return C[0] * (C[4] * C[8] - C[5] * C[7]) - C[1] * (C[3] * C[8] - C[5] * C[6]) +
         C[2] * (C[3] * C[7] - C[4] * C[6]);
}

/// Log of a rotation through its quaternion, by the largest component (Shepperd 1978): good up to half a
/// turn.
Angles rotation_vector(const Rotation& C) {
  const double trace = C[0] + C[4] + C[8];
  std::array<double, 4> q{};  // w, x, y, z, unnormalised
  if (trace >= C[0] && trace >= C[4] && trace >= C[8]) {
    q = {1.0 + trace, C[7] - C[5], C[2] - C[6], C[3] - C[1]};
  } else if (C[0] >= C[4] && C[0] >= C[8]) {
    q = {C[7] - C[5], 1.0 + C[0] - C[4] - C[8], C[1] + C[3], C[2] + C[6]};
  } else if (C[4] >= C[8]) {
    q = {C[2] - C[6], C[1] + C[3], 1.0 - C[0] + C[4] - C[8], C[5] + C[7]};
  } else {
    q = {C[3] - C[1], C[2] + C[6], C[5] + C[7], 1.0 - C[0] - C[4] + C[8]};
  }
  if (q[0] < 0.0) {
    for (double& component : q) component = -component;
  }
  const double length = std::hypot(q[1], q[2], q[3]);
  // Below this the ratio angle/length is its limit, 2/w, to all digits.
  constexpr double kTiny = 1e-12;
  const double factor = length > kTiny ? 2.0 * std::atan2(length, q[0]) / length : 2.0 / q[0];
  return {factor * q[1], factor * q[2], factor * q[3]};
}

}  // namespace

Angles boresight_deg(const Rotation& from, const Rotation& to) {
  Angles psi = rotation_vector(relative(from, to));
  for (double& angle : psi) angle *= -kDegPerRad;
  return psi;
}

Rotation nearest_square_mounting(const Rotation& C_b_s) {
  // The nearest rotation in the Frobenius norm has the largest trace of square^T C_b_s.
  std::array<std::size_t, kSide> columns{0, 1, 2};
  Rotation best{};
  double best_agreement = -1e300;
  do {
    for (unsigned signs = 0; signs < 8; ++signs) {
      Rotation square{};
      double agreement = 0.0;
      for (std::size_t row = 0; row < kSide; ++row) {
        const double sign = ((signs >> row) & 1U) != 0U ? -1.0 : 1.0;
        square[row * kSide + columns[row]] = sign;
        agreement += sign * at(C_b_s, row, columns[row]);
      }
      if (determinant(square) > 0.0 && agreement > best_agreement) {
        best_agreement = agreement;
        best = square;
      }
    }
  } while (std::next_permutation(columns.begin(), columns.end()));
  return best;
}

std::string square_mounting_words(const Rotation& square) {
  constexpr std::string_view kNames = "xyz";
  std::string words;
  for (std::size_t row = 0; row < kSide; ++row) {
    for (std::size_t column = 0; column < kSide; ++column) {
      const double value = at(square, row, column);
      if (value == 0.0) continue;
      words += fmt::format("{}{} along {}{}", row == 0 ? "" : ", ", kNames[row], value > 0 ? "+" : "−",
                           kNames[column]);
    }
  }
  return words;
}

}  // namespace imuscope::report
