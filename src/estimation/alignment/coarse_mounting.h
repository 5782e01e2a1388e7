#pragma once

/// How an S-IMU sits, without any prior: Wahba's problem on pairs of rates and forces. Good to a degree or
/// two after a minute of driving, which is enough for the filter to take over. Rates enter with their means
/// removed, so gyro biases do not matter; gravity enters once, with the accelerometer's bias as its
/// uncertainty. Twelve pairs at a time enter as their mean: engine vibration is not common to two mountings
/// and would otherwise turn the answer by degrees. in EQUATIONS.md.
///
/// Core: fixed memory, no allocation, noexcept. Thread: owner only.

#include <Eigen/Core>
#include <cstdint>

namespace imuscope {

enum class MountingResult : std::uint8_t {
  kOk,
  kTooFewPairs,
  kTooLittleExcitation,  ///< some direction's sd stays above the limit: at rest or on a straight road
  kInconsistent,         ///< no rotation makes the pairs match: another time offset, axes or a flipped sign
};

/// What the coarse alignment found: the mounting C_b_s (takes b to s) with its covariance, and a first gyro
/// bias.
struct CoarseMounting {
  Eigen::Matrix3d C_b_s = Eigen::Matrix3d::Identity();
  /// Covariance of the boresight psi (rotation vector in b, C = C^ Exp(-psi)), rad^2.
  Eigen::Matrix3d covariance_rad2 = Eigen::Matrix3d::Zero();
  double rate_correlation = 0.0;  ///< of C_b_s omega_b with omega_s, 0 to 1
  /// Mean of omega_s - C_b_s omega_b: first estimate of the S gyro bias, s axes.
  Eigen::Vector3d gyro_bias_s_radps = Eigen::Vector3d::Zero();
};

/// What is assumed of the two devices, and how certain the answer must be to count as one.
struct CoarseMountingOptions {
  double accel_bias_sd_mps2 = 0.15;  ///< of S against R, as it turns gravity
  double sd_limit_rad = 0.05;        ///< of the weakest direction
  double arm_m = 0.5;                ///< lever arms up to this are to be expected: they turn gravity, too
  int pairs_min = 200;
};

/// Gathers pairs of the reference's motion and S samples in fixed memory, and solves for the mounting of s
/// when asked.
class CoarseMountingEstimator {
 public:
  CoarseMountingEstimator() = default;
  explicit CoarseMountingEstimator(const CoarseMountingOptions& options) noexcept : options_(options) {}

  /// Adds one pair: the reference's motion at the S sample's time, and the S sample.
  void add(const Eigen::Vector3d& omega_b_radps, const Eigen::Vector3d& f_b_mps2,
           const Eigen::Vector3d& omega_s_radps, const Eigen::Vector3d& f_s_mps2) noexcept;

  /// Solves from all pairs since clear(). `out` is not written with kTooFewPairs.
  [[nodiscard]] MountingResult solve(CoarseMounting& out) const noexcept;

  [[nodiscard]] std::int64_t pairs() const noexcept { return pairs_; }
  void clear() noexcept;

 private:
  /// Running mean and second moments of a pair of vectors, about the means (Welford's update).
  struct Moments {
    void add(const Eigen::Vector3d& b, const Eigen::Vector3d& s, double n) noexcept;
    Eigen::Vector3d mean_b = Eigen::Vector3d::Zero();
    Eigen::Vector3d mean_s = Eigen::Vector3d::Zero();
    Eigen::Matrix3d bb = Eigen::Matrix3d::Zero();  ///< sum of (b - mean)(b - mean)'
    Eigen::Matrix3d sb = Eigen::Matrix3d::Zero();
    Eigen::Matrix3d ss = Eigen::Matrix3d::Zero();
  };

  [[nodiscard]] bool is_mirrored(const Eigen::Matrix3d& B, const Eigen::Matrix3d& C) const noexcept;

  /// Sum of the pairs that wait for their mean.
  struct Sums {
    Eigen::Vector3d omega_b = Eigen::Vector3d::Zero();
    Eigen::Vector3d f_b = Eigen::Vector3d::Zero();
    Eigen::Vector3d omega_s = Eigen::Vector3d::Zero();
    Eigen::Vector3d f_s = Eigen::Vector3d::Zero();
    int count = 0;
  };

  CoarseMountingOptions options_;
  Sums waiting_;
  Moments rate_;
  Moments force_;
  std::int64_t observations_ = 0;
  std::int64_t pairs_ = 0;
};

}  // namespace imuscope
