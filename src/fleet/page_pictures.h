#pragma once

/// Drawings of the fleet's page: where the drives went, and how units are distributed.

#include <optional>
#include <string>
#include <vector>

#include "results/page/html.h"

namespace imuscope::fleet {

/// One drive on the map.
struct MapTrack {
  std::string worst;  ///< "wrong", "limits", or anything else
  std::vector<std::pair<double, double>> lat_lon_deg;
};

/// All drives in one drawing, north up, with a bar of a round length. Empty where no drive has a position.
page::Html map_of(const std::vector<MapTrack>& tracks);

/// One row of a picture of a distribution: the units' means of one axis.
struct AxisValues {
  std::string axis;
  std::vector<double> values;
  std::vector<bool> stands_out;  ///< of each value
  std::optional<double> tolerance_low;
  std::optional<double> tolerance_high;
};

/// The axes of one quantity below each other on one scale, with the data sheet's number as a line.
page::Html distribution_of(const std::string& words, bool is_log, const std::vector<AxisValues>& axes,
                           std::optional<double> data_sheet);

}  // namespace imuscope::fleet
