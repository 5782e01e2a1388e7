#include "check/tracks.h"

#include <algorithm>
#include <cmath>

#include "base/limits.h"

namespace imuscope::check {

namespace {

Eigen::Vector3f vector_of(const Vector3& v) {
  return {static_cast<float>(v[0]), static_cast<float>(v[1]), static_cast<float>(v[2])};
}

bool all_finite(const Vector3& v) {
  return std::isfinite(v[0]) && std::isfinite(v[1]) && std::isfinite(v[2]);
}

void add_imu(const ImuData& data, double time_s, ImuTrack& track) {
  constexpr std::uint32_t kClips =
      kGyroClipX | kGyroClipY | kGyroClipZ | kAccelClipX | kAccelClipY | kAccelClipZ;
  constexpr std::uint32_t kWhole = kGyroValid | kAccelValid;
  if ((data.flags & kWhole) != kWhole || !all_finite(data.omega_radps) || !all_finite(data.f_mps2)) return;
  track.time_s.push_back(time_s);
  track.omega_radps.push_back(vector_of(data.omega_radps));
  track.f_mps2.push_back(vector_of(data.f_mps2));
  track.counter.push_back(data.counter);
  if ((data.flags & kClips) != 0) ++track.clipped;
}

void add_gnss(const GnssData& data, const GnssOptions& options, double time_s, GnssTrack& track) {
  const GeodeticPosition position{data.latitude_rad, data.longitude_rad, data.height_m};
  if ((data.flags & kPositionValid) == 0 || !is_on_earth(position)) return;
  if (track.time_s.empty()) track.first = position;
  const Vector3& sd = (data.flags & kHasPositionSd) != 0 ? data.sd_position_m : options.position_sd_m;
  track.time_s.push_back(time_s);
  track.position_m.emplace_back(ned_offset(track.first, position).head<2>());
  track.claimed_sd_m.push_back(std::max({sd[0], sd[1], options.position_sd_floor_m}));
}

}  // namespace

Drive::Drive(const Configuration& configuration, double longest_s)
    : configuration_(&configuration),
      longest_s_(std::min(longest_s, kLongest_s)),
      imus_(configuration.devices.size()),
      gnss_(configuration.devices.size()),
      scales_(configuration.devices.size(), TimeScale::kShared),
      full_(configuration.devices.size()),
      first_(configuration.devices.size()),
      has_first_(configuration.devices.size()) {}

void Drive::add(const Sample& sample) {
  const std::size_t device = sample.device;
  if (full_[device]) return;
  if (!has_origin_) origin_ = sample.time;
  has_origin_ = true;
  if (!has_first_[device]) first_[device] = sample.time;
  has_first_[device] = true;
  const auto taken = static_cast<double>(imus_[device].size() + gnss_[device].size());
  if (to_seconds(sample.time - first_[device]) > longest_s_ || taken >= longest_s_ * kMaxRate_hz) {
    full_[device] = true;
    return;
  }
  const double time_s = to_seconds(sample.time - origin_);
  if (sample.kind == SampleKind::kImu) add_imu(sample.imu, time_s, imus_[device]);
  if (sample.kind == SampleKind::kGnss)
    add_gnss(sample.gnss, configuration_->devices[device].gnss, time_s, gnss_[device]);
}

}  // namespace imuscope::check
