#include "drivers/rtklib_pos/decoder.h"

#include <algorithm>
#include <cmath>

#include "base/units.h"
#include "base/wgs84.h"
#include "drivers/device/feed.h"
#include "sample/gps_time.h"

namespace imuscope::rtklib_pos {
namespace {

constexpr std::int64_t kJstMinusUtcNs = 9 * 3600 * kNsPerSecond;
constexpr double kGapPeriods = 1.5;
/// Coordinates nearer to the centre of the Earth are none.
constexpr double kRadiusMin_m = 6.0e6;

GnssSolution solution_of(int q) noexcept {
  switch (q) {
    case 1:
      return GnssSolution::kFixed;
    case 2:
    case 6:
      return GnssSolution::kFloat;  // 6: PPP, decimetres as a float solution
    case 3:
    case 4:
      return GnssSolution::kDifferential;
    case 5:
      return GnssSolution::kSingle;
    default:
      return GnssSolution::kNone;
  }
}

UtcTime utc_of(std::int64_t time_ns, TimeSystem system) noexcept {
  switch (system) {
    case TimeSystem::kGpst:
      time_ns -= gps_minus_utc_s(time_ns / kNsPerSecond) * kNsPerSecond;
      break;
    case TimeSystem::kJst:
      time_ns -= kJstMinusUtcNs;
      break;
    case TimeSystem::kUtc:
      break;
  }
  return utc_time_from_ns(time_ns);
}

Vector3 square_roots(const Vector3& v) noexcept {
  return {std::sqrt(std::max(v[0], 0.0)), std::sqrt(std::max(v[1], 0.0)), std::sqrt(std::max(v[2], 0.0))};
}

bool all_positive(const Vector3& v) noexcept { return v[0] > 0.0 && v[1] > 0.0 && v[2] > 0.0; }

/// Variances along north, east, down of a covariance in x, y, z.
Vector3 ned_variance(const Vector3& variance, const Vector3& xy_yz_zx,
                     const std::array<double, 9>& c) noexcept {
  Vector3 ned{};
  for (std::size_t i = 0; i < 3; ++i) {
    const double x = c[3 * i], y = c[3 * i + 1], z = c[3 * i + 2];
    ned[i] = x * x * variance[0] + y * y * variance[1] + z * z * variance[2] +
             2.0 * (x * y * xy_yz_zx[0] + y * z * xy_yz_zx[1] + z * x * xy_yz_zx[2]);
  }
  return ned;
}

}  // namespace

Decoder::Decoder(const DecoderConfig& config) noexcept
    : config_(config),
      scanner_(config.per_byte),
      clock_(config.clock),
      format_(config.format),
      base_(config.base) {}

void Decoder::push(std::span<const std::uint8_t> bytes, Arrival arrival, SampleSink& sink) noexcept {
  counters_.bytes += bytes.size();
  feed(scanner_, bytes, arrival.received, [&] { drain(arrival.read, sink, false); });
}

std::string_view Decoder::remark() const noexcept {
  if (base_is_missing_)
    return "the solutions are relative to a base whose place is not known; set base_lat_lon_height";
  if (format_.geodetic_height)
    return "the heights are above the geoid; set RTKLIB's output height to "
           "ellipsoidal (out-height =ellipsoidal)";
  return {};
}

void Decoder::finish(HostTime arrival, SampleSink& sink) noexcept { drain(arrival, sink, true); }

void Decoder::drain(HostTime arrival, SampleSink& sink, bool at_end) noexcept {
  Frame frame;
  while (scanner_.next(frame, at_end)) {
    if (frame.line[0] == kCommentMark) {
      (void)read_comment(frame.line, format_, base_);
      continue;
    }
    const auto solution = parse_solution(frame.line, format_);
    if (solution && on_solution(*solution, frame.first_byte, arrival, sink)) continue;
    ++bad_lines_;
    bytes_of_bad_lines_ += frame.size;
  }
  counters_.bytes_skipped = bytes_of_bad_lines_ + scanner_.counters().bytes_skipped;
  counters_.bad_contents = bad_lines_;
  counters_.bad_lengths = scanner_.counters().bad_lengths;
}

bool Decoder::on_solution(const Solution& solution, HostTime first_byte, HostTime arrival,
                          SampleSink& sink) noexcept {
  if (last_time_ns_ && solution.time_ns == *last_time_ns_) return false;  // the same epoch again
  Sample sample{};
  sample.kind = SampleKind::kGnss;
  sample.device = config_.device;
  sample.gnss = GnssData{};
  if (!fill(solution, sample.gnss)) return false;
  if (last_time_ns_ && config_.period > Duration::zero()) {
    const double periods =
        to_seconds(Duration(solution.time_ns - *last_time_ns_)) / to_seconds(config_.period);
    if (periods > kGapPeriods)
      counters_.samples_lost += static_cast<std::uint64_t>(std::llround(periods)) - 1;
  }
  last_time_ns_ = solution.time_ns;
  sample.time = clock_.observe(solution.time_ns, first_byte);
  sample.arrival = clock_.is_fixed() ? sample.time : arrival;
  sample.has_utc = true;
  sample.utc = utc_of(solution.time_ns, format_.time_system);
  sample.sequence = sequence_++;
  ++counters_.frames;
  ++counters_.samples;
  counters_.clock_resets = clock_.restarts();
  sink.on_sample(sample);
  return true;
}

bool Decoder::fill(const Solution& solution, GnssData& gnss) noexcept {
  const auto& c = solution.coordinates;
  Geodetic at{};
  Vector3 variance_ned{};
  switch (format_.layout) {
    case Layout::kLlh:
    case Layout::kLlhDms:
      if (std::abs(c[0]) > 90.0 || std::abs(c[1]) > 360.0) return false;
      at = {c[0] * kRadPerDeg, std::remainder(c[1] * kRadPerDeg, 2.0 * kPi), c[2]};
      variance_ned = {solution.variance[0], solution.variance[1], solution.variance[2]};
      gnss.v_n_mps = {solution.velocity[0], solution.velocity[1], -solution.velocity[2]};
      gnss.sd_velocity_mps = solution.velocity_sd;
      break;
    case Layout::kXyz:
      if (std::hypot(c[0], c[1], c[2]) < kRadiusMin_m) return false;
      at = geodetic_of(c);
      variance_ned = ned_variance(solution.variance, solution.covariance, rotation_ecef_to_ned(at));
      gnss.v_n_mps = ned_of(solution.velocity, at);
      // Without their cross terms the velocity's standard deviations are rotated as independent ones.
      gnss.sd_velocity_mps = square_roots(ned_variance({solution.velocity_sd[0] * solution.velocity_sd[0],
                                                        solution.velocity_sd[1] * solution.velocity_sd[1],
                                                        solution.velocity_sd[2] * solution.velocity_sd[2]},
                                                       {}, rotation_ecef_to_ned(at)));
      break;
    case Layout::kEnu: {
      base_is_missing_ = !base_;
      if (!base_) return false;
      const Geodetic base{base_->lat_deg * kRadPerDeg, base_->lon_deg * kRadPerDeg, base_->height_m};
      const auto to_ned = rotation_ecef_to_ned(base);
      const Vector3 ned{c[1], c[0], -c[2]};
      auto xyz = ecef_of(base);
      for (std::size_t i = 0; i < 3; ++i) {
        for (std::size_t j = 0; j < 3; ++j) xyz[i] += to_ned[3 * j + i] * ned[j];
      }
      at = geodetic_of(xyz);
      variance_ned = {solution.variance[1], solution.variance[0], solution.variance[2]};
      gnss.v_n_mps = {solution.velocity[1], solution.velocity[0], -solution.velocity[2]};
      gnss.sd_velocity_mps = {solution.velocity_sd[1], solution.velocity_sd[0], solution.velocity_sd[2]};
      break;
    }
  }
  gnss.latitude_rad = at.lat_rad;
  gnss.longitude_rad = at.lon_rad;
  gnss.height_m = at.height_m;
  gnss.solution = solution_of(solution.q);
  if (gnss.solution == GnssSolution::kNone) return true;
  // A height above the geoid is not the one that navigation needs.
  if (!format_.geodetic_height) gnss.flags |= kPositionValid;
  gnss.sd_position_m = square_roots(variance_ned);
  if (all_positive(gnss.sd_position_m)) gnss.flags |= kHasPositionSd;
  if (!format_.has_velocity) return true;
  gnss.flags |= kVelocityValid;
  if (all_positive(gnss.sd_velocity_mps)) gnss.flags |= kHasVelocitySd;
  return true;
}

}  // namespace imuscope::rtklib_pos
