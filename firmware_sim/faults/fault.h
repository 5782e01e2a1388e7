#pragma once

/// What goes wrong in a simulated run, and when. A script (see imusim/fault_script.h) makes a list of these.

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

namespace imusim {

enum class FaultKind {
  // Bytes on the wire.
  kFlip,       ///< one bit of a byte turns; `share` of the bytes
  kDrop,       ///< a byte is lost; `share` of the bytes
  kDuplicate,  ///< a message is sent twice; `share` of the messages
  kCut,        ///< a message loses its tail; `share` of the messages
  kGarbage,    ///< random bytes follow a message; `share` of the messages
  // When they arrive.
  kStall,  ///< the host reads nothing; then all at once
  kBurst,  ///< the host reads only every `every_s`
  // The device.
  kClockSkew,  ///< its clock is fast by `ppm` more
  kClockJump,  ///< its clock is put ahead by `by_s`
  kRestart,    ///< without power for the time of the fault
  kUnplug,     ///< its port is gone for the time of the fault; the device runs on
  kMissing,    ///< `blocks` are left out of its messages
  // What it measures.
  kStuck,       ///< the sensors of `sensors` repeat what they showed when it began
  kSaturation,  ///< they show no more than `gyro_range_radps`, `accel_range_mps2`
  kRtkJump,     ///< a position is wrong by `by_n_m`
  kSolution,    ///< the receiver's solution is of `solution_type`
};

/// What a fault did, as the simulator knows it.
struct FaultTally {
  std::uint64_t messages = 0;   ///< sent while it lasted
  std::uint64_t hit = 0;        ///< of them, that it changed, repeated, or followed with garbage
  std::uint64_t bytes_hit = 0;  ///< turned, lost or added
  double silent_s = 0.0;  ///< kRestart: from the last message before to the first after which it sends on
};

struct Fault {
  FaultKind kind{};
  std::string device;
  double begin_s = 0.0;
  double end_s = 0.0;
  double share = 1.0;
  double every_s = 0.5;
  double ppm = 0.0;
  double by_s = 0.0;
  std::vector<std::string> blocks;
  bool gyro = true;
  bool accel = true;
  double gyro_range_radps = 1e9;
  double accel_range_mps2 = 1e9;
  Eigen::Vector3d by_n_m = Eigen::Vector3d::Zero();                    ///< north, east, down
  std::shared_ptr<FaultTally> tally = std::make_shared<FaultTally>();  ///< of this device; copies share it
  int solution_type = 0;  ///< GREIS: 0 none, 1 single, 2 differential, 3 float, 4 fixed

  [[nodiscard]] bool acts_at(double t_s) const { return t_s >= begin_s && t_s < end_s; }
};

}  // namespace imusim
