#pragma once

/// A function of time that is four times continuously differentiable, through equally spaced values. Its
/// derivatives are those of the very polynomial that gives the value, so quantities built on it are exact
/// derivatives of one another.

#include <vector>

namespace imusim {

class QuinticSpline {
 public:
  struct Point {
    double value;
    double first;   ///< d/dt
    double second;  ///< d2/dt2
  };

  /// @param step_s  time between two values; the first is at time 0
  /// @param values  at least 2. At both ends the function is at rest: first and second derivative are zero.
  QuinticSpline(double step_s, const std::vector<double>& values);

  /// Before the first and after the last value the function stays where it is.
  [[nodiscard]] Point at(double t_s) const;

 private:
  /// Value and derivatives at a node, with the step as the unit of time.
  struct Node {
    double value;
    double first;
    double second;
  };
  void solve_derivatives();

  double step_s_;
  std::vector<Node> nodes_;
};

}  // namespace imusim
