#pragma once

/// From a node's controller to the host's stamp: frames wait for the bus, which others use too, take their
/// time on it, and are stamped by the host's kernel a little later.

#include <cstdint>
#include <deque>
#include <functional>

#include "firmware_sim/devices/can_node.h"
#include "firmware_sim/random/random.h"

namespace imusim {

struct CanLineOptions {
  double bit_rate = 500e3;
  double bus_load = 0.3;         ///< by other nodes: the probability that a frame has to wait for one
  double jitter_mean_s = 30e-6;  ///< mean delay of the kernel's stamp, exponentially distributed
};

class CanLine {
 public:
  /// @param t_s  scenario time of the kernel's stamp
  using OnFrame = std::function<void(const CanFrame& frame, double t_s)>;

  CanLine(const CanLineOptions& options, const Random& random) : options_(options), random_(random) {}

  /// @param emission  of a CanNode; ready when its last bit is on a bus that is idle
  void send(const Emission& emission);

  /// Hands out the frames that are stamped before t_s. Whatever is sent later must be ready no earlier.
  void deliver_until(double t_s, const OnFrame& on_frame);

 private:
  struct Stamped {
    double t_s;
    CanFrame frame;
  };
  [[nodiscard]] double duration_s(const CanFrame& frame) const;

  CanLineOptions options_;
  Random random_;
  std::deque<Stamped> waiting_;
  double free_at_s_ = -1e300;
};

}  // namespace imusim
