#pragma once

/// The drive of the estimator's studies as samples: a fibre-optic R-IMU, three S-IMUs of MTx class at 0, 90
/// and 180 degrees, GNSS fixes at 5 Hz. Samples are instantaneous, the body is rigid, clocks are perfect; the
/// trajectory is one and the same, every error is drawn anew from the seed.

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "base/units.h"
#include "calibration/estimator.h"
#include "firmware_sim/imu/imu_model.h"
#include "firmware_sim/motion/motion.h"

namespace study_drive {

inline constexpr std::size_t kStudies = 3;
inline constexpr double kRate_hz = 100.0;
inline constexpr double kTimeOffset_s = 0.004;
inline constexpr imuscope::DeviceIndex kReferenceDevice = 0;
inline constexpr imuscope::DeviceIndex kFirstStudyDevice = 1;
inline constexpr imuscope::DeviceIndex kGnssDevice = 1 + kStudies;

[[nodiscard]] Eigen::Matrix3d mounting_of(std::size_t study);
[[nodiscard]] Eigen::Vector3d lever_arm_of(std::size_t study);

/// Three normal draws.
[[nodiscard]] Eigen::Vector3d normal3(imusim::Random& random);
[[nodiscard]] imuscope::Vector3 to_array(const Eigen::Vector3d& v);
[[nodiscard]] imuscope::Matrix3 to_array(const Eigen::Matrix3d& m);

/// The samples of 10 ms, in order of arrival.
using Tick = std::vector<imuscope::Sample>;

/// What a perfect set of instruments would show, worked out once for any number of runs.
class Truth {
 public:
  Truth(const imusim::Scenario& scenario, double duration_s);
  [[nodiscard]] std::size_t ticks() const { return reference_.size(); }
  [[nodiscard]] const imusim::Motion& motion() const { return motion_; }
  [[nodiscard]] imusim::MotionState end() const;

 private:
  friend class Instruments;
  imusim::Motion motion_;
  std::vector<imusim::IdealReading> reference_;
  std::array<std::vector<imusim::IdealReading>, kStudies> studies_;
  std::vector<imusim::GeodeticPosition> antenna_;
};

/// Errors of one run.
struct Draw {
  imusim::ImuErrors reference;
  std::array<imusim::ImuErrors, kStudies> studies;
};

/// The instruments of one run. `truth` must outlive them.
class Instruments {
 public:
  Instruments(const Truth& truth, const Draw& draw, std::uint64_t seed);
  /// The next 10 ms. Precondition: fewer than truth.ticks() calls so far.
  const Tick& next();

 private:
  const Truth& truth_;
  imusim::Random gnss_noise_;
  imusim::ImuModel reference_;
  std::vector<imusim::ImuModel> studies_;
  std::size_t k_ = 0;
  Tick tick_;
};

/// Estimator's configuration for the instruments: devices, GNSS, noise of the S-IMUs; nothing known of the
/// mounting.
[[nodiscard]] imuscope::EstimatorConfig configuration(const imusim::Motion& motion);

}  // namespace study_drive
