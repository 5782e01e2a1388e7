#include "estimation/navigation/gnss_gate.h"

#include <Eigen/Cholesky>
#include <cmath>
#include <limits>

namespace imuscope {

namespace {

double normalised_squared(const Eigen::Vector3d& y, const Eigen::Matrix3d& S) noexcept {
  const Eigen::LLT<Eigen::Matrix3d> factor(S);
  if (factor.info() != Eigen::Success) return std::numeric_limits<double>::infinity();
  return factor.matrixL().solve(y).squaredNorm();
}

/// While the state is wrong, its own error grows between two solutions; agreement allows for this much a
/// second, in the innovation's unit.
constexpr double kWrongStateGrowth_per_s = 1.0;

}  // namespace

GateDecision GnssGate::decide(HostTime time, const Eigen::Vector3d& innovation, const Eigen::Matrix3d& S,
                              const Eigen::Matrix3d& R) noexcept {
  last_nis_ = normalised_squared(innovation, S);
  if (last_nis_ <= options_.chi_square_limit) {
    streak_ = 0;
    agreeing_ = 0;
    ++accepted_;
    return GateDecision::kAccept;
  }
  ++rejected_;
  if (!innovation.allFinite()) return GateDecision::kReject;
  extend_streak(time, innovation, R);
  if (agreeing_ < options_.reacquire_count ||
      to_seconds(time - agreeing_since_) < options_.reacquire_after_s) {
    return GateDecision::kReject;
  }
  streak_ = 0;
  agreeing_ = 0;
  ++reacquisitions_;
  return GateDecision::kReacquire;
}

void GnssGate::extend_streak(HostTime time, const Eigen::Vector3d& innovation,
                             const Eigen::Matrix3d& R) noexcept {
  ++streak_;
  const double growth = kWrongStateGrowth_per_s * to_seconds(time - previous_time_);
  const Eigen::Matrix3d scatter = 2.0 * R + growth * growth * Eigen::Matrix3d::Identity();
  const bool agrees = agreeing_ > 0 && normalised_squared(innovation - previous_innovation_, scatter) <=
                                           options_.chi_square_limit;
  if (agrees) {
    ++agreeing_;
  } else {
    agreeing_ = 1;
    agreeing_since_ = time;
  }
  previous_innovation_ = innovation;
  previous_time_ = time;
}

Eigen::Vector3d floored_sd(const Eigen::Vector3d& reported_sd, const Eigen::Vector3d& floor_sd) noexcept {
  Eigen::Vector3d sd = floor_sd;
  for (Eigen::Index i = 0; i < sd.size(); ++i) {
    if (std::isfinite(reported_sd[i]) && reported_sd[i] > sd[i]) sd[i] = reported_sd[i];
  }
  return sd;
}

}  // namespace imuscope
