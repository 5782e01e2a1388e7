#include "real_recordings.h"

#include <fmt/format.h>

namespace real_drives {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

/// Forward-left-up (or any z-up) axes to those with y and z turned over, as the configurations do.
const Matrix3d kTurnedOver = Vector3d(1.0, -1.0, -1.0).asDiagonal();

RealDrive car(const std::string& data, const std::string& drive, double t_d_s) {
  const std::string folder = data + "/car_drive/" + drive;
  return {
      "car " + drive,
      "csv_drive.toml",
      {"reference=" + folder + "/reference_imu.csv", "gnss=" + folder + "/gnss.csv",
       "dot=" + folder + "/study_imu.csv"},
      {{"car", "dot", kTurnedOver, {-1.93, 0.20, -93.63}, {0.05, 0.18, 0.08}, {0.002, 0.038, 0.154}, 0.004}},
      {{0.25, 0.3, 0.3}, 0.010, 0.002},
      t_d_s};
}

/// Lever arms "repeat within 1 to 2 mm"; about z the known values hang on how crooked triads are taken to be.
RealDrive rc_car(const std::string& data, const std::string& drive) {
  const std::string folder = data + "/rc_car/" + drive;
  RealDrive out{"rc " + drive,
                "csv_rc_car.toml",
                {"reference=" + folder + "/reference_imu.csv", "gnss=" + folder + "/gnss.csv"},
                {},
                {{0.15, 0.15, 1.2}, 0.003, 0.0},
                std::nullopt};
  const auto add = [&](char imu, const Vector3d& euler_deg, const Vector3d& sd_deg, const Vector3d& r_m) {
    out.inputs.push_back(fmt::format("imu{}={}/study_imu_{}.csv", imu, folder, imu));
    out.mountings.push_back({fmt::format("rc {}", imu), fmt::format("imu{}", imu), Matrix3d::Identity(),
                             euler_deg, sd_deg, r_m, 0.001});
  };
  add('2', {-6.80, 3.08, -3.03}, {0.02, 0.02, 0.20}, {-0.0045, -0.0406, 0.0050});
  add('3', {-4.43, -0.73, -3.14}, {0.01, 0.05, 0.27}, {0.0417, -0.0360, 0.0025});
  add('4', {-9.74, 4.32, -4.44}, {0.03, 0.03, 0.38}, {0.0383, -0.0748, 0.0097});
  return out;
}

RealDrive pair(const std::string& data, const std::string& name, const Vector3d& euler_deg,
               const Vector3d& r_m, double t_d_s) {
  const std::string file = data + "/xsens_pair/" + name;
  return {"pair " + name,
          "csv_pair.toml",
          {"reference=" + file + "_b.csv", "study=" + file + "_a.csv"},
          {{"pair " + name.substr(0, 2), "study", kTurnedOver, euler_deg, {0.1, 0.1, 0.1}, r_m, 0.003}},
          {{0.05, 0.05, 0.05}, 0.003, 0.002},
          t_d_s};
}

}  // namespace

std::vector<RealDrive> recordings(const std::string& data) {
  return {car(data, "02", 0.253),
          car(data, "04", 5.838),
          car(data, "06", 0.402),
          car(data, "07", 0.035),
          car(data, "08", -0.075),
          rc_car(data, "h"),
          rc_car(data, "k"),
          rc_car(data, "l"),
          pair(data, "45_1", {-1.35, 1.60, -45.01}, {-0.170, -0.197, 0.001}, 0.0),
          pair(data, "45_2", {-1.32, 1.67, -44.98}, {-0.170, -0.197, 0.001}, 0.0),
          pair(data, "90_1", {-2.11, 0.30, -90.08}, {-0.197, -0.198, 0.003}, -0.251)};
}

}  // namespace real_drives
