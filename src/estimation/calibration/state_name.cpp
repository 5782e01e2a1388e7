#include "estimation/calibration/state_name.h"

#include <array>

#include "estimation/calibration/s_imu_model.h"
#include "estimation/navigation/antenna.h"
#include "estimation/navigation/odometry_measurement.h"

namespace imuscope {
namespace {

constexpr std::array kNavigationNames{"position_n",   "position_e",   "position_d",  "velocity_n",
                                      "velocity_e",   "velocity_d",   "attitude_n",  "attitude_e",
                                      "attitude_d",   "gyro_bias_x",  "gyro_bias_y", "gyro_bias_z",
                                      "accel_bias_x", "accel_bias_y", "accel_bias_z"};

constexpr std::array kOdometryNames{"wheel_scale",      "mount_y",          "mount_z",
                                    "axle_lever_arm_x", "axle_lever_arm_y", "axle_lever_arm_z"};
constexpr std::array kAntennaNames{"antenna_lever_arm_x", "antenna_lever_arm_y", "antenna_lever_arm_z",
                                   "receiver_latency"};
static_assert(kOdometryNames.size() == kOdometryErrorSize);
static_assert(kAntennaNames.size() == kAntennaErrorSize);

std::optional<std::string> study_state(const SImuLayout& layout, std::size_t index) {
  std::optional<std::string> found;
  const auto triple = [&](std::size_t first, const char* name) {
    if (first == SImuLayout::kAbsent || index < first || index >= first + 3) return;
    found = std::string(name) + "_" + "xyz"[index - first];
  };
  triple(layout.psi, "psi");
  triple(layout.r, "r");
  triple(layout.gyro_bias, "gyro_bias");
  triple(layout.accel_bias, "accel_bias");
  triple(layout.gyro_scale, "gyro_scale");
  triple(layout.accel_scale, "accel_scale");
  triple(layout.accel_boresight, "accel_boresight");
  triple(layout.gyro_axes, "gyro_axes");
  triple(layout.accel_axes, "accel_axes");
  const auto numbered = [&](std::size_t first, std::size_t count, const char* name) {
    if (first == SImuLayout::kAbsent || index < first || index >= first + count) return;
    found = std::string(name) + "_" + std::to_string(index - first + 1);
  };
  numbered(layout.places, 6, "accel_places");
  numbered(layout.g_sensitivity, 9, "g_sensitivity");
  if (index == layout.t_d) found = "t_d";
  if (index == layout.accel_t_d) found = "accel_t_d";
  if (index == layout.reference_accel_t_d) found = "reference_accel_t_d";
  return found;
}

}  // namespace

StateName state_name(const EstimatorConfig& config, std::size_t index) {
  if (index < kNavigationNames.size()) return {std::nullopt, kNavigationNames[index]};
  std::size_t first = kNavigationNames.size();
  for (std::size_t i = 0; i < config.studies.size(); ++i) {
    const SImuLayout layout = SImuLayout::make(config.studies[i].blocks, first);
    if (const auto name = study_state(layout, index)) return {i, *name};
    first += layout.size;
  }
  const auto named = [&](bool is_there, const auto& names) -> std::optional<std::string> {
    if (!is_there) return std::nullopt;
    if (index < first + names.size()) return names[index - first];
    first += names.size();
    return std::nullopt;
  };
  if (const auto name = named(config.odometry.enabled, kOdometryNames)) return {std::nullopt, *name};
  if (const auto name = named(config.gnss.enabled, kAntennaNames)) return {std::nullopt, *name};
  return {std::nullopt, "state " + std::to_string(index)};
}

}  // namespace imuscope
