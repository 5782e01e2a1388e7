#include "firmware_sim/imu/imperfections.h"

#include <algorithm>
#include <array>
#include <limits>

#include "firmware_sim/motion/degrees.h"
#include "firmware_sim/motion/draw.h"

namespace imusim {
namespace {

constexpr double kMps2PerG = 9.80665;
// A low-pass of resistors and capacitors on the chip.
constexpr double kLowPassSd = 0.1;
constexpr double kLowPassMost = 0.3;

Eigen::Matrix3d draw9(Random& random, double sd) {
  Eigen::Matrix3d drawn;
  for (int row = 0; row < 3; ++row) drawn.row(row) = draw3(random, sd).transpose();
  return drawn;
}

/// Symmetric, with half of the departure of each pair of axes on either side of the diagonal.
Eigen::Matrix3d leaning(const Eigen::Vector3d& departures_rad) {
  const Eigen::Vector3d half = 0.5 * departures_rad;
  Eigen::Matrix3d matrix;
  matrix << 0.0, half.z(), half.y(),  //
      half.z(), 0.0, half.x(),        //
      half.y(), half.x(), 0.0;
  return matrix;
}

}  // namespace

Imperfections study_imperfections(WorldKind world) {
  if (world == WorldKind::kIdeal) return {};
  Imperfections mtx;
  mtx.non_orthogonality_sd_rad = 0.1 * kRadPerDeg;
  mtx.triads_apart_sd_rad = 0.1 * kRadPerDeg;
  mtx.accel_place_sd_m = 0.02;
  mtx.g_sensitivity_sd_s_per_m = 0.05 * kRadPerDeg / kMps2PerG;
  mtx.delay_apart_sd_s = 1e-3;
  mtx.low_pass_hz = 40.0;
  mtx.low_pass_sd = kLowPassSd;
  mtx.own_vibration = 0.5;
  return mtx;
}

Imperfections reference_imperfections(WorldKind world, const ReferenceClass& of) {
  if (world == WorldKind::kIdeal) return {};
  struct Grade {
    double gyro_white_deg_per_sqrt_h;  ///< below
    double axes_rad;
    double scale;
    double low_pass_hz;
  };
  // Navigation grade, fibre-optic AHRS, tactical MEMS, and whatever is worse.
  constexpr std::array<Grade, 4> kGrades{
      {{0.01, 300e-6, 300e-6, 80.0},
       {0.05, 0.02 * kRadPerDeg, 500e-6, 80.0},
       {0.2, 0.05 * kRadPerDeg, 1e-3, 80.0},
       {std::numeric_limits<double>::infinity(), 0.1 * kRadPerDeg, 5e-3, 40.0}}};
  constexpr double kPerSqrtHour = kRadPerDeg / 60.0;
  const auto& grade = *std::find_if(kGrades.begin(), kGrades.end(), [&](const Grade& g) {
    return of.gyro_white_radps_per_sqrt_hz < g.gyro_white_deg_per_sqrt_h * kPerSqrtHour;
  });
  Imperfections reference;
  reference.non_orthogonality_sd_rad = grade.axes_rad;
  reference.triads_apart_sd_rad = grade.axes_rad;
  reference.scale_sd = grade.scale;
  reference.low_pass_hz = grade.low_pass_hz;
  reference.low_pass_sd = kLowPassSd;
  TriadErrors nominal;
  nominal.low_pass_hz = grade.low_pass_hz;
  reference.stated_delay_s = slow_delay_s(nominal);
  reference.own_vibration = 0.25;
  return reference;
}

void draw_imperfections(const Imperfections& imperfections, Random& random, ImuErrors& errors) {
  const auto draw_triad = [&](TriadErrors& triad) {
    triad.misalignment += leaning(draw3(random, imperfections.non_orthogonality_sd_rad));
    triad.scale += draw3(random, imperfections.scale_sd);
    // Both ends of what a part may show: no draw makes another sensor of it.
    const double share = std::clamp(imperfections.low_pass_sd * random.normal(), -kLowPassMost, kLowPassMost);
    triad.low_pass_hz = std::min(triad.low_pass_hz, imperfections.low_pass_hz * (1.0 + share));
  };
  draw_triad(errors.gyro);
  draw_triad(errors.accel);
  errors.accel.C_s_triad = rotation_from_vector(draw3(random, imperfections.triads_apart_sd_rad));
  errors.gyro.g_sensitivity += draw9(random, imperfections.g_sensitivity_sd_s_per_m);
  const Eigen::Matrix3d places = draw9(random, imperfections.accel_place_sd_m);
  errors.accel_places_s_m = places.colwise() - Eigen::Vector3d(places.rowwise().mean());
  errors.gyro.delay_s -= imperfections.stated_delay_s;
  errors.accel.delay_s = imperfections.delay_apart_sd_s * random.normal() - imperfections.stated_delay_s;
  errors.own_vibration = imperfections.own_vibration;
}

}  // namespace imusim
