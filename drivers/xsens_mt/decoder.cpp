#include "drivers/xsens_mt/decoder.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "base/bytes.h"
#include "base/contracts.h"
#include "drivers/device/feed.h"

namespace imuscope::xsens {
namespace {

// A block that is the same bit for bit this often comes from a device that fell off the bus: a sensor has
// noise.
constexpr int kRepeatsOfALostDevice = 3;

constexpr std::int64_t kNsPerTick = 100000;  // SampleTimeFine, 100 us

// Nearest whole number of a value that is not negative; llround() would be a call of a library for each
// sample. NOLINTNEXTLINE(bugprone-incorrect-roundings)
std::int64_t to_whole(double value) { return static_cast<std::int64_t>(value + 0.5); }

// FNV-1a, 64 bits.
std::uint64_t fingerprint_of(std::span<const std::uint8_t> data) {
  std::uint64_t hash = 14695981039346656037ULL;
  for (const std::uint8_t byte : data) hash = (hash ^ byte) * 1099511628211ULL;
  return hash;
}

void set_temperature(double degC, ImuData& imu) {
  imu.temperature_degC = static_cast<float>(degC);
  imu.flags |= kHasTemperature;
}

UnwrapConfig counter_config(double counts_per_s, const ClockMapConfig& clock) {
  return {kCounterModulus, 0, counts_per_s, clock.mode == ClockMapConfig::Mode::kOnline};
}

}  // namespace

MtDecoder::MtDecoder(const MtDecoderConfig& config)
    : wants_imu_(config.wants_imu),
      wants_attitude_(config.wants_attitude),
      wants_gnss_(config.wants_gnss),
      scanner_(config.per_byte),
      clock_(config.clock),
      gnss_clock_(config.clock),
      count_period_s_(1.0 / config.rate_hz),
      counter_(counter_config(config.rate_hz, config.clock)),
      rate_hz_(config.rate_hz),
      packet_counter_(counter_config(config.rate_hz, config.clock)),
      sample_time_({kSampleTimeFineModulus, kSampleTimeFineDay, kSampleTimeFinePerSecond,
                    config.clock.mode == ClockMapConfig::Mode::kOnline}) {
  IMUSCOPE_EXPECTS(config.rate_hz > 0.0);
  IMUSCOPE_EXPECTS(data_length(config.layout).has_value());
  IMUSCOPE_EXPECTS(config.bus.size() <= kBusDevicesMax);
  for (std::size_t k = 0; k < kBusDevicesMax; ++k) {
    Block& block = blocks_[k];
    block.layout = config.layout;
    block.length = *data_length(config.layout);
    block.wanted = config.bus.empty() && k == 0;
    block.device = config.device;
    block.axes = config.axes;
    if (k < config.bus.size() && config.bus[k]) {
      block.wanted = true;
      block.device = config.bus[k]->device;
      block.axes = config.bus[k]->axes;
    }
  }
  xbus_ = !config.bus.empty();
  n_blocks_ = std::max<std::size_t>(config.bus.size(), 1);
  message_length_ = n_blocks_ * blocks_[0].length + (xbus_ ? sizeof(std::uint16_t) : 0);
}

void MtDecoder::push(std::span<const std::uint8_t> bytes, Arrival arrival, SampleSink& sink) noexcept {
  counters_.bytes += bytes.size();
  feed(scanner_, bytes, arrival.received, [&] { drain(arrival.read, sink, false); });
}

void MtDecoder::finish(HostTime arrival, SampleSink& sink) noexcept { drain(arrival, sink, true); }

void MtDecoder::drain(HostTime arrival, SampleSink& sink, bool at_end) noexcept {
  Frame frame;
  while (scanner_.next(frame, at_end)) {
    // Of two frames that claim the same bytes one is false: the contents of data tell which, a command's do
    // not.
    if (frame.nested && frame.mid != mid::kMtData && frame.mid != mid::kMtData2) continue;
    ++counters_.frames;
    on_frame(frame, arrival, sink);
  }
  counters_.bytes_skipped = scanner_.counters().bytes_skipped;
  // A fixed clock map begins no segments of its own.
  counters_.clock_resets = std::max(restarts_, clock_.restarts());
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
    case mid::reply_to(mid::kOutputConfiguration):
      learn_output(frame.data);
      break;
    case mid::reply_to(mid::kGoToConfig):
      told_to_pause_ = true;
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
  const auto devices = std::span(configuration.devices).first(configuration.n_devices);
  const bool contradicts_itself = std::any_of(devices.begin(), devices.end(), [](const DeviceRecord& record) {
    const auto length = data_length({record.output_mode, record.output_settings});
    return record.data_length != 0 && length != record.data_length;
  });
  if (contradicts_itself) {
    ++counters_.bad_contents;
    return;
  }
  if (devices[0].data_length == 0) return;  // sends MTData2, whose rates the period does not tell
  n_blocks_ = devices.size();
  xbus_ = configuration.is_xbus_master();
  message_length_ = xbus_ ? sizeof(std::uint16_t) : 0;
  for (std::size_t k = 0; k < n_blocks_; ++k) {
    blocks_[k].layout = {devices[k].output_mode, devices[k].output_settings};
    blocks_[k].length = devices[k].data_length;
    message_length_ += devices[k].data_length;
  }
  counts_per_message_ = configuration.skip_factor + 1;
  // Device time goes on from where it is, at the new period.
  base_time_ns_ += to_whole(static_cast<double>(counter_.count() - base_count_) * count_period_s_ * 1e9);
  base_count_ = counter_.count();
  count_period_s_ = configuration.period / kPeriodTicksPerSecond;
  counter_.set_rate(1.0 / count_period_s_);
}

// What the device really sends, item by item: inertial items come at one rate, the fastest of those listed.
void MtDecoder::learn_output(std::span<const std::uint8_t> data) noexcept {
  std::uint16_t fastest_hz = 0;
  for (; data.size() >= kOutputItemSize; data = data.subspan(kOutputItemSize)) {
    const auto kind = static_cast<std::uint16_t>(read_be<std::uint16_t>(data) & ~xdi::kFormatBits);
    const auto rate_hz = read_be<std::uint16_t>(data, sizeof(std::uint16_t));
    const bool inertial = kind == xdi::kAcceleration || kind == xdi::kRateOfTurn || kind == xdi::kDeltaV ||
                          kind == xdi::kDeltaQ || kind == xdi::kAccelerationHr || kind == xdi::kRateOfTurnHr;
    if (inertial && rate_hz != kEveryMessage) fastest_hz = std::max(fastest_hz, rate_hz);
  }
  if (fastest_hz == 0) return;
  rate_hz_ = fastest_hz;
  packet_counter_.set_rate(rate_hz_);
}

// ------------------------------------------------------------------------------------------ legacy MTData

void MtDecoder::on_mtdata(const Frame& frame, HostTime arrival, SampleSink& sink) noexcept {
  if (frame.data.size() != message_length_ || !take_counter(counter_of(frame), frame.first_byte)) {
    ++counters_.bad_contents;
    return;
  }
  const double since_base_s = static_cast<double>(counter_.count() - base_count_) * count_period_s_;
  const HostTime time = clock_.observe(base_time_ns_ + to_whole(since_base_s * 1e9), frame.first_byte);
  const Instant at{time, arrival_of(frame, time, arrival), counter_.count(),
                   std::exchange(gap_pending_, false)};
  auto rest = frame.data.subspan(xbus_ ? sizeof(std::uint16_t) : 0);
  for (std::size_t k = 0; k < n_blocks_; ++k) {
    Block& block = blocks_[k];
    if (block.wanted) {
      emit_block(block, rest.first(block.length), at, sink);
      if (wants_gnss_) emit_legacy_gnss(message_, frame, arrival, sink);
    }
    rest = rest.subspan(block.length);
  }
}

// The Xbus head's counter, or the device's own; without one, messages are counted here.
std::uint16_t MtDecoder::counter_of(const Frame& frame) noexcept {
  if (xbus_) return read_be<std::uint16_t>(frame.data, 0);
  const DataLayout& layout = blocks_[0].layout;
  if ((layout.settings & output_settings::kSampleCounter) == 0) return uncounted_++;
  const std::size_t behind = (layout.settings & output_settings::kUtcTime) != 0 ? kUtcSize : 0;
  return read_be<std::uint16_t>(frame.data, frame.data.size() - behind - sizeof(std::uint16_t));
}

// False for a counter that cannot be true, and for one that came twice.
bool MtDecoder::take_counter(std::uint16_t counter, HostTime first_byte) noexcept {
  switch (counter_.take(counter, first_byte)) {
    case CountStep::kRejected:
    case CountStep::kRepeated:
      return false;
    case CountStep::kRestarted:
      restart_clock();
      break;
    case CountStep::kForward:
      if (const std::int64_t step = counter_.step(); step > counts_per_message_) {
        note_gap(std::max<std::int64_t>(step / counts_per_message_ - 1, 0));
      }
      break;
    case CountStep::kFirst:
      break;
  }
  told_to_pause_ = false;
  return true;
}

// A device that is being set up counts on and sends nothing: that is a gap, but nothing was lost in it.
void MtDecoder::note_gap(std::int64_t samples) noexcept {
  if (samples <= 0) return;
  gap_pending_ = true;
  if (!told_to_pause_) counters_.samples_lost += static_cast<std::uint64_t>(samples);
}

void MtDecoder::emit_block(Block& block, std::span<const std::uint8_t> data, const Instant& at,
                           SampleSink& sink) noexcept {
  if (xbus_ && is_repeated(block, data)) {
    ++counters_.bad_contents;
    message_.fields = 0;
    return;
  }
  const MtData& message = message_;
  read_mtdata_of_known_length(data, block.layout, message_);
  Sample sample{};
  sample.arrival = at.arrival;
  sample.time = at.time;
  if (message.has(Field::kUtc)) {
    if (const auto ns = utc_ns(message.utc)) {
      sample.has_utc = true;
      sample.utc = utc_time_from_ns(*ns);
    }
  }
  const bool has_rate = message.has(Field::kRate);
  const bool has_force = message.has(Field::kAcceleration);
  if (wants_imu_ && (has_rate || has_force)) {
    sample.kind = SampleKind::kImu;
    sample.imu.counter = at.counter;
    sample.imu.flags =
        (has_rate ? kGyroValid : 0U) | (has_force ? kAccelValid : 0U) | (at.gap_before ? kGapBefore : 0U);
    if (has_rate) rotate(block.axes, message.rate_radps, sample.imu.omega_radps);
    if (has_force) rotate(block.axes, message.acceleration_mps2, sample.imu.f_mps2);
    if (message.has(Field::kTemperature)) set_temperature(message.temperature_degc, sample.imu);
    put(sample, block, sink);
  }
  if (!wants_attitude_) return;
  if (const auto C_s_l = orientation_of(message)) {
    const bool valid = !message.has(Field::kStatus) || (message.status & kStatusFilterValid) != 0;
    emit_attitude(block, *C_s_l, local_frame_of(block.layout), valid, sample, sink);
  }
}

// The receiver of an MTi-G: no fix type and no date, its solution is repeated until there is a new one.
void MtDecoder::emit_legacy_gnss(const MtData& message, const Frame& frame, HostTime arrival,
                                 SampleSink& sink) noexcept {
  if (!message.has(Field::kGpsPvt)) return;
  constexpr std::int32_t kMmPerCm = 10;
  const GpsPvt& gps = message.gps;
  const bool fix = !message.has(Field::kStatus) || (message.status & kStatusGpsFix) != 0;
  NavPvt pvt{};
  pvt.itow = gps.time_of_week_ms;
  pvt.fix = fix ? kPvtFix3D : 0;
  pvt.flags = fix ? kPvtFixOk : 0;
  pvt.lat = gps.latitude_1e7_deg;
  pvt.lon = gps.longitude_1e7_deg;
  pvt.h = gps.altitude_mm;
  pvt.hacc = gps.horizontal_accuracy_mm;
  pvt.vacc = gps.vertical_accuracy_mm;
  pvt.vn = gps.velocity_ned_cmps[0] * kMmPerCm;
  pvt.ve = gps.velocity_ned_cmps[1] * kMmPerCm;
  pvt.vd = gps.velocity_ned_cmps[2] * kMmPerCm;
  pvt.sacc = gps.speed_accuracy_cmps * static_cast<std::uint32_t>(kMmPerCm);
  emit_gnss(pvt, frame, arrival, sink);
}

bool MtDecoder::is_repeated(Block& block, std::span<const std::uint8_t> data) noexcept {
  const std::uint64_t fingerprint = fingerprint_of(data);
  block.repeats = fingerprint == block.fingerprint ? block.repeats + 1 : 0;
  block.fingerprint = fingerprint;
  return block.repeats >= kRepeatsOfALostDevice;
}

// ---------------------------------------------------------------------------------------------- MTData2

void MtDecoder::on_mtdata2(const Frame& frame, HostTime arrival, SampleSink& sink) noexcept {
  if (!read_inertial(frame.data, inertial_) || !count_message(frame.first_byte)) {
    ++counters_.bad_contents;
    return;
  }
  if (wants_gnss_ && inertial_.has(InertialMessage::kGnss)) {
    const unsigned rtk = inertial_.status_word >> kStatusRtkShift & kStatusRtkMask;
    emit_gnss(nav_pvt_of(*read_gnss_pvt(inertial_.gnss), rtk), frame, arrival, sink);
  }
  constexpr std::uint32_t kImuItems = InertialMessage::kRate | InertialMessage::kAcceleration |
                                      InertialMessage::kDeltaV | InertialMessage::kDeltaQ;
  if ((inertial_.items & kImuItems) == 0) return;
  if (!advance_sample_time(frame.first_byte)) {
    ++counters_.bad_contents;
    return;
  }
  const HostTime time = clock_.observe(device_time_ns(), frame.first_byte);
  emit_inertial({time, arrival_of(frame, time, arrival), sample_count_, gap_pending_}, sink);
}

void MtDecoder::emit_inertial(const Instant& at, SampleSink& sink) noexcept {
  Block& block = blocks_[0];
  Sample sample{};
  sample.arrival = at.arrival;
  sample.time = at.time;
  if (inertial_.has(InertialMessage::kUtc)) {
    if (const auto ns = utc_ns(inertial_.utc)) {
      sample.has_utc = true;
      sample.utc = utc_time_from_ns(*ns);
    }
  }
  if (wants_imu_) {
    sample.kind = SampleKind::kImu;
    fill_imu(sample.imu);
    sample.imu.counter = at.counter;
    if (at.gap_before) sample.imu.flags |= kGapBefore;
    gap_pending_ = false;
    put(sample, block, sink);
  }
  if (!wants_attitude_ || !inertial_.has(InertialMessage::kOrientation)) return;
  const bool valid =
      !inertial_.has(InertialMessage::kStatus) || (inertial_.status_word & kStatusFilterValid) != 0;
  emit_attitude(block, inertial_.C_s_l, inertial_.frame, valid, sample, sink);
}

// packet_counter counts messages whatever they hold: GNSS takes numbers of its own, so a hole among the
// inertial messages alone is no loss.
bool MtDecoder::count_message(HostTime first_byte) noexcept {
  if (!inertial_.has(InertialMessage::kPacketCounter)) return true;
  const CountStep step = packet_counter_.take(inertial_.packet_counter, first_byte);
  if (step == CountStep::kRejected) return false;
  // A message that came twice; SampleTimeFine knows better where there is one.
  if (step == CountStep::kRepeated && !inertial_.has(InertialMessage::kSampleTimeFine)) return false;
  if (step == CountStep::kForward) lost_messages_ += packet_counter_.step() - 1;
  if (step == CountStep::kRestarted && !inertial_.has(InertialMessage::kSampleTimeFine)) restart_clock();
  return true;
}

// Moves sample_count_ and the device time to this message's sample and counts what is missing before it.
bool MtDecoder::advance_sample_time(HostTime first_byte) noexcept {
  std::int64_t samples = 1 + std::exchange(lost_messages_, 0);
  if (inertial_.has(InertialMessage::kSampleTimeFine)) {
    const CountStep step = sample_time_.take(inertial_.sample_time_fine, first_byte);
    if (step == CountStep::kRejected || step == CountStep::kRepeated) return false;
    if (step == CountStep::kRestarted) restart_clock();
    last_step_ticks_ =
        step == CountStep::kForward && has_sample_ ? sample_time_.count() - last_sample_time_ : 0;
    last_sample_time_ = sample_time_.count();
    const double periods = static_cast<double>(last_step_ticks_) * rate_hz_ / kSampleTimeFinePerSecond;
    samples = std::max<std::int64_t>(to_whole(periods), 1);
  }
  sample_count_ += has_sample_ ? samples : 0;
  if (has_sample_) note_gap(samples - 1);
  told_to_pause_ = false;
  has_sample_ = true;
  return true;
}

std::int64_t MtDecoder::device_time_ns() const noexcept {
  if (inertial_.has(InertialMessage::kSampleTimeFine)) return sample_time_.count() * kNsPerTick;
  return to_whole(static_cast<double>(sample_count_) / rate_hz_ * 1e9);
}

void MtDecoder::fill_imu(ImuData& imu) const noexcept {
  imu.flags = clip_flags(inertial_.status_word);
  if (inertial_.has(InertialMessage::kTemperature)) set_temperature(inertial_.temperature_degC[0], imu);
  const bool has_rate = inertial_.has(InertialMessage::kRate);
  const bool has_force = inertial_.has(InertialMessage::kAcceleration);
  if (!has_rate && !has_force) {
    fill_increments(imu);
    return;
  }
  if (has_rate) {
    rotate(blocks_[0].axes, inertial_.rate_radps, imu.omega_radps);
    imu.flags |= kGyroValid;
  }
  if (has_force) {
    rotate(blocks_[0].axes, inertial_.acceleration_mps2, imu.f_mps2);
    imu.flags |= kAccelValid;
  }
}

void MtDecoder::fill_increments(ImuData& imu) const noexcept {
  const double per_second = inertial_.has(InertialMessage::kSampleTimeFine) && last_step_ticks_ > 0
                                ? kSampleTimeFinePerSecond / static_cast<double>(last_step_ticks_)
                                : rate_hz_;
  const auto mean = [&](std::array<double, 3> increment) {
    for (double& value : increment) value *= per_second;
    return increment;
  };
  imu.flags |= kIsIncrement;
  if (inertial_.has(InertialMessage::kDeltaQ)) {
    rotate(blocks_[0].axes, mean(rotation_vector(inertial_.delta_q)), imu.omega_radps);
    imu.flags |= kGyroValid;
  }
  if (inertial_.has(InertialMessage::kDeltaV)) {
    rotate(blocks_[0].axes, mean(inertial_.delta_v_mps), imu.f_mps2);
    imu.flags |= kAccelValid;
  }
}

// ---------------------------------------------------------------------------------------------- both

void MtDecoder::emit_attitude(Block& block, const Matrix3& C_s_l, LocalFrame local, bool filter_valid,
                              const Sample& like, SampleSink& sink) noexcept {
  Sample sample = like;
  sample.kind = SampleKind::kAttitude;
  sample.attitude = attitude_of(C_s_l, local, block.axes);
  if (!filter_valid) sample.attitude.flags = 0;
  put(sample, block, sink);
}

void MtDecoder::emit_gnss(const NavPvt& pvt, const Frame& frame, HostTime arrival,
                          SampleSink& sink) noexcept {
  if (!gnss_time_.take(pvt.itow)) return;  // the same solution again
  Sample sample{};
  sample.kind = SampleKind::kGnss;
  sample.time = gnss_clock_.observe(gnss_time_.time_ns(), frame.first_byte);
  sample.arrival = arrival_of(frame, sample.time, arrival);
  if (const auto utc = utc_of(pvt)) {
    sample.has_utc = true;
    sample.utc = *utc;
  }
  sample.gnss = gnss_of(pvt);
  put(sample, blocks_[0], sink);
}

void MtDecoder::restart_clock() noexcept {
  ++restarts_;
  clock_.restart();
  gap_pending_ = true;
}

HostTime MtDecoder::arrival_of(const Frame& frame, HostTime time, HostTime arrival) const noexcept {
  return clock_.is_fixed() ? time + scanner_.per_byte() * static_cast<std::int64_t>(frame.size) : arrival;
}

void MtDecoder::put(Sample& sample, Block& block, SampleSink& sink) noexcept {
  sample.device = block.device;
  sample.sequence = block.sequence++;
  ++counters_.samples;
  sink.on_sample(sample);
}

}  // namespace imuscope::xsens
