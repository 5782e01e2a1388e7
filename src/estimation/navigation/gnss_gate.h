#pragma once

/// Decides whether a GNSS solution may correct the state: a chi-square gate that cannot lock itself out.
///
/// A single improbable innovation is rejected. When innovations stay improbable for a while and agree with
/// one another, it is the state that is wrong (a bridged outage, a wrong start) and not the receiver: the
/// gate then asks for re-acquisition, once, and the caller widens its position and velocity covariance and
/// takes the solution. A receiver that jumps about never agrees with itself and stays rejected. Core: fixed
/// memory, no allocation. Thread: owner only.

#include <Eigen/Core>
#include <cstdint>

#include "base/time.h"

namespace imuscope {

enum class GateDecision : std::uint8_t {
  kAccept,
  kReject,
  kReacquire,  ///< the receiver has agreed with itself, against the state, for long enough
};

/// Bounds of the gate: what is improbable, and how long a receiver must insist.
struct GnssGateOptions {
  /// Bound of the squared, normalised innovation (3 degrees of freedom). 16.27 is the 99.9 % point.
  double chi_square_limit = 16.266;
  /// Re-acquire after this many consecutive rejections that agree with one another ...
  int reacquire_count = 10;
  /// ... that also span at least this time.
  double reacquire_after_s = 10.0;
};

class GnssGate {
 public:
  GnssGate() = default;
  explicit GnssGate(const GnssGateOptions& options) noexcept : options_(options) {}

  /// @param innovation  NED
  /// @param S           its covariance, H P H' + R
  /// @param R           the part of S that is the receiver's own
  [[nodiscard]] GateDecision decide(HostTime time, const Eigen::Vector3d& innovation,
                                    const Eigen::Matrix3d& S, const Eigen::Matrix3d& R) noexcept;

  /// Normalised innovation squared of the last decide(), 3 degrees of freedom.
  [[nodiscard]] double last_nis() const noexcept { return last_nis_; }
  /// Consecutive rejections up to now.
  [[nodiscard]] int streak() const noexcept { return streak_; }
  [[nodiscard]] std::uint64_t accepted() const noexcept { return accepted_; }
  [[nodiscard]] std::uint64_t rejected() const noexcept { return rejected_; }
  [[nodiscard]] std::uint64_t reacquisitions() const noexcept { return reacquisitions_; }

 private:
  void extend_streak(HostTime time, const Eigen::Vector3d& innovation, const Eigen::Matrix3d& R) noexcept;

  GnssGateOptions options_;
  double last_nis_ = 0.0;
  int streak_ = 0;    ///< consecutive rejections
  int agreeing_ = 0;  ///< those at the end of the streak that agree with one another
  HostTime agreeing_since_{};
  Eigen::Vector3d previous_innovation_ = Eigen::Vector3d::Zero();
  HostTime previous_time_{};
  std::uint64_t accepted_ = 0;
  std::uint64_t rejected_ = 0;
  std::uint64_t reacquisitions_ = 0;
};

/// Reported sd with a floor per axis: receivers in RTK report millimetres that they cannot know. A value that
/// is not a positive number is replaced by the floor.
[[nodiscard]] Eigen::Vector3d floored_sd(const Eigen::Vector3d& reported_sd,
                                         const Eigen::Vector3d& floor_sd) noexcept;

}  // namespace imuscope
