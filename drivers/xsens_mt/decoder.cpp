#include "drivers/xsens_mt/decoder.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "base/contracts.h"
#include "drivers/device/bytes.h"

namespace imuscope::xsens {
namespace {

// A block that is the same bit for bit this often comes from a device that fell off the bus: a sensor has
// noise.
constexpr int kRepeatsOfALostDevice = 3;

constexpr std::int64_t kNsPerTick = 100000;  // SampleTimeFine, 100 us

std::int64_t to_whole(double value) { return static_cast<std::int64_t>(std::llround(value)); }

// FNV-1a, 64 bits.
std::uint64_t fingerprint_of(std::span<const std::uint8_t> data) {
  std::uint64_t hash = 14695981039346656037ULL;
  for (const std::uint8_t byte : data) hash = (hash ^ byte) * 1099511628211ULL;
  return hash;
}

/// Rotation vector of a small rotation.
std::array<double, 3> rotation_vector(const std::array<double, 4>& q) {
  const double sign = q[0] < 0.0 ? -1.0 : 1.0;
  const double sine = std::sqrt(q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  // angle / sine(angle/2), with its limit at zero
  const double scale = sign * (sine > 0.0 ? 2.0 * std::atan2(sine, sign * q[0]) / sine : 2.0);
  return {scale * q[1], scale * q[2], scale * q[3]};
}

std::uint32_t clip_flags(std::uint32_t status_word) {
  constexpr std::array<ImuFlag, 3> kAccel{kAccelClipX, kAccelClipY, kAccelClipZ};
  constexpr std::array<ImuFlag, 3> kGyro{kGyroClipX, kGyroClipY, kGyroClipZ};
  std::uint32_t flags = 0;
  for (unsigned axis = 0; axis < 3; ++axis) {
    if ((status_word >> (kStatusAccelClipBit + axis) & 1U) != 0) flags |= kAccel[axis];
    if ((status_word >> (kStatusGyroClipBit + axis) & 1U) != 0) flags |= kGyro[axis];
  }
  return flags;
}

UnwrapConfig counter_config(double counts_per_s, const ClockMapConfig& clock) {
  return {kCounterModulus, 0, counts_per_s, clock.mode == ClockMapConfig::Mode::kOnline};
}

}  // namespace

MtDecoder::MtDecoder(const MtDecoderConfig& config)
    : axes_(config.axes),
      per_byte_(byte_time(config.baud)),
      scanner_(per_byte_),
      clock_(config.clock),
      count_period_s_(1.0 / config.rate_hz),
      counter_(counter_config(config.rate_hz, config.clock)),
      rate_hz_(config.rate_hz),
      packet_counter_(counter_config(config.rate_hz, config.clock)),
      sample_time_({kSampleTimeFineModulus, kSampleTimeFineDay, kSampleTimeFinePerSecond,
                    config.clock.mode == ClockMapConfig::Mode::kOnline}) {
  IMUSCOPE_EXPECTS(config.rate_hz > 0.0);
  IMUSCOPE_EXPECTS(data_length(config.layout).has_value());
  IMUSCOPE_EXPECTS(config.bus_devices.size() <= kBusDevicesMax);
  for (std::size_t k = 0; k < kBusDevicesMax; ++k) {
    Block& block = blocks_[k];
    block.layout = config.layout;
    block.length = *data_length(config.layout);
    block.wanted = config.bus_devices.empty() ? k == 0 : k < config.bus_devices.size();
    block.device = k < config.bus_devices.size() ? config.bus_devices[k] : config.device;
  }
  if (config.bus_devices.size() > 1) {
    n_blocks_ = config.bus_devices.size();
    xbus_ = true;
  }
}

void MtDecoder::push(std::span<const std::uint8_t> bytes, HostTime arrival, SampleSink& sink) noexcept {
  counters_.bytes += bytes.size();
  while (!bytes.empty()) {
    bytes = bytes.subspan(scanner_.append(bytes, arrival));
    drain(arrival, sink, false);
  }
}

void MtDecoder::finish(HostTime arrival, SampleSink& sink) noexcept { drain(arrival, sink, true); }

void MtDecoder::drain(HostTime arrival, SampleSink& sink, bool at_end) noexcept {
  Frame frame;
  while (scanner_.next(frame, at_end)) {
    ++counters_.frames;
    on_frame(frame, arrival, sink);
  }
  counters_.bytes_skipped = scanner_.counters().bytes_skipped;
  counters_.bad_checksums = scanner_.counters().bad_checksums;
  counters_.bad_lengths = scanner_.counters().bad_lengths;
}

void MtDecoder::on_frame(const Frame& frame, HostTime arrival, SampleSink& sink) noexcept {
  switch (frame.mid) {
    case mid::kMtData:
      on_mtdata(frame, arrival, sink);
      break;
    case mid::kMtData2:
      on_mtdata2(frame, arrival, sink);
      break;
    case mid::kConfiguration:
      if (const auto configuration = read_configuration(frame.data)) {
        learn(*configuration);
      } else {
        ++counters_.bad_contents;
      }
      break;
    case mid::kError:
      if (!frame.data.empty()) last_error_ = frame.data[0];
      break;
    default:
      break;
  }
}

void MtDecoder::learn(const Configuration& configuration) noexcept {
  if (configuration.n_devices == 0 || configuration.period == 0) return;
  rate_hz_ = configuration.rate_hz();
  packet_counter_.set_rate(rate_hz_);
  if (configuration.devices[0].data_length == 0) return;  // sends MTData2
  for (std::size_t k = 0; k < configuration.n_devices; ++k) {
    const DeviceRecord& record = configuration.devices[k];
    blocks_[k].layout = {record.output_mode, record.output_settings};
    blocks_[k].length = record.data_length;
  }
  n_blocks_ = configuration.n_devices;
  xbus_ = configuration.is_xbus_master();
  counts_per_message_ = configuration.skip_factor + 1;
  // Device time goes on from where it is, at the new period.
  base_time_ns_ += to_whole(static_cast<double>(counter_.count() - base_count_) * count_period_s_ * 1e9);
  base_count_ = counter_.count();
  count_period_s_ = configuration.period / kPeriodTicksPerSecond;
  counter_.set_rate(1.0 / count_period_s_);
}

// ---------------------------------------------------------------------------------------------- legacy
// MTData

void MtDecoder::on_mtdata(const Frame& frame, HostTime arrival, SampleSink& sink) noexcept {
  std::size_t expected = xbus_ ? sizeof(std::uint16_t) : 0;
  for (std::size_t k = 0; k < n_blocks_; ++k) expected += blocks_[k].length;
  if (frame.data.size() != expected) {
    ++counters_.bad_contents;
    return;
  }
  const auto at = instant_of_counter(counter_of(frame), frame, arrival);
  if (!at) return;
  auto rest = frame.data.subspan(xbus_ ? sizeof(std::uint16_t) : 0);
  for (std::size_t k = 0; k < n_blocks_; ++k) {
    Block& block = blocks_[k];
    if (block.wanted) emit_block(block, rest.first(block.length), *at, sink);
    rest = rest.subspan(block.length);
  }
}

// The Xbus head's counter, or the device's own; nothing where the layout has none.
std::optional<std::uint16_t> MtDecoder::counter_of(const Frame& frame) noexcept {
  if (xbus_) return read_be<std::uint16_t>(frame.data, 0);
  const DataLayout& layout = blocks_[0].layout;
  if ((layout.settings & output_settings::kSampleCounter) == 0) return std::nullopt;
  const std::size_t behind = (layout.settings & output_settings::kUtcTime) != 0 ? kUtcSize : 0;
  return read_be<std::uint16_t>(frame.data, frame.data.size() - behind - sizeof(std::uint16_t));
}

std::optional<MtDecoder::Instant> MtDecoder::instant_of_counter(std::optional<std::uint16_t> counter,
                                                                const Frame& frame,
                                                                HostTime arrival) noexcept {
  const CountStep step = counter_.take(counter ? *counter : uncounted_++, frame.first_byte);
  if (step == CountStep::kRejected || step == CountStep::kRepeated) {
    ++counters_.bad_contents;
    return std::nullopt;
  }
  if (step == CountStep::kRestarted) restart_clock();
  if (step == CountStep::kForward) {
    const std::int64_t lost = std::max<std::int64_t>(counter_.step() / counts_per_message_ - 1, 0);
    counters_.samples_lost += static_cast<std::uint64_t>(lost);
    if (lost > 0) gap_pending_ = true;
  }
  const std::int64_t device_time_ns =
      base_time_ns_ + to_whole(static_cast<double>(counter_.count() - base_count_) * count_period_s_ * 1e9);
  const HostTime time = map(device_time_ns, frame);
  return Instant{time, arrival_of(frame, time, arrival), counter_.count(),
                 std::exchange(gap_pending_, false)};
}

void MtDecoder::emit_block(Block& block, std::span<const std::uint8_t> data, const Instant& at,
                           SampleSink& sink) noexcept {
  MtData message;
  if (!read_mtdata(data, block.layout, message) || (xbus_ && is_repeated(block, data))) {
    ++counters_.bad_contents;
    return;
  }
  const bool has_rate = message.has(Field::kRate);
  const bool has_force = message.has(Field::kAcceleration);
  if (!has_rate && !has_force) return;
  Sample sample{};
  sample.imu.flags = (has_rate ? kGyroValid : 0U) | (has_force ? kAccelValid : 0U);
  sample.imu.omega_radps = rotated(message.rate_radps);
  sample.imu.f_mps2 = rotated(message.acceleration_mps2);
  if (message.has(Field::kUtc)) {
    if (const auto ns = utc_ns(message.utc)) {
      sample.has_utc = true;
      sample.utc = utc_time_from_ns(*ns);
    }
  }
  put(sample, block, at, sink);
}

bool MtDecoder::is_repeated(Block& block, std::span<const std::uint8_t> data) noexcept {
  const std::uint64_t fingerprint = fingerprint_of(data);
  block.repeats = fingerprint == block.fingerprint ? block.repeats + 1 : 0;
  block.fingerprint = fingerprint;
  return block.repeats >= kRepeatsOfALostDevice;
}

// ---------------------------------------------------------------------------------------------- MTData2

void MtDecoder::on_mtdata2(const Frame& frame, HostTime arrival, SampleSink& sink) noexcept {
  Inertial message;
  if (!read_items(frame.data, message) || !count_message(message, frame.first_byte)) {
    ++counters_.bad_contents;
    return;
  }
  Sample sample{};
  const bool increments = message.delta_v.has_value() || message.delta_q.has_value();
  if (!message.rate && !message.acceleration && !increments) return;
  if (!advance_sample_time(message, frame.first_byte)) {
    ++counters_.bad_contents;
    return;
  }
  const bool has_ticks = message.sample_time_fine.has_value();
  const double dt_s = has_ticks && last_step_ticks_ > 0
                          ? static_cast<double>(last_step_ticks_) / kSampleTimeFinePerSecond
                          : 1.0 / rate_hz_;
  fill_imu(message, dt_s, sample.imu);
  const std::int64_t device_time_ns = has_ticks
                                          ? sample_time_.count() * kNsPerTick
                                          : to_whole(static_cast<double>(sample_count_) / rate_hz_ * 1e9);
  const HostTime time = map(device_time_ns, frame);
  const Instant at{time, arrival_of(frame, time, arrival), sample_count_, std::exchange(gap_pending_, false)};
  if (message.utc_ns) {
    sample.has_utc = true;
    sample.utc = utc_time_from_ns(*message.utc_ns);
  }
  put(sample, blocks_[0], at, sink);
}

bool MtDecoder::read_items(std::span<const std::uint8_t> data, Inertial& out) noexcept {
  if (!items_are_whole(data)) return false;
  ItemReader reader(data);
  Item item;
  while (reader.next(item)) {
    switch (item.kind()) {
      case xdi::kAcceleration:
        out.acceleration = read_numbers<3>(item);
        break;
      case xdi::kRateOfTurn:
        out.rate = read_numbers<3>(item);
        break;
      case xdi::kDeltaV:
        out.delta_v = read_numbers<3>(item);
        break;
      case xdi::kDeltaQ:
        out.delta_q = read_numbers<4>(item);
        break;
      case xdi::kPacketCounter:
        if (item.data.size() == 2) out.packet_counter = read_be<std::uint16_t>(item.data);
        break;
      case xdi::kSampleTimeFine:
        if (item.data.size() == 4) out.sample_time_fine = read_be<std::uint32_t>(item.data);
        break;
      case xdi::kStatusWord:
        if (item.data.size() == 4) out.status_word = read_be<std::uint32_t>(item.data);
        break;
      case xdi::kUtcTime:
        if (item.data.size() == kUtcSize) out.utc_ns = utc_ns(read_utc(item.data));
        break;
      default:
        break;
    }
  }
  return true;
}

// packet_counter counts messages whatever they hold: GNSS takes numbers of its own, so a hole among the
// inertial messages alone is no loss.
bool MtDecoder::count_message(const Inertial& message, HostTime first_byte) noexcept {
  if (!message.packet_counter) return true;
  const CountStep step = packet_counter_.take(*message.packet_counter, first_byte);
  if (step == CountStep::kRejected) return false;
  if (step == CountStep::kForward) lost_messages_ += packet_counter_.step() - 1;
  if (step == CountStep::kRestarted && !message.sample_time_fine) restart_clock();
  return true;
}

// Moves sample_count_ and the device time to this message's sample and counts what is missing before it.
bool MtDecoder::advance_sample_time(const Inertial& message, HostTime first_byte) noexcept {
  std::int64_t samples = 1 + std::exchange(lost_messages_, 0);
  if (message.sample_time_fine) {
    const CountStep step = sample_time_.take(*message.sample_time_fine, first_byte);
    if (step == CountStep::kRejected) return false;
    if (step == CountStep::kRestarted) restart_clock();
    last_step_ticks_ =
        step == CountStep::kForward && has_sample_ ? sample_time_.count() - last_sample_time_ : 0;
    last_sample_time_ = sample_time_.count();
    const double periods = static_cast<double>(last_step_ticks_) * rate_hz_ / kSampleTimeFinePerSecond;
    samples = std::max<std::int64_t>(to_whole(periods), 1);
  }
  sample_count_ += has_sample_ ? samples : 0;
  if (has_sample_ && samples > 1) {
    counters_.samples_lost += static_cast<std::uint64_t>(samples - 1);
    gap_pending_ = true;
  }
  has_sample_ = true;
  return true;
}

void MtDecoder::fill_imu(const Inertial& message, double dt_s, ImuData& imu) const noexcept {
  imu.flags = clip_flags(message.status_word);
  if (message.rate || message.acceleration) {
    if (message.rate) {
      imu.omega_radps = rotated(*message.rate);
      imu.flags |= kGyroValid;
    }
    if (message.acceleration) {
      imu.f_mps2 = rotated(*message.acceleration);
      imu.flags |= kAccelValid;
    }
    return;
  }
  imu.flags |= kIsIncrement;
  const auto per_second = [dt_s](std::array<double, 3> v) {
    for (double& value : v) value /= dt_s;
    return v;
  };
  if (message.delta_q) {
    imu.omega_radps = rotated(per_second(rotation_vector(*message.delta_q)));
    imu.flags |= kGyroValid;
  }
  if (message.delta_v) {
    imu.f_mps2 = rotated(per_second(*message.delta_v));
    imu.flags |= kAccelValid;
  }
}

// ---------------------------------------------------------------------------------------------- both

void MtDecoder::restart_clock() noexcept {
  ++counters_.clock_resets;
  clock_.restart();
  gap_pending_ = true;
}

HostTime MtDecoder::map(std::int64_t device_time_ns, const Frame& frame) noexcept {
  return clock_.observe(device_time_ns, frame.first_byte);
}

HostTime MtDecoder::arrival_of(const Frame& frame, HostTime time, HostTime arrival) const noexcept {
  return clock_.is_fixed() ? time + per_byte_ * static_cast<std::int64_t>(frame.size) : arrival;
}

Vector3 MtDecoder::rotated(const std::array<double, 3>& v) const noexcept {
  Vector3 out;
  for (std::size_t row = 0; row < 3; ++row) {
    out[row] = axes_[3 * row] * v[0] + axes_[3 * row + 1] * v[1] + axes_[3 * row + 2] * v[2];
  }
  return out;
}

void MtDecoder::put(Sample& sample, Block& block, const Instant& at, SampleSink& sink) noexcept {
  sample.kind = SampleKind::kImu;
  sample.device = block.device;
  sample.sequence = block.sequence++;
  sample.arrival = at.arrival;
  sample.time = at.time;
  sample.imu.counter = at.counter;
  if (at.gap_before) sample.imu.flags |= kGapBefore;
  ++counters_.samples;
  sink.on_sample(sample);
}

}  // namespace imuscope::xsens
