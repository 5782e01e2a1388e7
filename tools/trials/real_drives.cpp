/// What is found on recorded drives with known mountings, what is claimed, and what is known.
///
///   imuscope_real_drives DATA [--config DIR] [--only NAME] [--json]
///
/// DATA holds car_drive, rc_car and xsens_pair. Every recording goes the way of a user's: CSV files and a
/// committed configuration, nothing known of mounting, clocks or noise. Beside the batch estimate, which is
/// what `process` publishes, stands the live filter's end. Ends with 1 where a goal is missed.

#include <fmt/format.h>
#include <CLI/CLI.hpp>
#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "base/units.h"
#include "estimation/calibration/combine.h"
#include "estimation/calibration/filter_core.h"
#include "estimation/navigation/so3.h"
#include "real_recordings.h"
#include "service/pipeline/estimator_setup.h"
#include "service/recording/recording.h"
#include "service/recording/replay.h"
#include "study/batch_study.h"

namespace {

using namespace imuscope;
using Eigen::Matrix3d;
using Eigen::Vector3d;
using real_drives::KnownMounting;
using real_drives::RealDrive;

/// Keeps the last snapshot, and the mean of the NIS while the vehicle moves.
class Last final : public CoreSink {
 public:
  void on_error(const ErrorRecord&) noexcept override {}
  void on_event(const EstimatorEvent&) noexcept override {}
  void on_snapshot(const Snapshot& snapshot) noexcept override {
    last = snapshot;
    for (std::size_t i = 0; i < nis.size(); ++i) {
      const SImuOutput& study = snapshot.studies[i];
      if (!has_estimate(study.status) || study.regime != Regime::kDynamic) continue;
      nis[i][0] += to_eigen(study.nis_gyro);
      nis[i][1] += to_eigen(study.nis_accel);
      n[i] += 1.0;
    }
  }
  void on_late_sample(const LateSample&) noexcept override {}
  Snapshot last{};
  std::array<std::array<Vector3d, 2>, kMaxSImus> nis{};
  std::array<double, kMaxSImus> n{};
};

/// Zyx Euler angles, lever arm, time offset: truth as others know it, and by how much it is missed.
struct Comparison {
  static constexpr std::size_t kParts = 7;
  std::array<double, kParts> error{};     ///< deg, m, s
  std::array<double, kParts> sd{};        ///< published
  std::array<double, kParts> known_sd{};  ///< of the known value

  /// Error in sd of both.
  [[nodiscard]] double share(std::size_t i) const { return error[i] / std::hypot(sd[i], known_sd[i]); }
};

/// One S-IMU in one drive.
struct Found {
  const RealDrive* drive = nullptr;
  const KnownMounting* known = nullptr;
  std::optional<Comparison> batch;
  std::string why_not;
  std::optional<MountingEstimate> estimate;  ///< the batch's, for combine()
  std::optional<Comparison> filter;
  /// What `process` publishes: the batch's, or the filter's where the batch has too little to go by.
  [[nodiscard]] const std::optional<Comparison>& published() const { return batch ? batch : filter; }
  SImuOutput filter_output;
  std::array<Vector3d, 2> nis{Vector3d::Zero(), Vector3d::Zero()};
  std::uint64_t gnss_rejected = 0;
};

Vector3d euler_deg(const Matrix3d& R) {
  const EulerAngles angles = euler_from_rotation(R);
  return kDegPerRad * Vector3d(angles.roll_rad, angles.pitch_rad, angles.heading_rad);
}

Vector3d wrapped_deg(Vector3d v) {
  for (Eigen::Index i = 0; i < 3; ++i) v(i) = kDegPerRad * wrapped_angle(kRadPerDeg * v(i));
  return v;
}

Comparison compare(const RealDrive& drive, const KnownMounting& known, const SImuOutput& study,
                   double clock_shift_s) {
  const Matrix3d C_b_s = to_eigen(study.C_b_s);
  // C_b_s takes b to s; the known rotation takes s to the reference's file axes.
  const auto file_from_study = [&](const Vector3d& psi) -> Matrix3d {
    return known.b_file.transpose() * (C_b_s * exp_so3(-psi)).transpose();
  };
  const Vector3d angles = euler_deg(file_from_study(Vector3d::Zero()));
  constexpr double kStep_rad = 1e-5;
  Matrix3d slope;
  for (Eigen::Index i = 0; i < 3; ++i) {
    slope.col(i) =
        wrapped_deg(euler_deg(file_from_study(kStep_rad * Vector3d::Unit(i))) - angles) / kStep_rad;
  }
  const Eigen::Map<const Eigen::Matrix<double, 6, 6>> P(study.covariance_psi_r.data());
  const Matrix3d P_euler = slope * P.topLeftCorner<3, 3>() * slope.transpose();
  const Vector3d angle_error = wrapped_deg(angles - known.euler_deg);
  const Vector3d r_error = known.b_file.transpose() * to_eigen(study.r_bs_b_m) - known.r_m;
  Comparison out;
  for (std::size_t i = 0; i < 3; ++i) {
    const auto k = static_cast<Eigen::Index>(i);
    out.error[i] = angle_error(k);
    out.sd[i] = std::sqrt(P_euler(k, k));
    out.known_sd[i] = known.euler_sd_deg(k);
    out.error[i + 3] = r_error(k);
    out.sd[i + 3] = study.sd_r_bs_b_m[i];
    out.known_sd[i + 3] = known.r_sd_m;
  }
  // The known offsets are given to the millisecond.
  constexpr double kTimeOffsetSpread_s = 0.001;
  if (drive.t_d_s) out.error[6] = study.t_d_s + clock_shift_s - *drive.t_d_s;
  out.sd[6] = study.sd_t_d_s;
  out.known_sd[6] = kTimeOffsetSpread_s;
  return out;
}

Result<std::vector<Found>> calibrate(const RealDrive& drive, const std::string& configs) {
  const auto opened = open_recording(drive.inputs, configs + "/" + drive.config);
  if (!opened) return tl::unexpected<Error>(opened.error());
  const Configuration& configuration = opened->configuration;
  Last sink;
  BatchEstimates batch(configuration, reader_of(configuration, opened->recording));
  ReplayOptions options;
  options.on_sample = [&batch](const Sample& sample) { batch.add(sample); };
  const auto replayed =
      replay(configuration, estimator_config(configuration), opened->recording, sink, options);
  if (!replayed) return tl::unexpected<Error>(replayed.error());
  const auto indices = configuration.study_indices();
  const auto outcomes = batch.outcomes(FormerMountings(indices.size()));
  std::vector<Found> all;
  for (const KnownMounting& known : drive.mountings) {
    for (std::size_t i = 0; i < indices.size(); ++i) {
      if (configuration.devices[indices[i]].name != known.device) continue;
      const double shift_s = opened->recording.clocks[indices[i]].shift_s;
      Found found;
      found.drive = &drive;
      found.known = &known;
      found.filter_output = sink.last.studies[i];
      found.gnss_rejected = sink.last.counters.gnss_rejected;
      for (std::size_t k = 0; k < 2; ++k) found.nis[k] = sink.nis[i][k] / std::max(1.0, sink.n[i]);
      if (has_estimate(found.filter_output.status))
        found.filter = compare(drive, known, found.filter_output, shift_s);
      if (outcomes[i].mounting) {
        SImuOutput published = found.filter_output;
        take_over(*outcomes[i].mounting, published);
        found.batch = compare(drive, known, published, shift_s);
        found.estimate = estimate_of(*outcomes[i].mounting);
      } else {
        found.why_not = outcomes[i].why_not.text();
      }
      all.push_back(std::move(found));
    }
  }
  return all;
}

/// One mounting over its drives.
struct Together {
  std::string name;
  std::vector<const Found*> drives;
  CombinedMounting combined;
};

std::vector<Together> together(const std::vector<Found>& all) {
  std::map<std::string, Together> by_name;
  std::vector<std::string> order;
  for (const Found& found : all) {
    if (!found.estimate) continue;
    Together& group = by_name[found.known->name];
    if (group.drives.empty()) order.push_back(found.known->name);
    group.name = found.known->name;
    group.drives.push_back(&found);
  }
  std::vector<Together> out;
  for (const std::string& name : order) {
    Together& group = by_name[name];
    if (group.drives.size() < 2) continue;
    std::vector<MountingEstimate> estimates;
    for (const Found* found : group.drives) estimates.push_back(*found->estimate);
    auto combined = combine(estimates, CombineMethod::kInverseVariance);
    if (!combined) continue;
    group.combined = std::move(*combined);
    out.push_back(std::move(group));
  }
  return out;
}

/// How many of the hypotheses Holm's procedure rejects.
int rejected_by_holm(std::vector<double> p) {
  constexpr double kLevel = 0.05;
  std::ranges::sort(p);
  for (std::size_t i = 0; i < p.size(); ++i)
    if (p[i] > kLevel / static_cast<double>(p.size() - i)) return static_cast<int>(i);
  return static_cast<int>(p.size());
}

/// The goals, counted.
struct Counts {
  int mountings = 0;
  int found = 0;
  int components = 0;
  int inside = 0;  ///< three sd of both
  double z2 = 0.0;
  std::vector<std::string> missed;  ///< errors beyond the goal
  int false_claims = 0;  ///< the filter said "calibrated", far from the known value and the batch's
  int rejected = 0;
};

Counts count(const std::vector<Found>& all, const std::vector<Together>& groups) {
  constexpr double kInside = 3.0;
  constexpr std::array<const char*, 6> kNames{"angle x", "angle y", "angle z", "r x", "r y", "r z"};
  Counts c;
  for (const Found& found : all) {
    ++c.mountings;
    const std::string who = found.drive->name + " " + found.known->device;
    if (!found.published()) {
      c.missed.push_back(who + " not found");
      continue;
    }
    ++c.found;
    const auto& goals = found.drive->goals;
    for (std::size_t i = 0; i < 6; ++i) {
      const double share = found.published()->share(i);
      ++c.components;
      c.inside += std::abs(share) <= kInside ? 1 : 0;
      c.z2 += share * share;
      const double goal = i < 3 ? goals.euler_deg[static_cast<Eigen::Index>(i)] : goals.r_m;
      if (std::abs(found.published()->error[i]) > goal) c.missed.push_back(who + " " + kNames[i]);
    }
    if (found.drive->t_d_s && std::abs(found.published()->error[6]) > goals.t_d_s)
      c.missed.push_back(who + " t_d");
    if (found.filter && found.filter_output.status == CalibrationStatus::kCalibrated) {
      // A drive sees its own mounting, which may differ from that of others: what it saw the batch tells,
      // too.
      const auto from_batch = [&](std::size_t i) {
        if (!found.batch) return kInside + 1.0;
        const double apart = found.filter->error[i] - found.batch->error[i];
        return std::abs(apart) / std::hypot(found.filter->sd[i], found.batch->sd[i]);
      };
      bool far = false;
      for (std::size_t i = 0; i < 6; ++i)
        far = far || (std::abs(found.filter->share(i)) > kInside && from_batch(i) > kInside);
      c.false_claims += far ? 1 : 0;
    }
  }
  if (c.components > 0) c.z2 /= c.components;
  std::vector<double> p;
  for (const Together& group : groups)
    for (const DriveDeviation& drive : group.combined.drives) p.push_back(drive.p_value);
  c.rejected = rejected_by_holm(p);
  return c;
}

std::string row_of(const std::array<double, Comparison::kParts>& values) {
  const auto mm = [](double m) { return m * kMmPerM; };
  constexpr double kMsPerS = 1e3;
  return fmt::format("{:7.3f} {:7.3f} {:7.3f}  {:7.1f} {:7.1f} {:7.1f}  {:7.2f}", values[0], values[1],
                     values[2], mm(values[3]), mm(values[4]), mm(values[5]), values[6] * kMsPerS);
}

std::string outside(const Comparison& c) {
  constexpr double kInside = 3.0;
  constexpr std::array<const char*, 7> kNames{"angle x", "angle y", "angle z", "r x", "r y", "r z", "t_d"};
  std::string names;
  for (std::size_t i = 0; i < c.error.size(); ++i)
    if (std::abs(c.share(i)) > kInside) names += fmt::format(" {}", kNames[i]);
  return names.empty() ? "inside" : "outside:" + names;
}

void print(const Found& found) {
  fmt::print("{} {}\n", found.drive->name, found.known->device);
  if (found.batch) {
    fmt::print("  batch   error {}   {}\n", row_of(found.batch->error), outside(*found.batch));
    fmt::print("          sd    {}\n", row_of(found.batch->sd));
  } else {
    fmt::print("  batch   {}\n", found.why_not);
  }
  const bool calibrated = found.filter_output.status == CalibrationStatus::kCalibrated;
  if (found.filter) {
    fmt::print("  filter  error {}   {}{}\n", row_of(found.filter->error), outside(*found.filter),
               calibrated ? ", \"calibrated\"" : "");
    fmt::print("          sd    {}   NIS {:.2f} {:.2f}\n", row_of(found.filter->sd), found.nis[0].mean(),
               found.nis[1].mean());
  } else {
    fmt::print("  filter  no mounting\n");
  }
}

void print(const Together& group) {
  fmt::print(
      "{}: {} drives, between them {:.3f} deg and {:.2f} mm beyond their own sd (repeats exactly: p "
      "{:.2g}); each against the others: p",
      group.name, group.drives.size(), group.combined.between_drives_psi_sd_rad * kDegPerRad,
      group.combined.between_drives_r_sd_m * kMmPerM, group.combined.homogeneity_p_value);
  for (const DriveDeviation& drive : group.combined.drives) fmt::print(" {:.2g}", drive.p_value);
  fmt::print("\n");
}

bool print(const Counts& c) {
  const double share = c.components > 0 ? 100.0 * c.inside / c.components : 0.0;
  fmt::print("\nfound {} of {}\n", c.found, c.mountings);
  fmt::print(
      "within 3 sd of both: {} of {} components ({:.1f} %, goal 95); mean z2 {:.2f} (goal 0.5 to 1.5)\n",
      c.inside, c.components, share, c.z2);
  fmt::print("beyond the goals: {}\n",
             c.missed.empty() ? "none" : fmt::format("{}", fmt::join(c.missed, ", ")));
  fmt::print("drives that Holm's test takes for another mounting: {} (goal 0)\n", c.rejected);
  fmt::print("filters that say \"calibrated\" beyond 3 sd of the known value and of the batch: {} (goal 0)\n",
             c.false_claims);
  return c.found == c.mountings && share >= 95.0 && c.z2 >= 0.5 && c.z2 <= 1.5 && c.missed.empty() &&
         c.rejected == 0 && c.false_claims == 0;
}

nlohmann::json to_json(const Comparison& c) {
  const auto part = [](const std::array<double, Comparison::kParts>& v) {
    return nlohmann::json{{"euler_deg", {v[0], v[1], v[2]}}, {"r_m", {v[3], v[4], v[5]}}, {"t_d_s", v[6]}};
  };
  return {{"error", part(c.error)}, {"sd", part(c.sd)}, {"known_sd", part(c.known_sd)}};
}

nlohmann::json to_json(const Found& found) {
  nlohmann::json row{{"recording", found.drive->name},
                     {"device", found.known->device},
                     {"batch", found.batch ? to_json(*found.batch) : nlohmann::json(found.why_not)},
                     {"filter", found.filter ? to_json(*found.filter) : nlohmann::json(nullptr)},
                     {"filter_calibrated", found.filter_output.status == CalibrationStatus::kCalibrated},
                     {"nis_gyro", to_array(found.nis[0])},
                     {"nis_accel", to_array(found.nis[1])},
                     {"resets", found.filter_output.counters.resets},
                     {"gnss_rejected", found.gnss_rejected}};
  return row;
}

nlohmann::json to_json(const std::vector<Found>& all, const std::vector<Together>& groups, const Counts& c) {
  nlohmann::json out{{"recordings", nlohmann::json::array()}, {"mountings", nlohmann::json::array()}};
  for (const Found& found : all) out["recordings"].push_back(to_json(found));
  for (const Together& group : groups) {
    nlohmann::json one{{"mounting", group.name},
                       {"between_drives_deg", group.combined.between_drives_psi_sd_rad * kDegPerRad},
                       {"between_drives_m", group.combined.between_drives_r_sd_m},
                       {"repeats_exactly_p", group.combined.homogeneity_p_value},
                       {"p", nlohmann::json::array()}};
    for (const DriveDeviation& drive : group.combined.drives) one["p"].push_back(drive.p_value);
    out["mountings"].push_back(one);
  }
  out["counts"] = {{"mountings", c.mountings},
                   {"found", c.found},
                   {"components", c.components},
                   {"inside", c.inside},
                   {"mean_z2", c.z2},
                   {"beyond_goals", c.missed},
                   {"rejected", c.rejected},
                   {"false_claims", c.false_claims}};
  return out;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{"The estimates of recorded drives beside known mountings"};
  std::string data;
  std::string configs = "config";
  std::string only;
  bool json = false;
  app.add_option("data", data, "folder with car_drive, rc_car and xsens_pair")
      ->required()
      ->check(CLI::ExistingDirectory);
  app.add_option("--config", configs, "folder of csv_drive.toml, csv_rc_car.toml and csv_pair.toml");
  app.add_option("--only", only, "drives whose name begins so");
  app.add_flag("--json", json, "print JSON");
  CLI11_PARSE(app, argc, argv);
  const auto drives = real_drives::recordings(data);
  std::vector<Found> all;
  if (!json)
    fmt::print("{:16}{:^23}  {:^23}  {:>7}\n", "", "zyx Euler x y z, deg", "lever arm x y z, mm", "t_d, ms");
  for (const RealDrive& drive : drives) {
    if (!drive.name.starts_with(only)) continue;
    auto found = calibrate(drive, configs);
    if (!found) {
      fmt::print(stderr, "{}: {}\n", drive.name, found.error().text());
      return 2;
    }
    for (Found& one : *found) {
      if (!json) print(one);
      all.push_back(std::move(one));
    }
  }
  const auto groups = together(all);
  const Counts counts = count(all, groups);
  if (json) {
    fmt::print("{}\n", to_json(all, groups, counts).dump(2));
    return 0;
  }
  for (const Together& group : groups) print(group);
  return print(counts) ? 0 : 1;
}
