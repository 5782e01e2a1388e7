/// What is not known at the start is in the sd: antenna, latency, and the level that rest gives.

#include <gtest/gtest.h>
#include <array>
#include <cmath>
#include <random>

#include "estimation/navigation/so3.h"
#include "estimation/navigation/wgs84.h"
#include "firmware_sim/imu/imperfections.h"
#include "sample/eigen_arrays.h"
#include "tests/estimation/calibration/simulated_drive.h"

namespace imuscope::test {
namespace {

using Eigen::Vector3d;

/// Feeds the drive to its end, each sample changed before; `truth` is the motion at its epoch.
template <typename Change>
void run_changed(SimulatedDrive& drive, Estimator& estimator, Change change) {
  while (!drive.done()) {
    const imusim::MotionState truth = drive.motion().state_at(drive.time_s());
    std::vector<Sample> samples = drive.next();
    for (Sample& sample : samples) {
      change(sample, truth);
      estimator.add(sample);
    }
    estimator.advance(samples.front().arrival);
  }
}

/// A mean of squares over n errors that are normal with the sd claimed lies within this many of its own sd.
constexpr double kOwnSd = 3.3;

struct Squares {
  double sum = 0.0;
  int n = 0;
  void add(double error, double sd) {
    sum += error * error / (sd * sd);
    ++n;
  }
  void expect_not_too_sure(const char* name) const {
    EXPECT_LT(sum / n, 1.0 + kOwnSd * std::sqrt(2.0 / n)) << name;
    testing::Test::RecordProperty(name, std::to_string(sum / n));
  }
  void expect_normal(const char* name) const {
    expect_not_too_sure(name);
    EXPECT_GT(sum / n, 1.0 - kOwnSd * std::sqrt(2.0 / n)) << name;
  }
};

TEST(Antenna, LeverArmAndLatencyThatAreWrongAreFoundWithinTheirSd) {
  constexpr int kDrives = 24;
  constexpr double kLatency_s = 0.1;
  std::mt19937 random(71);
  std::normal_distribution<> normal;
  Squares arm;
  Squares latency;
  Squares position;
  for (int drive_number = 0; drive_number < kDrives; ++drive_number) {
    SimulatedDrive drive(200.0, {}, static_cast<std::uint64_t>(200 + drive_number));
    EstimatorConfig config = drive.config();
    // In this simulation the antenna is at b's origin.
    for (std::size_t i = 0; i < 3; ++i)
      config.gnss.antenna_lever_arm_b_m[i] = config.gnss.antenna_lever_arm_sd_m[i] * normal(random);
    config.gnss.latency_s = kLatency_s;
    config.gnss.latency_sd_s = 0.5 * kLatency_s;
    const double late_s = std::max(0.01, kLatency_s + config.gnss.latency_sd_s * normal(random));
    Estimator estimator(config);
    run_changed(drive, estimator, [&](Sample& sample, const imusim::MotionState&) {
      if (sample.kind == SampleKind::kGnss) sample.time += from_seconds(late_s);
    });
    const NavigationOutput& out = estimator.navigation();
    ASSERT_EQ(out.status, NavigationStatus::kNavigating);
    for (std::size_t i = 0; i < 3; ++i) arm.add(out.antenna_lever_arm_b_m[i], out.sd_antenna_lever_arm_m[i]);
    EXPECT_LT(out.sd_receiver_latency_s, 1e-3);
    latency.add(out.receiver_latency_s - late_s, out.sd_receiver_latency_s);
    position.add(horizontal_error_m(out, drive.motion().state_at(drive.time_s() - 0.01)),
                 std::hypot(out.sd_position_m[0], out.sd_position_m[1]));
  }
  arm.expect_normal("arm");
  latency.expect_normal("latency");
  position.expect_normal("position");
}

TEST(Antenna, ThatIsKnownExactlyStaysWhereItIs) {
  SimulatedDrive drive(60.0, {}, 5);
  EstimatorConfig config = drive.config();
  config.gnss.antenna_lever_arm_sd_m = {};
  config.gnss.latency_sd_s = 0.0;
  Estimator estimator(config);
  run(drive, estimator);
  EXPECT_EQ(estimator.navigation().antenna_lever_arm_b_m, Vector3{});
  EXPECT_EQ(estimator.navigation().receiver_latency_s, 0.0);
  EXPECT_EQ(estimator.navigation().sd_antenna_lever_arm_m, Vector3{});
}

/// Level and heading from rest; the vehicle stands on. Its accelerometers' bias is all that is wrong with the
/// level, its gyros' with the heading.
TEST(Start, OfAGyrocompassKnowsThatTiltAndBiasAreOneError) {
  constexpr int kRuns = 30;
  Squares level;
  Squares heading;
  for (int run_number = 0; run_number < kRuns; ++run_number) {
    SimulatedDrive drive(90.0, {}, static_cast<std::uint64_t>(300 + run_number),
                         imusim::ScenarioKind::kStatic);
    EstimatorConfig config = drive.config();
    config.navigation.initial_rpy_rad.reset();
    Estimator estimator(config);
    run(drive, estimator);
    const NavigationOutput& out = estimator.navigation();
    ASSERT_EQ(out.status, NavigationStatus::kNavigating);
    ASSERT_EQ(out.method, InitialisationMethod::kGyrocompass);
    const imusim::MotionState truth = drive.motion().state_at(drive.time_s() - 0.01);
    const Vector3d phi_b = log_so3(to_eigen(out.C_b_n).transpose() * truth.C_b_n);
    level.add(phi_b.x(), out.sd_rpy_rad[0]);
    level.add(phi_b.y(), out.sd_rpy_rad[1]);
    heading.add(phi_b.z(), out.sd_rpy_rad[2]);
  }
  level.expect_normal("level");
  // The filter allows for a parked vehicle that sways, which this one does not.
  heading.expect_not_too_sure("heading");
}

/// Scale and axes of one R-IMU, as the simulator draws them: the filter is told their class alone.
struct OwnAxes {
  Eigen::Matrix3d gyro;
  Eigen::Matrix3d accel;

  explicit OwnAxes(imusim::Random& random) {
    imusim::ImuErrors errors;
    imusim::draw_imperfections(
        imusim::reference_imperfections(imusim::WorldKind::kHarsh, imusim::ReferenceClass{}), random, errors);
    const auto matrix_of = [](const imusim::TriadErrors& triad) -> Eigen::Matrix3d {
      return Eigen::Matrix3d::Identity() + triad.misalignment + Eigen::Matrix3d(triad.scale.asDiagonal());
    };
    gyro = matrix_of(errors.gyro);
    accel = matrix_of(errors.accel) * errors.accel.C_s_triad;
  }
};

TEST(ReferenceAxes, ThatAreCrookedMakeNoNavigationTooSure) {
  constexpr int kDrives = 24;
  imusim::Random random(81, "own axes");
  Squares level;
  Squares heading;
  Squares velocity;
  Squares position;
  for (int drive_number = 0; drive_number < kDrives; ++drive_number) {
    SimulatedDrive drive(240.0, {}, static_cast<std::uint64_t>(400 + drive_number));
    EstimatorConfig config = drive.config();
    config.reference.grade = kNavigationGrade;
    const OwnAxes axes(random);
    Estimator estimator(config);
    run_changed(drive, estimator, [&](Sample& sample, const imusim::MotionState&) {
      if (sample.kind != SampleKind::kImu) return;
      sample.imu.omega_radps = to_array(Vector3d(axes.gyro * to_eigen(sample.imu.omega_radps)));
      sample.imu.f_mps2 = to_array(Vector3d(axes.accel * to_eigen(sample.imu.f_mps2)));
    });
    const NavigationOutput& out = estimator.navigation();
    ASSERT_EQ(out.status, NavigationStatus::kNavigating);
    const imusim::MotionState truth = drive.motion().state_at(drive.time_s() - 0.01);
    const Vector3d phi_b = log_so3(to_eigen(out.C_b_n).transpose() * truth.C_b_n);
    level.add(phi_b.x(), out.sd_rpy_rad[0]);
    level.add(phi_b.y(), out.sd_rpy_rad[1]);
    heading.add(phi_b.z(), out.sd_rpy_rad[2]);
    for (std::size_t i = 0; i < 3; ++i)
      velocity.add(out.v_n_mps[i] - truth.v_n_mps[static_cast<Eigen::Index>(i)], out.sd_velocity_mps[i]);
    position.add(horizontal_error_m(out, truth), std::hypot(out.sd_position_m[0], out.sd_position_m[1]));
  }
  level.expect_not_too_sure("level");
  heading.expect_not_too_sure("heading");
  velocity.expect_not_too_sure("velocity");
  position.expect_not_too_sure("position");
}

/// A fix of 2 cm/s whose antenna lies at `arm_b_m` of a vehicle that moves so.
void show_antenna(const GeodeticPosition& at, const imusim::MotionState& motion, const Vector3d& arm_b_m,
                  std::mt19937& random, GnssData& gnss) {
  std::normal_distribution<> normal;
  gnss.latitude_rad = at.latitude_rad;
  gnss.longitude_rad = at.longitude_rad;
  gnss.height_m = at.height_m;
  Vector3d v_n_mps = motion.v_n_mps + motion.C_b_n * motion.omega_nb_b_radps.cross(arm_b_m);
  for (double& v : v_n_mps) v += 0.02 * normal(random);
  gnss.v_n_mps = to_array(v_n_mps);
  gnss.flags |= kVelocityValid;
}

/// The swing of the antenna is seen through the rate: noise of an MTx in it would shorten the arm by a sixth.
TEST(Antenna, ArmIsNotShortenedByTheNoiseOfTheGyros) {
  constexpr int kDrives = 6;
  const Vector3d arm_b_m(-0.5, 0.2, -1.3);
  constexpr double kRateNoise_radps = 0.8 * kRadPerDeg;
  std::mt19937 random(91);
  std::normal_distribution<> normal;
  double squares_m2 = 0.0;
  double along_m = 0.0;
  for (int drive_number = 0; drive_number < kDrives; ++drive_number) {
    SimulatedDrive drive(400.0, {}, static_cast<std::uint64_t>(500 + drive_number));
    EstimatorConfig config = drive.config();
    config.reference.gyro_white_radps_per_sqrt_hz = kRateNoise_radps / std::sqrt(SimulatedDrive::kRate_hz);
    for (std::size_t i = 0; i < 3; ++i)
      config.gnss.antenna_lever_arm_b_m[i] = arm_b_m[static_cast<Eigen::Index>(i)] + 0.02 * normal(random);
    Estimator estimator(config);
    run_changed(drive, estimator, [&](Sample& sample, const imusim::MotionState& truth) {
      if (sample.kind == SampleKind::kImu) {
        for (double& rate : sample.imu.omega_radps) rate += kRateNoise_radps * normal(random);
      } else if (sample.kind == SampleKind::kGnss) {
        const GeodeticPosition at =
            displaced({sample.gnss.latitude_rad, sample.gnss.longitude_rad, sample.gnss.height_m},
                      truth.C_b_n * arm_b_m);
        show_antenna(at, truth, arm_b_m, random, sample.gnss);
      }
    });
    const NavigationOutput& out = estimator.navigation();
    ASSERT_EQ(out.status, NavigationStatus::kNavigating);
    const Vector3d error_m = to_eigen(out.antenna_lever_arm_b_m) - arm_b_m;
    squares_m2 += error_m.squaredNorm() / kDrives;
    along_m += error_m.dot(arm_b_m.normalized()) / kDrives;
  }
  // A sixth would be 0.23 m; two hundredths are what is believed of the arm before.
  EXPECT_LT(std::sqrt(squares_m2), 0.05);
  EXPECT_LT(std::abs(along_m), 0.03);
}

/// A rough road swings the antenna by up to 15 Hz, and receivers know nothing of the reference's instants: half way
/// between two of them a line through its rates has a tenth of such a swing too little, and the arm would be as much too
/// long.
TEST(Antenna, ArmIsNotMadeLongerByARoughRoad) {
  const Vector3d arm_b_m(-0.5, 0.2, -1.3);
  constexpr double kAgo_s = 0.025;
  imusim::Scenario scenario;
  scenario.duration_s = 400.0;
  scenario.rough_road_to_hz = imusim::kWheelHop_hz;
  const imusim::Motion rough(scenario);
  SimulatedDrive drive(scenario.duration_s, {}, 700);
  EstimatorConfig config = drive.config();
  config.gnss.antenna_lever_arm_b_m = to_array(arm_b_m);
  std::mt19937 random(92);
  std::normal_distribution<> normal;
  Estimator estimator(config);
  run_changed(drive, estimator, [&](Sample& sample, const imusim::MotionState& smooth) {
    const imusim::MotionState now = rough.state_at(smooth.t_s);
    if (sample.kind == SampleKind::kImu) {
      for (std::size_t i = 0; i < 3; ++i) {
        const auto axis = static_cast<Eigen::Index>(i);
        sample.imu.omega_radps[i] += now.omega_ib_b_radps[axis] - smooth.omega_ib_b_radps[axis];
        sample.imu.f_mps2[i] += now.f_b_mps2[axis] - smooth.f_b_mps2[axis];
      }
    } else if (sample.kind == SampleKind::kGnss) {
      const imusim::MotionState then = rough.state_at(smooth.t_s - kAgo_s);
      sample.time -= from_seconds(kAgo_s);
      const GeodeticPosition at =
          displaced({then.position.latitude_rad, then.position.longitude_rad, then.position.height_m},
                    then.C_b_n * arm_b_m + 0.01 * Vector3d(normal(random), normal(random), normal(random)));
      show_antenna(at, then, arm_b_m, random, sample.gnss);
    }
  });
  const NavigationOutput& out = estimator.navigation();
  ASSERT_EQ(out.status, NavigationStatus::kNavigating);
  const Vector3d error_m = to_eigen(out.antenna_lever_arm_b_m) - arm_b_m;
  for (std::size_t i = 0; i < 3; ++i)
    EXPECT_LT(std::abs(error_m[static_cast<Eigen::Index>(i)]), 3.3 * out.sd_antenna_lever_arm_m[i]) << i;
  EXPECT_LT(out.sd_antenna_lever_arm_m[2], 0.01);
  EXPECT_LT(error_m.norm(), 0.006) << error_m.transpose();  // by a line 14 mm
}

}  // namespace
}  // namespace imuscope::test
