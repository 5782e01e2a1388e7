#include "joint_run.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <limits>

#include "base/text.h"
#include "results/tables/json_file.h"
#include "results/tables/table_reader.h"

namespace imuscope::cli {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr std::array<const char*, kErrorAxes> kErrorColumns{"e_gyro_x_radps", "e_gyro_y_radps",
                                                            "e_gyro_z_radps", "e_accel_x_mps2",
                                                            "e_accel_y_mps2", "e_accel_z_mps2"};
/// A day at 2 kHz would be less.
constexpr double kSamplesMax = 2e8;

/// One S-IMU's rows.
struct ErrorRows {
  std::vector<double> time_s;
  std::array<std::vector<double>, kErrorAxes> errors;  ///< in b; NaN in another regime
};

Result<Eigen::Matrix3d> mounting_of(const nlohmann::json& calibration, const std::string& name) {
  for (const auto& imu : calibration.value("imus", nlohmann::json::array())) {
    if (!imu.is_object() || imu.value("name", "") != name || !imu.contains("C_b_s")) continue;
    const auto& numbers = imu.at("C_b_s");
    constexpr std::size_t kElements = 9;
    if (!numbers.is_array() || numbers.size() != kElements) continue;
    Eigen::Matrix3d C_b_s;
    for (std::size_t i = 0; i < kElements; ++i) {
      if (!numbers[i].is_number())
        return work_error(fmt::format("calibration.json: C_b_s of {} is no matrix", name));
      C_b_s(static_cast<Eigen::Index>(i / 3), static_cast<Eigen::Index>(i % 3)) = numbers[i].get<double>();
    }
    return C_b_s;
  }
  return usage_error(fmt::format("calibration.json has no mounting of {}", name),
                     "leave it out: --name takes the S-IMUs that have one");
}

/// Places of the columns that are read.
struct Places {
  std::size_t time = 0;
  std::size_t regime = 0;
  std::array<std::size_t, kErrorAxes> errors{};
};

Result<Places> places_in(const tables::TableReader& reader, const std::filesystem::path& file) {
  std::optional<Error> missing;
  const auto place = [&](std::string_view name) {
    const auto& columns = reader.columns();
    const auto found =
        std::find_if(columns.begin(), columns.end(), [&](const auto& c) { return c.name == name; });
    if (found == columns.end() && !missing)
      missing = Error{ErrorKind::kWork, fmt::format("{} has no column {}", file.string(), name), {}};
    return static_cast<std::size_t>(found - columns.begin());
  };
  Places places{place("time_s"), place("regime"), {}};
  for (std::size_t i = 0; i < kErrorAxes; ++i) places.errors[i] = place(kErrorColumns[i]);
  if (missing) return tl::unexpected(*missing);
  return places;
}

Result<ErrorRows> read_rows(const std::filesystem::path& file, const Eigen::Matrix3d& C_b_s,
                            const std::string& regime) {
  auto reader = tables::TableReader::open(file, tables::run_table("errors"));
  if (!reader) return tl::unexpected(reader.error());
  const auto places = places_in(*reader, file);
  if (!places) return tl::unexpected(places.error());
  ErrorRows rows;
  constexpr std::size_t kBlock = 65536;
  while (true) {
    const auto block = reader->next(kBlock);
    if (!block) return tl::unexpected(block.error());
    if (block->rows == 0) return rows;
    const auto& words = reader->words(places->regime);
    for (std::size_t r = 0; r < block->rows; ++r) {
      const double word = block->columns[places->regime][r];
      const bool taken = regime == "all" || (word >= 0.0 && words[static_cast<std::size_t>(word)] == regime);
      rows.time_s.push_back(block->columns[places->time][r]);
      for (std::size_t triad = 0; triad < 2; ++triad) {
        Eigen::Vector3d e_s;
        for (std::size_t i = 0; i < 3; ++i)
          e_s[static_cast<Eigen::Index>(i)] = taken ? block->columns[places->errors[3 * triad + i]][r] : kNaN;
        const Eigen::Vector3d e_b = C_b_s.transpose() * e_s;
        for (std::size_t i = 0; i < 3; ++i)
          rows.errors[3 * triad + i].push_back(e_b[static_cast<Eigen::Index>(i)]);
      }
    }
  }
}

/// Samples a second, by the middle of the steps.
double rate_of(const std::vector<double>& time_s) {
  std::vector<double> steps;
  for (std::size_t i = 1; i < time_s.size(); ++i) steps.push_back(time_s[i] - time_s[i - 1]);
  if (steps.empty()) return 0.0;
  const auto middle = steps.begin() + static_cast<std::ptrdiff_t>(steps.size() / 2);
  std::nth_element(steps.begin(), middle, steps.end());
  return *middle > 0.0 ? 1.0 / *middle : 0.0;
}

std::vector<std::string> imus_of(const std::filesystem::path& folder) {
  std::vector<std::string> names;
  std::error_code error;
  for (const auto& entry : std::filesystem::directory_iterator(folder, error)) {
    const auto file = tables::table_file(entry.path().filename().string());
    if (file && file->kind->stem == "errors") names.push_back(file->device);
  }
  std::sort(names.begin(), names.end());
  return names;
}

}  // namespace

Result<JointRun> read_joint_run(const std::filesystem::path& folder, const std::vector<std::string>& names,
                                const std::string& regime) {
  const auto there = imus_of(folder);
  if (there.empty())
    return usage_error(fmt::format("{} holds no errors_NAME.csv", folder.string()),
                       "give the folder of a study");
  JointRun out;
  out.names = names.empty() ? there : names;
  for (const auto& name : out.names) {
    if (std::find(there.begin(), there.end(), name) == there.end())
      return usage_error(fmt::format("{} holds no S-IMU {}", folder.string(), name),
                         fmt::format("there is {}", fmt::join(there, ", ")));
  }
  const auto calibration = tables::read_json_file(folder / "calibration.json");
  std::vector<ErrorRows> all;
  for (const auto& name : out.names) {
    const auto C_b_s = mounting_of(calibration, name);
    if (!C_b_s) return tl::unexpected(C_b_s.error());
    auto rows = read_rows(folder / device_file_name("errors", name, ".csv"), *C_b_s, regime);
    if (!rows) return tl::unexpected(rows.error());
    const double rate_hz = rate_of(rows->time_s);
    if (!(rate_hz > 0.0)) return work_error(fmt::format("errors_{}.csv has no rows", name));
    constexpr double kSlack = 0.01;
    if (out.rate_hz > 0.0 && std::abs(rate_hz / out.rate_hz - 1.0) > kSlack)
      return work_error(fmt::format("{} has {:.1f} samples a second, {} has {:.1f}", out.names.front(),
                                    out.rate_hz, name, rate_hz),
                        "choose S-IMUs of one rate with --name");
    if (out.rate_hz == 0.0) out.rate_hz = rate_hz;
    all.push_back(std::move(*rows));
  }
  double begin_s = all.front().time_s.front();
  double end_s = all.front().time_s.back();
  for (const auto& rows : all) {
    begin_s = std::max(begin_s, rows.time_s.front());
    end_s = std::min(end_s, rows.time_s.back());
  }
  const double count = std::floor((end_s - begin_s) * out.rate_hz) + 1.0;
  if (!(count >= 2.0) || count > kSamplesMax)
    return work_error(fmt::format("the S-IMUs of {} have no time in common", folder.string()));
  for (std::size_t axis = 0; axis < kErrorAxes; ++axis) {
    for (const auto& rows : all) {
      std::vector<double> grid(static_cast<std::size_t>(count), kNaN);
      for (std::size_t i = 0; i < rows.time_s.size(); ++i) {
        const double place = std::round((rows.time_s[i] - begin_s) * out.rate_hz);
        if (place >= 0.0 && place < count) grid[static_cast<std::size_t>(place)] = rows.errors[axis][i];
      }
      out.values[axis].push_back(std::move(grid));
    }
  }
  return out;
}

}  // namespace imuscope::cli
