#pragma once

/// How an S-IMU sits, for people: the right-angled mounting it is nearest to, and the small angles that
/// remain.

#include <array>
#include <string>

namespace imuscope::report {

using Rotation = std::array<double, 9>;  ///< row-major, as C_b_s: takes b to s
using Angles = std::array<double, 3>;

/// psi = -Log(from^T to), a rotation vector in b, in degrees: the boresight `to` seen from `from`.
Angles boresight_deg(const Rotation& from, const Rotation& to);

/// The rotation among the 24 that map axes to axes which is nearest to C_b_s.
Rotation nearest_square_mounting(const Rotation& C_b_s);

/// "x_s ≈ +y_b, y_s ≈ −x_b, z_s ≈ +z_b" of a square mounting.
std::string square_mounting_words(const Rotation& square);

}  // namespace imuscope::report
