#include "oracle_files.h"

#include <zlib.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "tests/support/shared_data.h"

namespace imuscope::noise::test {
namespace {

std::filesystem::path series_path(const std::string& name) {
  static const std::map<std::string, std::string> adis{{"accX", "accel_x_g"},     {"accY", "accel_y_g"},
                                                       {"accZ", "accel_z_g"},     {"gyroX", "gyro_x_degps"},
                                                       {"gyroY", "gyro_y_degps"}, {"gyroZ", "gyro_z_degps"}};
  const std::string prefix = "adis16405_imu1_";
  if (name.rfind(prefix, 0) == 0) {
    return imuscope::test::shared_path("data/adis16405_static/" + adis.at(name.substr(prefix.size())) +
                                       ".f64");
  }
  const auto folder = imuscope::test::shared_path(kOracle) / "series";
  for (const char* ending : {".csv", ".csv.gz"}) {
    if (std::filesystem::exists(folder / (name + ending))) return folder / (name + ending);
  }
  return {};
}

/// Plain files too: zlib hands them through.
std::string read_all(const std::filesystem::path& path) {
  std::string text;
  gzFile file = gzopen(path.c_str(), "rb");
  if (file == nullptr) return text;
  char buffer[65536];
  for (int n = gzread(file, buffer, sizeof buffer); n > 0; n = gzread(file, buffer, sizeof buffer)) {
    text.append(buffer, static_cast<std::size_t>(n));
  }
  gzclose(file);
  return text;
}

}  // namespace

std::vector<double> read_series(const std::string& name) {
  const auto path = series_path(name);
  std::vector<double> values;
  if (path.empty() || !std::filesystem::exists(path)) return values;
  if (path.extension() == ".f64") {
    values.resize(std::filesystem::file_size(path) / sizeof(double));
    std::ifstream(path, std::ios::binary)
        .read(reinterpret_cast<char*>(values.data()),
              static_cast<std::streamsize>(values.size() * sizeof(double)));
    return values;
  }
  std::istringstream lines(read_all(path));
  std::string line;
  std::getline(lines, line);  // the header
  while (std::getline(lines, line)) values.push_back(std::strtod(line.c_str(), nullptr));
  return values;
}

std::vector<std::map<std::string, std::string>> read_table(const std::string& file) {
  std::ifstream in(imuscope::test::shared_path(kOracle) / file);
  std::string line;
  std::vector<std::string> header;
  std::vector<std::map<std::string, std::string>> rows;
  while (std::getline(in, line)) {
    if (!line.empty() && line.back() == '\r') line.pop_back();
    std::vector<std::string> cells;
    std::istringstream stream(line);
    std::string cell;
    while (std::getline(stream, cell, ',')) cells.push_back(cell);
    if (header.empty()) {
      header = cells;
      continue;
    }
    auto& row = rows.emplace_back();
    for (std::size_t i = 0; i < cells.size() && i < header.size(); ++i) row[header[i]] = cells[i];
  }
  return rows;
}

}  // namespace imuscope::noise::test
