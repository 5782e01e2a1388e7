#include "fleet/mounting_change.h"

#include <Eigen/Dense>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "base/units.h"
#include "results/tables/json_fields.h"

namespace imuscope::fleet {
namespace {

using Rotation = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;

constexpr std::array<const char*, 3> kAxisNames{"x", "y", "z"};

/// C_b_s = C_first Exp(-psi): psi in b, degrees.
Eigen::Vector3d change_deg(const std::array<double, 9>& first, const std::array<double, 9>& C_b_s) {
  const Eigen::Matrix3d change =
      Eigen::Map<const Rotation>(first.data()).transpose() * Eigen::Map<const Rotation>(C_b_s.data());
  const Eigen::AngleAxisd turn(change);
  return -kDegPerRad * turn.angle() * turn.axis();
}

}  // namespace

void MountingChange::take(const std::string& mounting, const Place& place, double day,
                          const nlohmann::json& imu) {
  const auto C = tables::numbers_at<9>(imu, "C_b_s");
  const auto psi_sd = tables::numbers_at<3>(imu, "boresight_sd_deg");
  const auto r = tables::numbers_at<3>(imu, "r_bs_b_m");
  const auto r_sd = tables::numbers_at<3>(imu, "r_bs_b_sd_m");
  if (!C || !psi_sd || !r || !r_sd) return;
  const auto positive = [](const std::array<double, 3>& sd) {
    return std::all_of(sd.begin(), sd.end(), [](double one) { return std::isfinite(one) && one > 0.0; });
  };
  if (!positive(*psi_sd) || !positive(*r_sd)) return;
  drives_[mounting].push_back({place, day, *C, *psi_sd, *r, *r_sd});
}

void MountingChange::add_to(const Measure& measure) const {
  for (const auto& [mounting, drives] : drives_) {
    // Ends of captures come in the order of their names already; nobody's time is after everybody's.
    const auto first = std::min_element(drives.begin(), drives.end(), [](const Drive& a, const Drive& b) {
      return (std::isfinite(a.day) ? a.day : INFINITY) < (std::isfinite(b.day) ? b.day : INFINITY);
    });
    for (const Drive& drive : drives) {
      const Eigen::Vector3d psi_deg = change_deg(first->C_b_s, drive.C_b_s);
      for (std::size_t i = 0; i < kAxisNames.size(); ++i) {
        measure("mounting angle since the first drive", kAxisNames[i], "deg", drive.place,
                psi_deg(static_cast<Eigen::Index>(i)), drive.psi_sd_deg[i]);
        measure("lever arm since the first drive", kAxisNames[i], "mm", drive.place,
                kMmPerM * (drive.r_bs_b_m[i] - first->r_bs_b_m[i]), kMmPerM * drive.r_sd_m[i]);
      }
    }
  }
}

}  // namespace imuscope::fleet
