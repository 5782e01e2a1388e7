#pragma once

/// The parts of a device's configuration that belong to a vehicle's CAN: which signals of its DBC file are
/// its speed, and which identifiers an MTi on the bus has. The text of the DBC file becomes part of the
/// configuration, so that a capture holds all that its replay needs.

#include <array>
#include <filesystem>
#include <map>
#include <memory>
#include <string>

#include "drivers/can_odometry/decoder.h"
#include "drivers/xsens_can/messages.h"
#include "sample/sample.h"

namespace imuscope {

class TomlReader;

/// [device.odometry]: role odometry.
struct OdometryOptions {
  std::shared_ptr<const dbc::Database> database;
  can_odometry::Choice choice;
  double latency_s = 0.0;
  double max_speed_mps = 0.0;
  double max_acceleration_mps2 = 0.0;
  // What the filter is told; see OdometryConfig.
  bool use_speed = true;
  bool use_non_holonomic = true;
  bool use_zero_velocity = true;
  Vector3 axle_lever_arm_b_m{};
  double axle_lever_arm_sd_m = 0.0;
  double mounting_sd_rad = 0.0;
  double scale_sd = 0.0;
  double speed_sd_mps = 0.0;
  double sideways_sd_mps = 0.0;
  double upwards_sd_mps = 0.0;
  double zero_velocity_sd_mps = 0.0;
  double dead_band_mps = 0.0;
};

/// Texts of files that a configuration names, by the name that it writes: kept in the configuration itself,
/// or read from beside it. The configuration of a capture or of a run folder reads nothing: it may come from
/// elsewhere, and what it named would stand in the files made of it.
struct AttachedFiles {
  std::optional<std::filesystem::path> folder;  ///< of the configuration's file; absent: nothing is read
  std::map<std::string, std::string> texts;
};

/// Reads [device.odometry] and the DBC file that it names.
void read_odometry(TomlReader in, AttachedFiles& files, OdometryOptions& options);

/// Reads what [device.odometry] says to the filter alone, for speeds that do not come from a CAN bus.
void read_odometry_filter(TomlReader in, OdometryOptions& options);

/// Reads [device.xsens_can]: `ids`, where they are not the device's defaults.
void read_xsens_can(TomlReader in, xsens_can::ItemIds& ids);

}  // namespace imuscope
