#include "check/signed_axes.h"

#include <fmt/format.h>
#include <algorithm>
#include <cmath>

namespace imuscope::check {

namespace {

std::array<Eigen::Matrix3d, 48> make_all() {
  std::array<Eigen::Matrix3d, 48> all;
  std::size_t n = 0;
  std::array<int, 3> order{0, 1, 2};
  do {
    for (unsigned signs = 0; signs < 8; ++signs) {
      Eigen::Matrix3d axes = Eigen::Matrix3d::Zero();
      for (int row = 0; row < 3; ++row)
        axes(row, order[static_cast<std::size_t>(row)]) =
            (signs >> static_cast<unsigned>(row) & 1U) != 0 ? -1.0 : 1.0;
      all[n++] = axes;
    }
  } while (std::next_permutation(order.begin(), order.end()));
  return all;
}

}  // namespace

const std::array<Eigen::Matrix3d, 48>& signed_axes() {
  static const auto all = make_all();
  return all;
}

Eigen::Matrix3d nearest_signed_axes(const Eigen::Matrix3d& matrix) {
  const auto likeness = [&](const Eigen::Matrix3d& axes) { return axes.cwiseProduct(matrix).sum(); };
  return *std::max_element(signed_axes().begin(), signed_axes().end(),
                           [&](const auto& a, const auto& b) { return likeness(a) < likeness(b); });
}

std::string axes_words(const Eigen::Matrix3d& axes) {
  std::string words;
  for (int row = 0; row < 3; ++row) {
    int column = 0;
    axes.row(row).cwiseAbs().maxCoeff(&column);
    words += fmt::format("{}{}{}", row == 0 ? "" : " ", axes(row, column) > 0.0 ? '+' : '-', "xyz"[column]);
  }
  return words;
}

std::optional<std::string> columns_toml(const Eigen::Matrix3d& matrix,
                                        const std::array<std::string, 3>& columns) {
  constexpr double kWhole = 1e-9;
  const Eigen::Matrix3d axes = nearest_signed_axes(matrix);
  if ((axes - matrix).cwiseAbs().maxCoeff() > kWhole) return std::nullopt;
  std::string toml = "[";
  for (int row = 0; row < 3; ++row) {
    int column = 0;
    axes.row(row).cwiseAbs().maxCoeff(&column);
    std::string name = columns[static_cast<std::size_t>(column)];
    const bool turned = !name.empty() && name.front() == '-';
    if (turned) name.erase(0, 1);
    toml +=
        fmt::format("{}\"{}{}\"", row == 0 ? "" : ", ", turned == (axes(row, column) > 0.0) ? "-" : "", name);
  }
  return toml + "]";
}

}  // namespace imuscope::check
