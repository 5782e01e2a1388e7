#include "drivers/ubx/decoder.h"

#include <chrono>
#include <cmath>
#include <numbers>

#include "base/units.h"
#include "drivers/device/calendar.h"

namespace imuscope::ubx {
namespace {

constexpr double kDegPerCount = 1e-7;
constexpr double kMetrePerMm = 1e-3;
constexpr std::int64_t kNsPerMs = 1'000'000;

std::optional<UtcTime> utc_of(const NavPvt& pvt) noexcept {
  constexpr std::uint8_t kBoth = kValidDate | kValidTime;
  const auto days = days_since_1970(pvt.year, pvt.month, pvt.day);
  if ((pvt.valid & kBoth) != kBoth || !days) return std::nullopt;
  return UtcTime{std::chrono::days(*days)} + std::chrono::hours(pvt.hour) + std::chrono::minutes(pvt.minute) +
         std::chrono::seconds(pvt.sec) + Duration(pvt.nano);
}

GnssSolution solution_of(const NavPvt& pvt) noexcept {
  const bool fixed_in_space = pvt.fix == kFix3D || pvt.fix == kFixWithDeadReckoning;
  if ((pvt.flags & kFixOk) == 0 || !fixed_in_space) return GnssSolution::kNone;
  switch (pvt.flags >> kCarrierShift) {
    case 1:
      return GnssSolution::kFloat;
    case 2:
      return GnssSolution::kFixed;
    default:
      break;
  }
  return (pvt.flags & kDifferential) != 0 ? GnssSolution::kDifferential : GnssSolution::kSingle;
}

void fill(const NavPvt& pvt, GnssData& gnss) noexcept {
  gnss.solution = solution_of(pvt);
  if (gnss.solution == GnssSolution::kNone) return;
  gnss.latitude_rad = pvt.lat * kDegPerCount * kRadPerDeg;
  gnss.longitude_rad = pvt.lon * kDegPerCount * kRadPerDeg;
  gnss.height_m = pvt.h * kMetrePerMm;
  gnss.v_n_mps = {pvt.vn * kMetrePerMm, pvt.ve * kMetrePerMm, pvt.vd * kMetrePerMm};
  gnss.flags = kPositionValid | kVelocityValid;
  if (pvt.hacc > 0 && pvt.vacc > 0) {
    const double one_axis_m = pvt.hacc * kMetrePerMm / std::numbers::sqrt2;
    gnss.sd_position_m = {one_axis_m, one_axis_m, pvt.vacc * kMetrePerMm};
    gnss.flags |= kHasPositionSd;
  }
  if (pvt.sacc > 0) {
    const double one_axis_mps = pvt.sacc * kMetrePerMm / std::numbers::sqrt3;
    gnss.sd_velocity_mps = {one_axis_mps, one_axis_mps, one_axis_mps};
    gnss.flags |= kHasVelocitySd;
  }
}

}  // namespace

Decoder::Decoder(const DecoderConfig& config) noexcept
    : config_(config), scanner_(byte_time(config.baud)), clock_(config.clock) {}

void Decoder::push(std::span<const std::uint8_t> bytes, HostTime arrival, SampleSink& sink) noexcept {
  counters_.bytes += bytes.size();
  while (!bytes.empty()) {
    bytes = bytes.subspan(scanner_.append(bytes, arrival));
    drain(arrival, sink, false);
  }
}

void Decoder::finish(HostTime arrival, SampleSink& sink) noexcept { drain(arrival, sink, true); }

void Decoder::drain(HostTime arrival, SampleSink& sink, bool at_end) noexcept {
  Frame frame;
  while (scanner_.next(frame, at_end)) {
    ++counters_.frames;
    if (frame.kind != Frame::Kind::kMessage) continue;
    if (frame.message_class == kClassNav && frame.id == kIdPvt) on_pvt(frame, arrival, sink);
  }
  counters_.bytes_skipped = scanner_.counters().bytes_skipped;
  counters_.bad_checksums = scanner_.counters().bad_checksums;
  counters_.bad_lengths = scanner_.counters().bad_lengths;
  counters_.bad_contents = bad_messages_;
  counters_.clock_resets = clock_.restarts();
}

void Decoder::on_pvt(const Frame& frame, HostTime arrival, SampleSink& sink) noexcept {
  if (frame.payload.size() < kPvtMin) {
    ++bad_messages_;
    return;
  }
  const NavPvt pvt = parse_nav_pvt(frame.payload);
  if (pvt.itow >= kMsPerWeek || !unwrap_time(pvt.itow)) {
    ++bad_messages_;
    return;
  }
  Sample sample{};
  sample.kind = SampleKind::kGnss;
  sample.device = config_.device;
  sample.time = clock_.observe(time_ms_ * kNsPerMs, frame.first_byte);
  const auto wire_time = byte_time(config_.baud) * static_cast<std::int64_t>(frame.bytes.size());
  sample.arrival = clock_.is_fixed() ? sample.time + wire_time : arrival;
  if (const auto utc = utc_of(pvt)) {
    sample.has_utc = true;
    sample.utc = *utc;
  }
  sample.gnss = GnssData{};
  fill(pvt, sample.gnss);
  sample.sequence = sequence_++;
  ++counters_.samples;
  sink.on_sample(sample);
}

/// False for an epoch that came twice.
bool Decoder::unwrap_time(std::uint32_t itow_ms) noexcept {
  if (last_itow_ms_) {
    std::int64_t step = static_cast<std::int64_t>(itow_ms) - static_cast<std::int64_t>(*last_itow_ms_);
    if (step < -kMsPerWeek / 2) step += kMsPerWeek;
    if (step > kMsPerWeek / 2) step -= kMsPerWeek;
    if (step == 0) return false;
    const auto period_ms = std::chrono::duration_cast<std::chrono::milliseconds>(config_.period).count();
    if (period_ms > 0 && 2 * step > 3 * period_ms) {
      counters_.samples_lost += static_cast<std::uint64_t>((step + period_ms / 2) / period_ms - 1);
    }
    time_ms_ += step;
  } else {
    time_ms_ = itow_ms;
  }
  last_itow_ms_ = itow_ms;
  return true;
}

}  // namespace imuscope::ubx
