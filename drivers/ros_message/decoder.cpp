#include "drivers/ros_message/decoder.h"

#include <algorithm>
#include <cmath>

#include "base/bytes.h"
#include "base/units.h"
#include "drivers/device/feed.h"
#include "logs/mcap/records.h"

namespace imuscope::ros_message {
namespace {

constexpr double kGapPeriods = 1.5;
constexpr double kNsPerS = 1e9;
/// The clock map's range is 2^62 ns.
constexpr std::int64_t kTimeMost_ns = std::int64_t{4'000'000'000} * 1'000'000'000;

Examined examine(std::span<const std::uint8_t> pending) noexcept {
  const std::size_t n = std::min(pending.size(), kMark.size());
  if (!std::equal(pending.begin(), pending.begin() + static_cast<std::ptrdiff_t>(n), kMark.begin()))
    return {Verdict::kFalseStart};
  if (pending.size() < kHeadBytes) return {Verdict::kNeedMore};
  const std::size_t values = value_count(static_cast<Kind>(pending[4]));
  if (values == 0) return {Verdict::kBadLength};
  const std::size_t size = kHeadBytes + values * sizeof(double) + kChecksumBytes;
  if (pending.size() < size) return {Verdict::kNeedMore};
  const std::size_t summed = size - kChecksumBytes;
  const bool is_right = mcap::crc32_of(pending.first(summed)) == read_le<std::uint32_t>(pending, summed);
  return {is_right ? Verdict::kFrame : Verdict::kBadChecksum, size};
}

bool all_finite(const Content& content) noexcept {
  return std::all_of(content.values.begin(), content.values.end(), [](double v) { return std::isfinite(v); });
}

Vector3 three(const Content& content, std::size_t at) noexcept {
  return {content.values[at], content.values[at + 1], content.values[at + 2]};
}

Vector3 rotate(const std::array<double, 9>& axes, const Vector3& v) noexcept {
  Vector3 rotated{};
  for (std::size_t i = 0; i < 3; ++i) {
    for (std::size_t j = 0; j < 3; ++j) rotated[i] += axes[3 * i + j] * v[j];
  }
  return rotated;
}

bool fill_gnss(const Content& content, GnssData& gnss) noexcept {
  gnss = GnssData{};
  const auto& values = content.values;
  if (std::abs(values[0]) > kPi / 2.0 || std::abs(values[1]) > 2.0 * kPi) return false;
  gnss.latitude_rad = values[0];
  gnss.longitude_rad = std::remainder(values[1], 2.0 * kPi);
  gnss.height_m = values[2];
  const auto solution = content.flags & kSolutionBits;
  if (solution > static_cast<std::uint8_t>(GnssSolution::kFixed)) return false;
  gnss.solution = static_cast<GnssSolution>(solution);
  if (gnss.solution == GnssSolution::kNone) return true;
  gnss.flags = kPositionValid;
  gnss.sd_position_m = three(content, 3);
  if ((content.flags & kHasSdPosition) != 0) gnss.flags |= kHasPositionSd;
  if ((content.flags & kHasVelocity) == 0) return true;
  gnss.flags |= kVelocityValid;
  gnss.v_n_mps = three(content, 6);
  gnss.sd_velocity_mps = three(content, 9);
  if ((content.flags & kHasSdVelocity) != 0) gnss.flags |= kHasVelocitySd;
  return true;
}

}  // namespace

void Decoder::push(std::span<const std::uint8_t> bytes, Arrival arrival, SampleSink& sink) noexcept {
  counters_.bytes += bytes.size();
  feed(loop_, bytes, arrival.received, [&] { drain(arrival.read, sink, false); });
}

std::string_view Decoder::remark() const noexcept {
  if (went_back_ > 0)
    return "messages have a time before that of the message above them and were left out; choose "
           "another time (mcap.time) or topic";
  return {};
}

void Decoder::drain(HostTime arrival, SampleSink& sink, bool at_end) noexcept {
  while (loop_.next(examine, at_end)) {
    ++counters_.frames;
    if (!take(read_frame(loop_.bytes()), loop_.first_byte(), arrival, sink)) ++counters_.bad_contents;
  }
  counters_.bytes_skipped = loop_.counters().bytes_skipped;
  counters_.bad_checksums = loop_.counters().bad_checksums;
  counters_.bad_lengths = loop_.counters().bad_lengths;
}

bool Decoder::take(const Content& content, HostTime first_byte, HostTime arrival, SampleSink& sink) noexcept {
  if (!all_finite(content) || std::abs(content.time_ns) >= kTimeMost_ns) return false;
  if (last_time_ns_ && content.time_ns < *last_time_ns_) {
    ++went_back_;
    return false;
  }
  std::uint64_t missing = 0;
  if (last_time_ns_ && config_.period > Duration::zero()) {
    const double periods =
        to_seconds(Duration(content.time_ns - *last_time_ns_)) / to_seconds(config_.period);
    if (periods > kGapPeriods) missing = static_cast<std::uint64_t>(std::llround(periods)) - 1;
  }
  Sample sample{};
  sample.device = config_.device;
  if (!fill(content, missing, sample)) return false;
  counters_.samples_lost += missing;
  last_time_ns_ = content.time_ns;
  sample.time = clock_.observe(content.time_ns, first_byte);
  sample.arrival = clock_.is_fixed() ? sample.time : arrival;
  // A pulse is the whole second next to the reference.
  if (content.kind == Kind::kTimeReference) sample.time -= from_seconds(content.values[0]);
  sample.has_utc = config_.times_are_utc && content.kind != Kind::kTimeReference;
  sample.utc = utc_time_from_ns(content.time_ns);
  sample.sequence = sequence_++;
  ++counters_.samples;
  counters_.clock_resets = std::max(counters_.clock_resets, clock_.restarts());
  sink.on_sample(sample);
  return true;
}

bool Decoder::fill(const Content& content, std::uint64_t missing, Sample& sample) const noexcept {
  switch (content.kind) {
    case Kind::kImu: {
      sample.kind = SampleKind::kImu;
      sample.imu = ImuData{};
      sample.imu.counter = static_cast<std::int64_t>(sequence_);
      if ((content.flags & kHasGyro) != 0) sample.imu.flags |= kGyroValid;
      if ((content.flags & kHasAccel) != 0) sample.imu.flags |= kAccelValid;
      if (missing > 0) sample.imu.flags |= kGapBefore;
      sample.imu.omega_radps = rotate(config_.axes, three(content, 0));
      sample.imu.f_mps2 = rotate(config_.axes, three(content, 3));
      return true;
    }
    case Kind::kGnss:
      sample.kind = SampleKind::kGnss;
      return fill_gnss(content, sample.gnss);
    case Kind::kSpeed:
      sample.kind = SampleKind::kOdometry;
      sample.odometry = {content.values[0], 0};
      return true;
    case Kind::kTimeReference:
      if (std::abs(content.values[0]) > 0.5 ||
          std::abs(content.values[1]) * kNsPerS >= static_cast<double>(kTimeMost_ns))
        return false;
      sample.kind = SampleKind::kPulse;
      sample.pulse.wall_ns = static_cast<std::int64_t>(std::llround(content.values[1])) * 1'000'000'000;
      return true;
  }
  return false;
}

}  // namespace imuscope::ros_message
