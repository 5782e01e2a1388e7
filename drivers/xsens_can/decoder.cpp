#include "drivers/xsens_can/decoder.h"

#include <algorithm>
#include <cmath>

#include "base/contracts.h"
#include "drivers/xsens_mt/inertial.h"
#include "drivers/xsens_mt/wire.h"

namespace imuscope::xsens_can {
namespace {

constexpr std::int64_t kGroupCounterModulus = std::int64_t{1} << 16U;
constexpr std::int64_t kSampleTimeModulus = std::int64_t{1} << 32U;
constexpr std::int64_t kTickCoarse_ns = 100'000;
constexpr std::int64_t kTickFine_ns = 1'000;
constexpr double kNsPerSecond = 1e9;
/// Half an order of magnitude between the two ticks' ratio of 100: a step decides by which side it is on.
constexpr double kTickDecision = 10.0;
/// A step between two rounded times is off by a tick at the most.
constexpr double kTickRounding = 1.5;
/// What samples are made of changes for the worse when it has been missing so long: a lost frame is no
/// reason.
constexpr int kSourceGone = 100;
/// Code of the error message.
constexpr std::uint8_t kOutputBufferOverflow = 1;

constexpr std::size_t at(Item item) noexcept { return static_cast<std::size_t>(item); }

}  // namespace

Decoder::Decoder(const DecoderConfig& config)
    : config_(config), clock_(config.clock), counter_({kGroupCounterModulus, 0, config.rate_hz, true}) {
  IMUSCOPE_EXPECTS(config.rate_hz > 0.0);
}

void Decoder::on_frame(const CanFrame& frame, HostTime arrival, SampleSink& sink) noexcept {
  const CanId id{frame.id, frame.is_extended};
  const auto found = std::find(config_.ids.begin(), config_.ids.end(), id);
  if (found == config_.ids.end()) return;
  const auto item = static_cast<Item>(found - config_.ids.begin());
  if (frame.length < kItemKinds[at(item)].size) {
    ++counters_.bad_lengths;
    return;
  }
  const bool opens = item == Item::kSampleTime || item == Item::kGroupCounter;
  // A node that hears no acknowledgement repeats its frame: it opens no second group.
  if (opens && is_repeated(item, frame.payload())) return;
  if (opens) {
    const bool again =
        item == Item::kSampleTime ? group_.sample_time.has_value() : group_.counter.has_value();
    if (group_.is_open && (group_.has_data || again)) close(arrival, sink);
    if (!group_.is_open) open(frame.stamp);
  } else if (!group_.is_open && item != Item::kError) {
    ++untimed_;
  }
  if (!take(item, frame.payload())) ++counters_.bad_contents;
}

bool Decoder::is_repeated(Item item, std::span<const std::uint8_t> data) const noexcept {
  if (!group_.is_open) return false;
  if (item == Item::kSampleTime) return group_.sample_time && group_.sample_time == read_u32(data);
  return group_.counter && group_.counter == read_u16(data);
}

void Decoder::open(HostTime stamp) noexcept {
  group_ = Group{};
  untimed_ = 0;
  group_.is_open = true;
  group_.stamp = stamp;
}

bool Decoder::take(Item item, std::span<const std::uint8_t> data) noexcept {
  const auto add = [this](std::size_t which, const std::optional<RawTriad>& raw) {
    if (!raw) return false;
    Mean& mean = group_.high_rate[which];
    for (std::size_t i = 0; i < 3; ++i) mean.sum[i] += (*raw)[i];
    ++mean.n;
    return true;
  };
  // An error may be told between the two frames that open a group.
  group_.has_data =
      group_.has_data || (item != Item::kSampleTime && item != Item::kGroupCounter && item != Item::kError);
  switch (item) {
    case Item::kError:
      if (data[0] == kOutputBufferOverflow) ++overflows_;
      return true;
    case Item::kSampleTime:
      return (group_.sample_time = read_u32(data)).has_value();
    case Item::kGroupCounter:
      return (group_.counter = read_u16(data)).has_value();
    case Item::kStatusWord:
      return (group_.status_word = read_u32(data)).has_value();
    case Item::kDeltaV:
      return (group_.delta_v = read_delta_v(data)).has_value();
    case Item::kRateOfTurn:
      return (group_.rate = read_scaled(data, kRate_radps)).has_value();
    case Item::kDeltaQ:
      return (group_.delta_q = read_delta_q(data)).has_value();
    case Item::kAcceleration:
      return (group_.acceleration = read_scaled(data, kAcceleration_mps2)).has_value();
    case Item::kHighRateFirst:
      return add(0, read_raw(data));
    case Item::kHighRateSecond:
      return add(1, read_raw(data));
  }
  return false;
}

void Decoder::close(HostTime arrival, SampleSink& sink) noexcept {
  group_.is_open = false;
  if (group_.high_rate[0].n > 0 && group_.high_rate[1].n > 0) {
    const auto mean = [](const Mean& sum) {
      RawTriad out{};
      for (std::size_t i = 0; i < out.size(); ++i) out[i] = static_cast<std::int16_t>(sum.sum[i] / sum.n);
      return out;
    };
    high_rate_.add(mean(group_.high_rate[0]), mean(group_.high_rate[1]));
  }
  Instant now;
  if (!locate(now)) return;
  Sample sample{};
  sample.kind = SampleKind::kImu;
  if (!choose_source() || !fill(now, sample.imu)) {
    // Rates without forces are no sample: what is lost here is told as a gap.
    ++counters_.bad_contents;
    if (source_ != Source::kNone) ++counters_.samples_lost;
    gap_pending_ = true;
    return;
  }
  sample.device = config_.device;
  sample.sequence = sequence_++;
  sample.arrival = arrival;
  sample.time = clock_.observe(now.time_ns, group_.stamp);
  // A fixed clock map begins no segments of its own.
  counters_.clock_resets = std::max(restarts_, clock_.restarts());
  sample.imu.counter = now.counter;
  if (gap_pending_) sample.imu.flags |= kGapBefore;
  gap_pending_ = false;
  ++counters_.samples;
  sink.on_sample(sample);
}

/// The group's count and time, of which it has at least one: they open it. False for a group that only
/// teaches (the first one).
bool Decoder::locate(Instant& now) noexcept {
  const double period_s = 1.0 / config_.rate_hz;
  // Groups since the last one by the counter, or by the time where there is no counter.
  std::int64_t groups = 1;
  if (group_.counter) {
    const std::optional<std::uint16_t> last = last_raw_counter_;
    last_raw_counter_ = group_.counter;
    const xsens::CountStep step = counter_.take(*group_.counter, group_.stamp);
    if (step == xsens::CountStep::kRejected || step == xsens::CountStep::kRepeated) return false;
    if (step == xsens::CountStep::kRestarted) restart();
    groups = step == xsens::CountStep::kForward ? counter_.step() : 1;
    if (!last) groups = 1;
  }
  if (group_.sample_time) {
    const bool known = settle_tick(*group_.sample_time, groups);
    last_raw_time_ = group_.sample_time;
    if (!known) return false;
    const xsens::CountStep step = sample_time_->take(*group_.sample_time, group_.stamp);
    if (step == xsens::CountStep::kRejected || step == xsens::CountStep::kRepeated) return false;
    // Where the counter began anew just before, this is the same restart.
    if (step == xsens::CountStep::kRestarted && has_last_) restart();
    now.time_ns = sample_time_->count() * tick_ns_;
  } else if (sample_time_) {
    // Its SampleTime was lost on the way: the count goes on from the group before, on the same time scale.
    gap_pending_ = gap_pending_ || !has_last_;
    if (!has_last_) return false;
    now.time_ns = last_time_ns_ + std::llround(static_cast<double>(groups) * period_s * kNsPerSecond);
  } else {
    now.time_ns = std::llround(static_cast<double>(counter_.count()) * period_s * kNsPerSecond);
  }
  const double step_s =
      has_last_ ? static_cast<double>(now.time_ns - last_time_ns_) / kNsPerSecond : period_s;
  if (!group_.counter) groups = std::max<std::int64_t>(1, std::llround(step_s / period_s));
  now.counter = group_.counter ? counter_.count() : last_counter_ + (has_last_ ? groups : 0);
  // The step is rounded to a tick, a percent of the period at 100 Hz: it overrules the nominal period only
  // where it is another one.
  const bool is_nominal =
      std::abs(step_s - period_s) <= kTickRounding * static_cast<double>(tick_ns_) / kNsPerSecond;
  now.dt_s = groups == 1 && step_s > 0.0 && !is_nominal ? step_s : period_s;
  // Since the last group, which may have lacked its counter: that one is not missing.
  if (const std::int64_t step = now.counter - last_counter_; has_last_ && step > 1) {
    counters_.samples_lost += static_cast<std::uint64_t>(step - 1);
    gap_pending_ = true;
  }
  has_last_ = true;
  last_counter_ = now.counter;
  last_time_ns_ = now.time_ns;
  return true;
}

/// SampleTime counts 100 us by one document and 1 us by another: its step at the known rate tells.
bool Decoder::settle_tick(std::uint32_t raw, std::int64_t groups) noexcept {
  if (tick_ns_ != 0) return true;
  if (!last_raw_time_) return false;
  const std::uint32_t step = raw - *last_raw_time_;
  if (step == 0) return false;
  const double expected = static_cast<double>(groups) / config_.rate_hz * kNsPerSecond / kTickCoarse_ns;
  tick_ns_ = static_cast<double>(step) < kTickDecision * expected ? kTickCoarse_ns : kTickFine_ns;
  sample_time_.emplace(
      xsens::UnwrapConfig{kSampleTimeModulus, 0, kNsPerSecond / static_cast<double>(tick_ns_), true});
  return true;
}

void Decoder::restart() noexcept {
  ++restarts_;
  clock_.restart();
  has_last_ = false;
  gap_pending_ = true;
}

Source Decoder::best_source() const noexcept {
  if (group_.delta_q && group_.delta_v) return Source::kIncrements;
  if (group_.rate && group_.acceleration) return Source::kRates;
  const bool resolved = high_rate_.order() != HighRateOrder::kUnknown;
  if (resolved && group_.high_rate[0].n > 0 && group_.high_rate[1].n > 0) return Source::kHighRate;
  return Source::kNone;
}

/// A better source is taken at once, a worse one only when the better has stayed away: mean and instantaneous
/// values do not mix in one series.
bool Decoder::choose_source() noexcept {
  const Source best = best_source();
  if (best >= source_) {
    lacking_ = 0;
    source_ = best;
    return source_ != Source::kNone;
  }
  if (++lacking_ < kSourceGone) return false;
  lacking_ = 0;
  source_ = best;
  return source_ != Source::kNone;
}

bool Decoder::fill(const Instant& now, ImuData& imu) noexcept {
  imu.flags = kGyroValid | kAccelValid | (group_.status_word ? xsens::clip_flags(*group_.status_word) : 0U);
  const auto per_second = [&now](Triad v) {
    for (double& value : v) value /= now.dt_s;
    return v;
  };
  switch (source_) {
    case Source::kIncrements:
      imu.flags |= kIsIncrement;
      imu.omega_radps = rotated(per_second(xsens::rotation_vector(*group_.delta_q)));
      imu.f_mps2 = rotated(per_second(*group_.delta_v));
      return true;
    case Source::kRates:
      imu.omega_radps = rotated(*group_.rate);
      imu.f_mps2 = rotated(*group_.acceleration);
      return true;
    case Source::kHighRate:
      return fill_high_rate(imu);
    case Source::kNone:
      break;
  }
  return false;
}

bool Decoder::fill_high_rate(ImuData& imu) const noexcept {
  const auto mean = [](const Mean& sum, double scale) {
    Triad out{};
    for (std::size_t i = 0; i < 3; ++i) out[i] = scale * static_cast<double>(sum.sum[i]) / sum.n;
    return out;
  };
  const bool first = high_rate_.order() == HighRateOrder::kAccelerationFirst;
  const Mean& acceleration = group_.high_rate[first ? 0 : 1];
  const Mean& rate = group_.high_rate[first ? 1 : 0];
  imu.f_mps2 = rotated(mean(acceleration, kAcceleration_mps2));
  imu.omega_radps = rotated(mean(rate, kRate_radps));
  // Several frames of a group: their mean stands for the whole interval.
  if (acceleration.n > 1 || rate.n > 1) imu.flags |= kIsIncrement;
  return true;
}

Vector3 Decoder::rotated(const Triad& v) const noexcept {
  const std::array<double, 9>& m = config_.axes;
  Vector3 out{};
  for (std::size_t row = 0; row < 3; ++row)
    out[row] = m[3 * row] * v[0] + m[3 * row + 1] * v[1] + m[3 * row + 2] * v[2];
  return out;
}

std::string_view Decoder::remark() const noexcept {
  if (overflows_ > 0)
    return "its CAN output buffer overflowed: lower its output rate, send fewer "
           "messages or raise the bit rate";
  if (counters_.bad_lengths > 0)
    return "frames with its identifiers are too short for its messages: does "
           "another device use these identifiers?";
  // A stream may be joined in the midst of a group.
  constexpr std::uint64_t kFramesOfAGroup = 8;
  if (untimed_ > kFramesOfAGroup)
    return "its groups have neither SampleTime nor GroupCounter: switch both on";
  if (counters_.frames > 0 && counters_.samples == 0 && high_rate_.order() == HighRateOrder::kUnknown &&
      group_.high_rate[0].n > 0) {
    return "it sends high-rate messages only, and which of 061 and 062 is the acceleration shows at rest: "
           "let it stand still for a second, or switch on delta_v and delta_q";
  }
  if (counters_.frames > 0 && counters_.samples == 0 && counters_.bad_contents > 0)
    return "its groups lack rates or accelerations: switch on delta_v and delta_q";
  return {};
}

}  // namespace imuscope::xsens_can
