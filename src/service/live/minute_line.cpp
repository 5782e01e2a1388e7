#include "service/live/minute_line.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>

#include "base/calibration_levels.h"
#include "base/units.h"

namespace imuscope {
namespace {

double largest(const Vector3& three) { return *std::max_element(three.begin(), three.end()); }

std::string vehicle_words(const NavigationOutput& navigation) {
  if (navigation.status == NavigationStatus::kNotOffered) return "without GNSS";
  if (navigation.status != NavigationStatus::kNavigating) return "no navigation yet";
  constexpr double kKmhPerMps = 3.6;
  const double speed_kmh = kKmhPerMps * std::hypot(navigation.v_n_mps[0], navigation.v_n_mps[1]);
  return fmt::format("{:.0f} km/h, position {:.2g} m", speed_kmh, largest(navigation.sd_position_m));
}

std::string study_words(const std::string& name, const SImuOutput& study) {
  if (!has_estimate(study.status)) return fmt::format("{} {}", name, words_of(study.status));
  return fmt::format("{} boresight {:.2g} deg, lever arm {:.2g} mm, time {:.2g} ms", name,
                     kDegPerRad * largest(study.sd_psi_rad), kMmPerM * largest(study.sd_r_bs_b_m),
                     kMsPerS * study.sd_t_d_s);
}

}  // namespace

std::optional<std::string> MinuteLine::look(const Snapshot& snapshot) {
  const auto minutes = snapshot.tick * kTickPeriod / std::chrono::minutes(1);
  if (minutes <= told_) return std::nullopt;
  told_ = minutes;
  std::string line = fmt::format("{} min: {}", minutes, vehicle_words(snapshot.navigation));
  const auto studies = configuration_.study_indices();
  for (std::size_t i = 0; i < snapshot.n_studies; ++i)
    line += "; " + study_words(configuration_.devices[studies[i]].name, snapshot.studies[i]);
  return line;
}

}  // namespace imuscope
