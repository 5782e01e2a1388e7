#include "results/tables/columns.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>

#include "base/contracts.h"
#include "base/text.h"

namespace imuscope::tables {
namespace {

constexpr std::array kAxes{'x', 'y', 'z'};
constexpr std::string_view kCsv = ".csv";

struct Suffix {
  std::string_view text;
  std::string_view unit;
};

/// A longer one before those that it ends in.
constexpr std::array kSuffixes{
    Suffix{"_radps3", "rad/s^3"},
    Suffix{"_radps2", "rad/s^2"},
    Suffix{"_radps", "rad/s"},
    Suffix{"_mps3", "m/s^3"},
    Suffix{"_mps2", "m/s^2"},
    Suffix{"_mps", "m/s"},
    Suffix{"_degC", "degC"},
    Suffix{"_deg_per_h", "deg/h"},
    Suffix{"_deg", "deg"},
    Suffix{"_rad", "rad"},
    Suffix{"_percent", "%"},
    Suffix{"_ppm", "ppm"},
    Suffix{"_hz", "Hz"},
    Suffix{"_km", "km"},
    Suffix{"_mm", "mm"},
    Suffix{"_mb", "MB"},
    Suffix{"_ms", "ms"},
    Suffix{"_us", "us"},
    Suffix{"_ns", "ns"},
    Suffix{"_m", "m"},
    Suffix{"_s", "s"},
};

/// End in the name of a frame, not in a unit.
constexpr std::array<std::string_view, 3> kOfFrames{"C_b_s", "q_b_s", "rotation_b_s"};

Column number(std::string name, std::string unit, std::string description) {
  return {std::move(name), std::move(unit), std::move(description), CellKind::kNumber};
}

/// Columns PREFIXxSUFFIX, PREFIXySUFFIX, PREFIXzSUFFIX.
void add_axes(std::vector<Column>& columns, std::string_view prefix, std::string_view suffix,
              const char* unit, std::string_view description) {
  for (const char axis : kAxes) {
    columns.push_back(
        number(fmt::format("{}{}{}", prefix, axis, suffix), unit, fmt::format("{}, {}", description, axis)));
  }
}

std::vector<Column> time_columns() {
  return {number("time_s", "s", "time of validity since the run's first R-IMU epoch, by the PC's clock"),
          number("utc_s", "s", "the same instant, UTC since 1970-01-01; empty where nobody told UTC")};
}

std::vector<Column> navigation_columns() {
  auto columns = time_columns();
  columns.push_back(number("gps_week", "1", "GPS week, counted on without roll-over"));
  columns.push_back(number("gps_tow_s", "s", "GPS time of week"));
  columns.push_back(number("lat_deg", "deg", "latitude of the R-IMU, WGS-84"));
  columns.push_back(number("lon_deg", "deg", "longitude of the R-IMU, WGS-84"));
  columns.push_back(number("height_m", "m", "height above the WGS-84 ellipsoid"));
  const std::array<std::array<const char*, 2>, 3> directions{{{"n", "north"}, {"e", "east"}, {"d", "down"}}};
  for (const auto& [key, word] : directions)
    columns.push_back(number(fmt::format("v_{}_mps", key), "m/s", fmt::format("velocity {}", word)));
  columns.push_back(number("roll_deg", "deg", "roll of b relative to north-east-down"));
  columns.push_back(number("pitch_deg", "deg", "pitch of b relative to north-east-down"));
  columns.push_back(number("heading_deg", "deg", "heading of b, clockwise from true north"));
  for (const auto& [key, word] : directions)
    columns.push_back(number(fmt::format("sd_{}_m", key), "m", fmt::format("sd of the position {}", word)));
  for (const auto& [key, word] : directions)
    columns.push_back(
        number(fmt::format("sd_v_{}_mps", key), "m/s", fmt::format("sd of the velocity {}", word)));
  for (const char* angle : {"roll", "pitch", "heading"})
    columns.push_back(number(fmt::format("sd_{}_deg", angle), "deg", fmt::format("sd of the {}", angle)));
  return columns;
}

std::vector<Column> odometry_columns() {
  auto columns = time_columns();
  columns.push_back(number("speed_mps", "m/s", "newest speed as the wheels show it, forward positive"));
  columns.push_back(number("standing", "1", "1: the wheels have stood for a while"));
  columns.push_back(number("zero_velocity", "1", "1: rest is used: the wheels stand and the R-IMU is quiet"));
  columns.push_back(number("lost", "1", "1: no speed for a while"));
  columns.push_back(number("scale_percent", "%", "the wheels show 1 + scale/100 times the speed"));
  columns.push_back(number("mount_y_deg", "deg", "rotation vector that takes b to the vehicle's axes, y"));
  columns.push_back(number("mount_z_deg", "deg", "rotation vector that takes b to the vehicle's axes, z"));
  add_axes(columns, "axle_", "_m", "m", "lever arm from b's origin to the middle of the axle, in b");
  columns.push_back(number("sd_scale_percent", "%", "sd of scale_percent"));
  columns.push_back(number("sd_mount_y_deg", "deg", "sd of mount_y_deg"));
  columns.push_back(number("sd_mount_z_deg", "deg", "sd of mount_z_deg"));
  add_axes(columns, "sd_axle_", "_m", "m", "sd of the axle's lever arm");
  return columns;
}

std::vector<Column> calibration_columns() {
  std::vector<Column> states;
  add_axes(states, "psi_", "_deg", "deg", "boresight: rotation vector -Log(C_prior^T C_b_s), in b");
  add_axes(states, "r_", "_m", "m", "lever arm from b's origin to s's origin, in b");
  states.push_back(number("t_d_ms", "ms", "time offset: S at t shows the motion at t + t_d"));
  add_axes(states, "bg_", "_radps", "rad/s", "gyroscope bias, in s");
  add_axes(states, "ba_", "_mps2", "m/s^2", "accelerometer bias, in s");
  add_axes(states, "sg_", "", "1", "gyroscope scale error, along s");
  add_axes(states, "sa_", "", "1", "accelerometer scale error, along s");
  auto columns = time_columns();
  constexpr std::size_t kPsiColumns = 3;
  for (std::size_t i = 0; i < states.size(); ++i) {
    if (i == kPsiColumns) {
      for (const char* part : {"w", "x", "y", "z"})
        columns.push_back(
            number(fmt::format("q_{}", part), "1",
                   fmt::format("{} of the Hamilton quaternion, scalar first, that rotates b to s", part)));
    }
    columns.push_back(states[i]);
  }
  for (const Column& state : states)
    columns.push_back(
        number(fmt::format("sd_{}", state.name), state.unit, fmt::format("sd of {}", state.name)));
  return columns;
}

void add_errors(std::vector<Column>& columns) {
  add_axes(columns, "e_gyro_", "_radps", "rad/s", "error of the gyroscope, in s where it is valid");
  add_axes(columns, "e_accel_", "_mps2", "m/s^2", "error of the accelerometer, in s where it is valid");
}

std::vector<Column> error_columns() {
  auto columns = time_columns();
  columns.push_back(number("counter", "1", "the S-IMU's own count of samples, unwrapped"));
  add_errors(columns);
  columns.push_back(
      {"regime", "", "static, dynamic, a bin of intensity or what a person named", CellKind::kText});
  return columns;
}

std::vector<Column> scatter_columns() {
  auto columns = time_columns();
  add_axes(columns, "omega_", "", "rad/s", "angular rate, in s");
  add_axes(columns, "omega_dot_", "", "rad/s^2", "angular acceleration, in s");
  add_axes(columns, "omega_ddot_", "", "rad/s^3", "angular jerk, in s");
  add_axes(columns, "f_", "", "m/s^2", "specific force, in s");
  add_axes(columns, "f_dot_", "", "m/s^3", "linear jerk, in s");
  add_errors(columns);
  return columns;
}

std::vector<TableKind> make_tables() {
  return {{"navigation", false, "position, velocity and attitude of the R-IMU, 10 Hz", navigation_columns()},
          {"odometry", false, "what the wheels show and what was learned of them, 10 Hz", odometry_columns()},
          {"smoothed_navigation", false, "as navigation, smoothed, 5 Hz", navigation_columns()},
          {"calibration", true, "how one S-IMU sits and errs relative to the R-IMU, 10 Hz",
           calibration_columns()},
          {"smoothed", true, "as calibration, smoothed, 5 Hz", calibration_columns()},
          {"errors", true, "the error process, one row per S sample", error_columns()},
          {"scatter", true, "errors and motion of samples spread over the drive", scatter_columns()}};
}

}  // namespace

const std::vector<TableKind>& run_tables() {
  static const std::vector<TableKind> tables = make_tables();
  return tables;
}

const TableKind& run_table(std::string_view stem) {
  const auto& all = run_tables();
  const auto at = std::find_if(all.begin(), all.end(), [&](const TableKind& t) { return t.stem == stem; });
  IMUSCOPE_EXPECTS(at != all.end());
  return *at;
}

std::string csv_header(const TableKind& table) {
  std::string header;
  for (const Column& column : table.columns) {
    if (!header.empty()) header += ',';
    header += column.name;
  }
  return header + '\n';
}

std::optional<TableFile> table_file(std::string_view file_name) {
  if (!file_name.ends_with(kCsv)) return std::nullopt;
  file_name.remove_suffix(kCsv.size());
  for (const TableKind& kind : run_tables()) {
    if (!kind.is_per_device && file_name == kind.stem) return TableFile{&kind, {}};
  }
  for (const TableKind& kind : run_tables()) {
    if (!kind.is_per_device || !file_name.starts_with(kind.stem + "_")) continue;
    const std::string device(file_name.substr(kind.stem.size() + 1));
    if (is_device_name(device)) return TableFile{&kind, device};
  }
  return std::nullopt;
}

std::string_view unit_in_name(std::string_view name) {
  if (std::find(kOfFrames.begin(), kOfFrames.end(), name) != kOfFrames.end()) return {};
  for (const Suffix& suffix : kSuffixes) {
    if (name.ends_with(suffix.text)) return suffix.unit;
  }
  return {};
}

}  // namespace imuscope::tables
