#include "firmware_sim/io/serial_line.h"

#include <algorithm>
#include <cmath>

namespace imusim {
namespace {

constexpr double kBitsPerByte = 10.0;  // 8N1
constexpr double kUsbFrame_s = 1e-3;
// FTDI chips: a USB transfer of 64 bytes, two of them status; the latency timer's default.
constexpr std::size_t kFtdiBytes = 62;
constexpr double kFtdiTimer_s = 16e-3;

}  // namespace

void SerialLine::send(const Emission& emission) {
  const double byte_s = kBitsPerByte / options_.baud;
  double done = std::max(emission.ready_s, free_at_s_);
  const Unplugged* lost_to = nullptr;
  std::size_t lost = 0;
  for (const std::uint8_t value : emission.bytes) {
    done += byte_s;
    if (const Unplugged* span = unplugged_at(done)) {
      lost_to = span;
      ++lost;
    } else {
      waiting_.push_back({done, value, false});
    }
  }
  if (lost_to != nullptr && lost_to->on_unheard) lost_to->on_unheard(lost);
  if (!waiting_.empty()) waiting_.back().ends_message = true;
  free_at_s_ = done;
}

const Unplugged* SerialLine::unplugged_at(double t_s) const {
  for (const Unplugged& span : options_.unplugged)
    if (t_s >= span.begin_s && t_s < span.end_s) return &span;
  return nullptr;
}

double SerialLine::held_until(double t_s) const {
  for (const HeldReads& hold : options_.holds) {
    if (t_s < hold.begin_s || t_s >= hold.end_s) continue;
    const double reads = std::ceil((t_s - hold.begin_s) / hold.every_s);
    t_s = std::min(hold.end_s, hold.begin_s + reads * hold.every_s);
  }
  return t_s;
}

double SerialLine::next_usb_frame(double t_s) const {
  return options_.usb_phase_s + std::ceil((t_s - options_.usb_phase_s) / kUsbFrame_s) * kUsbFrame_s;
}

SerialLine::NextRead SerialLine::next_ftdi_read() const {
  // The timer runs on without data: it expires every 16 ms since the last transfer.
  const double first_s = waiting_.front().done_s;
  const double since_s = flushed_at_s_.value_or(first_s);
  const double expiry_s = since_s + (std::floor((first_s - since_s) / kFtdiTimer_s) + 1.0) * kFtdiTimer_s;
  if (waiting_.size() >= kFtdiBytes && waiting_[kFtdiBytes - 1].done_s <= expiry_s)
    return {waiting_[kFtdiBytes - 1].done_s, kFtdiBytes};
  std::size_t count = 0;
  while (count < waiting_.size() && waiting_[count].done_s <= expiry_s) ++count;
  return {expiry_s, count};
}

SerialLine::NextRead SerialLine::next_read() const {
  const NextRead next = unheld_read();
  const double held_s = held_until(next.at_s);
  if (held_s == next.at_s) return next;
  std::size_t count = next.count;
  while (count < waiting_.size() && waiting_[count].done_s <= held_s) ++count;
  return {held_s, count};
}

SerialLine::NextRead SerialLine::unheld_read() const {
  if (options_.reads == ReadModel::kFtdi) return next_ftdi_read();
  if (options_.reads == ReadModel::kMessages) {
    std::size_t count = 1;
    while (count < waiting_.size() && !waiting_[count - 1].ends_message) ++count;
    return {waiting_[count - 1].done_s, count};
  }
  const double frame_s = next_usb_frame(waiting_.front().done_s);
  std::size_t count = 1;
  while (count < waiting_.size() && waiting_[count].done_s <= frame_s) ++count;
  return {frame_s, count};
}

void SerialLine::deliver_until(double t_s, const OnRead& on_read) {
  while (!waiting_.empty()) {
    const NextRead next = next_read();
    // A byte that is still to come could belong to a read that ends after t_s, never to an earlier one.
    if (next.at_s >= t_s) return;
    read_.clear();
    for (std::size_t i = 0; i < next.count; ++i) {
      read_.push_back(waiting_.front().value);
      waiting_.pop_front();
    }
    flushed_at_s_ = next.at_s;
    const double delivered_s = options_.reads == ReadModel::kFtdi ? next_usb_frame(next.at_s) : next.at_s;
    const double jitter_s = -options_.jitter_mean_s * std::log(1.0 - random_.uniform());
    const double host_s = options_.clock.seconds_at(delivered_s + jitter_s);
    last_arrival_ns_ = std::max(
        last_arrival_ns_, options_.host_begin_ns + static_cast<std::int64_t>(std::llround(host_s * 1e9)));
    on_read(read_, last_arrival_ns_);
  }
}

}  // namespace imusim
