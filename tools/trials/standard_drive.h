#pragma once

/// The drive of the estimator's trials as samples: a fibre-optic R-IMU, three S-IMUs of MTx class at 0, 90
/// and 180 degrees, GNSS fixes at 5 Hz. Clocks are perfect; the trajectory is one and the same, every error
/// is drawn anew from the seed. In the ideal world samples are instantaneous and the body is rigid; in the
/// harsh one sensors have all that imu/imperfections.h draws.

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "base/units.h"
#include "estimation/calibration/estimator.h"
#include "firmware_sim/imu/imperfections.h"
#include "firmware_sim/imu/imu_model.h"
#include "firmware_sim/imu/sensor_classes.h"
#include "firmware_sim/motion/motion.h"
#include "sample/eigen_arrays.h"
#include "tools/trials/s_imu_score.h"

namespace standard_drive {

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

/// The samples of 10 ms, in order of arrival.
using Tick = std::vector<imuscope::Sample>;

/// What a perfect set of instruments would show, worked out once for any number of runs.
class Truth {
 public:
  Truth(const imusim::Scenario& scenario, double duration_s,
        imusim::WorldKind world = imusim::WorldKind::kIdeal);
  [[nodiscard]] std::size_t ticks() const { return ticks_; }
  [[nodiscard]] const imusim::Motion& motion() const { return motion_; }
  [[nodiscard]] imusim::MotionState end() const;

 private:
  friend class Instruments;
  imusim::Motion motion_;
  imusim::WorldKind world_;
  std::size_t ticks_ = 0;
  // Ideal world only: in the harsh one what a sensor feels is its own.
  std::vector<imusim::IdealReading> reference_;
  std::array<std::vector<imusim::IdealReading>, kStudies> studies_;
  std::vector<imusim::GeodeticPosition> antenna_;
};

/// Errors of one run.
struct Draw {
  imusim::ImuErrors reference;
  std::array<imusim::ImuErrors, kStudies> studies;
};

/// What the errors of a run are drawn from.
struct DrawOptions {
  imusim::WorldKind world = imusim::WorldKind::kIdeal;
  int reference_class = 1;  ///< imusim::reference_class()
  imusim::MtxClass mtx;
};
/// The ideal world's errors are part of the harsh one's: same random numbers, same biases, scales and noise.
/// @param seed  of the run: what is drawn for the harsh world alone
[[nodiscard]] Draw draw(const DrawOptions& options, imusim::Random& random, std::uint64_t seed);

/// What an estimator should find.
[[nodiscard]] s_imu_score::SImuTruth truth_of(const Draw& draw, std::size_t study);

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

/// Estimator's configuration for the instruments: devices, GNSS, noise of the reference's class and of the
/// S-IMUs; nothing known of the mounting.
[[nodiscard]] imuscope::EstimatorConfig configuration(const imusim::Motion& motion, int reference_class = 1);

}  // namespace standard_drive
