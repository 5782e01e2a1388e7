#include "firmware_sim/devices/xsens_mti.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

namespace imusim {
namespace {

using namespace xsens;

constexpr std::uint16_t kBaseRate_hz = 400;
constexpr std::uint16_t kGnssRate_hz = 4;
constexpr std::uint16_t kEveryMessage = 0xFFFF;
constexpr std::size_t kOutputsMax = 32;
constexpr std::size_t kEntrySize = 4;
constexpr std::uint32_t kTicksPerDay = 864'000'000;
constexpr double kTicksPerSecond = 10'000.0;

// Items; the low nibble is the number format and the frame.
constexpr std::uint16_t kFormatMask = 0x000F;
constexpr std::uint16_t kPrecisionMask = 0x0003;
constexpr std::uint16_t kTemperature = 0x0810;
constexpr std::uint16_t kPacketCounter = 0x1020;
constexpr std::uint16_t kSampleTimeFine = 0x1060;
constexpr std::uint16_t kQuaternion = 0x2010;
constexpr std::uint16_t kAcceleration = 0x4020;
constexpr std::uint16_t kGnssPvt = 0x7010;
constexpr std::uint16_t kRateOfTurn = 0x8020;
constexpr std::uint16_t kMagneticField = 0xC020;
constexpr std::uint16_t kStatusByte = 0xE010;
constexpr std::uint16_t kStatusWord = 0xE020;
constexpr std::size_t kGnssPvtSize = 94;

struct KnownItem {
  std::uint16_t kind;
  std::uint16_t fastest_hz;  ///< kEveryMessage: has no rate of its own
};
constexpr std::array<KnownItem, 10> kKnownItems{{{kTemperature, 400},
                                                 {kPacketCounter, kEveryMessage},
                                                 {kSampleTimeFine, kEveryMessage},
                                                 {kQuaternion, 400},
                                                 {kAcceleration, 400},
                                                 {kGnssPvt, kGnssRate_hz},
                                                 {kRateOfTurn, 400},
                                                 {kMagneticField, 100},
                                                 {kStatusByte, kEveryMessage},
                                                 {kStatusWord, kEveryMessage}}};

std::uint16_t kind_of(std::uint16_t item) { return static_cast<std::uint16_t>(item & ~kFormatMask); }

const KnownItem* find_item(std::uint16_t item) {
  const auto* const found = std::find_if(kKnownItems.begin(), kKnownItems.end(),
                                         [&](const KnownItem& known) { return known.kind == kind_of(item); });
  return found == kKnownItems.end() ? nullptr : found;
}

}  // namespace

XsensMti::XsensMti(const Options& options, Sampler sampler, double power_on_s)
    : XsensUnit({options.first_sample_s, 1.0 / kBaseRate_hz, options.clock_skew_ppm}, kAnswerDelay_s,
                power_on_s),
      options_(options),
      sampler_(std::move(sampler)),
      outputs_{{kPacketCounter, kEveryMessage}, {kSampleTimeFine, kEveryMessage}, {kQuaternion, 100}},
      baud_code_(code_of_baud(options.baud)),
      baud_(options.baud),
      time_origin_s_(options.first_sample_s - options.first_sample_time / kTicksPerSecond),
      packet_(options.first_packet) {}

void XsensMti::acknowledge(const Command& command, double t_s) {
  reply(static_cast<std::uint8_t>(command.mid + 1), {}, t_s);
}

void XsensMti::count_anew() {
  time_origin_s_ = grid_.device_time(next_index_);
  packet_ = 0;
}

void XsensMti::start_inertial(double t_s, std::uint16_t rate_hz) {
  outputs_ = {{kPacketCounter, kEveryMessage},
              {kSampleTimeFine, kEveryMessage},
              {kAcceleration, rate_hz},
              {kRateOfTurn, rate_hz},
              {kStatusWord, kEveryMessage}};
  if (options_.has_gnss) outputs_.push_back({kGnssPvt, kGnssRate_hz});
  start_measuring(t_s, {});
}

void XsensMti::reply(std::uint8_t mid, const Bytes& data, double t_s) { answer(frame(mid, data), t_s); }

void XsensMti::handle_in_config(const Command& command, double t_s) {
  const auto ack = static_cast<std::uint8_t>(command.mid + 1);
  switch (command.mid) {
    case kReqDid:
    case kInitMt: {
      Bytes data;
      put_be(data, options_.device_id);
      return reply(ack, data, t_s);
    }
    case kReqConfiguration:
      return reply(ack, configuration(), t_s);
    case kReqFirmwareRevision:
      return reply(ack, {1, 8, 2, 0, 0, 0, 38, 0, 0, 0x1A, 0x85}, t_s);
    case kReqProductCode: {
      Bytes data;
      put_text(data, "MTi-G-710-2A8G4     ");
      return reply(ack, data, t_s);
    }
    case kReqHardwareVersion:
      return reply(ack, {0x02, 0x00}, t_s);
    case kOutputConfiguration:
      return set_outputs(command, t_s);
    case kBaudrate:
      if (command.data.empty()) return reply(ack, {baud_code_}, t_s);
      if (command.data.size() != 1 || baud_of_code(command.data[0]) == 0)
        return reply(kError, {kErrorBaudrate}, t_s);
      baud_code_ = command.data[0];  // in force after the next Reset
      return reply(ack, {}, t_s);
    case kGoToMeasurement:
      reply(ack, {}, t_s);
      return enter_measurement_when_answered(t_s);
    default:
      reply(kError, {kErrorMessage}, t_s);
  }
}

/// Takes what it knows, at rates that it has, and says what that is.
void XsensMti::set_outputs(const Command& command, double t_s) {
  const std::size_t size = command.data.size();
  if (size % kEntrySize != 0 || size > kOutputsMax * kEntrySize) return reply(kError, {kErrorParameter}, t_s);
  if (size != 0) {
    outputs_.clear();
    for (std::size_t at = 0; at < size; at += kEntrySize) {
      const auto item = get_be<std::uint16_t>(std::span(command.data).subspan(at));
      const auto wanted = get_be<std::uint16_t>(std::span(command.data).subspan(at + 2));
      const KnownItem* known = find_item(item);
      if (known == nullptr || (known->kind == kGnssPvt && !options_.has_gnss)) continue;
      const bool fastest = wanted == 0 || wanted == kEveryMessage || wanted > known->fastest_hz;
      outputs_.push_back({item, known->fastest_hz == kEveryMessage || fastest ? known->fastest_hz : wanted});
    }
  }
  reply(kOutputConfiguration + 1, outputs_data(), t_s);
}

Bytes XsensMti::outputs_data() const {
  Bytes data;
  for (const Output& output : outputs_) {
    put_be(data, output.item);
    put_be(data, output.rate_hz);
  }
  return data;
}

Bytes XsensMti::configuration() const {
  constexpr std::size_t kDeviceCountOffset = 96;
  constexpr std::uint16_t kPeriod = 1152;  // as real units say, whatever their outputs are
  Bytes data;
  put_be(data, options_.device_id);
  put_be(data, kPeriod);
  data.resize(kDeviceCountOffset, 0);
  put_be(data, std::uint16_t{1});
  put_be(data, options_.device_id);
  put_be(data, std::uint16_t{0});  // no legacy data: neither length nor mode
  put_be(data, std::uint16_t{0});
  put_be(data, std::uint32_t{1});
  put_be(data, std::uint16_t{0x27});
  put_bytes(data, Bytes{1, 8, 2, 0, 0, 0});
  return data;
}

bool XsensMti::is_due(const Output& output, std::int64_t index) const {
  return output.rate_hz != kEveryMessage && index * output.rate_hz % kBaseRate_hz < output.rate_hz;
}

std::uint32_t XsensMti::sample_time_fine(std::int64_t index) const {
  const auto ticks = std::llround((grid_.device_time(index) - time_origin_s_) * kTicksPerSecond);
  const std::int64_t day = kTicksPerDay;
  return static_cast<std::uint32_t>((ticks % day + day) % day);
}

void XsensMti::put_item(Bytes& payload, const Output& output, const MtSample& sample,
                        std::int64_t index) const {
  Bytes data;
  const auto numbers = [&](const auto& values) {
    for (const double value : values) put_number(data, value, (output.item & kPrecisionMask) << 8U);
  };
  switch (kind_of(output.item)) {
    case kTemperature:
      numbers(std::array{sample.temperature_degC});
      break;
    case kPacketCounter:
      put_be(data, packet_);
      break;
    case kSampleTimeFine:
      put_be(data, sample_time_fine(index));
      break;
    case kQuaternion: {
      const auto& q = sample.sensor_to_world;
      numbers(std::array{q.w(), q.x(), q.y(), q.z()});
      break;
    }
    case kAcceleration:
      numbers(sample.acc_mps2);
      break;
    case kRateOfTurn:
      numbers(sample.gyr_radps);
      break;
    case kMagneticField:
      numbers(sample.mag);
      break;
    case kStatusByte:
      data.push_back(sample.status);
      break;
    case kStatusWord:
      put_be(data, std::uint32_t{sample.status});
      break;
    default:
      data.resize(kGnssPvtSize, 0);  // no fix
  }
  put_be(payload, output.item);
  payload.push_back(static_cast<std::uint8_t>(data.size()));
  put_bytes(payload, data);
}

void XsensMti::emit_samples_until(double t_s, std::vector<Emission>& out) {
  for (;;) {
    const double ready_s = grid_.instant(next_index_) + options_.latency_s;
    if (ready_s > t_s || !measures_at(ready_s)) return;
    const std::int64_t index = next_index_++;
    const auto send = [&](bool gnss) {
      const auto wanted = [&](const Output& output) {
        return is_due(output, index) && (kind_of(output.item) == kGnssPvt) == gnss;
      };
      if (std::none_of(outputs_.begin(), outputs_.end(), wanted)) return;
      const MtSample sample = gnss ? MtSample{} : sampler_(grid_.instant(index), index);
      Bytes payload;
      for (const Output& output : outputs_)
        if (wanted(output) || output.rate_hz == kEveryMessage) put_item(payload, output, sample, index);
      ++packet_;
      out.push_back({ready_s, frame(kMtData2, payload)});
    };
    send(false);
    send(true);
  }
}

}  // namespace imusim
