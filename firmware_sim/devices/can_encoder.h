#pragma once

/// Frames of the simulated vehicle's wheel speeds and of an XSens MTi-600 with CAN output.

#include <Eigen/Core>
#include <array>
#include <vector>

#include "firmware_sim/devices/can_node.h"

namespace imusim {

/// The wheels' frame, as simulated_vehicle.dbc describes it: 0AA, four speeds of 16 bits, most significant
/// byte first, 0.01 km/h a unit, 6767 at standstill, in the order front right, front left, rear right, rear
/// left. Speeds beyond the range are the ends of it.
[[nodiscard]] CanFrame wheel_frame(const std::array<double, 4>& speeds_mps);

/// The DBC file that describes the wheels' frame.
[[nodiscard]] std::string_view wheel_dbc();

/// Which messages an MTi has been told to send beside SampleTime, GroupCounter and StatusWord.
enum class MtiOutput {
  kIncrements,       ///< delta_v and delta_q
  kHighRate,         ///< 061, the acceleration, and 062, the rate of turn
  kHighRateSwapped,  ///< documents disagree: 061 the rate of turn, 062 the acceleration
};

/// One group of messages: the increments of the interval that ends at the sampling instant, or what is felt
/// at that instant.
struct MtiGroup {
  MtiOutput output = MtiOutput::kIncrements;
  std::uint32_t sample_time_100us = 0;
  std::uint16_t counter = 0;
  std::uint32_t status = 0;
  Eigen::Vector3d delta_v_mps;          ///< integral of the specific force
  Eigen::Vector3d rotation_vector_rad;  ///< of the interval
  Eigen::Vector3d f_mps2;               ///< for the high-rate messages, like the next
  Eigen::Vector3d omega_radps;
};

/// SampleTime, GroupCounter, StatusWord and the two messages of the output, in the order in which the device
/// sends them.
[[nodiscard]] std::vector<CanFrame> mti_frames(const MtiGroup& group);

}  // namespace imusim
