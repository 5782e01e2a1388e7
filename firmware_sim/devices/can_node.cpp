#include "firmware_sim/devices/can_node.h"

#include <algorithm>
#include <charconv>
#include <utility>

namespace imusim {
namespace {

constexpr std::uint16_t kStandardIdMax = 0x7FF;
constexpr std::size_t kIdDigits = 3;

}  // namespace

Bytes pack(const CanFrame& frame) {
  constexpr std::size_t kIdBytes = sizeof frame.id;
  Bytes bytes(kIdBytes + frame.data.size());
  bytes[0] = static_cast<std::uint8_t>(frame.id >> 8U);
  bytes[1] = static_cast<std::uint8_t>(frame.id);
  std::copy(frame.data.begin(), frame.data.end(), bytes.begin() + kIdBytes);
  return bytes;
}

CanFrame unpack(std::span<const std::uint8_t> bytes) {
  const auto data = bytes.subspan(sizeof(std::uint16_t));
  return {get_be<std::uint16_t>(bytes), Bytes(data.begin(), data.end())};
}

CanNode::CanNode(const Options& options, Sampler sampler)
    : options_(options),
      sampler_(std::move(sampler)),
      grid_(options.first_s, 1.0 / options.rate_hz, options.clock_skew_ppm) {}

void CanNode::receive(std::span<const std::uint8_t> /*bytes*/, double /*t_s*/) {}

void CanNode::run_until(double t_s, std::vector<Emission>& out) {
  for (; grid_.instant(next_index_) + options_.latency_s < t_s; ++next_index_) {
    const double instant_s = grid_.instant(next_index_);
    for (const CanFrame& frame : sampler_(instant_s, grid_.device_time(next_index_), next_index_)) {
      if (std::find(left_out_.begin(), left_out_.end(), frame.id) != left_out_.end()) continue;
      out.push_back({instant_s + options_.latency_s, pack(frame)});
    }
  }
}

bool CanNode::leave_out(const std::vector<std::string>& blocks) {
  std::vector<std::uint16_t> ids;
  for (const std::string& block : blocks) {
    std::uint16_t id = 0;
    const auto [end, error] = std::from_chars(block.data(), block.data() + block.size(), id, 16);
    const bool whole = end == block.data() + block.size() && block.size() == kIdDigits;
    if (error != std::errc{} || !whole || id > kStandardIdMax) return false;
    ids.push_back(id);
  }
  left_out_ = std::move(ids);
  return true;
}

}  // namespace imusim
