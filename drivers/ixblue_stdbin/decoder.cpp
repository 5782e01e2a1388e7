#include "drivers/ixblue_stdbin/decoder.h"

#include <algorithm>
#include <cmath>

#include "base/bytes.h"
#include "base/units.h"
#include "drivers/device/attitude_angles.h"
#include "drivers/device/calendar.h"
#include "drivers/device/feed.h"

namespace imuscope::ixblue_stdbin {
namespace {

/// Equal raw blocks in a row before they are called frozen. A 24-bit converter's noise repeats all three axes
/// this often never; a unit that repeats values between updates does so a few times.
constexpr std::uint64_t kFrozenAfter = 10;

/// Telegrams older than the last one by no more than this came out of order over a network.
constexpr std::int32_t kReorderedMax = 16;
/// More telegrams than this missing at once: not a loss but a restart (an hour at 100 Hz).
constexpr std::int32_t kLostMax = 360'000;

/// Where date and time of day may belong to different days (a public driver allows the same).
constexpr std::int64_t kNearMidnightTicks = 600 * kTicksPerSecond;

/// Date block to days since 1970; nothing where it is not a date.
std::optional<std::int64_t> days_of(std::span<const std::uint8_t> block) noexcept {
  return days_since_1970(read_be<std::uint16_t>(block, 2), block[1], block[0]);
}

/// XV (forward, port, up) to forward-right-down.
constexpr Matrix3 kXvToFrd{1.0, 0.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0, -1.0};

}  // namespace

std::string_view describe(RawBlocks state) noexcept {
  switch (state) {
    case RawBlocks::kUnknown:
    case RawBlocks::kGood:
      return {};
    case RawBlocks::kMissing:
      return "the telegrams hold no raw rotation rate or no raw acceleration; switch on RAW ROTATION RATE "
             "(extended bit 2) and RAW ACCELERATION (bit 28) in the unit's StdBin output";
    case RawBlocks::kZero:
      return "the raw rotation rate or raw acceleration is all zero, so nothing can be calibrated on this "
             "unit; it is export-limited or simulating: ask its maker for an output with raw data";
    case RawBlocks::kFrozen:
      return "the raw rotation rate or raw acceleration does not change, so nothing can be "
             "calibrated on this unit; it is export-limited, simulating or faulty: ask its "
             "maker for an output with raw data";
  }
  return {};
}

Decoder::Decoder(const DecoderConfig& config) noexcept
    : config_(config), is_turned_(config.axes != kXvToFrd), scanner_(config.per_byte), clock_(config.clock) {}

void Decoder::push(std::span<const std::uint8_t> bytes, Arrival arrival, SampleSink& sink) noexcept {
  counters_.bytes += bytes.size();
  feed(scanner_, bytes, arrival.received, [&] { drain(arrival.read, sink, false); });
}

void Decoder::finish(HostTime arrival, SampleSink& sink) noexcept { drain(arrival, sink, true); }

void Decoder::drain(HostTime arrival, SampleSink& sink, bool at_end) noexcept {
  Frame frame;
  while (scanner_.next(frame, at_end)) {
    ++counters_.frames;
    if (frame.kind == Frame::Kind::kTelegram) on_telegram(frame, arrival, sink);
  }
  mirror_scan_counters();
}

void Decoder::mirror_scan_counters() noexcept {
  counters_.bytes_skipped = scanner_.counters().bytes_skipped;
  counters_.bad_checksums = scanner_.counters().bad_checksums;
  counters_.bad_lengths = scanner_.counters().bad_lengths;
  counters_.bad_contents = bad_messages_ + raw_blocks_refused_;
  // A fixed clock map begins no segments of its own.
  counters_.clock_resets = std::max(restarts_, clock_.restarts());
}

void Decoder::on_telegram(const Frame& frame, HostTime arrival, SampleSink& sink) noexcept {
  const Telegram telegram = parse_telegram(frame.bytes);
  if (telegram.rest_unread) ++bad_messages_;
  // A day with a leap second has one second more.
  if (telegram.validity_ticks >= kTicksPerDay + kTicksPerSecond) {
    ++bad_messages_;
    return;
  }
  if (!unwrap_counter(telegram.counter)) {
    ++bad_messages_;
    return;
  }
  unwrap_validity(telegram.validity_ticks);
  if (const auto status = telegram.block(Nav::kUserStatus); !status.empty()) {
    user_status_ = read_be<std::uint32_t>(status);
  }
  update_utc(telegram);

  Sample sample{};
  sample.device = config_.device;
  sample.time = clock_.observe(ticks_ * kTickNs, frame.first_byte);
  const auto wire_time = scanner_.per_byte() * static_cast<std::int64_t>(frame.bytes.size());
  sample.arrival = clock_.is_fixed() ? sample.time + wire_time : arrival;
  sample.has_utc = has_utc_ && utc_at_ticks_ == ticks_;
  if (sample.has_utc) sample.utc = utc_time_from_ns(utc_ticks_ * kTickNs);
  emit_imu(telegram, sample, sink);
  emit_attitude(telegram, sample, sink);
}

void Decoder::restart_segment() noexcept {
  ++restarts_;
  clock_.restart();
  in_segment_ = false;
  has_utc_ = false;
  gap_before_imu_ = last_imu_counter_.has_value();
  last_imu_counter_.reset();
  rate_ = {};
  acceleration_ = {};
}

/// False for a telegram that came twice or too late.
bool Decoder::unwrap_counter(std::uint32_t counter) noexcept {
  if (in_segment_) {
    const auto step = static_cast<std::int32_t>(counter - last_counter_);
    if (step <= 0 && step >= -kReorderedMax) {
      // A unit that restarts counts from 0 again, and goes on: the third such telegram is no straggler.
      constexpr int kStragglersMax = 2;
      if (++stragglers_ <= kStragglersMax) return false;
      restart_segment();
    } else if (step < 0 || step > kLostMax) {
      restart_segment();
    } else {
      counters_.samples_lost += static_cast<std::uint64_t>(step - 1);
      counter_ += step;
    }
  }
  stragglers_ = 0;
  if (!in_segment_) counter_ = counter;
  last_counter_ = counter;
  return true;
}

void Decoder::unwrap_validity(std::uint32_t ticks) noexcept {
  if (in_segment_) {
    std::int64_t step = static_cast<std::int64_t>(ticks) - last_validity_;
    if (step < -kTicksPerDay / 2) step += kTicksPerDay;
    if (step > kTicksPerDay / 2) step -= kTicksPerDay;
    if (is_leap_second(Duration(ticks * kTickNs), Duration(step * kTickNs))) {
      step += kTicksPerSecond;
      utc_ticks_ -= kTicksPerSecond;  // UTC shows one second twice
    }
    // The counter went on but the time of day went back: the unit has just been given the time.
    if (step < 0) has_utc_ = false;
    ticks_ += step;
  } else {
    ticks_ = ticks;
    in_segment_ = true;
  }
  last_validity_ = ticks;
}

void Decoder::update_utc(const Telegram& telegram) noexcept {
  const bool synchronised = !user_status_ || (*user_status_ & kUserTimeReceived) != 0;
  if (!synchronised) {
    has_utc_ = false;
    return;
  }
  const std::int64_t expected = utc_ticks_ + (ticks_ - utc_at_ticks_);
  const auto block = telegram.block(Nav::kSystemDate);
  const auto days = block.empty() ? std::nullopt : days_of(block);
  if (days) {
    const std::int64_t time_of_day = telegram.validity_ticks;
    utc_ticks_ = *days * kTicksPerDay + time_of_day;
    // The date need not change in the telegram in which the time of day wraps.
    const bool near_midnight =
        time_of_day < kNearMidnightTicks || time_of_day > kTicksPerDay - kNearMidnightTicks;
    if (has_utc_ && near_midnight) {
      const std::int64_t off = expected - utc_ticks_;
      if (off > kTicksPerDay / 2 && off < 3 * kTicksPerDay / 2) utc_ticks_ += kTicksPerDay;
      if (off < -kTicksPerDay / 2 && off > -3 * kTicksPerDay / 2) utc_ticks_ -= kTicksPerDay;
    }
    has_utc_ = true;
  } else {
    utc_ticks_ = expected;
  }
  utc_at_ticks_ = ticks_;
}

RawBlocks Decoder::RepeatedBlock::take(std::span<const std::uint8_t> block) noexcept {
  const auto bytes = block.first<kSize>();  // of known size: compared and copied without a call
  const bool same = in_a_row > 0 && std::equal(bytes.begin(), bytes.end(), last.begin());
  in_a_row = same ? in_a_row + 1 : 1;
  std::copy(bytes.begin(), bytes.end(), last.begin());
  const auto is_zero = [&](std::size_t axis) { return read_be<float>(bytes, 4 * axis) == 0.0F; };
  if (is_zero(0) && is_zero(1) && is_zero(2)) return RawBlocks::kZero;
  return in_a_row >= kFrozenAfter ? RawBlocks::kFrozen : RawBlocks::kGood;
}

Vector3 Decoder::to_b(std::span<const std::uint8_t> block, double unit) const noexcept {
  Vector3 v_b;
  rotate(config_.axes,
         {unit * static_cast<double>(read_be<float>(block, 0)),
          unit * static_cast<double>(read_be<float>(block, 4)),
          unit * static_cast<double>(read_be<float>(block, 8))},
         v_b);
  return v_b;
}

void Decoder::emit_imu(const Telegram& telegram, Sample& sample, SampleSink& sink) noexcept {
  const auto rate = telegram.block(Extended::kRawRotationRate);
  const auto acceleration = telegram.block(Nav::kRawAcceleration);
  if (rate.empty() || acceleration.empty()) {
    raw_blocks_ = RawBlocks::kMissing;
    return;
  }
  raw_blocks_ = std::max(rate_.take(rate), acceleration_.take(acceleration));
  if (raw_blocks_ != RawBlocks::kGood) {
    ++raw_blocks_refused_;
    return;
  }
  sample.kind = SampleKind::kImu;
  ImuData& imu = sample.imu;
  imu = ImuData{};
  imu.omega_radps = to_b(rate, kRadPerDeg);
  imu.f_mps2 = to_b(acceleration, 1.0);
  imu.counter = counter_;
  imu.flags = kGyroValid | kAccelValid;
  if (const auto block = telegram.block(Extended::kRotationAcceleration); !block.empty()) {
    imu.angular_acceleration_radps2 = to_b(block, kRadPerDeg);
    imu.flags |= kHasAngularAcceleration;
  }
  if (last_imu_counter_ && counter_ != *last_imu_counter_ + 1) gap_before_imu_ = true;
  last_imu_counter_ = counter_;
  if (gap_before_imu_) imu.flags |= kGapBefore;
  for (const double value : {imu.omega_radps[0], imu.omega_radps[1], imu.omega_radps[2], imu.f_mps2[0],
                             imu.f_mps2[1], imu.f_mps2[2]}) {
    if (!std::isfinite(value)) {
      ++bad_messages_;
      gap_before_imu_ = true;
      return;
    }
  }
  gap_before_imu_ = false;
  emit(sample, sink);
}

void Decoder::emit_attitude(const Telegram& telegram, Sample& sample, SampleSink& sink) noexcept {
  const auto block = telegram.block(Nav::kAttitude);
  if (block.empty()) return;
  const auto angle = [](std::span<const std::uint8_t> bytes, std::size_t field) {
    return static_cast<double>(read_be<float>(bytes, 4 * field)) * kRadPerDeg;
  };
  // The unit's pitch is positive bow down.
  RollPitchHeading rph{angle(block, 1), -angle(block, 2), angle(block, 0)};
  if (!std::isfinite(rph.roll_rad) || !std::isfinite(rph.pitch_rad) || !std::isfinite(rph.heading_rad)) {
    ++bad_messages_;
    return;
  }
  sample.kind = SampleKind::kAttitude;
  AttitudeData& attitude = sample.attitude;
  attitude = AttitudeData{};
  if (is_turned_) {
    const Matrix3 frd_to_b = multiply(config_.axes, transpose(kXvToFrd));
    rph = angles_of(multiply(rotation_of(rph), transpose(frd_to_b)));
  }
  attitude.roll_rad = rph.roll_rad;
  attitude.pitch_rad = rph.pitch_rad;
  attitude.heading_rad = to_positive_turn(rph.heading_rad);

  const std::uint32_t status = user_status_.value_or(0);
  if ((status & kUserFailure) == 0) attitude.flags |= kRollPitchValid;
  const bool heading_known = user_status_.has_value();
  if (heading_known && (status & (kUserFailure | kUserHrpInvalid | kUserAlignment)) == 0) {
    attitude.flags |= kHeadingValid;
  }
  if (const auto std_block = telegram.block(Nav::kAttitudeStd); !std_block.empty()) {
    attitude.sd_rpy_rad = {angle(std_block, 1), angle(std_block, 2), angle(std_block, 0)};
    // In turned axes a tilt of the unit is part roll, part pitch: the larger sd holds for both.
    if (is_turned_) {
      const double tilt = std::max(attitude.sd_rpy_rad[0], attitude.sd_rpy_rad[1]);
      attitude.sd_rpy_rad[0] = attitude.sd_rpy_rad[1] = tilt;
    }
    const bool usable = std::all_of(attitude.sd_rpy_rad.begin(), attitude.sd_rpy_rad.end(),
                                    [](double sd) { return std::isfinite(sd) && sd >= 0.0; });
    if (usable) attitude.flags |= kHasAttitudeSd;
  }
  emit(sample, sink);
}

void Decoder::emit(Sample& sample, SampleSink& sink) noexcept {
  sample.sequence = sequence_++;
  ++counters_.samples;
  sink.on_sample(sample);
}

}  // namespace imuscope::ixblue_stdbin
