#include "service/evaluation_drive.h"

#include <algorithm>
#include <cmath>
#include <deque>
#include <optional>

#include "base/units.h"
#include "calibration/gnss_trust.h"
#include "navigation/so3.h"
#include "report/csv_reader.h"
#include "service/estimator_setup.h"
#include "service/study.h"

namespace imuscope {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using nlohmann::json;

Vector3d vector(const Vector3& v) { return {v[0], v[1], v[2]}; }

Matrix3d matrix(const Matrix3& m) {
  return Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(m.data());
}

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

/// Everything that one replay yields.
class Gatherer final : public CoreSink {
 public:
  struct StudySample {
    HostTime shown;  ///< instant of the motion
    InertialRates measured;
    Vector3d omega_ib_b;
    Regime regime;
    bool whole;  ///< neither triad missing nor at the end of its range
  };
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

  explicit Gatherer(std::size_t n_studies) : samples(n_studies) {}

  void on_epoch(const StudyEpoch& epoch, HostTime first_reference) noexcept override {
    first_reference_time = first_reference;
    constexpr std::uint32_t kBoth = kGyroValid | kAccelValid;
    constexpr std::uint32_t kClipped =
        kGyroClipX | kGyroClipY | kGyroClipZ | kAccelClipX | kAccelClipY | kAccelClipZ;
    const std::uint32_t flags = epoch.sample.flags;
    samples[epoch.study].push_back({epoch.time + from_seconds(epoch.t_d_s),
                                    {vector(epoch.sample.omega_radps), vector(epoch.sample.f_mps2)},
                                    vector(epoch.omega_ib_b_radps),
                                    epoch.regime,
                                    (flags & kBoth) == kBoth && (flags & kClipped) == 0});
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

  /// Of each study; without the spare room that a growing vector has for as much again.
  std::vector<std::deque<StudySample>> samples;
  std::vector<Fix> fixes;
  std::vector<Tag> tags;
  HostTime first_reference_time{};
};

/// One row of navigation.csv.
struct TrajectoryRow {
  double time_s;
  NavigationState state;  ///< of b
  KinematicVector sd;
};

Result<std::vector<TrajectoryRow>> read_trajectory(const std::filesystem::path& run_dir) {
  auto file = run_dir / "smoothed_navigation.csv";
  if (!std::filesystem::exists(file)) file = run_dir / "navigation.csv";
  auto reader = report::CsvReader::open(
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

/// The trajectory at the S-IMU's place. The Earth's rate through the lever arm (below 0.1 mm/s) is left out.
std::vector<DriveReference> at_study(const std::vector<TrajectoryRow>& rows, const KnownMounting& mounting,
                                     const std::deque<Gatherer::StudySample>& samples, HostTime origin) {
  const Vector3d r_bs_b = vector(mounting.r_bs_b_m);
  const Matrix3d C_b_s = matrix(mounting.C_b_s);
  std::vector<DriveReference> reference;
  auto sample = samples.begin();
  for (const TrajectoryRow& row : rows) {
    const HostTime time = origin + from_seconds(row.time_s);
    while (sample != samples.end() && sample->shown < time) ++sample;
    if (sample == samples.end()) break;
    DriveReference at{row.time_s, row.state, row.sd};
    at.state.position = displaced(row.state.position, row.state.C_b_n * r_bs_b);
    at.state.v_n_mps += row.state.C_b_n * sample->omega_ib_b.cross(r_bs_b);
    at.state.C_b_n = row.state.C_b_n * C_b_s.transpose();
    reference.push_back(at);
  }
  return reference;
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
    out.v_n_mps = vector(gnss.v_n_mps);
    out.sd_velocity_mps = trusted_velocity_sd(gnss, config);
    last_s = out.time_s;
    fixes.push_back(out);
  }
  return fixes;
}

std::vector<DriveSample> drive_samples(const std::deque<Gatherer::StudySample>& samples,
                                       const KnownMounting& mounting, HostTime origin) {
  const Vector3d gyro_gain = Vector3d::Ones() + vector(mounting.gyro_scale);
  const Vector3d accel_gain = Vector3d::Ones() + vector(mounting.accel_scale);
  std::vector<DriveSample> out;
  out.reserve(samples.size());
  for (const auto& sample : samples) {
    if (!sample.whole) continue;
    out.push_back({to_seconds(sample.shown - origin),
                   {sample.measured.omega_ib_b_radps.cwiseQuotient(gyro_gain),
                    sample.measured.f_b_mps2.cwiseQuotient(accel_gain)}});
  }
  return out;
}

StudyDrive study_drive(const Gatherer& gathered, const FoundMounting& found,
                       const std::vector<TrajectoryRow>& rows, const EstimatorConfig& estimator) {
  const HostTime origin = gathered.first_reference_time;
  const auto& samples = gathered.samples[found.study];
  StudyDrive out;
  out.name = found.name;
  out.drive.samples = drive_samples(samples, found.mounting, origin);
  out.drive.fixes = drive_fixes(gathered, estimator.gnss);
  out.drive.reference = at_study(rows, found.mounting, samples, origin);
  out.drive.r_sa_s_m = matrix(found.mounting.C_b_s) *
                       (vector(estimator.gnss.antenna_lever_arm_b_m) - vector(found.mounting.r_bs_b_m));
  for (const auto& sample : samples) {
    if (out.regimes.empty() || out.regimes.back().second != sample.regime)
      out.regimes.emplace_back(to_seconds(sample.shown - origin), sample.regime);
  }
  return out;
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
  ReplayOptions options;
  options.progress = progress;
  const auto reference = static_cast<DeviceIndex>(configuration.reference_index());
  options.on_sample = [&](const Sample& sample) {
    gathered.on_sample(sample, reference, static_cast<DeviceIndex>(*gnss));
  };
  const auto replayed = replay(configuration, estimator, opened.recording, gathered, options);
  if (!replayed) return tl::unexpected<Error>(replayed.error());

  std::vector<StudyDrive> drives;
  for (const FoundMounting& study : found) {
    auto& samples = gathered.samples[study.study];
    if (!samples.empty()) drives.push_back(study_drive(gathered, study, *rows, estimator));
    samples = {};
  }
  return drives;
}

}  // namespace imuscope
