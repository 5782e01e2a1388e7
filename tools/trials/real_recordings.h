#pragma once

/// Recorded drives whose mountings others know: what is to be read, and what is known. Kept beside the
/// checkout; known values and their spread over drives come with them.

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

namespace real_drives {

/// What independent estimates over many drives found of one S-IMU's mounting.
struct KnownMounting {
  std::string name;        ///< of the mounting; drives of one mounting have it in common
  std::string device;      ///< in the configuration
  Eigen::Matrix3d b_file;  ///< axes of the reference's file to b, as the configuration has them
  Eigen::Vector3d
      euler_deg;  ///< zyx, about x, y, z: takes study components to the file's reference components
  Eigen::Vector3d euler_sd_deg;
  Eigen::Vector3d r_m;  ///< of the study in the axes of the reference's file
  double r_sd_m = 0.0;
};

/// What a result has to reach.
struct Goals {
  Eigen::Vector3d euler_deg;
  double r_m = 0.0;
  double t_d_s = 0.0;
};

struct RealDrive {
  std::string name;
  std::string config;
  std::vector<std::string> inputs;
  std::vector<KnownMounting> mountings;
  Goals goals;
  std::optional<double> t_d_s;  ///< to be added to the study's times
};

/// car_drive/{02,04,06,07,08}, rc_car/{h,k,l} with three S-IMUs each, and xsens_pair.
[[nodiscard]] std::vector<RealDrive> recordings(const std::string& data);

}  // namespace real_drives
