#pragma once

/// Reads the oracle files of the noise engine: series (plain or gzip CSV, raw float64) and tables.

#include <cstddef>
#include <map>
#include <string>
#include <string_view>
#include <vector>

namespace imuscope::noise::test {

/// Folder of the oracle tables, relative to the shared folder.
inline constexpr const char* kOracle = "oracle/gmwm";

/// A series by its oracle name ("s01_wn_n1000", "adis16405_imu1_gyroX"); empty when it is not there.
std::vector<double> read_series(const std::string& name);

/// A table: one map from column name to text a row.
std::vector<std::map<std::string, std::string>> read_table(const std::string& file);

}  // namespace imuscope::noise::test
