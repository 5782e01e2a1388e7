#include "firmware_sim/devices/xsens_mtx.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

namespace imusim {
namespace {

using namespace xsens;

constexpr double kNever_s = std::numeric_limits<double>::infinity();
constexpr double kPeriodTicksPerSecond = 115200.0;
constexpr std::uint16_t kPeriodFastest = 225;    // 512 Hz
constexpr std::uint16_t kPeriodSlowest = 11520;  // 10 Hz
constexpr double kWakeUpTimeout_s = 0.5;
// Time the firmware takes to answer a command.
constexpr double kAnswerDelay_s = 0.003;
// Longest message that a host sends to an MTx: OutputConfiguration with 32 entries.
constexpr std::size_t kLongestCommand = 128;

constexpr std::uint8_t kErrorPeriod = 0x03;
constexpr std::uint8_t kErrorMessage = 0x04;
constexpr std::uint8_t kErrorBaudrate = 0x20;
constexpr std::uint8_t kErrorParameter = 0x21;

// Index = baud code; 0x80 is another code of 921600.
constexpr std::array<int, 12> kBauds = {460800, 230400, 115200, 76800, 57600,  38400,
                                        28800,  19200,  14400,  9600,  921600, 4800};

int baud_of_code(std::uint8_t code) {
  if (code == 0x80) return 921600;
  return code < kBauds.size() ? kBauds[code] : 0;
}

std::uint8_t code_of_baud(int baud) {
  const auto* const found = std::find(kBauds.begin(), kBauds.end(), baud);
  return static_cast<std::uint8_t>(found == kBauds.end() ? 2 : found - kBauds.begin());
}

bool valid_period(std::uint16_t period) { return period >= kPeriodFastest && period <= kPeriodSlowest; }
bool valid_mode(std::uint16_t mode) { return mode != 0 && (mode & ~kKnownModes) == 0; }
bool valid_settings(std::uint32_t settings) { return (settings & ~kKnownSettings) == 0; }
bool valid_error_mode(std::uint16_t mode) { return mode <= 3; }
bool any_skip(std::uint16_t /*skip*/) { return true; }

}  // namespace

XsensMtx::XsensMtx(const Options& options, Sampler sampler, double power_on_s)
    : options_(options),
      sampler_(std::move(sampler)),
      baud_(options.baud),
      measurement_end_s_(kNever_s),
      grid_origin_s_(options.first_sample_s) {
  settings_.period = options.period;
  settings_.baud_code = code_of_baud(options.baud);
  power_on(power_on_s);
}

void XsensMtx::power_on(double t_s) {
  state_ = State::kWaking;
  measurement_end_s_ = kNever_s;
  wake_deadline_s_ = t_s + kWakeUpTimeout_s;
  heard_.clear();
  replies_.push_back({t_s, frame(kWakeUp, {})});
}

void XsensMtx::start_calibrated(double t_s) {
  settings_.output_mode = kModeCalibrated;
  settings_.output_settings = kSettingsCounter | kSettingsNoMag;
  replies_.clear();
  // Early enough for the line to be free when the first data come.
  constexpr double kAhead_s = 0.05;
  replies_.push_back({t_s - kAhead_s, frame(kConfiguration, configuration())});
  replies_.push_back({t_s - kAhead_s, frame(kGoToMeasurement + 1, {})});
  enter_measurement(t_s);
}

double XsensMtx::period_s() const {
  return settings_.period / kPeriodTicksPerSecond / (1.0 + options_.clock_skew_ppm * 1e-6);
}

double XsensMtx::sample_time(std::int64_t index) const {
  return grid_origin_s_ + static_cast<double>(index - index_at_grid_) * period_s();
}

void XsensMtx::enter_measurement(double t_s) {
  state_ = State::kMeasurement;
  measurement_end_s_ = kNever_s;
  // The sampling clock never stopped: go on with the first sample that lies ahead.
  const double ahead = std::ceil((t_s - grid_origin_s_) / period_s());
  next_index_ = std::max(index_at_grid_ + static_cast<std::int64_t>(std::max(ahead, 0.0)), next_index_);
}

void XsensMtx::receive(std::span<const std::uint8_t> bytes, double t_s) {
  put_bytes(heard_, bytes);
  Command command;
  while (take_frame(command)) handle(command, t_s);
}

/// Takes the first good frame out of what was heard, skipping one byte where a preamble was none.
bool XsensMtx::take_frame(Command& command) {
  constexpr std::size_t kHeader = 4;
  while (true) {
    const auto preamble = std::find(heard_.begin(), heard_.end(), std::uint8_t{0xFA});
    heard_.erase(heard_.begin(), preamble);
    if (heard_.size() < kHeader) return false;
    const std::size_t length = heard_[3];
    if (length > kLongestCommand) {
      heard_.erase(heard_.begin());
      continue;
    }
    const std::size_t whole = kHeader + length + 1;
    if (heard_.size() < whole) return false;
    unsigned sum = 0;
    for (std::size_t i = 1; i < whole; ++i) sum += heard_[i];
    if ((sum & 0xFFU) != 0) {
      heard_.erase(heard_.begin());
      continue;
    }
    command.mid = heard_[2];
    command.data.assign(heard_.begin() + kHeader, heard_.begin() + static_cast<std::ptrdiff_t>(whole) - 1);
    heard_.erase(heard_.begin(), heard_.begin() + static_cast<std::ptrdiff_t>(whole));
    return true;
  }
}

void XsensMtx::reply(std::uint8_t mid, const Bytes& data, double t_s) {
  replies_.push_back({t_s + kAnswerDelay_s, frame(mid, data)});
}

void XsensMtx::error(std::uint8_t code, double t_s) { reply(kError, {code}, t_s); }

void XsensMtx::handle(const Command& command, double t_s) {
  switch (command.mid) {
    case kReset:
      reply(kReset + 1, {}, t_s);
      baud_ = baud_of_code(settings_.baud_code);
      power_on(t_s + kAnswerDelay_s);
      return;
    case kGoToConfig:
      reply(kGoToConfig + 1, {}, t_s);
      if (state_ == State::kMeasurement)
        measurement_end_s_ = t_s + kAnswerDelay_s;
      else
        state_ = State::kConfig;
      return;
    case kWakeUpAck:
      if (state_ == State::kWaking) state_ = State::kConfig;
      return;
    default:
      // A command may follow the GoToConfig that is being acknowledged; while measuring all others are
      // ignored.
      if (state_ == State::kConfig || measurement_end_s_ != kNever_s) handle_in_config(command, t_s);
  }
}

template <typename T>
void XsensMtx::request_or_set(const Command& command, T& setting, bool (*is_valid)(T),
                              std::uint8_t error_code, double t_s) {
  const auto ack = static_cast<std::uint8_t>(command.mid + 1);
  if (command.data.empty()) {
    Bytes data;
    put_be(data, setting);
    return reply(ack, data, t_s);
  }
  if (command.data.size() != sizeof(T)) return error(kErrorMessage, t_s);
  const T value = get_be<T>(command.data);
  if (!is_valid(value)) return error(error_code, t_s);
  setting = value;
  reply(ack, {}, t_s);
}

void XsensMtx::set_baudrate(const Command& command, double t_s) {
  if (command.data.empty()) return reply(kBaudrate + 1, {settings_.baud_code}, t_s);
  if (command.data.size() != 1) return error(kErrorMessage, t_s);
  if (baud_of_code(command.data[0]) == 0) return error(kErrorBaudrate, t_s);
  settings_.baud_code = command.data[0];  // in force after the next Reset
  reply(kBaudrate + 1, {}, t_s);
}

void XsensMtx::handle_in_config(const Command& command, double t_s) {
  switch (command.mid) {
    case kReqDid:
    case kInitMt: {
      Bytes data;
      put_be(data, options_.device_id);
      return reply(static_cast<std::uint8_t>(command.mid + 1), data, t_s);
    }
    case kPeriod: {
      const double instant = sample_time(next_index_);
      const std::uint16_t before = settings_.period;
      request_or_set<std::uint16_t>(command, settings_.period, valid_period, kErrorPeriod, t_s);
      if (settings_.period != before) {
        grid_origin_s_ = instant;
        index_at_grid_ = next_index_;
      }
      return;
    }
    case kReqDataLength: {
      Bytes data;
      put_be(data, data_length());
      return reply(kReqDataLength + 1, data, t_s);
    }
    case kReqConfiguration:
      return reply(kConfiguration, configuration(), t_s);
    case kRestoreFactoryDef:
      settings_ = Settings{};
      return reply(kRestoreFactoryDef + 1, {}, t_s);
    case kReqFirmwareRevision:
      return reply(kReqFirmwareRevision + 1, {2, 3, 1}, t_s);
    case kReqProductCode: {
      Bytes data;
      put_text(data, "MTx-28A53G25        ");
      return reply(kReqProductCode + 1, data, t_s);
    }
    case kBaudrate:
      return set_baudrate(command, t_s);
    case kOutputMode:
      return request_or_set<std::uint16_t>(command, settings_.output_mode, valid_mode, kErrorParameter, t_s);
    case kOutputSettings:
      return request_or_set<std::uint32_t>(command, settings_.output_settings, valid_settings,
                                           kErrorParameter, t_s);
    case kOutputSkipFactor:
      return request_or_set<std::uint16_t>(command, settings_.skip_factor, any_skip, kErrorParameter, t_s);
    case kErrorMode:
      return request_or_set<std::uint16_t>(command, settings_.error_mode, valid_error_mode, kErrorParameter,
                                           t_s);
    case kGoToMeasurement:
      reply(kGoToMeasurement + 1, {}, t_s);
      return enter_measurement(t_s + kAnswerDelay_s);
    default:
      error(kErrorMessage, t_s);
  }
}

std::uint16_t XsensMtx::data_length() const {
  return static_cast<std::uint16_t>(
      mtdata_payload(MtSample{}, settings_.output_mode, settings_.output_settings).size());
}

Bytes XsensMtx::configuration() const {
  constexpr std::size_t kDeviceCountOffset = 96;
  Bytes data;
  put_be(data, options_.device_id);
  put_be(data, settings_.period);
  put_be(data, settings_.skip_factor);
  data.resize(kDeviceCountOffset, 0);  // sync settings off, no date, reserved fields empty
  put_be(data, std::uint16_t{1});
  put_be(data, options_.device_id);
  put_be(data, data_length());
  put_be(data, settings_.output_mode);
  put_be(data, settings_.output_settings);
  put_be(data, std::uint16_t{3});            // scenario
  put_bytes(data, Bytes{2, 3, 1, 0, 0, 0});  // firmware, filter
  return data;
}

void XsensMtx::emit_samples_until(double t_s, std::vector<Emission>& out) {
  while (state_ == State::kMeasurement) {
    const double sampled_s = sample_time(next_index_);
    const double ready_s = sampled_s + options_.latency_s;
    if (ready_s > t_s || ready_s >= measurement_end_s_) return;
    const std::int64_t index = next_index_++;
    const bool every_sample = settings_.skip_factor == 0;
    if (!every_sample && index % (std::int64_t{settings_.skip_factor} + 1) != 0) continue;
    MtSample sample = sampler_(sampled_s, index + options_.first_counter);
    sample.counter = static_cast<std::uint16_t>((index + options_.first_counter) & 0xFFFF);
    out.push_back(
        {ready_s, frame(kMtData, mtdata_payload(sample, settings_.output_mode, settings_.output_settings))});
  }
}

void XsensMtx::run_until(double t_s, std::vector<Emission>& out) {
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
