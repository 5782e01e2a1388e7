#pragma once

/// One IMU made of several: the weighted mean of S-IMUs, in the axes of the R-IMU.
///
/// What each S-IMU says is turned into b by its mounting and moved to the motion's time by its time offset. The
/// first one's samples are the instants; the others are interpolated linearly between their own, so that the mean
/// depends on the reference through the mountings alone. At scales of a few samples interpolation makes it a little
/// quieter than the mean of samples taken together would be; a motion that turns within a sample interval is off by
/// up to an eighth of its second derivative times that interval's square.
///
/// Forces are not moved to one point, which would take the derivative of the rate: each component is the force at the
/// weighted mean of the lever arms, which is published with it. Biases are not removed.

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <imuscope/virtual_imu_t.hpp>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "configuration/config.h"
#include "service/pipeline/core.h"
#include "service/run/telemetry.h"

namespace imuscope {

/// Thread: one, non-real-time (it allocates). What comes out depends on the records alone, so that live run and replay
/// say the same. Keeps two seconds of samples at most.
class VirtualImu {
 public:
  /// @param configuration  with a virtual_imu of two members or more
  explicit VirtualImu(const Configuration& configuration);

  /// Takes a row of any S-IMU, of each in order of time; those of others are passed over.
  /// @return the messages that are whole now
  [[nodiscard]] std::vector<virtual_imu_t> add(const ErrorRecord& record);
  /// The message of what is there, if anything.
  [[nodiscard]] std::optional<virtual_imu_t> take();

  /// The same once every row of its tenth of a second must have come.
  [[nodiscard]] std::optional<virtual_imu_t> take_old(double time_s);

 private:
  /// By triad, component: what an S-IMU says in b.
  using Triads = Eigen::Matrix<double, 3, 2>;

  struct Sample {
    double time_s = 0.0;  ///< of the motion, since the run's first R-IMU epoch
    std::int64_t utime = 0;
    Triads reading;
    Triads error;
    Eigen::Vector3d place_b_m;
    Validity validity = Validity::kUsable;
  };
  struct Member {
    std::size_t study = 0;
    double gap_s = 0.0;  ///< samples further apart are not interpolated between
    Triads weights;
    std::deque<Sample> samples;
  };

  [[nodiscard]] static Sample sample_of(const ErrorRecord& record);
  [[nodiscard]] bool is_decided(double time_s) const;
  [[nodiscard]] static std::optional<Sample> at(Member& member, double time_s);
  void emit(std::vector<virtual_imu_t>& messages);
  void append(const std::vector<Sample>& samples, std::vector<virtual_imu_t>& messages);
  void forget();

  std::vector<std::string> names_;
  std::vector<Member> members_;
  double newest_s_ = -std::numeric_limits<double>::infinity();
  std::optional<virtual_imu_t> pending_;
  MessageTenth tenth_;
  std::int64_t missing_ = 0;
};

}  // namespace imuscope
