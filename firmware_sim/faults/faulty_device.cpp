#include "firmware_sim/faults/faulty_device.h"

#include <algorithm>
#include <utility>

namespace imusim {
namespace {

constexpr std::size_t kGarbageMax = 64;

void flip_bits(Bytes& bytes, double share, Random& random) {
  for (std::uint8_t& byte : bytes) {
    if (random.uniform() < share) byte = static_cast<std::uint8_t>(byte ^ (1U << (random.bits() & 7U)));
  }
}

void drop_bytes(Bytes& bytes, double share, Random& random) {
  std::erase_if(bytes, [&](std::uint8_t) { return random.uniform() < share; });
}

void cut_tail(Bytes& bytes, Random& random) {
  bytes.resize(static_cast<std::size_t>(random.uniform() * static_cast<double>(bytes.size())));
}

Bytes garbage(Random& random) {
  Bytes bytes(1 + random.bits() % kGarbageMax);
  for (std::uint8_t& byte : bytes) byte = static_cast<std::uint8_t>(random.bits() & 0xFFU);
  return bytes;
}

}  // namespace

FaultyDevice::FaultyDevice(std::unique_ptr<Device> device, const std::vector<Fault>& faults,
                           const Random& random)
    : device_(std::move(device)), faults_(faults), random_(random) {
  for (const Fault& fault : faults_) {
    turns_.push_back({fault.begin_s, &fault, true});
    turns_.push_back({fault.end_s, &fault, false});
  }
  std::stable_sort(turns_.begin(), turns_.end(), [](const Turn& a, const Turn& b) { return a.t_s < b.t_s; });
}

void FaultyDevice::receive(std::span<const std::uint8_t> bytes, double t_s) {
  const bool unplugged = std::any_of(faults_.begin(), faults_.end(), [&](const Fault& fault) {
    return fault.kind == FaultKind::kUnplug && fault.acts_at(t_s);
  });
  if (!unplugged) device_->receive(bytes, t_s);
}

void FaultyDevice::run_until(double t_s, std::vector<Emission>& out) {
  pure_.clear();
  for (; next_turn_ < turns_.size() && turns_[next_turn_].t_s <= t_s; ++next_turn_) {
    device_->run_until(turns_[next_turn_].t_s, pure_);
    befall(turns_[next_turn_]);
  }
  device_->run_until(t_s, pure_);
  for (Emission& emission : pure_) put_distorted(std::move(emission), out);
}

void FaultyDevice::befall(const Turn& turn) {
  const Fault& fault = *turn.fault;
  switch (fault.kind) {
    case FaultKind::kClockSkew:
      return device_->add_skew(turn.begins ? fault.ppm : -fault.ppm);
    case FaultKind::kClockJump:
      if (turn.begins) device_->jump_clock(fault.by_s);
      return;
    case FaultKind::kRestart:
      if (turn.begins) device_->power_cycle(fault.begin_s, fault.end_s - fault.begin_s);
      return;
    case FaultKind::kMissing:
      (void)device_->leave_out(turn.begins ? fault.blocks : std::vector<std::string>{});
      return;
    default:
      return;  // of the bytes, the line or the sensors
  }
}

void FaultyDevice::put_distorted(Emission&& emission, std::vector<Emission>& out) {
  Bytes behind;
  for (const Fault& fault : faults_) {
    if (!fault.acts_at(emission.ready_s)) continue;
    switch (fault.kind) {
      case FaultKind::kFlip:
        flip_bits(emission.bytes, fault.share, random_);
        break;
      case FaultKind::kDrop:
        drop_bytes(emission.bytes, fault.share, random_);
        break;
      case FaultKind::kDuplicate:
        if (random_.uniform() < fault.share) behind = emission.bytes;
        break;
      case FaultKind::kCut:
        if (random_.uniform() < fault.share) cut_tail(emission.bytes, random_);
        break;
      case FaultKind::kGarbage:
        if (random_.uniform() < fault.share) behind = garbage(random_);
        break;
      default:
        break;
    }
  }
  const double ready_s = emission.ready_s;
  if (!emission.bytes.empty()) out.push_back(std::move(emission));
  if (!behind.empty()) out.push_back({ready_s, std::move(behind)});
}

void add_line_faults(const std::vector<Fault>& faults, LineOptions& line) {
  for (const Fault& fault : faults) {
    if (fault.kind == FaultKind::kStall)
      line.holds.push_back({fault.begin_s, fault.end_s, fault.end_s - fault.begin_s});
    if (fault.kind == FaultKind::kBurst) line.holds.push_back({fault.begin_s, fault.end_s, fault.every_s});
    if (fault.kind == FaultKind::kUnplug) line.unplugged.push_back({fault.begin_s, fault.end_s});
  }
}

}  // namespace imusim
