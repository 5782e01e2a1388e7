#include "firmware_sim/motion/quintic_spline.h"

#include <Eigen/Core>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

namespace imusim {

QuinticSpline::QuinticSpline(double step_s, const std::vector<double>& values) : step_s_(step_s) {
  nodes_.reserve(values.size());
  for (const double value : values) nodes_.push_back({value, 0.0, 0.0});
  solve_derivatives();
}

// Between two nodes runs the quintic Hermite polynomial of their values v, first derivatives d and second
// derivatives s. Equal third and fourth derivatives on both sides of node i ask, with D_i = v_i - v_{i-1},
// for
//   -24 d_{i-1}           + 24 d_{i+1}  -  3 s_{i-1} + 18 s_i -  3 s_{i+1} =  60 (D_{i+1} - D_i)
//   168 d_{i-1} + 384 d_i + 168 d_{i+1} + 24 s_{i-1}          - 24 s_{i+1} = 360 (D_{i+1} + D_i)
// a block tridiagonal system, solved by elimination and back substitution.
void QuinticSpline::solve_derivatives() {
  if (nodes_.size() < 3) return;
  const std::size_t last = nodes_.size() - 1;
  Eigen::Matrix2d below;
  below << -24.0, -3.0, 168.0, 24.0;
  Eigen::Matrix2d diagonal;
  diagonal << 0.0, 18.0, 384.0, 0.0;
  Eigen::Matrix2d above;
  above << 24.0, -3.0, 168.0, -24.0;

  std::vector<Eigen::Matrix2d> factor(last, Eigen::Matrix2d::Zero());
  std::vector<Eigen::Vector2d> reduced(last, Eigen::Vector2d::Zero());
  for (std::size_t i = 1; i < last; ++i) {
    const double before = nodes_[i].value - nodes_[i - 1].value;
    const double after = nodes_[i + 1].value - nodes_[i].value;
    const Eigen::Vector2d right(60.0 * (after - before), 360.0 * (after + before));
    const Eigen::Matrix2d pivot = (diagonal - below * factor[i - 1]).inverse();
    factor[i] = pivot * above;
    reduced[i] = pivot * (right - below * reduced[i - 1]);
  }
  Eigen::Vector2d next = Eigen::Vector2d::Zero();
  for (std::size_t i = last - 1; i >= 1; --i) {
    next = reduced[i] - factor[i] * next;
    nodes_[i].first = next.x();
    nodes_[i].second = next.y();
  }
}

QuinticSpline::Point QuinticSpline::at(double t_s) const {
  const double place = t_s / step_s_;
  const auto last = static_cast<double>(nodes_.size() - 1);
  if (!(place > 0.0)) return {nodes_.front().value, 0.0, 0.0};
  if (place >= last) return {nodes_.back().value, 0.0, 0.0};
  const double whole = std::floor(place);
  const auto index = static_cast<std::size_t>(whole);
  const double x = place - whole;
  const Node& a = nodes_[index];
  const Node& b = nodes_[index + 1];
  const double rise = b.value - a.value;
  const double c2 = 0.5 * a.second;
  const double c3 = 10.0 * rise - 6.0 * a.first - 4.0 * b.first - 1.5 * a.second + 0.5 * b.second;
  const double c4 = -15.0 * rise + 8.0 * a.first + 7.0 * b.first + 1.5 * a.second - b.second;
  const double c5 = 6.0 * rise - 3.0 * (a.first + b.first) + 0.5 * (b.second - a.second);
  const double value = a.value + x * (a.first + x * (c2 + x * (c3 + x * (c4 + x * c5))));
  const double first = a.first + x * (2.0 * c2 + x * (3.0 * c3 + x * (4.0 * c4 + x * 5.0 * c5)));
  const double second = 2.0 * c2 + x * (6.0 * c3 + x * (12.0 * c4 + x * 20.0 * c5));
  return {value, first / step_s_, second / (step_s_ * step_s_)};
}

}  // namespace imusim
