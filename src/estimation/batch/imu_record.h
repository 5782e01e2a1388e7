#pragma once

/// What one IMU recorded over a drive, as the batch estimate takes it.

#include <Eigen/Core>
#include <vector>

namespace imuscope::batch {

/// Samples of one IMU in order of time. Times are times of validity in seconds from an origin that all IMUs
/// of one estimate share. Rates and forces in the IMU's own axes.
struct ImuRecord {
  std::vector<double> time_s;                ///< strictly increasing
  std::vector<Eigen::Vector3f> omega_radps;  ///< angular rate
  std::vector<Eigen::Vector3f> f_mps2;       ///< specific force

  [[nodiscard]] std::size_t size() const { return time_s.size(); }
  void add(double time, const Eigen::Vector3f& omega, const Eigen::Vector3f& f) {
    time_s.push_back(time);
    omega_radps.push_back(omega);
    f_mps2.push_back(f);
  }
};

}  // namespace imuscope::batch
