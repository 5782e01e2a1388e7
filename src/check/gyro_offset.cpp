#include <fmt/format.h>
#include <algorithm>

#include "base/units.h"
#include "check/bins.h"
#include "check/checks.h"

namespace imuscope::check {

namespace {

/// The largest offset of consumer gyros (20 deg/s, data sheet of the MPU-6050), nearly; others have a tenth of it.
constexpr double kGyroOffsetMax_radps = 10.0 * kRadPerDeg;
/// Three quarters of a drive are near to the offset: somebody who swings a sensor in circles is not.
constexpr float kNearOffset = 0.5F;
constexpr double kStaysShare = 0.75;

bool stays_at(const ImuTrack& track, const Eigen::Vector3f& usual) {
  const auto near = std::count_if(
      track.omega_radps.begin(), track.omega_radps.end(),
      [&](const Eigen::Vector3f& omega) { return (omega - usual).norm() < kNearOffset * usual.norm(); });
  return static_cast<double>(near) > kStaysShare * static_cast<double>(track.size());
}

}  // namespace

void check_gyro_offset(const Drive& drive, std::size_t device, std::vector<Finding>& findings) {
  const DeviceConfig& config = drive.configuration().devices[device];
  const ImuTrack& track = drive.imu(device);
  if (track.size() == 0) return;
  const Eigen::Vector3f usual = usual_rate(track);
  if (!(usual.norm() > static_cast<float>(kGyroOffsetMax_radps)) || !stays_at(track, usual)) return;
  int axis = 0;
  usual.cwiseAbs().maxCoeff(&axis);
  findings.push_back({Harm::kWrong,
                      "gyro offset",
                      config.name,
                      fmt::format("its {} gyro does not return to zero", "xyz"[axis]),
                      static_cast<double>(usual[axis]) * kDegPerRad,
                      0.0,
                      "deg/s",
                      "take the offset at rest out where it is written, and check that axis",
                      {}});
}

}  // namespace imuscope::check
