#pragma once

/// The noise of each S-IMU in the terms of data sheets, beside what its maker says.

#include <string>
#include <vector>

#include "models/noise/export.h"
#include "results/report/fits.h"
#include "results/report/page_parts.h"
#include "results/report/run_files.h"

namespace imuscope::report {

/// The fits of one sensor in one regime that can be exported.
std::vector<noise::AxisFit> axis_fits(const RunFiles& run, const std::string& imu, const std::string& regime);

/// "4.62 [4.51, 4.73] deg/√h", "at most 5.1 deg/√h": the random walk of one axis, as a filter feels it.
Html random_walk_cell(const std::vector<noise::AxisFit>& fits, const std::string& axis);

/// One row for each S-IMU and term: the range over its three axes in each regime, the maker's number, and how
/// they compare. Nothing where there is no model.
Html data_sheet_table(const RunFiles& run, const std::vector<Fit>& fits);

}  // namespace imuscope::report
