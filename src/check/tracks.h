#pragma once

/// What every device of a drive said, as the checks look at it. Non-real-time: allocates.

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "configuration/config.h"
#include "estimation/navigation/wgs84.h"
#include "sample/sample.h"

namespace imuscope::check {

/// No more than this of a recording is looked at: a mistake of the configuration is there from the beginning.
inline constexpr double kLongest_s = 3600.0;

/// An IMU's samples in their order, in the configured units and axes; seconds since the drive's origin.
struct ImuTrack {
  std::vector<double> time_s;
  std::vector<Eigen::Vector3f> omega_radps;
  std::vector<Eigen::Vector3f> f_mps2;
  std::vector<std::int64_t> counter;
  std::size_t clipped = 0;  ///< samples that the device itself marks as at the end of its range
  [[nodiscard]] std::size_t size() const noexcept { return time_s.size(); }
};

/// A receiver's valid positions; north and east of the first one.
struct GnssTrack {
  std::vector<double> time_s;
  std::vector<Eigen::Vector2d> position_m;
  std::vector<double> claimed_sd_m;  ///< the larger of north and east
  GeodeticPosition first;
  [[nodiscard]] std::size_t size() const noexcept { return time_s.size(); }
};

/// How the times of a device stand to the reference's.
enum class TimeScale : std::uint8_t {
  kShared,  ///< they are the same: by configuration, by arrival stamps or by UTC
  kOwn,     ///< of a clock that begins anywhere
};

/// All devices of one drive, in the order of the configuration.
class Drive {
 public:
  /// @param longest_s  of each device's samples that it takes, at most kLongest_s
  explicit Drive(const Configuration& configuration, double longest_s = kLongest_s);

  /// Takes a sample of a device in stream order, and no more than the fastest device has in that time.
  void add(const Sample& sample);
  [[nodiscard]] bool is_full(std::size_t device) const { return full_[device]; }
  /// Whether a sample has come, from whose time the seconds of all tracks count.
  [[nodiscard]] bool has_origin() const noexcept { return has_origin_; }
  void set_time_scale(std::size_t device, TimeScale scale) { scales_[device] = scale; }

  [[nodiscard]] const Configuration& configuration() const noexcept { return *configuration_; }
  [[nodiscard]] ImuTrack& imu(std::size_t device) { return imus_[device]; }
  [[nodiscard]] const ImuTrack& imu(std::size_t device) const { return imus_[device]; }
  [[nodiscard]] GnssTrack& gnss(std::size_t device) { return gnss_[device]; }
  [[nodiscard]] const GnssTrack& gnss(std::size_t device) const { return gnss_[device]; }
  [[nodiscard]] TimeScale time_scale(std::size_t device) const { return scales_[device]; }

 private:
  const Configuration* configuration_;
  double longest_s_;
  std::vector<ImuTrack> imus_;
  std::vector<GnssTrack> gnss_;
  std::vector<TimeScale> scales_;
  std::vector<bool> full_;
  std::vector<HostTime> first_;
  std::vector<bool> has_first_;
  bool has_origin_ = false;
  HostTime origin_{};
};

}  // namespace imuscope::check
