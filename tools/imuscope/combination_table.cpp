#include "combination_table.h"

#include <fmt/format.h>
#include <cmath>

#include "base/units.h"
#include "estimation/calibration/filter_core.h"
#include "estimation/navigation/so3.h"
#include "print.h"

namespace imuscope::cli {
namespace {

/// Below this, the drives did not see one mounting: once in a hundred cases by chance.
constexpr double kSuspicious = 0.01;

std::string three(const std::array<double, 6>& values, std::size_t first, double unit, int digits) {
  return fmt::format("{:9.{}f} {:9.{}f} {:9.{}f}", values[first] * unit, digits, values[first + 1] * unit,
                     digits, values[first + 2] * unit, digits);
}

void print_drive(const Combination& combination, const CombinedStudy& study, std::size_t i) {
  const DriveDeviation& drive = study.mounting.drives[i];
  say("  {}\n", combination.runs[study.drives[i]].string());
  say("    from the others    {}  mdeg   {}  mm\n", three(drive.deviation, 0, kMdegPerRad, 1),
      three(drive.deviation, 3, kMmPerM, 2));
  say("    sd of that         {}  mdeg   {}  mm\n", three(drive.deviation_sd, 0, kMdegPerRad, 1),
      three(drive.deviation_sd, 3, kMmPerM, 2));
  say("    p {:.3g}   weight {:.3f}{}\n", drive.p_value, study.mounting.weights[i],
      drive.p_value < kSuspicious ? "   stands out" : "");
}

void print_combined_study(const Combination& combination, const CombinedStudy& study) {
  const CombinedMounting& mounting = study.mounting;
  const MountingEstimate& estimate = mounting.estimate;
  say("\n{}  ({} drives, {})\n", study.name, study.drives.size(), name_of(combination.method));
  const EulerAngles angles = euler_from_rotation(to_eigen(estimate.C_b_s));
  const double heading_deg = wrapped_angle(angles.heading_rad) * kDegPerRad;
  std::array<double, 6> sd{};
  for (std::size_t i = 0; i < sd.size(); ++i) sd[i] = std::sqrt(estimate.covariance_psi_r[7 * i]);
  const auto& r = estimate.r_bs_b_m;
  say("  C_b_s, zyx Euler x y z {:9.3f} {:9.3f} {:9.3f}  deg\n", angles.roll_rad * kDegPerRad,
      angles.pitch_rad * kDegPerRad, heading_deg);
  say("    sd               {}  mdeg\n", three(sd, 0, kMdegPerRad, 1));
  say("  lever arm b, x y z {:9.2f} {:9.2f} {:9.2f}  mm\n", r[0] * kMmPerM, r[1] * kMmPerM, r[2] * kMmPerM);
  say("    sd               {}  mm\n", three(sd, 3, kMmPerM, 2));
  say("  repeats exactly?   chi2 {:.1f} of {} degrees of freedom, p = {:.3g}: {}\n",
      mounting.homogeneity_chi2, mounting.homogeneity_dof, mounting.homogeneity_p_value,
      mounting.homogeneity_p_value < kSuspicious ? "the drives differ by more than their sd allow"
                                                 : "the drives agree within their sd");
  if (combination.method == CombineMethod::kInverseVariance) {
    say("  between drives     sd {:.1f} mdeg, {:.2f} mm an axis, beyond the drives' own\n",
        mounting.between_drives_psi_sd_rad * kMdegPerRad, mounting.between_drives_r_sd_m * kMmPerM);
  }
  say("  one mounting?      p = {:.3g}: {}\n", mounting.one_mounting_p_value(),
      mounting.one_mounting_p_value() < kSuspicious
          ? "a drive lies farther from the others than a mounting gives way"
          : "no drive stands out");
  for (std::size_t i = 0; i < study.drives.size(); ++i) print_drive(combination, study, i);
}

}  // namespace

void print_combination(const Combination& combination) {
  for (const auto& study : combination.studies) print_combined_study(combination, study);
  for (const auto& remark : combination.remarks) say("\nNote: {}\n", remark);
}

}  // namespace imuscope::cli
