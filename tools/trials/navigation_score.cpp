#include "tools/trials/navigation_score.h"

#include <fmt/format.h>
#include <algorithm>
#include <cmath>
#include <fstream>
#include <sstream>

#include "base/units.h"
#include "base/utc_text.h"
#include "estimation/calibration/filter_core.h"
#include "estimation/navigation/so3.h"
#include "estimation/navigation/wgs84.h"

namespace s_imu_score {
namespace {

using Eigen::Vector3d;

constexpr double kSameInstant_s = 0.5e-3;

imuscope::UtcTime utc_of(const std::string& text) {
  const auto utc = imuscope::parse_utc_text(text);
  if (!utc) return {};
  return imuscope::UtcTime(imuscope::from_seconds(utc->since_1970_s));
}

}  // namespace

imuscope::Result<NavigationTruth> NavigationTruth::read(const std::filesystem::path& folder) {
  NavigationTruth truth;
  std::ifstream json_file(folder / "truth.json");
  truth.begin_ = utc_of(nlohmann::json::parse(json_file).at("t0_utc").get<std::string>());
  std::ifstream file(folder / "truth.csv");
  std::string line;
  std::getline(file, line);
  std::vector<double> times_s;
  while (std::getline(file, line)) {
    std::replace(line.begin(), line.end(), ',', ' ');
    std::istringstream in(line);
    double time_s = 0.0;
    Row row{};
    in >> time_s >> row.latitude_rad >> row.longitude_rad >> row.height_m >> row.v_n_mps[0] >>
        row.v_n_mps[1] >> row.v_n_mps[2] >> row.rpy_rad[0] >> row.rpy_rad[1] >> row.rpy_rad[2];
    if (!in) return imuscope::work_error("truth.csv is not as imusim writes it: " + line);
    row.latitude_rad *= imuscope::kRadPerDeg;
    row.longitude_rad *= imuscope::kRadPerDeg;
    for (double& angle : row.rpy_rad) angle *= imuscope::kRadPerDeg;
    times_s.push_back(time_s);
    truth.rows_.push_back(row);
  }
  if (truth.rows_.size() < 2) return imuscope::work_error("truth.csv holds no rows");
  truth.rows_hz_ = static_cast<double>(times_s.size() - 1) / (times_s.back() - times_s.front());
  return truth;
}

const NavigationTruth::Row* NavigationTruth::at(imuscope::UtcTime utc) const {
  const double place = imuscope::to_seconds(utc - begin_) * rows_hz_;
  const double nearest = std::round(place);
  if (nearest < 0.0 || nearest >= static_cast<double>(rows_.size())) return nullptr;
  if (std::abs(place - nearest) > kSameInstant_s * rows_hz_) return nullptr;
  return &rows_[static_cast<std::size_t>(nearest)];
}

imuscope::UtcTime NavigationTruth::instant_of(const Row& row) const {
  return begin_ + imuscope::from_seconds(static_cast<double>(&row - rows_.data()) / rows_hz_);
}

void NavigationScore::add(const imuscope::NavigationOutput& out, const imuscope::TimeScale& scale,
                          const NavigationTruth& truth) {
  if (out.status != imuscope::NavigationStatus::kNavigating || !out.has_utc) return;
  const NavigationTruth::Row* row = truth.at(out.utc);
  if (row == nullptr) return;
  const double utc_error_s = imuscope::to_seconds(scale.at(out.time).utc - truth.instant_of(*row));
  utc_.add(utc_error_s, scale.sd_utc_s);
  utc_errors_s_.push_back(std::abs(utc_error_s));
  const imuscope::EulerAngles angles{row->rpy_rad[0], row->rpy_rad[1], row->rpy_rad[2]};
  // True = Exp(phi) estimated, phi about north, east, down; its sd are published as those of roll, pitch and
  // heading, which are the same about a level vehicle's axes.
  const Eigen::Matrix3d C_true = imuscope::rotation_from_euler(angles);
  const Vector3d phi_b = imuscope::log_so3(imuscope::to_eigen(out.C_b_n).transpose() * C_true);
  level_.add(phi_b.x(), out.sd_rpy_rad[0]);
  level_.add(phi_b.y(), out.sd_rpy_rad[1]);
  heading_.add(phi_b.z(), out.sd_rpy_rad[2]);
  velocity_.add(out.v_n_mps, out.sd_velocity_mps, imuscope::to_eigen(row->v_n_mps));
  const Vector3d offset = imuscope::ned_offset({out.latitude_rad, out.longitude_rad, out.height_m},
                                               {row->latitude_rad, row->longitude_rad, row->height_m});
  for (std::size_t i = 0; i < 3; ++i)
    position_.add(offset(static_cast<Eigen::Index>(i)), out.sd_position_m[i]);
}

void NavigationScore::add(const NavigationScore& other) {
  heading_.add(other.heading_);
  level_.add(other.level_);
  velocity_.add(other.velocity_);
  position_.add(other.position_);
  utc_.add(other.utc_);
  utc_errors_s_.insert(utc_errors_s_.end(), other.utc_errors_s_.begin(), other.utc_errors_s_.end());
}

bool NavigationScore::is_honest() const {
  constexpr double kLeast = 0.9;  // of 95 %: errors of one drive hang together
  return std::ranges::all_of(scores(), [](const auto& kind) { return kind.second->coverage() >= kLeast; });
}

std::string NavigationScore::table() const {
  constexpr double kMdeg = 1e3 * imuscope::kDegPerRad;
  std::string text;
  const auto line = [&](const char* name, const char* unit, double per_si, const StateScore& score) {
    if (score.n() == 0) return;
    text += fmt::format(
        "   {:15} {:5} rms {:10.3f}  sd {:10.3f}  NEES an axis {:8.2f}  within 95 % interval {:5.1f} %\n",
        name, unit, per_si * score.rms(), per_si * score.rms_sd(), score.mean_z2(), 1e2 * score.coverage());
  };
  line("heading", "mdeg", kMdeg, heading_);
  line("roll, pitch", "mdeg", kMdeg, level_);
  line("velocity", "mm/s", 1e3, velocity_);
  line("position", "mm", 1e3, position_);
  line("UTC of a row", "us", 1e6, utc_);
  if (!utc_errors_s_.empty()) {
    std::vector<double> errors = utc_errors_s_;
    const auto place = static_cast<std::ptrdiff_t>(0.95 * static_cast<double>(errors.size()));
    std::nth_element(errors.begin(), errors.begin() + place, errors.end());
    text += fmt::format("   UTC of 95 % of the rows within {:.1f} us\n",
                        1e6 * errors[static_cast<std::size_t>(place)]);
  }
  return text;
}

}  // namespace s_imu_score
