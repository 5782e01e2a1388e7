#pragma once

/// GNSS outages played on a recorded drive: the filter runs with GNSS up to the start of an outage, coasts on
/// the S-IMU alone, and is compared with the reference trajectory after each of the durations. Every start
/// begins from the filter that has had GNSS until then; nothing of an outage reaches the next start.

#include <functional>
#include <vector>

#include "study/evaluation/coasting_filter.h"

namespace imuscope {

/// One S sample, in its own axes, scale error taken out.
struct DriveSample {
  double time_s = 0.0;  ///< of the motion that it shows
  InertialRates measured;
};

/// One GNSS solution: the antenna's position, and its velocity where the receiver gave one; vectors are
/// north, east, down.
struct DriveFix {
  double time_s = 0.0;
  GeodeticPosition antenna;
  Eigen::Vector3d sd_position_m = Eigen::Vector3d::Zero();
  bool has_velocity = false;
  Eigen::Vector3d v_n_mps = Eigen::Vector3d::Zero();
  Eigen::Vector3d sd_velocity_mps = Eigen::Vector3d::Zero();
};

/// Where s was, by the reference's own solution.
struct DriveReference {
  double time_s = 0.0;
  NavigationState state;  ///< of s; biases are not used
  KinematicVector sd = KinematicVector::Zero();
};

/// All in order of time; of samples of one instant the last one counts.
struct Drive {
  std::vector<DriveSample> samples;
  std::vector<DriveFix> fixes;
  std::vector<DriveReference> reference;
  Eigen::Vector3d r_sa_s_m = Eigen::Vector3d::Zero();  ///< from s's origin to the antenna, in s
  double sample_period_s = 0.01;
};

/// When outages begin, and after how long they are looked at: each lasts for the longest duration and shows
/// the shorter ones on its way.
struct OutageOptions {
  std::vector<double> durations_s{10.0, 30.0, 60.0};  ///< rising
  double spacing_s = 5.0;                             ///< between starts
  /// With GNSS and in motion before the first start: at rest a heading can only be lost.
  double settle_s = 60.0;
  std::function<void(double)> progress;  ///< share done; may be empty
};

/// State of one outage after one duration.
struct OutageResult {
  double start_s = 0.0;
  double duration_s = 0.0;
  KinematicVector error;           ///< reference minus filter: NED m, m/s, phi rad
  KinematicCovariance covariance;  ///< predicted by the filter
  KinematicVector reference_sd;    ///< of what it is compared with
};

/// Plays the outages. Starts without a fix in the two seconds before them are left out; so are durations
/// without a reference within half a second of their end, or with a longer gap of the samples on their way.
/// After such a gap the filter starts anew. An empty result: the drive is too short, or its parts do not
/// overlap.
std::vector<OutageResult> play_outages(const Drive& drive, const CoastingModel& model,
                                       const OutageOptions& options);

/// How well the predicted sd describe the errors, after one duration.
struct Consistency {
  double duration_s = 0.0;
  std::size_t n = 0;              ///< outages
  std::size_t n_independent = 0;  ///< of them that do not overlap
  double horizontal_rms_m = 0.0;
  double horizontal_sd_m = 0.0;  ///< root of the mean predicted variance, reference's own included
  double vertical_rms_m = 0.0;
  double vertical_sd_m = 0.0;
  double velocity_rms_mps = 0.0;
  double velocity_sd_mps = 0.0;
  double attitude_rms_rad = 0.0;
  double attitude_sd_rad = 0.0;
  /// Mean normalised estimation error squared per degree of freedom; 1 where the model is right.
  double nees_position = 0.0;
  double nees_velocity = 0.0;
  double nees_attitude = 0.0;
  /// Where the mean NEES of a right model lies with 95 %, for n_independent outages.
  double nees_low = 0.0;
  double nees_high = 0.0;
  /// Mean of -log density of the position error, in nats: the smaller the better the model predicts.
  double surprise = 0.0;
};

/// One entry per duration, those without an outage left out.
std::vector<Consistency> consistency_of(const std::vector<OutageResult>& results,
                                        const std::vector<double>& durations_s);

}  // namespace imuscope
