#include "drivers/nmea/decoder.h"

#include <cmath>

#include "base/units.h"
#include "drivers/device/calendar.h"
#include "drivers/device/feed.h"

namespace imuscope::nmea {
namespace {

constexpr std::int64_t kNsPerSecond = 1'000'000'000;
constexpr std::int64_t kNsPerDay = 86'400 * kNsPerSecond;
/// Below this speed a receiver without a course is taken to stand, m/s.
constexpr double kStandstill_mps = 0.3;

GnssSolution solution_of(int quality) noexcept {
  switch (quality) {
    case 1:
    case 3:
      return GnssSolution::kSingle;  // 3: PPS, an authorised single-point solution
    case 2:
      return GnssSolution::kDifferential;
    case 4:
      return GnssSolution::kFixed;
    case 5:
      return GnssSolution::kFloat;
    default:
      return GnssSolution::kNone;  // 6 dead reckoning, 7 entered, 8 simulated: not of satellites
  }
}

}  // namespace

Decoder::Decoder(const DecoderConfig& config) noexcept
    : config_(config), scanner_(config.per_byte, config.checksum_required), clock_(config.clock) {}

void Decoder::push(std::span<const std::uint8_t> bytes, Arrival arrival, SampleSink& sink) noexcept {
  counters_.bytes += bytes.size();
  feed(scanner_, bytes, arrival.received, [&] { drain(arrival.read, sink, false); });
}

void Decoder::finish(HostTime arrival, SampleSink& sink) noexcept {
  drain(arrival, sink, true);
  publish(arrival, sink);
  mirror_counts();
}

void Decoder::drain(HostTime arrival, SampleSink& sink, bool at_end) noexcept {
  Frame frame;
  while (scanner_.next(frame, at_end)) {
    ++counters_.frames;
    on_sentence(frame, arrival, sink);
  }
  mirror_counts();
}

void Decoder::mirror_counts() noexcept {
  counters_.bytes_skipped = scanner_.counters().bytes_skipped;
  counters_.bad_checksums = scanner_.counters().bad_checksums;
  counters_.clock_resets = clock_.restarts();
}

Decoder::Type Decoder::type_of(std::string_view name) noexcept {
  if (name == "GGA") return Type::kGga;
  if (name == "RMC") return Type::kRmc;
  if (name == "VTG") return Type::kVtg;
  if (name == "GST") return Type::kGst;
  if (name == "ZDA") return Type::kZda;
  return Type::kNone;
}

void Decoder::take(Type type, const Fields& fields) noexcept {
  switch (type) {
    case Type::kGga: {
      const Gga gga{fields};
      epoch_.position = Position{gga.quality().value_or(0), gga.lat_deg(), gga.lon_deg(), gga.alt_msl_m(),
                                 gga.geoid_sep_m()};
      break;
    }
    case Type::kRmc: {
      const Rmc rmc{fields};
      if (rmc.valid()) epoch_.rmc = Course{rmc.sog_kn(), rmc.cog_deg()};
      if (const auto date = rmc.date()) epoch_.date = date;
      break;
    }
    case Type::kVtg: {
      const Vtg vtg{fields};
      epoch_.vtg = Course{vtg.sog_kn(), vtg.cog_deg()};
      break;
    }
    case Type::kGst: {
      const Gst gst{fields};
      epoch_.sd = PositionSd{gst.std_lat_m(), gst.std_lon_m(), gst.std_alt_m()};
      break;
    }
    case Type::kZda:
      if (const auto date = Zda{fields}.date()) epoch_.date = date;
      break;
    case Type::kNone:
      break;
  }
}

void Decoder::on_sentence(const Frame& frame, HostTime arrival, SampleSink& sink) noexcept {
  const Fields fields(frame.sentence);
  const Type type = type_of(fields.type());
  if (type == Type::kNone) return;
  if (type != Type::kVtg) {
    const auto time = fields.time(0);
    if (!time) return;  // a receiver that does not know the time has no solution either
    const std::int64_t tod_ns = from_seconds(time->seconds()).count();
    if (!epoch_.open || tod_ns != epoch_.tod_ns) {
      if (epoch_.open) last_of_epoch_ = epoch_.last;
      publish(arrival, sink);
      epoch_ = Epoch{};
      epoch_.open = true;
      epoch_.tod_ns = tod_ns;
      epoch_.first_byte = frame.first_byte;
    }
  }
  if (!epoch_.open) return;
  take(type, fields);
  epoch_.last = type;
  epoch_.bytes += frame.sentence.size() + 2;  // CR LF
  if (type == last_of_epoch_) publish(arrival, sink);
}

void Decoder::publish(HostTime arrival, SampleSink& sink) noexcept {
  if (!epoch_.open || epoch_.published) return;
  epoch_.published = true;
  unwrap_time();
  update_date();
  if (!epoch_.position && !epoch_.rmc && !epoch_.vtg) return;
  Sample sample{};
  sample.kind = SampleKind::kGnss;
  sample.device = config_.device;
  sample.time = clock_.observe(time_ns_, epoch_.first_byte);
  const auto wire_time = scanner_.per_byte() * static_cast<std::int64_t>(epoch_.bytes);
  sample.arrival = clock_.is_fixed() ? sample.time + wire_time : arrival;
  if (since_1970_minus_time_ns_) {
    sample.has_utc = true;
    sample.utc = utc_time_from_ns(time_ns_ + *since_1970_minus_time_ns_);
  }
  sample.gnss = GnssData{};
  fill_position(sample.gnss);
  fill_velocity(sample.gnss);
  sample.sequence = sequence_++;
  ++counters_.samples;
  sink.on_sample(sample);
}

void Decoder::unwrap_time() noexcept {
  if (has_time_) {
    std::int64_t step = epoch_.tod_ns - last_tod_ns_;
    if (step < -kNsPerDay / 2) step += kNsPerDay;
    if (step > kNsPerDay / 2) step -= kNsPerDay;
    if (is_leap_second(Duration(epoch_.tod_ns), Duration(step))) {
      step += kNsPerSecond;
      // Until the next date comes; UTC shows one second twice.
      if (since_1970_minus_time_ns_) *since_1970_minus_time_ns_ -= kNsPerSecond;
    }
    const double periods =
        config_.period > Duration::zero() ? to_seconds(Duration(step)) / to_seconds(config_.period) : 0.0;
    constexpr double kGapPeriods = 1.5;
    if (periods > kGapPeriods)
      counters_.samples_lost += static_cast<std::uint64_t>(std::llround(periods)) - 1;
    time_ns_ += step;
  } else {
    time_ns_ = epoch_.tod_ns;
  }
  has_time_ = true;
  last_tod_ns_ = epoch_.tod_ns;
}

void Decoder::update_date() noexcept {
  if (!epoch_.date) return;
  const Date& date = *epoch_.date;
  if (date.month < 0 || date.day < 0) return;
  const auto days =
      days_since_1970(date.year, static_cast<unsigned>(date.month), static_cast<unsigned>(date.day));
  if (!days) return;
  since_1970_minus_time_ns_ = *days * kNsPerDay + epoch_.tod_ns - time_ns_;
}

std::string_view Decoder::remark() const noexcept {
  if (!separation_is_missing_) return {};
  return "the receiver gives heights above sea level and no geoid separation; set geoid_separation_m";
}

void Decoder::fill_position(GnssData& gnss) noexcept {
  if (!epoch_.position) return;
  const Position& position = *epoch_.position;
  gnss.solution = solution_of(position.quality);
  const auto separation = position.geoid_sep_m ? position.geoid_sep_m : config_.geoid_separation_m;
  separation_is_missing_ = position.alt_msl_m && !separation;
  if (gnss.solution == GnssSolution::kNone || !position.lat_deg || !position.lon_deg || !position.alt_msl_m ||
      !separation) {
    return;
  }
  gnss.latitude_rad = *position.lat_deg * kRadPerDeg;
  gnss.longitude_rad = *position.lon_deg * kRadPerDeg;
  gnss.height_m = *position.alt_msl_m + *separation;
  gnss.flags |= kPositionValid;
  if (!epoch_.sd) return;
  const auto& [lat_m, lon_m, alt_m] = *epoch_.sd;
  if (lat_m && lon_m && alt_m && *lat_m > 0.0 && *lon_m > 0.0 && *alt_m > 0.0) {
    gnss.sd_position_m = {*lat_m, *lon_m, *alt_m};
    gnss.flags |= kHasPositionSd;
  }
}

void Decoder::fill_velocity(GnssData& gnss) const noexcept {
  const auto& course = epoch_.rmc ? epoch_.rmc : epoch_.vtg;
  if (!course || !course->sog_kn || (epoch_.position && gnss.solution == GnssSolution::kNone)) return;
  const double speed_mps = *course->sog_kn * kMpsPerKnot;
  if (course->cog_deg) {
    const double cog_rad = *course->cog_deg * kRadPerDeg;
    gnss.v_n_mps = {speed_mps * std::cos(cog_rad), speed_mps * std::sin(cog_rad), 0.0};
  } else if (speed_mps > kStandstill_mps) {
    return;
  }
  gnss.flags |= kVelocityValid | kHasVelocitySd;
  gnss.sd_velocity_mps = {config_.horizontal_velocity_sd_mps, config_.horizontal_velocity_sd_mps,
                          config_.vertical_velocity_sd_mps};
}

}  // namespace imuscope::nmea
