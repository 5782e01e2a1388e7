#pragma once

/// The 48 ways in which three axes can be named and signed: rows with one +-1 each.

#include <Eigen/Core>
#include <array>
#include <optional>
#include <string>

namespace imuscope::check {

[[nodiscard]] const std::array<Eigen::Matrix3d, 48>& signed_axes();
/// The one that is nearest to a matrix.
[[nodiscard]] Eigen::Matrix3d nearest_signed_axes(const Eigen::Matrix3d& matrix);
/// "+x -y -z": of which axis each row is.
[[nodiscard]] std::string axes_words(const Eigen::Matrix3d& signed_axes);
/// The same of columns that have names: "-" before a name turns its sign. Nothing where `matrix` is no signed
/// permutation.
[[nodiscard]] std::optional<std::string> columns_toml(const Eigen::Matrix3d& matrix,
                                                      const std::array<std::string, 3>& columns);

}  // namespace imuscope::check
