#include "firmware_sim/devices/xsens_mtx.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

namespace imusim {
namespace {

using namespace xsens;

// A device has room for one message beside the one that it is sending.
constexpr double kMessagesInHand = 1.0;
constexpr double kBitsPerByte = 10.0;

constexpr std::uint8_t kErrorTimerOverflow = 0x1E;
// Error modes: from the first on, an Error message is sent; from the second on, measuring ends too.
constexpr std::uint16_t kErrorModeMessage = 2;
constexpr std::uint16_t kErrorModeConfig = 3;
// OutputSkipFactor of a device that sends on ReqData only.
constexpr std::uint16_t kSkipAll = 0xFFFF;

bool valid_period(std::uint16_t period) { return period >= kPeriodFastest && period <= kPeriodSlowest; }
bool valid_mode(std::uint16_t mode) { return mode != 0 && (mode & ~kKnownModes) == 0; }
bool valid_settings(std::uint32_t settings) { return (settings & ~kKnownSettings) == 0; }
bool valid_error_mode(std::uint16_t mode) { return mode <= 3; }
bool any_value(std::uint16_t /*value*/) { return true; }

}  // namespace

XsensMtx::XsensMtx(const Options& options, Sampler sampler, double power_on_s)
    : XsensUnit({options.first_sample_s, options.period / kPeriodTicksPerSecond, options.clock_skew_ppm},
                kAnswerDelay_s, power_on_s),
      options_(options),
      sampler_(std::move(sampler)),
      baud_(options.baud),
      counter_offset_(options.first_counter) {
  settings_.period = options.period;
  settings_.baud_code = code_of_baud(options.baud);
}

void XsensMtx::jump_clock(double by_s) { counter_offset_ += std::llround(by_s / grid_.period()); }

void XsensMtx::start_calibrated(double t_s) {
  settings_.output_mode = kModeCalibrated;
  if (options_.sends_temperature) settings_.output_mode |= kModeTemperature;
  settings_.output_settings = kSettingsCounter | kSettingsNoMag;
  start_measuring(t_s, {frame(kConfiguration, configuration()), frame(kGoToMeasurement + 1, {})});
}

void XsensMtx::acknowledge(const Command& command, double t_s) {
  reply(static_cast<std::uint8_t>(command.mid + 1), {}, t_s);
}

bool XsensMtx::handle_measuring(const Command& command, double t_s) {
  if (command.mid != kReqData) return false;
  if (settings_.skip_factor == kSkipAll) {
    next_index_ = std::max(next_index_, grid_.first_from(t_s));
    send({grid_.instant(next_index_) + options_.latency_s, data_frame(next_index_)});
    ++next_index_;
  }
  return true;
}

void XsensMtx::reply(std::uint8_t mid, const Bytes& data, double t_s) { answer(frame(mid, data), t_s); }

void XsensMtx::error(std::uint8_t code, double t_s) { reply(kError, {code}, t_s); }

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

void XsensMtx::set_period(const Command& command, double t_s) {
  const std::uint16_t before = settings_.period;
  request_or_set<std::uint16_t>(command, settings_.period, valid_period, kErrorPeriod, t_s);
  if (settings_.period != before) grid_.set_period(settings_.period / kPeriodTicksPerSecond, next_index_);
}

/// SyncIn and SyncOut: a parameter's number, and its value where it is to be set. Modes and skips are short.
void XsensMtx::set_sync(const Command& command, std::array<std::uint32_t, 4>& sync, std::size_t parameters,
                        double t_s) {
  if (command.data.empty()) return error(kErrorMessage, t_s);
  const std::size_t parameter = command.data[0];
  if (parameter >= parameters) return error(kErrorParameter, t_s);
  const std::span<const std::uint8_t> value = std::span(command.data).subspan(1);
  const bool is_short = parameter < 2;
  const auto ack = static_cast<std::uint8_t>(command.mid + 1);
  if (value.empty()) {
    Bytes data{command.data[0]};
    if (is_short)
      put_be(data, static_cast<std::uint16_t>(sync[parameter]));
    else
      put_be(data, sync[parameter]);
    return reply(ack, data, t_s);
  }
  if (value.size() != (is_short ? 2U : 4U)) return error(kErrorMessage, t_s);
  sync[parameter] = is_short ? get_be<std::uint16_t>(value) : get_be<std::uint32_t>(value);
  reply(ack, {}, t_s);
}

void XsensMtx::handle_in_config(const Command& command, double t_s) {
  switch (command.mid) {
    case kReqDid:
    case kInitMt: {
      Bytes data;
      put_be(data, options_.device_id);
      return reply(static_cast<std::uint8_t>(command.mid + 1), data, t_s);
    }
    case kPeriod:
      return set_period(command, t_s);
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
    case kReqHardwareVersion:
      return reply(kReqHardwareVersion + 1, {0x01, 0x03}, t_s);
    case kRunSelftest: {
      constexpr std::uint16_t kAllPass = 0x01FF;
      Bytes data;
      put_be(data, kAllPass);
      return reply(kRunSelftest + 1, data, t_s);
    }
    case kSyncInSettings:
      return set_sync(command, settings_.sync_in, 3, t_s);
    case kSyncOutSettings:
      return set_sync(command, settings_.sync_out, 4, t_s);
    case kTransmitDelay:
      return request_or_set<std::uint16_t>(command, settings_.transmit_delay, any_value, kErrorParameter,
                                           t_s);
    case kBaudrate:
      return set_baudrate(command, t_s);
    case kOutputMode:
      return request_or_set<std::uint16_t>(command, settings_.output_mode, valid_mode, kErrorParameter, t_s);
    case kOutputSettings:
      return request_or_set<std::uint32_t>(command, settings_.output_settings, valid_settings,
                                           kErrorParameter, t_s);
    case kOutputSkipFactor:
      return request_or_set<std::uint16_t>(command, settings_.skip_factor, any_value, kErrorParameter, t_s);
    case kErrorMode:
      return request_or_set<std::uint16_t>(command, settings_.error_mode, valid_error_mode, kErrorParameter,
                                           t_s);
    case kReqData:
      return;  // has a meaning while it measures
    case kGoToMeasurement:
      reply(kGoToMeasurement + 1, {}, t_s);
      return enter_measurement_when_answered(t_s);
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
  put_be(data, static_cast<std::uint16_t>(settings_.sync_in[0]));
  put_be(data, static_cast<std::uint16_t>(settings_.sync_in[1]));
  put_be(data, settings_.sync_in[2]);
  data.resize(kDeviceCountOffset, 0);  // no date, reserved fields empty
  put_be(data, std::uint16_t{1});
  put_be(data, options_.device_id);
  put_be(data, data_length());
  put_be(data, settings_.output_mode);
  put_be(data, settings_.output_settings);
  put_be(data, std::uint16_t{3});            // scenario
  put_bytes(data, Bytes{2, 3, 1, 0, 0, 0});  // firmware, filter
  return data;
}

Bytes XsensMtx::data_frame(std::int64_t index) {
  MtSample sample = sampler_(grid_.instant(index), index + options_.first_counter);
  sample.counter = static_cast<std::uint16_t>((index + counter_offset_) & 0xFFFF);
  return frame(kMtData, mtdata_payload(sample, settings_.output_mode, settings_.output_settings));
}

/// Whether a message that is ready now still fits into what the line has to send.
bool XsensMtx::line_is_free(double ready_s, std::size_t bytes) {
  if (line_busy_until_s_ > ready_s + kMessagesInHand * grid_.period()) return false;
  line_busy_until_s_ =
      std::max(line_busy_until_s_, ready_s) + kBitsPerByte * static_cast<double>(bytes) / baud_;
  return true;
}

void XsensMtx::emit_samples_until(double t_s, std::vector<Emission>& out) {
  while (settings_.skip_factor != kSkipAll) {
    const double ready_s = grid_.instant(next_index_) + options_.latency_s;
    if (ready_s > t_s || !measures_at(ready_s)) return;
    const std::int64_t index = next_index_++;
    if (index % (std::int64_t{settings_.skip_factor} + 1) != 0) continue;
    Bytes message = data_frame(index);
    if (line_is_free(ready_s, message.size())) {
      out.push_back({ready_s, std::move(message)});
      continue;
    }
    // More than the line takes: the sample is gone, and the error mode says who hears of it.
    if (settings_.error_mode >= kErrorModeMessage)
      out.push_back({ready_s, frame(kError, Bytes{kErrorTimerOverflow})});
    if (settings_.error_mode >= kErrorModeConfig) leave_measurement();
  }
}

}  // namespace imusim
