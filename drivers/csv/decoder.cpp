#include "drivers/csv/decoder.h"

#include <algorithm>
#include <charconv>
#include <cmath>

#include "base/units.h"
#include "drivers/device/feed.h"

namespace imuscope::csv {
namespace {

/// A gap is a step of more than this many periods.
constexpr double kGapPeriods = 1.5;
/// Integers above are not exact in a double.
constexpr double kCounterMax = 9007199254740992.0;
/// A counter that wraps at 2^16 or 2^32 has lost fewer samples than this at its wrap.
constexpr std::int64_t kLostAtWrapMax = 30'000;

constexpr double kTimeMax_s = 4e9;  ///< the clock map's range, 2^62 ns

bool any_named(const std::array<std::string, 3>& columns) {
  return std::any_of(columns.begin(), columns.end(), [](const std::string& name) { return !name.empty(); });
}

bool is_turned(const std::string& column) { return column.size() > 1 && column.front() == '-'; }

std::string without_sign(const std::string& column) { return is_turned(column) ? column.substr(1) : column; }

Vector3 units_of(const std::array<std::string, 3>& columns, double unit) {
  Vector3 units{};
  for (std::size_t i = 0; i < units.size(); ++i) units[i] = is_turned(columns[i]) ? -unit : unit;
  return units;
}

std::vector<Column> columns_of(const ImuConfig& config) {
  std::vector<Column> columns{{config.time_column}};
  for (const std::string& name : config.gyro_columns) columns.push_back({without_sign(name)});
  for (const std::string& name : config.accel_columns) columns.push_back({without_sign(name)});
  if (!config.counter_column.empty()) columns.push_back({config.counter_column});
  return columns;
}

std::vector<Column> columns_of(const GnssConfig& config) {
  std::vector<Column> columns{
      {config.time_column}, {config.latitude_column}, {config.longitude_column}, {config.height_column}};
  for (const auto* group :
       {&config.velocity_columns, &config.position_sd_columns, &config.velocity_sd_columns}) {
    if (!any_named(*group)) continue;
    for (const std::string& name : *group) columns.push_back({name, false});
  }
  if (!config.solution_column.empty()) columns.push_back({config.solution_column});
  return columns;
}

GnssSolution solution_of(SolutionCode code, double value) noexcept {
  constexpr std::array kRtklib{
      GnssSolution::kNone,         GnssSolution::kFixed,  GnssSolution::kFloat, GnssSolution::kDifferential,
      GnssSolution::kDifferential, GnssSolution::kSingle, GnssSolution::kSingle};
  constexpr std::array kNmea{GnssSolution::kNone,         GnssSolution::kSingle, GnssSolution::kDifferential,
                             GnssSolution::kDifferential, GnssSolution::kFixed,  GnssSolution::kFloat};
  const auto pick = [value](const auto& table) {
    const bool inside = value >= 0.0 && value < static_cast<double>(table.size());
    return inside ? table[static_cast<std::size_t>(value)] : GnssSolution::kNone;
  };
  return code == SolutionCode::kRtklib ? pick(kRtklib) : pick(kNmea);
}

Vector3 three(std::span<const double> values, std::size_t at) noexcept {
  return {values[at], values[at + 1], values[at + 2]};
}

bool all_finite(const Vector3& v) noexcept {
  return std::isfinite(v[0]) && std::isfinite(v[1]) && std::isfinite(v[2]);
}

bool all_positive(const Vector3& v) noexcept {
  return all_finite(v) && v[0] > 0.0 && v[1] > 0.0 && v[2] > 0.0;
}

Vector3 rotate(const std::array<double, 9>& axes, const Vector3& v, const Vector3& units) noexcept {
  Vector3 rotated{};
  for (std::size_t i = 0; i < 3; ++i) {
    for (std::size_t j = 0; j < 3; ++j) rotated[i] += axes[3 * i + j] * (v[j] * units[j]);
  }
  return rotated;
}

}  // namespace

std::uint64_t RowPeriod::missing(Duration step) noexcept {
  if (period_ == Duration::zero()) {
    if (step > Duration::zero()) steps_[n_steps_++] = step;
    if (n_steps_ == kLearn) {
      std::nth_element(steps_.begin(), steps_.begin() + kLearn / 2, steps_.end());
      period_ = steps_[kLearn / 2];
    }
    return 0;
  }
  const double periods = to_seconds(step) / to_seconds(period_);
  return periods > kGapPeriods ? static_cast<std::uint64_t>(std::llround(periods)) - 1 : 0;
}

RowDecoder::RowDecoder(std::vector<Column> columns, double time_unit_s, double time_offset_s, Duration period,
                       const ClockMapConfig& clock, DeviceIndex device)
    : reader_(std::move(columns)),
      clock_(clock),
      period_(period),
      time_unit_s_(time_unit_s),
      time_offset_s_(time_offset_s),
      device_(device) {}

void RowDecoder::push(std::span<const std::uint8_t> bytes, Arrival arrival, SampleSink& sink) noexcept {
  counters_.bytes += bytes.size();
  feed(reader_, bytes, arrival.received, [&] { drain(arrival.read, sink, false); });
}

void RowDecoder::finish(HostTime arrival, SampleSink& sink) noexcept { drain(arrival, sink, true); }

void RowDecoder::drain(HostTime arrival, SampleSink& sink, bool at_end) noexcept {
  for (;;) {
    bool bad = false;
    switch (reader_.next_line(at_end)) {
      case RowReader::Line::kNeedMore:
        return;
      case RowReader::Line::kNothing:
        break;
      case RowReader::Line::kRow:
        bad = !take_row(arrival, sink);
        break;
      case RowReader::Line::kBad:
        bad = true;
        break;
    }
    if (!bad) continue;
    ++counters_.bad_contents;
    counters_.bytes_skipped += reader_.line_size();
  }
}

bool RowDecoder::take_row(HostTime arrival, SampleSink& sink) noexcept {
  const auto values = reader_.values();
  const double time_s = values[0] * time_unit_s_ + time_offset_s_;
  if (!(std::abs(time_s) < kTimeMax_s)) {
    report(RowError::Kind::kOutOfRange, 0, values[0]);
    return false;
  }
  const std::int64_t time_ns = from_seconds(time_s).count();
  if (last_time_ns_ && time_ns < *last_time_ns_) {
    report(RowError::Kind::kTimeGoesBack, 0, values[0]);
    return false;
  }
  Sample sample{};
  sample.device = device_;
  const std::uint64_t missing = last_time_ns_ ? period_.missing(Duration(time_ns - *last_time_ns_)) : 0;
  if (!fill(values, missing, sample)) return false;
  last_time_ns_ = time_ns;
  sample.time = clock_.observe(time_ns, reader_.first_byte());
  sample.arrival = clock_.is_fixed() ? sample.time : arrival;
  sample.sequence = sequence_++;
  ++counters_.frames;
  ++counters_.samples;
  counters_.clock_resets = std::max(counters_.clock_resets, clock_.restarts());
  sink.on_sample(sample);
  return true;
}

void RowDecoder::report(RowError::Kind kind, std::size_t column, double value) noexcept {
  std::array<char, 32> text{};
  const auto end = std::to_chars(text.data(), text.data() + text.size(), value).ptr;
  reader_.report(kind, column, {text.data(), static_cast<std::size_t>(end - text.data())});
}

ImuDecoder::ImuDecoder(const ImuConfig& config)
    : RowDecoder(columns_of(config), config.time_unit_s, config.time_offset_s, config.period, config.clock,
                 config.device),
      axes_(config.axes),
      gyro_units_radps_(
          units_of(config.gyro_columns, config.gyro_unit == AngularRateUnit::kDegps ? kRadPerDeg : 1.0)),
      accel_units_mps2_(
          units_of(config.accel_columns, config.accel_unit == AccelerationUnit::kG ? kMps2PerG : 1.0)),
      has_counter_(!config.counter_column.empty()) {}

bool ImuDecoder::fill(std::span<const double> values, std::uint64_t missing_before, Sample& sample) noexcept {
  constexpr std::size_t kGyroAt = 1, kAccelAt = 4, kCounterAt = 7;
  sample.kind = SampleKind::kImu;
  sample.imu = ImuData{};
  ImuData& imu = sample.imu;
  imu.flags = kGyroValid | kAccelValid;
  if (has_counter_) {
    if (!take_counter(values[kCounterAt], imu)) return false;
  } else {
    imu.counter = row_++;
    counters_.samples_lost += missing_before;
    if (missing_before > 0) imu.flags |= kGapBefore;
  }
  imu.omega_radps = rotate(axes_, three(values, kGyroAt), gyro_units_radps_);
  imu.f_mps2 = rotate(axes_, three(values, kAccelAt), accel_units_mps2_);
  return true;
}

bool ImuDecoder::take_counter(double value, ImuData& imu) noexcept {
  constexpr std::size_t kCounterAt = 7;
  if (!(std::abs(value) < kCounterMax) || value != std::floor(value)) {
    report(RowError::Kind::kOutOfRange, kCounterAt, value);
    return false;
  }
  std::int64_t counter = static_cast<std::int64_t>(value) + unwrapped_by_;
  if (last_counter_ && counter <= *last_counter_) {
    for (const std::int64_t modulus : {std::int64_t{1} << 16U, std::int64_t{1} << 32U}) {
      const std::int64_t step = counter + modulus - *last_counter_;
      if (step < 1 || step > kLostAtWrapMax) continue;
      unwrapped_by_ += modulus;
      counter += modulus;
      break;
    }
  }
  if (last_counter_) {
    const std::int64_t step = counter - *last_counter_;
    if (step == 0) {
      report(RowError::Kind::kOutOfRange, kCounterAt, value);
      return false;
    }
    if (step < 0) ++counters_.clock_resets;
    if (step > 1) counters_.samples_lost += static_cast<std::uint64_t>(step - 1);
    if (step != 1) imu.flags |= kGapBefore;
  }
  last_counter_ = counter;
  imu.counter = counter;
  return true;
}

GnssDecoder::GnssDecoder(const GnssConfig& config)
    : RowDecoder(columns_of(config), config.time_unit_s, config.time_offset_s, config.period, config.clock,
                 config.device),
      solution_code_(config.solution_code),
      solution_without_column_(config.solution_without_column) {
  std::size_t at = 4;
  const auto place = [&at](const std::array<std::string, 3>& group) {
    if (!any_named(group)) return std::size_t{0};
    at += group.size();
    return at - group.size();
  };
  velocity_at_ = place(config.velocity_columns);
  position_sd_at_ = place(config.position_sd_columns);
  velocity_sd_at_ = place(config.velocity_sd_columns);
  solution_at_ = config.solution_column.empty() ? 0 : at;
}

bool GnssDecoder::fill(std::span<const double> values, std::uint64_t missing_before,
                       Sample& sample) noexcept {
  constexpr std::size_t kLatitudeAt = 1, kLongitudeAt = 2, kHeightAt = 3;
  if (std::abs(values[kLatitudeAt]) > 90.0) {
    report(RowError::Kind::kOutOfRange, kLatitudeAt, values[kLatitudeAt]);
    return false;
  }
  if (std::abs(values[kLongitudeAt]) > 360.0) {
    report(RowError::Kind::kOutOfRange, kLongitudeAt, values[kLongitudeAt]);
    return false;
  }
  counters_.samples_lost += missing_before;
  sample.kind = SampleKind::kGnss;
  sample.gnss = GnssData{};
  GnssData& gnss = sample.gnss;
  gnss.latitude_rad = values[kLatitudeAt] * kRadPerDeg;
  gnss.longitude_rad = std::remainder(values[kLongitudeAt] * kRadPerDeg, 2.0 * kPi);
  gnss.height_m = values[kHeightAt];
  gnss.solution =
      solution_at_ == 0 ? solution_without_column_ : solution_of(solution_code_, values[solution_at_]);
  if (gnss.solution == GnssSolution::kNone) return true;
  gnss.flags |= kPositionValid;
  if (position_sd_at_ != 0 && all_positive(three(values, position_sd_at_))) {
    gnss.sd_position_m = three(values, position_sd_at_);
    gnss.flags |= kHasPositionSd;
  }
  if (velocity_at_ == 0 || !all_finite(three(values, velocity_at_))) return true;
  gnss.v_n_mps = three(values, velocity_at_);
  gnss.flags |= kVelocityValid;
  if (velocity_sd_at_ != 0 && all_positive(three(values, velocity_sd_at_))) {
    gnss.sd_velocity_mps = three(values, velocity_sd_at_);
    gnss.flags |= kHasVelocitySd;
  }
  return true;
}

}  // namespace imuscope::csv
