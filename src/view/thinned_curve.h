#pragma once

/// A curve that grows without end in bounded memory.

#include <array>
#include <cstddef>
#include <vector>

namespace imuscope::view {

/// Keeps every n-th of the points that are added; n doubles whenever there are too many. The first one stays.
template <std::size_t Dimensions>
class ThinnedCurve {
 public:
  using Point = std::array<double, Dimensions>;

  /// @param most  points, at least 2
  explicit ThinnedCurve(std::size_t most) : most_(most) {}

  void add(const Point& point) {
    if (added_++ % every_ != 0) return;
    points_.push_back(point);
    if (points_.size() <= most_) return;
    std::size_t kept = 0;
    for (std::size_t i = 0; i < points_.size(); i += 2) points_[kept++] = points_[i];
    points_.resize(kept);
    every_ *= 2;
  }

  [[nodiscard]] const std::vector<Point>& points() const noexcept { return points_; }

 private:
  std::size_t most_;
  std::size_t every_ = 1;
  std::size_t added_ = 0;
  std::vector<Point> points_;
};

}  // namespace imuscope::view
