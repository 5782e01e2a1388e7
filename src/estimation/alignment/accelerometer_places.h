#pragma once

/// Three accelerometers that are not at one place: where each is about the middle of the three.

#include <Eigen/Core>
#include <array>
#include <cstddef>

namespace imuscope {

/// Column j (0 to 5) of the places of the three: that of accelerometer `axis`, in s. The six columns are
/// orthonormal, and each leaves the middle of the three where it is.
[[nodiscard]] inline Eigen::Vector3d place_basis(Eigen::Index axis, Eigen::Index j) noexcept {
  // Two patterns over the three accelerometers that sum to zero, for each direction.
  constexpr std::array<std::array<double, 3>, 2> kPatterns{
      {{0.7071067811865476, -0.7071067811865476, 0.0},
       {0.408248290463863, 0.408248290463863, -0.816496580927726}}};
  return kPatterns[static_cast<std::size_t>(j / 3)][static_cast<std::size_t>(axis)] *
         Eigen::Vector3d::Unit(j % 3);
}

}  // namespace imuscope
