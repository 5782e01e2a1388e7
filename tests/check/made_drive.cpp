#include "made_drive.h"

#include <fmt/format.h>
#include <Eigen/Geometry>
#include <cmath>
#include <random>

#include "base/units.h"
#include "estimation/navigation/wgs84.h"

namespace imuscope::check {

namespace {

constexpr const char* kThreeDevices = R"([[device]]
name = "reference"
role = "reference"
protocol = "csv_imu"
rate_hz = {}

[[device]]
name = "study"
role = "study"
protocol = "csv_imu"
rate_hz = {}
[device.csv]
clock = "own"

[[device]]
name = "gnss"
role = "gnss"
protocol = "csv_gnss"
rate_hz = {}
)";

struct Motion {
  double speed_mps = 0.0;
  double acceleration_mps2 = 0.0;
  double turn_radps = 0.0;
  double roll_rad = 0.0;
  double roll_radps = 0.0;
  double pitch_rad = 0.0;
  double pitch_radps = 0.0;
};

/// From 0 where nothing turns to 1, of a drive that has straights.
double share_of_curves(const MadeDrive& how, double t) {
  constexpr double kMinute_s = 60.0;
  constexpr double kStraight_s = 45.0;
  if (!how.straights) return 1.0;
  const double curve_s = std::fmod(t, kMinute_s) - kStraight_s;
  return curve_s > 0.0 ? std::pow(std::sin(kPi * curve_s / (kMinute_s - kStraight_s)), 2) : 0.0;
}

/// Speed, turn and tilts so many seconds after the rest; their sines do not repeat together.
Motion without_derivatives(const MadeDrive& how, double t) {
  Motion m;
  if (t <= 0.0) return m;
  const double starts = 1.0 - std::exp(-0.2 * t);
  const double curves = starts * share_of_curves(how, t);
  m.speed_mps = starts * (9.0 + 2.0 * std::sin(0.37 * t));
  m.turn_radps = how.turns * curves * (0.25 * std::sin(0.31 * t) + 0.12 * std::sin(0.83 * t));
  m.roll_rad = how.tilts * 0.05 * curves * std::sin(2.1 * t);
  m.pitch_rad = how.tilts * 0.04 * curves * std::sin(2.7 * t);
  return m;
}

Motion motion_at(const MadeDrive& how, double time_s) {
  constexpr double kHalfStep_s = 1e-3;
  const double t = time_s - how.rest_s;
  Motion m = without_derivatives(how, t);
  const Motion before = without_derivatives(how, t - kHalfStep_s);
  const Motion after = without_derivatives(how, t + kHalfStep_s);
  m.acceleration_mps2 = (after.speed_mps - before.speed_mps) / (2.0 * kHalfStep_s);
  m.roll_radps = (after.roll_rad - before.roll_rad) / (2.0 * kHalfStep_s);
  m.pitch_radps = (after.pitch_rad - before.pitch_rad) / (2.0 * kHalfStep_s);
  return m;
}

struct RatesAndForces {
  Eigen::Vector3d omega_radps;
  Eigen::Vector3d f_mps2;
};

RatesAndForces imu_at(const Motion& m) {
  // Yaw, pitch, roll in this order; forward-right-down.
  const Eigen::Matrix3d level_from_body = (Eigen::AngleAxisd(m.pitch_rad, Eigen::Vector3d::UnitY()) *
                                           Eigen::AngleAxisd(m.roll_rad, Eigen::Vector3d::UnitX()))
                                              .toRotationMatrix();
  const Eigen::Vector3d f_level(m.acceleration_mps2, m.speed_mps * m.turn_radps, -kMps2PerG);
  const Eigen::Vector3d omega(
      m.roll_radps - std::sin(m.pitch_rad) * m.turn_radps,
      std::cos(m.roll_rad) * m.pitch_radps + std::sin(m.roll_rad) * std::cos(m.pitch_rad) * m.turn_radps,
      -std::sin(m.roll_rad) * m.pitch_radps + std::cos(m.roll_rad) * std::cos(m.pitch_rad) * m.turn_radps);
  return {omega, level_from_body.transpose() * f_level};
}

class Noise {
 public:
  explicit Noise(unsigned seed) : random_(seed) {}
  Eigen::Vector3d operator()(double sd) {
    const double x = normal_(random_);
    const double y = normal_(random_);
    return sd * Eigen::Vector3d(x, y, normal_(random_));
  }

 private:
  std::mt19937_64 random_;
  std::normal_distribution<double> normal_;
};

Sample imu_sample(DeviceIndex device, std::size_t i, double time_s, const RatesAndForces& imu) {
  Sample sample{};
  sample.kind = SampleKind::kImu;
  sample.device = device;
  sample.sequence = i;
  sample.time = HostTime{} + from_seconds(time_s);
  for (Eigen::Index axis = 0; axis < 3; ++axis) {
    sample.imu.omega_radps[static_cast<std::size_t>(axis)] = imu.omega_radps[axis];
    sample.imu.f_mps2[static_cast<std::size_t>(axis)] = imu.f_mps2[axis];
  }
  sample.imu.flags = kGyroValid | kAccelValid;
  sample.imu.counter = static_cast<std::int64_t>(i);
  return sample;
}

std::vector<Sample> imu_samples(const MadeDrive& how, bool study) {
  // An S-IMU lies as it was thrown in, its clock begins 3.3 s earlier.
  const Eigen::Matrix3d turn =
      study ? Eigen::AngleAxisd(0.9, Eigen::Vector3d(0.3, -0.8, 0.5).normalized()).toRotationMatrix()
            : Eigen::Matrix3d::Identity();
  const double rate_hz = study ? how.study_hz : how.reference_hz;
  Noise noise(study ? 2 : 1);
  std::vector<Sample> samples;
  for (std::size_t i = 0; static_cast<double>(i) < how.length_s * rate_hz; ++i) {
    const double time_s = 100.0 + static_cast<double>(i) / rate_hz;
    RatesAndForces imu = imu_at(motion_at(how, time_s - 100.0));
    imu.omega_radps = turn.transpose() * imu.omega_radps + noise(study ? 5e-3 : 1e-4);
    imu.f_mps2 = turn.transpose() * imu.f_mps2 + noise(study ? 2e-2 : 1e-3);
    samples.push_back(imu_sample(study ? 1 : 0, i, study ? time_s + 3.3 : time_s, imu));
  }
  return samples;
}

std::vector<Sample> gnss_samples(const MadeDrive& how) {
  constexpr GeodeticPosition kHome{46.5 * kRadPerDeg, 6.5 * kRadPerDeg, 400.0};
  constexpr int kStepsPerSecond = 200;
  const int every = static_cast<int>(kStepsPerSecond / how.gnss_hz);
  Noise noise(3);
  Eigen::Vector3d place_m = Eigen::Vector3d::Zero();
  double course_rad = 0.5;
  std::vector<Sample> samples;
  for (int step = 0; step < how.length_s * kStepsPerSecond; ++step) {
    if (step % every == 0) {
      Sample sample{};
      sample.kind = SampleKind::kGnss;
      sample.device = 2;
      sample.sequence = samples.size();
      sample.time = HostTime{} + from_seconds(100.0 + static_cast<double>(step) / kStepsPerSecond);
      const GeodeticPosition position = displaced(kHome, place_m + noise(0.01));
      sample.gnss.latitude_rad = position.latitude_rad;
      sample.gnss.longitude_rad = position.longitude_rad;
      sample.gnss.height_m = position.height_m;
      sample.gnss.flags = kPositionValid | kHasPositionSd;
      sample.gnss.sd_position_m = {0.02, 0.03, 0.05};
      samples.push_back(sample);
    }
    const Motion m = motion_at(how, (step + 0.5) / kStepsPerSecond);
    course_rad += 0.5 * m.turn_radps / kStepsPerSecond;
    place_m +=
        m.speed_mps / kStepsPerSecond * Eigen::Vector3d(std::cos(course_rad), std::sin(course_rad), 0.0);
    course_rad += 0.5 * m.turn_radps / kStepsPerSecond;
  }
  return samples;
}

}  // namespace

test::DriveInMemory made_drive(const MadeDrive& how) {
  test::DriveInMemory drive;
  drive.toml = fmt::format(fmt::runtime(kThreeDevices), how.reference_hz, how.study_hz, how.gnss_hz);
  drive.configuration = parse_configuration(drive.toml, "drive.toml").value();
  drive.samples = {imu_samples(how, false), imu_samples(how, true), gnss_samples(how)};
  drive.has_own_clock = {false, true, false};
  return drive;
}

std::string findings_text(const std::vector<Finding>& findings) {
  std::string text;
  for (const Finding& f : findings) {
    text += fmt::format("  {} | {} | {} | {} | {:.7g} | {:.7g} | {} | {}", key_of(f.harm), f.check, f.device,
                        f.what, f.value, f.expected, f.unit, f.remedy);
    for (const ConfigLine& line : f.mends)
      text += fmt::format(" | {}.{} = {}", line.device, line.key, line.value);
    text += '\n';
  }
  return text.empty() ? "  nothing\n" : text;
}

}  // namespace imuscope::check
