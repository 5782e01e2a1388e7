#pragma once

/// The standard drive as the records that the batch estimate takes, and what it should find in them.
///
/// A gyro triad whose axes are not at right angles has several frames that could be called its own. The truth
/// is turned to the one that the estimate publishes: x along the x gyro, y in the plane of the x and y gyros.

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "estimation/batch/batch_mounting.h"
#include "tools/trials/standard_drive.h"

namespace batch_pairs {

struct PairOptions {
  imusim::WorldKind world = imusim::WorldKind::kHarsh;
  int reference_class = 1;  ///< imusim::reference_class()
};

/// One run: what was drawn, and the records of the R-IMU and of each S-IMU.
struct Run {
  standard_drive::Draw draw;
  imuscope::batch::ImuRecord reference;
  std::vector<imuscope::batch::ImuRecord> studies;
};
[[nodiscard]] Run run(const standard_drive::Truth& truth, const PairOptions& options, std::uint64_t seed);

/// What the estimate should be; psi stays zero, biases and flexure are left out.
struct TrueSensor {
  Eigen::Matrix3d C_b_s;
  imuscope::batch::ParameterVector x = imuscope::batch::ParameterVector::Zero();
};
[[nodiscard]] TrueSensor true_sensor(const standard_drive::Draw& draw, std::size_t study);

/// Truth minus estimate, in the parameters of the published covariance.
[[nodiscard]] imuscope::batch::ParameterVector error_of(const imuscope::batch::BatchMounting& found,
                                                        const TrueSensor& truth);

/// Squared error of (psi, r) over its covariance.
[[nodiscard]] double nees6(const imuscope::batch::BatchMounting& found,
                           const imuscope::batch::ParameterVector& error);

}  // namespace batch_pairs
