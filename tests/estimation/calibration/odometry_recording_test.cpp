// A real car: phone-grade IMU, wheel speeds from its CAN, a published pose. GNSS is taken from the pose and
// cut.
#include <gtest/gtest.h>
#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <sstream>

#include "base/units.h"
#include "drivers/can_odometry/decoder.h"
#include "drivers/dbc/parser.h"
#include "estimation/calibration/estimator.h"
#include "estimation/navigation/so3.h"
#include "estimation/navigation/wgs84.h"
#include "tests/support/shared_data.h"

namespace imuscope {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr DeviceIndex kReference = 0;
constexpr DeviceIndex kGnss = 1;
constexpr DeviceIndex kWheels = 2;

Vector3 array_of(const Vector3d& v) { return {v.x(), v.y(), v.z()}; }

template <std::size_t N>
std::vector<std::array<double, N>> rows_of(const std::filesystem::path& file) {
  std::ifstream in(file);
  std::string line;
  std::getline(in, line);
  std::vector<std::array<double, N>> rows;
  while (std::getline(in, line)) {
    std::istringstream cells(line);
    std::string cell;
    rows.emplace_back();
    for (double& value : rows.back()) {
      std::getline(cells, cell, ',');
      value = std::stod(cell);
    }
  }
  return rows;
}

Sample stamped(SampleKind kind, DeviceIndex device, double t_s) {
  Sample sample{};
  sample.kind = kind;
  sample.device = device;
  sample.time = HostTime{from_seconds(t_s)};
  sample.arrival = sample.time;
  return sample;
}

class Collector final : public SampleSink {
 public:
  explicit Collector(std::vector<Sample>& samples) : samples_(samples) {}
  void on_sample(const Sample& sample) noexcept override { samples_.push_back(sample); }

 private:
  std::vector<Sample>& samples_;
};

void add_wheels(std::vector<Sample>& samples) {
  const auto text = dbc::read_text(test::source_path("config/toyota_rav4.dbc"));
  ASSERT_TRUE(text);
  const auto database = dbc::parse(*text, "toyota_rav4.dbc");
  ASSERT_TRUE(database);
  can_odometry::Choice choice;
  choice.speed_signals = {"RR", "RL"};
  choice.has_no_sign = true;
  can_odometry::DecoderConfig config;
  config.device = kWheels;
  config.rate_hz = 83.0;
  auto decoder = can_odometry::Decoder::make(*database, choice, config);
  ASSERT_TRUE(decoder);
  Collector collector(samples);
  std::ifstream log(test::shared_path("data/can_car/car.candump.log"));
  for (std::string line; std::getline(log, line);) {
    if (line.find(" 0AA#") == std::string::npos) continue;
    CanFrame frame;
    frame.id = 0x0AA;
    frame.stamp = HostTime{from_seconds(std::stod(line.substr(1, line.find(')') - 1)))};
    for (std::size_t at = line.find('#') + 1; at + 1 < line.size(); at += 2)
      frame.data[frame.length++] = static_cast<std::uint8_t>(std::stoul(line.substr(at, 2), nullptr, 16));
    std::array<std::uint8_t, kCanRecordMaxBytes> record{};
    (*decoder)->push(std::span(record).first(write_can_record(frame, record)), frame.stamp, collector);
  }
}

/// t, week, tow, position, velocity (ECEF), quaternion that takes the device's axes to ECEF.
using Pose = std::array<double, 13>;

struct Local {
  GeodeticPosition position;
  Vector3d v_n;
  Matrix3d C_b_n;
};
Local local_of(const Pose& pose) {
  Local local;
  local.position = geodetic_from_ecef({pose[3], pose[4], pose[5]});
  const Matrix3d C_e_n =
      rotation_ned_to_ecef(local.position.latitude_rad, local.position.longitude_rad).transpose();
  local.v_n = C_e_n * Vector3d(pose[6], pose[7], pose[8]);
  local.C_b_n = C_e_n * Eigen::Quaterniond(pose[9], pose[10], pose[11], pose[12]).toRotationMatrix();
  return local;
}

struct Drift {
  double horizontal_m;
  double path_m;
  OdometryOutput odometry;
  EstimatorCounters counters;
};

Drift drift_without_gnss(bool with_wheels, double cut_s) {
  const auto imu = rows_of<10>(test::shared_path("data/can_car/imu.csv"));
  const auto poses = rows_of<13>(test::shared_path("data/can_car/pose_ecef.csv"));
  const double end_s = std::min(imu.back()[0], poses.back()[0]);
  std::vector<Sample> samples;
  for (const auto& row : imu) {
    Sample sample = stamped(SampleKind::kImu, kReference, row[0]);
    sample.imu.f_mps2 = {row[1], row[2], row[3]};
    sample.imu.omega_radps = {row[4], row[5], row[6]};
    sample.imu.flags = kGyroValid | kAccelValid;
    samples.push_back(sample);
  }
  Drift drift{};
  for (std::size_t i = 0; i < poses.size(); ++i) {
    const Local local = local_of(poses[i]);
    if (poses[i][0] > end_s - cut_s) {
      drift.path_m += 0.05 * local.v_n.norm();
      continue;
    }
    const EulerAngles rpy = euler_from_rotation(local.C_b_n);
    Sample attitude = stamped(SampleKind::kAttitude, kReference, poses[i][0]);
    attitude.attitude = {rpy.roll_rad, rpy.pitch_rad, rpy.heading_rad, {}, kRollPitchValid | kHeadingValid};
    samples.push_back(attitude);
    if (i % 4 != 0) continue;
    Sample gnss = stamped(SampleKind::kGnss, kGnss, poses[i][0]);
    gnss.gnss.latitude_rad = local.position.latitude_rad;
    gnss.gnss.longitude_rad = local.position.longitude_rad;
    gnss.gnss.height_m = local.position.height_m;
    gnss.gnss.v_n_mps = array_of(local.v_n);
    gnss.gnss.solution = GnssSolution::kFixed;
    gnss.gnss.flags = kPositionValid | kVelocityValid;
    samples.push_back(gnss);
  }
  if (with_wheels) add_wheels(samples);
  std::stable_sort(samples.begin(), samples.end(),
                   [](const Sample& a, const Sample& b) { return a.arrival < b.arrival; });

  EstimatorConfig config;
  config.reference.rate_hz = 104.0;
  config.reference.gyro_white_radps_per_sqrt_hz = 0.01 * kRadPerDeg;
  config.reference.accel_white_mps2_per_sqrt_hz = 0.02;
  config.reference.gyro_bias = {0.5 * kRadPerDeg, 1000.0};
  config.reference.accel_bias = {0.2, 1000.0};
  config.gnss.enabled = true;
  config.gnss.device = kGnss;
  config.gnss.default_sd_position_m = {0.5, 0.5, 0.5};
  config.gnss.default_sd_velocity_mps = {0.1, 0.1, 0.1};
  config.navigation.initial_rpy_sd_rad = {1.0 * kRadPerDeg, 1.0 * kRadPerDeg, 1.0 * kRadPerDeg};
  config.odometry.enabled = with_wheels;
  config.odometry.device = kWheels;
  config.odometry.rate_hz = 83.0;
  // The device hangs behind the windscreen.
  config.odometry.prior_r_bv_b_m = {-1.5, 0.0, 1.0};
  config.odometry.prior_r_bv_b_sd_m = {0.5, 0.3, 0.3};
  Estimator estimator(config);
  for (const Sample& sample : samples) {
    if (to_seconds(sample.arrival.time_since_epoch()) > end_s) break;
    estimator.add(sample);
    estimator.advance(sample.arrival);
  }
  const NavigationOutput& out = estimator.navigation();
  EXPECT_EQ(out.status, NavigationStatus::kNavigating);
  const auto near = std::min_element(poses.begin(), poses.end(), [&](const Pose& a, const Pose& b) {
    const double t_s = to_seconds(out.time.time_since_epoch());
    return std::abs(a[0] - t_s) < std::abs(b[0] - t_s);
  });
  const Local truth = local_of(*near);
  const double late_s = to_seconds(out.time.time_since_epoch()) - (*near)[0];
  const Vector3d error =
      ned_offset({out.latitude_rad, out.longitude_rad, out.height_m}, truth.position) + late_s * truth.v_n;
  drift.horizontal_m = error.head<2>().norm();
  drift.odometry = estimator.odometry();
  drift.counters = estimator.counters();
  return drift;
}

TEST(OdometryRecording, WheelsHoldARealCarThroughThirtySecondsWithoutGnss) {
  IMUSCOPE_NEEDS_SHARED("data/can_car/car.candump.log");
  const Drift inertial = drift_without_gnss(false, 30.0);
  const Drift wheels = drift_without_gnss(true, 30.0);
  RecordProperty("path_m", std::to_string(wheels.path_m));
  RecordProperty("inertial_m", std::to_string(inertial.horizontal_m));
  RecordProperty("wheels_m", std::to_string(wheels.horizontal_m));
  EXPECT_GT(wheels.path_m, 400.0);
  EXPECT_LT(wheels.horizontal_m, 0.5 * inertial.horizontal_m);
  EXPECT_LT(wheels.horizontal_m, 0.01 * wheels.path_m);
  // A windscreen mount looks up or down by degrees; the wheels of a car are right to a few percent.
  EXPECT_LT(std::abs(wheels.odometry.scale), 0.03);
  EXPECT_LT(wheels.odometry.sd_scale, 0.002);
  // Half a minute with GNSS: less than half of the prior of 2 deg is left.
  EXPECT_LT(wheels.odometry.sd_mount_rad[2], 1.0 * kRadPerDeg);
  const auto rejected = wheels.counters.odometry_speed_rejected + wheels.counters.odometry_slip_rejected;
  EXPECT_LT(rejected, wheels.counters.odometry_speed_used / 50);
}

}  // namespace
}  // namespace imuscope
