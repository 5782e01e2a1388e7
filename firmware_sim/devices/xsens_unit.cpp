#include "firmware_sim/devices/xsens_unit.h"

#include <algorithm>
#include <limits>

namespace imusim {
namespace {

using namespace xsens;

constexpr double kNever_s = std::numeric_limits<double>::infinity();
constexpr double kWakeUpTimeout_s = 0.5;
// From power to WakeUp.
constexpr double kBoot_s = 1.7;
// What announces a measurement that nobody asked for goes ahead of it, so that the line is free for the data.
constexpr double kAhead_s = 0.05;

}  // namespace

XsensUnit::XsensUnit(const SampleGrid& grid, double answer_delay_s, double power_on_s)
    : grid_(grid), answer_delay_s_(answer_delay_s), measurement_end_s_(kNever_s) {
  power_on(power_on_s);
}

void XsensUnit::power_on(double t_s) {
  state_ = State::kWaking;
  measurement_end_s_ = kNever_s;
  wake_deadline_s_ = t_s + kWakeUpTimeout_s;
  scanner_ = {};
  replies_.push_back({t_s, frame(kWakeUp, {})});
}

void XsensUnit::power_cycle(double t_s, double off_s) {
  state_ = State::kOff;
  replies_.clear();
  power_on_s_ = t_s + off_s + kBoot_s;
  restart();
  next_index_ = std::max(next_index_, grid_.first_from(power_on_s_));
  count_anew();
}

void XsensUnit::start_measuring(double t_s, std::vector<Bytes> announcements) {
  replies_.clear();
  for (Bytes& message : announcements) replies_.push_back({t_s - kAhead_s, std::move(message)});
  enter_measurement(t_s);
}

void XsensUnit::enter_measurement(double t_s) {
  state_ = State::kMeasurement;
  measurement_end_s_ = kNever_s;
  next_index_ = std::max(grid_.first_from(t_s), next_index_);
}

void XsensUnit::answer(Bytes message, double t_s) {
  replies_.push_back({t_s + answer_delay_s_, std::move(message)});
}

void XsensUnit::receive(std::span<const std::uint8_t> bytes, double t_s) {
  if (state_ == State::kOff) {
    if (t_s < power_on_s_) return;
    power_on(power_on_s_);
  }
  scanner_.hear(bytes);
  Command command;
  while (scanner_.next(command)) {
    if (is_addressed(command)) handle(command, t_s);
  }
}

void XsensUnit::handle(const Command& command, double t_s) {
  switch (command.mid) {
    case kReset:
      acknowledge(command, t_s);
      restart();
      return power_on(t_s + answer_delay_s_);
    case kGoToConfig:
      acknowledge(command, t_s);
      if (state_ == State::kMeasurement)
        measurement_end_s_ = t_s + answer_delay_s_;
      else
        state_ = State::kConfig;
      return;
    case kWakeUpAck:
      if (state_ == State::kWaking) state_ = State::kConfig;
      return;
    default:
      if (state_ == State::kMeasurement && handle_measuring(command, t_s)) return;
      // A command may follow the GoToConfig that is being acknowledged; while measuring all others are
      // ignored.
      if (state_ == State::kConfig || measurement_end_s_ != kNever_s) handle_in_config(command, t_s);
  }
}

void XsensUnit::run_until(double t_s, std::vector<Emission>& out) {
  if (state_ == State::kOff) {
    if (t_s < power_on_s_) return;
    power_on(power_on_s_);
  }
  while (!replies_.empty() && replies_.front().ready_s <= t_s) {
    emit_samples_until(replies_.front().ready_s, out);
    if (measurement_end_s_ <= replies_.front().ready_s && state_ == State::kMeasurement) {
      state_ = State::kConfig;
      measurement_end_s_ = kNever_s;
    }
    out.push_back(std::move(replies_.front()));
    replies_.pop_front();
  }
  if (state_ == State::kWaking && t_s >= wake_deadline_s_) {
    out.push_back({wake_deadline_s_, frame(kConfiguration, configuration())});
    enter_measurement(wake_deadline_s_);
  }
  emit_samples_until(t_s, out);
}

}  // namespace imusim
