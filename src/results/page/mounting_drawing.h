#pragma once

/// The mounting as a person looks for it first: where each S-IMU sits and where its axes point, seen from
/// above, from the right and from behind, in one scale.

#include <array>
#include <string>
#include <vector>

#include "results/page/html.h"

namespace imuscope::page {

struct DrawnImu {
  std::string name;
  std::array<double, 9> C_b_s{};     ///< row-major; takes b to s: its rows are the axes of s in b
  std::array<double, 3> r_bs_b_m{};  ///< from the R-IMU to it
};

/// Three drawings; nothing where there is no S-IMU to draw.
Html mounting_drawing(const std::vector<DrawnImu>& imus);

}  // namespace imuscope::page
