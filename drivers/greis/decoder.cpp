#include "drivers/greis/decoder.h"

#include <chrono>
#include <cmath>
#include <numbers>

#include "base/wgs84.h"
#include "drivers/device/calendar.h"
#include "drivers/device/feed.h"
#include "sample/gps_time.h"

namespace imuscope::greis {
namespace {

constexpr std::int64_t kNsPerMs = 1'000'000;
constexpr double kNsPerSecond = 1e9;

/// RTK solutions are late by a few seconds at most; an [ST] further off is not this epoch's.
constexpr std::int64_t kSolutionDelayMaxMs = 60'000;
/// Receivers keep their clock within a millisecond of the reference time, or within half a second at worst.
constexpr double kTimeOffsetMax_s = 0.5;

/// Time of day difference a - b, taken through midnight: in [-12 h, 12 h).
constexpr std::int64_t tod_difference(std::uint32_t a_ms, std::uint32_t b_ms) noexcept {
  std::int64_t difference = static_cast<std::int64_t>(a_ms) - static_cast<std::int64_t>(b_ms);
  if (difference < -kMsPerDay / 2) difference += kMsPerDay;
  if (difference >= kMsPerDay / 2) difference -= kMsPerDay;
  return difference;
}

std::int64_t since_1970_ms(const GpsTime& time) noexcept {
  const std::int64_t rollovers = (kFirstWeek - time.wn + kWeeksPerRollover - 1) / kWeeksPerRollover;
  const std::int64_t week = time.wn + rollovers * kWeeksPerRollover;
  return (kGpsEpochDays + 7 * week) * kMsPerDay + time.tow_ms;
}

GnssSolution solution_of(std::uint8_t soltype) noexcept {
  switch (soltype) {
    case 1:
      return GnssSolution::kSingle;
    case 2:
      return GnssSolution::kDifferential;
    case 3:
      return GnssSolution::kFloat;
    case 4:
      return GnssSolution::kFixed;
    default:
      return GnssSolution::kNone;
  }
}

bool is_sd(double value) noexcept { return std::isfinite(value) && value > 0.0; }

/// North and east from the sd of the plane, down.
std::optional<Vector3> sd_of(std::optional<Sigmas> sigmas, float Sigmas::*horizontal, float Sigmas::*vertical,
                             double own_sigma) noexcept {
  if (sigmas && is_sd((*sigmas).*horizontal) && is_sd((*sigmas).*vertical)) {
    const double one_axis = static_cast<double>((*sigmas).*horizontal) / std::numbers::sqrt2;
    return Vector3{one_axis, one_axis, static_cast<double>((*sigmas).*vertical)};
  }
  if (!is_sd(own_sigma)) return std::nullopt;
  const double one_axis = own_sigma / kSepPerSd;
  return Vector3{one_axis, one_axis, one_axis};
}

bool all_finite(const Vector3& v) noexcept {
  return std::isfinite(v[0]) && std::isfinite(v[1]) && std::isfinite(v[2]);
}

}  // namespace

Decoder::Decoder(const DecoderConfig& config) noexcept
    : config_(config), scanner_(config.per_byte), clock_(config.clock) {}

void Decoder::push(std::span<const std::uint8_t> bytes, Arrival arrival, SampleSink& sink) noexcept {
  counters_.bytes += bytes.size();
  feed(scanner_, bytes, arrival.received, [&] { drain(arrival.read, sink, false); });
}

void Decoder::finish(HostTime arrival, SampleSink& sink) noexcept {
  drain(arrival, sink, true);
  if (in_epoch_) end_epoch(!stream_has_epoch_end_, counters_.bytes, arrival, sink);
  mirror_counts();
}

void Decoder::drain(HostTime arrival, SampleSink& sink, bool at_end) noexcept {
  Frame frame;
  while (scanner_.next(frame, at_end)) {
    ++counters_.frames;
    if (frame.kind == Frame::Kind::kMessage) on_message(frame, arrival, sink);
  }
  mirror_counts();
}

void Decoder::mirror_counts() noexcept {
  counters_.bytes_skipped = scanner_.counters().bytes_skipped;
  counters_.bad_checksums = scanner_.counters().bad_checksums;
  counters_.bad_lengths = scanner_.counters().bad_lengths;
  counters_.bad_contents = bad_messages_ + epochs_damaged_;
  counters_.clock_resets = clock_.restarts();
}

void Decoder::on_message(const Frame& frame, HostTime arrival, SampleSink& sink) noexcept {
  switch (frame.id) {
    case kReceiverTime:
      if (in_epoch_) end_epoch(!stream_has_epoch_end_, frame.offset, arrival, sink);
      begin_epoch(frame);
      break;
    case kEpochTime:
      stream_has_epoch_end_ = true;
      if (in_epoch_) {
        const bool same = parse_time_of_day(frame.body).tod_ms == epoch_.tod_ms;
        end_epoch(same, frame.offset + frame.bytes.size(), arrival, sink);
      }
      break;
    case kUtcOffset:
      leap_s_ = parse_utc_offset(frame.body).leap_s;
      break;
    default: {
      // An unknown message with one '~' in its id was most likely an RT before it was damaged.
      const bool first = frame.bytes[0] == '~';
      const bool second = frame.bytes[1] == '~';
      if (first != second) epoch_.damaged = true;
      if (in_epoch_) on_epoch_message(frame);
      break;
    }
  }
}

void Decoder::on_epoch_message(const Frame& frame) noexcept {
  switch (frame.id) {
    case kReceiverDate:
      epoch_.date = parse_receiver_date(frame.body);
      break;
    case kGpsTime:
      epoch_.gps_time = parse_gps_time(frame.body);
      break;
    case kTimeOffset:
      epoch_.time_offset = parse_time_offset(frame.body);
      break;
    case kSolutionTime:
      epoch_.solution_time = parse_solution_time(frame.body);
      break;
    case kPositionGeodetic:
      epoch_.position_geodetic = parse_position_geodetic(frame.body);
      break;
    case kVelocityGeodetic:
      epoch_.velocity_geodetic = parse_velocity_geodetic(frame.body);
      break;
    case kPositionEcef:
      epoch_.position_ecef = parse_position_ecef(frame.body);
      break;
    case kVelocityEcef:
      epoch_.velocity_ecef = parse_velocity_ecef(frame.body);
      break;
    case kPositionVelocityEcef: {
      const PositionVelocityEcef pv = parse_position_velocity_ecef(frame.body);
      epoch_.position_ecef = pv.position;
      epoch_.velocity_ecef = pv.velocity;
      break;
    }
    case kSigmas:
      epoch_.sigmas = parse_sigmas(frame.body);
      break;
    default:
      break;
  }
}

void Decoder::begin_epoch(const Frame& frame) noexcept {
  ++epochs_;
  in_epoch_ = true;
  epoch_ = Epoch{};
  epoch_.tod_ms = parse_time_of_day(frame.body).tod_ms;
  epoch_.first_byte = frame.first_byte;
  epoch_.offset = frame.offset;
  epoch_.skipped_before = scanner_.counters().bytes_skipped;
  if (epoch_.tod_ms >= kMsPerDay) epoch_.damaged = true;
}

void Decoder::end_epoch(bool complete, std::uint64_t end_offset, HostTime arrival,
                        SampleSink& sink) noexcept {
  in_epoch_ = false;
  if (!complete || epoch_.damaged || scanner_.counters().bytes_skipped != epoch_.skipped_before) {
    ++epochs_damaged_;
    return;
  }
  if (!unwrap_time(epoch_.tod_ms)) {
    ++bad_messages_;
    return;
  }
  update_date();

  std::int64_t delay_ms = 0;
  if (epoch_.solution_time) {
    delay_ms = tod_difference(epoch_.tod_ms, epoch_.solution_time->time_ms);
    if (delay_ms < 0 || delay_ms > kSolutionDelayMaxMs) {
      ++bad_messages_;
      return;
    }
  }
  double offset_s = epoch_.time_offset ? epoch_.time_offset->val_s : 0.0;
  if (!(std::abs(offset_s) < kTimeOffsetMax_s)) offset_s = 0.0;
  const auto offset_ns = static_cast<std::int64_t>(std::llround(offset_s * kNsPerSecond));

  Sample sample{};
  sample.kind = SampleKind::kGnss;
  sample.device = config_.device;
  const HostTime epoch_time = clock_.observe(time_ms_ * kNsPerMs + offset_ns, epoch_.first_byte);
  const auto wire_time = scanner_.per_byte() * static_cast<std::int64_t>(end_offset - epoch_.offset);
  sample.arrival = clock_.is_fixed() ? epoch_time + wire_time : arrival;
  sample.time = epoch_time - Duration(delay_ms * kNsPerMs);
  if (since_1970_minus_time_ms_) {
    std::int64_t utc_ms = time_ms_ - delay_ms + *since_1970_minus_time_ms_;
    if (base_ == TimeBase::kGps) utc_ms -= 1000LL * leap_s_.value_or(gps_minus_utc_s(utc_ms / 1000));
    if (base_ == TimeBase::kGlonass) utc_ms -= kGlonassMinusUtcMs;
    sample.has_utc = true;
    sample.utc = utc_time_from_ns(utc_ms * kNsPerMs + offset_ns);
  }
  sample.gnss = GnssData{};
  fill_position(sample.gnss);
  fill_velocity(sample.gnss);
  sample.sequence = sequence_++;
  ++counters_.samples;
  sink.on_sample(sample);
}

/// False for an epoch that came twice.
bool Decoder::unwrap_time(std::uint32_t tod_ms) noexcept {
  if (!has_time_) {
    time_ms_ = tod_ms;
  } else {
    const std::int64_t step = tod_difference(tod_ms, last_tod_ms_);
    if (step == 0) return false;
    const auto period_ms = std::chrono::duration_cast<std::chrono::milliseconds>(config_.period).count();
    if (period_ms > 0 && 2 * step > 3 * period_ms) {
      counters_.samples_lost += static_cast<std::uint64_t>((step + period_ms / 2) / period_ms - 1);
    }
    time_ms_ += step;
  }
  has_time_ = true;
  last_tod_ms_ = tod_ms;
  return true;
}

void Decoder::update_date() noexcept {
  if (epoch_.date && epoch_.date->base <= static_cast<std::uint8_t>(TimeBase::kUtcSu)) {
    if (const auto days = days_since_1970(epoch_.date->year, epoch_.date->month, epoch_.date->day)) {
      since_1970_minus_time_ms_ = *days * kMsPerDay + epoch_.tod_ms - time_ms_;
      base_ = static_cast<TimeBase>(epoch_.date->base);
      date_from_receiver_date_ = true;
    }
  }
  if (epoch_.gps_time && !date_from_receiver_date_) {
    since_1970_minus_time_ms_ = since_1970_ms(*epoch_.gps_time) - time_ms_;
    base_ = TimeBase::kGps;
  }
}

void Decoder::fill_position(GnssData& gnss) const noexcept {
  double own_sigma = 0.0;
  if (epoch_.position_geodetic) {
    const PositionGeodetic& p = *epoch_.position_geodetic;
    gnss.solution = solution_of(p.soltype);
    gnss.latitude_rad = p.lat_rad;
    gnss.longitude_rad = p.lon_rad;
    gnss.height_m = p.alt_m;
    own_sigma = p.psigma;
  } else if (epoch_.position_ecef) {
    const PositionEcef& p = *epoch_.position_ecef;
    gnss.solution = solution_of(p.soltype);
    const Geodetic geodetic = geodetic_of(p.xyz_m);
    gnss.latitude_rad = geodetic.lat_rad;
    gnss.longitude_rad = geodetic.lon_rad;
    gnss.height_m = geodetic.height_m;
    own_sigma = p.psigma;
  }
  if (!all_finite({gnss.latitude_rad, gnss.longitude_rad, gnss.height_m}))
    gnss.solution = GnssSolution::kNone;
  if (gnss.solution == GnssSolution::kNone) {
    gnss.latitude_rad = gnss.longitude_rad = gnss.height_m = 0.0;
    return;
  }
  gnss.flags |= kPositionValid;
  if (const auto sd = sd_of(epoch_.sigmas, &Sigmas::hpos, &Sigmas::vpos, own_sigma)) {
    gnss.sd_position_m = *sd;
    gnss.flags |= kHasPositionSd;
  }
}

void Decoder::fill_velocity(GnssData& gnss) const noexcept {
  double own_sigma = 0.0;
  GnssSolution solution = GnssSolution::kNone;
  Vector3 v_n_mps{};
  if (epoch_.velocity_geodetic) {
    const VelocityGeodetic& v = *epoch_.velocity_geodetic;
    v_n_mps = {v.north, v.east, -static_cast<double>(v.up)};
    solution = solution_of(v.soltype);
    own_sigma = v.vsigma;
  } else if (epoch_.velocity_ecef && (gnss.flags & kPositionValid) != 0) {
    const VelocityEcef& v = *epoch_.velocity_ecef;
    v_n_mps =
        ned_of({v.v_mps[0], v.v_mps[1], v.v_mps[2]}, {gnss.latitude_rad, gnss.longitude_rad, gnss.height_m});
    solution = solution_of(v.soltype);
    own_sigma = v.vsigma;
  }
  if (solution == GnssSolution::kNone || !all_finite(v_n_mps)) return;
  gnss.v_n_mps = v_n_mps;
  gnss.flags |= kVelocityValid;
  if (const auto sd = sd_of(epoch_.sigmas, &Sigmas::hvel, &Sigmas::vvel, own_sigma)) {
    gnss.sd_velocity_mps = *sd;
    gnss.flags |= kHasVelocitySd;
  }
}

}  // namespace imuscope::greis
