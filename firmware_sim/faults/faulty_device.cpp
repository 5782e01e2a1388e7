#include "firmware_sim/faults/faulty_device.h"

#include <algorithm>
#include <utility>

namespace imusim {
namespace {

constexpr std::size_t kGarbageMax = 64;

std::size_t flip_bits(Bytes& bytes, double share, Random& random) {
  std::size_t flipped = 0;
  for (std::uint8_t& byte : bytes) {
    if (random.uniform() >= share) continue;
    byte = static_cast<std::uint8_t>(byte ^ (1U << (random.bits() & 7U)));
    ++flipped;
  }
  return flipped;
}

std::size_t drop_bytes(Bytes& bytes, double share, Random& random) {
  return std::erase_if(bytes, [&](std::uint8_t) { return random.uniform() < share; });
}

std::size_t cut_tail(Bytes& bytes, Random& random) {
  const std::size_t all = bytes.size();
  bytes.resize(static_cast<std::size_t>(random.uniform() * static_cast<double>(all)));
  return all - bytes.size();
}

Bytes garbage(Random& random) {
  Bytes bytes(1 + random.bits() % kGarbageMax);
  for (std::uint8_t& byte : bytes) byte = static_cast<std::uint8_t>(random.bits() & 0xFFU);
  return bytes;
}

}  // namespace

FaultyDevice::FaultyDevice(std::unique_ptr<Device> device, const std::vector<Fault>& faults,
                           const Random& random, Wire wire)
    : device_(std::move(device)), faults_(faults), random_(random), wire_(wire) {
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
      if (!turn.begins) return;
      silenced_by_ = &fault;
      silent_since_s_.reset();
      return device_->power_cycle(fault.begin_s, fault.end_s - fault.begin_s);
    case FaultKind::kMissing:
      (void)device_->leave_out(turn.begins ? fault.blocks : std::vector<std::string>{});
      return;
    default:
      return;  // of the bytes, the line or the sensors
  }
}

std::size_t FaultyDevice::distort(const Fault& fault, Bytes& bytes, Bytes& behind) {
  switch (fault.kind) {
    case FaultKind::kFlip:
      return flip_bits(bytes, fault.share, random_);
    case FaultKind::kDrop:
      return drop_bytes(bytes, fault.share, random_);
    case FaultKind::kDuplicate:
      if (random_.uniform() < fault.share) behind = bytes;
      return behind.size();
    case FaultKind::kCut:
      return random_.uniform() < fault.share ? cut_tail(bytes, random_) : 0;
    case FaultKind::kGarbage:
      if (random_.uniform() < fault.share) behind = garbage(random_);
      return behind.size();
    default:
      return 0;
  }
}

void FaultyDevice::note_silence(double ready_s) {
  // A device that boots may say so, and pause again before it goes on.
  constexpr double kPause_s = 0.25;
  const bool pauses = last_ready_s_ && ready_s - *last_ready_s_ > kPause_s;
  if (silenced_by_ != nullptr && pauses && ready_s >= silenced_by_->end_s) {
    if (!silent_since_s_) silent_since_s_ = last_ready_s_;
    silenced_by_->tally->silent_s = ready_s - *silent_since_s_;
  }
  last_ready_s_ = ready_s;
}

void FaultyDevice::put_distorted(Emission&& emission, std::vector<Emission>& out) {
  note_silence(emission.ready_s);
  Bytes behind;
  bool arrives = true;
  for (const Fault& fault : faults_) {
    if (!fault.acts_at(emission.ready_s)) continue;
    Bytes added;
    const std::size_t hit = distort(fault, emission.bytes, added);
    ++fault.tally->messages;
    if (hit == 0) continue;
    ++fault.tally->hit;
    fault.tally->bytes_hit += hit;
    if (!added.empty())
      behind = std::move(added);
    else if (wire_ == Wire::kFrames)
      arrives = false;
  }
  if (!arrives) return;
  const double ready_s = emission.ready_s;
  if (!emission.bytes.empty()) out.push_back(std::move(emission));
  if (behind.empty()) return;
  // On a bus, bytes that are no frame of anybody's do not arrive either.
  const bool repeated = wire_ == Wire::kFrames && !out.empty() && out.back().bytes == behind;
  if (wire_ == Wire::kBytes || repeated) out.push_back({ready_s, std::move(behind)});
}

void add_line_faults(const std::vector<Fault>& faults, LineOptions& line) {
  for (const Fault& fault : faults) {
    if (fault.kind == FaultKind::kStall)
      line.holds.push_back({fault.begin_s, fault.end_s, fault.end_s - fault.begin_s});
    if (fault.kind == FaultKind::kBurst) line.holds.push_back({fault.begin_s, fault.end_s, fault.every_s});
    if (fault.kind == FaultKind::kUnplug) {
      line.unplugged.push_back({fault.begin_s, fault.end_s, [tally = fault.tally](std::size_t bytes) {
                                  ++tally->hit;
                                  tally->bytes_hit += bytes;
                                }});
    }
  }
}

}  // namespace imusim
