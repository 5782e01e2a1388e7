#include "drivers/can_bus/session.h"

namespace imuscope {
namespace {

/// A frame that the controller lost is worth a word for so long.
constexpr Duration kTellOverflow = std::chrono::seconds(10);

}  // namespace

void CanSession::on_bytes(std::span<const std::uint8_t> bytes, HostTime now) noexcept {
  CanFrameReader reader(bytes);
  CanFrame frame;
  while (reader.next(frame)) {
    if (frame.is_error) {
      on_error(frame, now);
      continue;
    }
    last_frame_ = now;
    errors_alone_ = false;
    state_ = SessionState::kStreaming;
    // A controller that is off the bus hears nothing: so it is back, though nobody said so.
    if (bus_state_ == CanBusState::kOff) bus_state_ = CanBusState::kActive;
  }
  tell();
}

void CanSession::on_error(const CanFrame& frame, HostTime now) noexcept {
  ++error_frames_;
  const auto report = read_can_error(frame);
  if (report.state) {
    if (*report.state == CanBusState::kOff && bus_state_ != CanBusState::kOff) ++bus_offs_;
    bus_state_ = *report.state;
  }
  if (report.receive_overflow) {
    ++overflows_;
    overflowed_ = true;
    last_overflow_ = now;
  }
  errors_alone_ = report.state ? *report.state != CanBusState::kActive : errors_alone_ || report.bus_error;
}

std::span<const std::uint8_t> CanSession::poll(HostTime now) noexcept {
  if (state_ == SessionState::kStreaming && now - last_frame_ > kSilence) state_ = SessionState::kConnecting;
  if (overflowed_ && now - last_overflow_ > kTellOverflow) overflowed_ = false;
  tell();
  return {};
}

void CanSession::tell() noexcept {
  problem_.clear();
  if (bus_state_ == CanBusState::kOff) {
    problem_.say(
        "bus-off (time {}): the controller has gone silent after too many errors; check wiring, termination "
        "and bit rate, then restart it: ip link set ... type can restart",
        bus_offs_);
  } else if (errors_alone_ && state_ != SessionState::kStreaming) {
    problem_.say("only error frames come: the bit rate is probably not the bus's");
  } else if (overflowed_) {
    problem_.say(
        "the controller had no room for frames, {} times so far: frames are lost before this PC sees them",
        overflows_);
  } else if (bus_state_ == CanBusState::kPassive) {
    problem_.say("error-passive: frames are damaged; check wiring and termination");
  }
}

}  // namespace imuscope
