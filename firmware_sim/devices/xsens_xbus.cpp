#include "firmware_sim/devices/xsens_xbus.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace imusim {
namespace {

using namespace xsens;

constexpr double kBusAnswerDelay_s = 0.005;  // a question to the bus takes its time
constexpr std::uint8_t kHeadBid = 0xFF;
constexpr std::uint8_t kBusPower = 0x08;
constexpr std::uint8_t kErrorNoBus = 0x01;

}  // namespace

std::uint16_t XsensXbus::BusDevice::data_length() const {
  return static_cast<std::uint16_t>(mtdata_payload(MtSample{}, output_mode, output_settings).size());
}

XsensXbus::XsensXbus(const Options& options, Sampler sampler, double power_on_s)
    : XsensUnit({options.first_sample_s, options.period / kPeriodTicksPerSecond, options.clock_skew_ppm},
                kBusAnswerDelay_s, power_on_s),
      options_(options),
      sampler_(std::move(sampler)),
      period_(options.period),
      counter_offset_(options.first_counter) {
  for (const std::uint32_t id : options.bus_devices) {
    BusDevice device;
    device.id = id;
    bus_.push_back(device);
  }
}

void XsensXbus::jump_clock(double by_s) { counter_offset_ += std::llround(by_s / grid_.period()); }

bool XsensXbus::leave_out(const std::vector<std::string>& blocks) {
  for (const std::string& block : blocks) {
    const bool is_bid = !block.empty() && block.size() <= 2 &&
                        std::all_of(block.begin(), block.end(), [](char c) { return c >= '0' && c <= '9'; });
    if (!is_bid || std::stoul(block) < 1 || std::stoul(block) > bus_.size()) return false;
  }
  for (std::size_t i = 0; i < bus_.size(); ++i)
    bus_[i].is_off = std::find(blocks.begin(), blocks.end(), std::to_string(i + 1)) != blocks.end();
  return true;
}

void XsensXbus::start_calibrated(double t_s) {
  for (BusDevice& device : bus_) {
    device.output_mode = kModeCalibrated;
    device.output_settings = kSettingsCounter | kSettingsNoMag;
  }
  start_measuring(t_s, {frame(kConfiguration, configuration())});
}

void XsensXbus::reply(const Command& command, const Bytes& data, double t_s) {
  answer(frame(static_cast<std::uint8_t>(command.mid + 1), data, command.bid), t_s);
}

void XsensXbus::error(const Command& command, std::uint8_t code, double t_s) {
  answer(frame(kError, Bytes{code}, command.bid), t_s);
}

void XsensXbus::handle_in_config(const Command& command, double t_s) {
  if (command.bid == kHeadBid) return handle_for_head(command, t_s);
  const bool on_bus = command.bid >= 1 && command.bid <= bus_.size();
  if (!on_bus || bus_[command.bid - 1U].is_off) return error(command, kErrorNoBus, t_s);
  handle_for_device(command, bus_[command.bid - 1U], t_s);
}

void XsensXbus::handle_for_head(const Command& command, double t_s) {
  Bytes data;
  switch (command.mid) {
    case kReqDid:
      put_be(data, options_.device_id);
      return reply(command, data, t_s);
    case kInitMt:
      for (const BusDevice& device : bus_) put_be(data, device.id);
      return reply(command, data, t_s);
    case kBusPower:
      return reply(command, {}, t_s);
    case kPeriod:
      if (command.data.empty()) {
        put_be(data, period_);
        return reply(command, data, t_s);
      }
      if (command.data.size() != 2) return error(command, kErrorMessage, t_s);
      if (const auto period = get_be<std::uint16_t>(command.data);
          period < kPeriodFastest || period > kPeriodSlowest) {
        return error(command, kErrorPeriod, t_s);
      } else {
        period_ = period;
        grid_.set_period(period_ / kPeriodTicksPerSecond, next_index_);
      }
      return reply(command, {}, t_s);
    case kOutputSkipFactor:
      if (command.data.size() == 2) skip_factor_ = get_be<std::uint16_t>(command.data);
      if (command.data.empty()) put_be(data, skip_factor_);
      return reply(command, data, t_s);
    case kReqDataLength: {
      std::size_t length = 2;
      for (const BusDevice& device : bus_) length += device.data_length();
      put_be(data, static_cast<std::uint16_t>(length));
      return reply(command, data, t_s);
    }
    case kReqConfiguration:
      return reply(command, configuration(), t_s);
    case kReqFirmwareRevision:
      return reply(command, {1, 4, 0}, t_s);
    case kGoToMeasurement:
      reply(command, {}, t_s);
      return enter_measurement_when_answered(t_s);
    default:
      error(command, kErrorMessage, t_s);
  }
}

void XsensXbus::handle_for_device(const Command& command, BusDevice& device, double t_s) {
  Bytes data;
  switch (command.mid) {
    case kReqDid:
      put_be(data, device.id);
      return reply(command, data, t_s);
    case kOutputMode:
      if (command.data.empty()) {
        put_be(data, device.output_mode);
        return reply(command, data, t_s);
      }
      if (command.data.size() != 2) return error(command, kErrorMessage, t_s);
      if (const auto mode = get_be<std::uint16_t>(command.data); mode == 0 || (mode & ~kKnownModes) != 0)
        return error(command, kErrorParameter, t_s);
      else
        device.output_mode = mode;
      return reply(command, {}, t_s);
    case kOutputSettings:
      if (command.data.empty()) {
        put_be(data, device.output_settings);
        return reply(command, data, t_s);
      }
      if (command.data.size() != 4) return error(command, kErrorMessage, t_s);
      if (const auto settings = get_be<std::uint32_t>(command.data); (settings & ~kKnownSettings) != 0)
        return error(command, kErrorParameter, t_s);
      else
        device.output_settings = settings;
      return reply(command, {}, t_s);
    case kReqDataLength:
      put_be(data, device.data_length());
      return reply(command, data, t_s);
    default:
      error(command, kErrorMessage, t_s);
  }
}

Bytes XsensXbus::configuration() const {
  constexpr std::size_t kDeviceCountOffset = 96;
  Bytes data;
  put_be(data, options_.device_id);
  put_be(data, period_);
  put_be(data, skip_factor_);
  data.resize(kDeviceCountOffset, 0);
  put_be(data, static_cast<std::uint16_t>(bus_.size()));
  for (const BusDevice& device : bus_) {
    put_be(data, device.id);
    put_be(data, device.data_length());
    put_be(data, device.output_mode);
    put_be(data, device.output_settings);
    put_be(data, std::uint16_t{3});            // scenario
    put_bytes(data, Bytes{2, 3, 1, 0, 0, 0});  // firmware, filter
  }
  return data;
}

void XsensXbus::emit_samples_until(double t_s, std::vector<Emission>& out) {
  for (;;) {
    const double ready_s = grid_.instant(next_index_) + options_.latency_s;
    if (ready_s > t_s || !measures_at(ready_s)) return;
    const std::int64_t index = next_index_++;
    if (index % (std::int64_t{skip_factor_} + 1) != 0) continue;
    const auto counter = static_cast<std::uint16_t>((index + counter_offset_) & 0xFFFF);
    Bytes payload;
    put_be(payload, counter);
    for (std::size_t i = 0; i < bus_.size(); ++i) {
      BusDevice& device = bus_[i];
      if (!device.is_off || device.last_block.size() != device.data_length()) {
        MtSample sample = sampler_(i, grid_.instant(index), index + options_.first_counter);
        sample.counter = counter;
        device.last_block = mtdata_payload(sample, device.output_mode, device.output_settings);
      }
      put_bytes(payload, device.last_block);
    }
    out.push_back({ready_s, frame(kMtData, payload)});
  }
}

}  // namespace imusim
