#include "firmware_sim/io/can_line.h"

#include <algorithm>
#include <cmath>

namespace imusim {
namespace {

/// A classic frame of 11 bits without data, with the space after it; stuffing adds about a tenth.
constexpr double kFrameBits = 47.0;
constexpr double kStuffing = 1.1;
constexpr std::size_t kOthersBytes = 8;

}  // namespace

double CanLine::duration_s(const CanFrame& frame) const {
  return (kFrameBits + 8.0 * static_cast<double>(frame.data.size())) * kStuffing / options_.bit_rate;
}

void CanLine::send(const Emission& emission) {
  CanFrame frame = unpack(emission.bytes);
  const double own_s = duration_s(frame);
  double begin_s = std::max(emission.ready_s - own_s, free_at_s_);
  // Another node's frame is on its way: what is left of it is any part of it.
  if (random_.uniform() < options_.bus_load)
    begin_s += random_.uniform() * duration_s({0, Bytes(kOthersBytes)});
  free_at_s_ = begin_s + own_s;
  const double stamped_s = free_at_s_ - options_.jitter_mean_s * std::log(1.0 - random_.uniform());
  const double last_s = waiting_.empty() ? stamped_s : waiting_.back().t_s;
  waiting_.push_back({std::max(stamped_s, last_s), std::move(frame)});
}

void CanLine::deliver_until(double t_s, const OnFrame& on_frame) {
  while (!waiting_.empty() && waiting_.front().t_s < t_s) {
    on_frame(waiting_.front().frame, waiting_.front().t_s);
    waiting_.pop_front();
  }
}

}  // namespace imusim
