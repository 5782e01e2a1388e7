#include "check/check.h"

#include <fmt/format.h>
#include <algorithm>
#include <iterator>
#include <utility>

#include "check/bins.h"
#include "check/checks.h"

namespace imuscope::check {

namespace {

bool found(const std::vector<Finding>& findings, const std::string& device, const std::string& check) {
  return std::any_of(findings.begin(), findings.end(), [&](const Finding& finding) {
    return finding.device == device && finding.check == check;
  });
}

/// Each S-IMU that can be compared with the reference. A pair changes nothing but the S-IMU's own track.
std::vector<std::pair<std::size_t, PairAxes>> compare_pairs(Drive& drive, const std::vector<bool>& comparable,
                                                            std::launch how, std::vector<Finding>& findings) {
  struct Compared {
    PairAxes axes;
    std::vector<Finding> findings;
  };
  std::vector<std::pair<std::size_t, std::future<Compared>>> work;
  for (const std::size_t study : drive.configuration().study_indices()) {
    if (!comparable[study] || drive.imu(study).size() == 0) continue;
    work.emplace_back(study, std::async(how, [&drive, study] {
                        Compared compared;
                        compared.axes = check_pair(drive, study, compared.findings);
                        return compared;
                      }));
  }
  std::vector<std::pair<std::size_t, PairAxes>> pairs;
  for (auto& [study, future] : work) {
    Compared compared = future.get();
    pairs.emplace_back(study, compared.axes);
    // Samples that share their times with others move as nothing does.
    if (found(findings, drive.configuration().devices[study].name, "repeated samples"))
      std::erase_if(compared.findings, [](const Finding& f) { return f.check == "one body"; });
    findings.insert(findings.end(), std::make_move_iterator(compared.findings.begin()),
                    std::make_move_iterator(compared.findings.end()));
  }
  return pairs;
}

}  // namespace

std::string sentence(const Finding& finding) {
  std::string evidence;
  if (!finding.unit.empty()) {
    evidence = fmt::format(" ({:.4g} {}", finding.value, finding.unit);
    if (finding.expected != 0.0) evidence += fmt::format(", expected {:.4g}", finding.expected);
    evidence += ")";
  }
  return fmt::format("{}: {}{}; {}", finding.device, finding.what, evidence, finding.remedy);
}

std::vector<Finding> look_at(Drive& drive, std::launch pairs) {
  const Configuration& configuration = drive.configuration();
  std::vector<Finding> findings;
  std::vector<bool> comparable(configuration.devices.size(), true);
  for (std::size_t i = 0; i < configuration.devices.size(); ++i) {
    check_stamps(drive, i, findings);
    comparable[i] = !found(findings, configuration.devices[i].name, kStandingStamps);
    if (drive.imu(i).size() == 0) continue;
    if (!found(findings, configuration.devices[i].name, "repeated samples"))
      check_signals(drive, i, findings);
    check_gravity_norm(drive, i, findings);
  }
  if (check_files(drive, findings)) comparable[configuration.reference_index()] = false;
  ReferenceAxes reference = reference_down(drive);
  const bool has_reference = comparable[configuration.reference_index()];
  for (std::size_t i = 0; i < configuration.devices.size(); ++i)
    comparable[i] = comparable[i] && has_reference && check_overlap(drive, i, findings);
  if (const auto gnss = configuration.gnss_index()) {
    check_positions(drive, *gnss, findings);
    if (comparable[*gnss]) reference = check_motion(drive, *gnss, findings);
  }
  const auto compared = compare_pairs(drive, comparable, pairs, findings);
  check_axes(drive, reference, compared, findings);
  const bool units = std::none_of(findings.begin(), findings.end(),
                                  [](const Finding& f) { return f.check == "rate unit" && f.mends.empty(); });
  for (std::size_t i = 0; i < configuration.devices.size() && units; ++i)
    check_gyro_offset(drive, i, findings);
  check_drive(drive, reference, findings);
  std::stable_sort(findings.begin(), findings.end(),
                   [](const Finding& a, const Finding& b) { return a.harm < b.harm; });
  return findings;
}

void check_drive(const Drive& drive, const ReferenceAxes& reference, std::vector<Finding>& findings) {
  // A quarter turn each way shows a scale error of the yaw gyro from its bias.
  constexpr double kTurnMin_rad = 1.5;
  constexpr double kRestMin_s = 10.0;
  constexpr double kRestRate_radps = 0.01;
  constexpr double kRestForce_mps2 = 0.2;
  constexpr int kMeanBins = 11;
  const std::size_t device = drive.configuration().reference_index();
  const ImuBins bins = bins_of(drive.imu(device), kMeanBins);
  double left_rad = 0.0;
  double right_rad = 0.0;
  double rest_s = 0.0;
  double longest_s = 0.0;
  Eigen::Vector3d before_f = Eigen::Vector3d::Zero();
  for (std::size_t i = 0; i < bins.valid.size(); ++i) {
    if (!bins.valid[i]) continue;
    const double turned_rad = bins.omega_radps[i].dot(reference.down) * kBin_s;
    (turned_rad > 0.0 ? right_rad : left_rad) += std::abs(turned_rad);
    const bool rests = bins.omega_radps[i].norm() < kRestRate_radps &&
                       (rest_s == 0.0 || (bins.f_mps2[i] - before_f).norm() < kRestForce_mps2);
    if (rests && rest_s == 0.0) before_f = bins.f_mps2[i];
    rest_s = rests ? rest_s + kBin_s : 0.0;
    longest_s = std::max(longest_s, rest_s);
  }
  const std::string& name = drive.configuration().devices[device].name;
  const double turn_rad = std::min(left_rad, right_rad);
  if (!bins.valid.empty() && turn_rad < kTurnMin_rad) {
    findings.push_back({Harm::kNote,
                        "turns",
                        name,
                        "the drive has no turns both ways",
                        turn_rad,
                        kTurnMin_rad,
                        "rad to one side",
                        "drive turns to the left and to the right",
                        {}});
  }
  if (!bins.valid.empty() && longest_s < kRestMin_s) {
    findings.push_back({Harm::kNote,
                        "rest",
                        name,
                        "the vehicle never rests",
                        longest_s,
                        kRestMin_s,
                        "s",
                        "stand for a minute at the beginning, where the noise at rest is wanted",
                        {}});
  }
}

}  // namespace imuscope::check
