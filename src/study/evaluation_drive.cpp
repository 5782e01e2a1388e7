#include "study/evaluation_drive.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "base/units.h"
#include "estimation/calibration/gnss_trust.h"
#include "estimation/navigation/so3.h"
#include "results/tables/csv_reader.h"
#include "sample/eigen_arrays.h"
#include "service/pipeline/estimator_setup.h"

namespace imuscope {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using nlohmann::json;

/// What calibration.json says of one S-IMU.
struct FoundMounting {
  std::size_t study = 0;  ///< in the order of the configuration
  std::string name;
  KnownMounting mounting;
};

std::vector<FoundMounting> found_mountings(const Configuration& configuration, const Recording& recording,
                                           const json& calibration) {
  std::vector<FoundMounting> found;
  const auto infos = study_file_infos(configuration, recording);
  for (std::size_t i = 0; i < infos.size(); ++i) {
    for (const json& imu : calibration.at("imus")) {
      if (imu.at("name") != infos[i].name || !imu.at("C_b_s").is_array()) continue;
      KnownMounting mounting;
      mounting.C_b_s = imu.at("C_b_s").get<Matrix3>();
      mounting.r_bs_b_m = imu.at("r_bs_b_m").get<Vector3>();
      mounting.t_d_s = imu.at("t_d_s").get<double>() - infos[i].clock_shift_s;
      mounting.gyro_scale = imu.at("gyro_scale").get<Vector3>();
      mounting.accel_scale = imu.at("accel_scale").get<Vector3>();
      found.push_back({i, infos[i].name, mounting});
    }
  }
  return found;
}

/// One row of navigation.csv.
struct TrajectoryRow {
  double time_s;
  NavigationState state;  ///< of b
  KinematicVector sd;
};

/// Makes one S-IMU's drive of its epochs as they come, so that nothing is held that the drive does not need.
class StudyDriveMaker {
 public:
  StudyDriveMaker(const FoundMounting& found, const std::vector<TrajectoryRow>& rows,
                  const Vector3d& r_ba_b_m)
      : rows_(rows),
        C_b_s_(to_eigen(found.mounting.C_b_s)),
        r_bs_b_m_(to_eigen(found.mounting.r_bs_b_m)),
        gyro_gain_(Vector3d::Ones() + to_eigen(found.mounting.gyro_scale)),
        accel_gain_(Vector3d::Ones() + to_eigen(found.mounting.accel_scale)) {
    made_.name = found.name;
    made_.drive.r_sa_s_m = C_b_s_ * (r_ba_b_m - r_bs_b_m_);
  }

  void add(const SImuEpoch& epoch, HostTime origin) {
    const HostTime shown = epoch.time + from_seconds(epoch.t_d_s);  // the motion's instant
    const double time_s = to_seconds(shown - origin);
    for (; next_row_ < rows_.size() && origin + from_seconds(rows_[next_row_].time_s) <= shown; ++next_row_)
      made_.drive.reference.push_back(at_study(rows_[next_row_], to_eigen(epoch.omega_ib_b_radps)));
    if (made_.regimes.empty() || made_.regimes.back().second != epoch.regime)
      made_.regimes.emplace_back(time_s, epoch.regime);
    if (!is_whole(epoch.sample.flags)) return;
    made_.drive.samples.push_back({time_s,
                                   {to_eigen(epoch.sample.omega_radps).cwiseQuotient(gyro_gain_),
                                    to_eigen(epoch.sample.f_mps2).cwiseQuotient(accel_gain_)}});
  }

  [[nodiscard]] StudyDrive& made() noexcept { return made_; }

 private:
  /// Neither triad missing nor at the end of its range.
  static bool is_whole(std::uint32_t flags) noexcept {
    constexpr std::uint32_t kBoth = kGyroValid | kAccelValid;
    constexpr std::uint32_t kClipped =
        kGyroClipX | kGyroClipY | kGyroClipZ | kAccelClipX | kAccelClipY | kAccelClipZ;
    return (flags & kBoth) == kBoth && (flags & kClipped) == 0;
  }

  /// The trajectory at the S-IMU's place. The Earth's rate through the lever arm (below 0.1 mm/s) is left
  /// out.
  [[nodiscard]] DriveReference at_study(const TrajectoryRow& row, const Vector3d& omega_ib_b_radps) const {
    DriveReference at{row.time_s, row.state, row.sd};
    at.state.position = displaced(row.state.position, row.state.C_b_n * r_bs_b_m_);
    at.state.v_n_mps += row.state.C_b_n * omega_ib_b_radps.cross(r_bs_b_m_);
    at.state.C_b_n = row.state.C_b_n * C_b_s_.transpose();
    return at;
  }

  const std::vector<TrajectoryRow>& rows_;
  Matrix3d C_b_s_;
  Vector3d r_bs_b_m_;
  Vector3d gyro_gain_;
  Vector3d accel_gain_;
  std::size_t next_row_ = 0;
  StudyDrive made_;
};

/// Everything that one replay yields.
class Gatherer final : public CoreSink {
 public:
  struct Fix {
    HostTime time;
    UtcTime utc;
    bool has_utc;
    GnssData gnss;
  };
  struct Tag {
    UtcTime utc;
    HostTime time;
  };

  explicit Gatherer(std::size_t n_studies) : makers(n_studies) {}

  void on_epoch(const SImuEpoch& epoch, const TickFacts& facts) noexcept override {
    first_reference_time = facts.first_reference_time;
    if (makers[epoch.study]) makers[epoch.study]->add(epoch, first_reference_time);
  }
  void on_error(const ErrorRecord&) noexcept override {}
  void on_event(const EstimatorEvent&) noexcept override {}
  void on_snapshot(const Snapshot&) noexcept override {}
  void on_late_sample(const LateSample&) noexcept override {}

  void on_sample(const Sample& sample, DeviceIndex reference, DeviceIndex gnss) {
    if (sample.device == reference && sample.kind == SampleKind::kImu && sample.has_utc)
      tags.push_back({sample.utc, sample.time});
    if (sample.device == gnss && sample.kind == SampleKind::kGnss)
      fixes.push_back({sample.time, sample.utc, sample.has_utc, sample.gnss});
  }

  /// On the run's time, as the live filter has it: by the UTC tag of the reference epoch before it.
  [[nodiscard]] HostTime time_of(const Fix& fix) const {
    if (!fix.has_utc || tags.empty()) return fix.time;
    auto after = std::upper_bound(tags.begin(), tags.end(), fix.utc,
                                  [](UtcTime utc, const Tag& tag) { return utc < tag.utc; });
    if (after != tags.begin()) --after;
    return after->time + (fix.utc - after->utc);
  }

  std::vector<std::optional<StudyDriveMaker>> makers;  ///< by study; those that were calibrated
  std::vector<Fix> fixes;
  std::vector<Tag> tags;
  HostTime first_reference_time{};
};

Result<std::vector<TrajectoryRow>> read_trajectory(const std::filesystem::path& run_dir) {
  auto file = run_dir / "smoothed_navigation.csv";
  if (!std::filesystem::exists(file)) file = run_dir / "navigation.csv";
  auto reader = tables::CsvReader::open(
      file, {"time_s", "lat_deg", "lon_deg", "height_m", "v_n_mps", "v_e_mps", "v_d_mps", "roll_deg",
             "pitch_deg", "heading_deg", "sd_n_m", "sd_e_m", "sd_d_m", "sd_v_n_mps", "sd_v_e_mps",
             "sd_v_d_mps", "sd_roll_deg", "sd_pitch_deg", "sd_heading_deg"});
  if (!reader) return tl::unexpected<Error>(reader.error());
  std::vector<TrajectoryRow> rows;
  while (reader->next()) {
    const auto number = [&](std::size_t i) { return reader->number(i); };
    TrajectoryRow row;
    row.time_s = number(0);
    row.state.position = {number(1) * kRadPerDeg, number(2) * kRadPerDeg, number(3)};
    row.state.v_n_mps = {number(4), number(5), number(6)};
    row.state.C_b_n =
        rotation_from_euler({number(7) * kRadPerDeg, number(8) * kRadPerDeg, number(9) * kRadPerDeg});
    for (Eigen::Index i = 0; i < 6; ++i) row.sd[i] = number(10 + static_cast<std::size_t>(i));
    // Roll and pitch lie in the level plane, in whatever direction the vehicle heads.
    const double level = std::max(number(16), number(17)) * kRadPerDeg;
    row.sd.tail<3>() = Vector3d(level, level, number(18) * kRadPerDeg);
    if (row.state.C_b_n.allFinite() && row.sd.allFinite() && std::isfinite(row.state.position.height_m))
      rows.push_back(row);
  }
  if (rows.empty()) {
    return work_error(file.string() + " holds no position",
                      "outages are judged against the reference's own navigation, which needs a gnss device");
  }
  return rows;
}

std::vector<DriveFix> drive_fixes(const Gatherer& gathered, const GnssConfig& config) {
  std::vector<DriveFix> fixes;
  double last_s = -std::numeric_limits<double>::infinity();
  for (const Gatherer::Fix& fix : gathered.fixes) {
    const GnssData& gnss = fix.gnss;
    if ((gnss.flags & kPositionValid) == 0 || gnss.solution == GnssSolution::kNone) continue;
    DriveFix out;
    out.time_s = to_seconds(gathered.time_of(fix) - gathered.first_reference_time);
    if (out.time_s <= last_s) continue;
    out.antenna = {gnss.latitude_rad, gnss.longitude_rad, gnss.height_m};
    out.sd_position_m =
        correlated_sd_factor(gnss.solution, out.time_s - last_s) * trusted_position_sd(gnss, config);
    out.has_velocity = config.use_velocity && (gnss.flags & kVelocityValid) != 0;
    out.v_n_mps = to_eigen(gnss.v_n_mps);
    out.sd_velocity_mps = trusted_velocity_sd(gnss, config);
    last_s = out.time_s;
    fixes.push_back(out);
  }
  return fixes;
}

}  // namespace

Result<std::vector<StudyDrive>> evaluation_drives(const OpenedRecording& opened,
                                                  const std::filesystem::path& run_dir,
                                                  const json& calibration,
                                                  const std::function<void(double)>& progress) {
  const Configuration& configuration = opened.configuration;
  const auto gnss = configuration.gnss_index();
  if (!gnss) return work_error("this run has no GNSS device", "outages of GNSS need one");
  const auto rows = read_trajectory(run_dir);
  if (!rows) return tl::unexpected<Error>(rows.error());
  const auto found = found_mountings(configuration, opened.recording, calibration);
  EstimatorConfig estimator = estimator_config(configuration);
  for (const FoundMounting& study : found)
    estimator.studies[study.study] = with_mounting(estimator.studies[study.study], study.mounting);

  Gatherer gathered(estimator.studies.size());
  for (const FoundMounting& study : found)
    gathered.makers[study.study].emplace(study, *rows, to_eigen(estimator.gnss.antenna_lever_arm_b_m));
  ReplayOptions options;
  options.progress = progress;
  const auto reference = static_cast<DeviceIndex>(configuration.reference_index());
  options.on_sample = [&](const Sample& sample) {
    gathered.on_sample(sample, reference, static_cast<DeviceIndex>(*gnss));
  };
  const auto replayed = replay(configuration, estimator, opened.recording, gathered, options);
  if (!replayed) return tl::unexpected<Error>(replayed.error());

  std::vector<StudyDrive> drives;
  const auto fixes = drive_fixes(gathered, estimator.gnss);
  for (const FoundMounting& study : found) {
    StudyDrive& made = gathered.makers[study.study]->made();
    if (made.regimes.empty()) continue;  // no epoch came
    made.drive.fixes = fixes;
    drives.push_back(std::move(made));
  }
  return drives;
}

}  // namespace imuscope
