#include "tools/trials/wheeled_drive.h"

#include <cmath>

#include "base/units.h"
#include "estimation/navigation/so3.h"
#include "estimation/navigation/wgs84.h"
#include "firmware_sim/imu/sensor_classes.h"

namespace imuscope::study {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr double kOrigin_s = 10.0;
constexpr std::uint64_t kGnssEvery = 20;
constexpr std::uint64_t kWheelsEvery = 2;
const Vector3d kGnssSd_m(0.01, 0.01, 0.02);
constexpr double kHalfTrack_m = 0.78;
constexpr double kAxleSd_m = 0.1;

// A good industrial MEMS unit, by its data sheet's class.
constexpr double kIndustrialArw_radps_per_sqrt_hz = 0.15 * kRadPerDeg / 60.0;
constexpr double kIndustrialVrw_mps2_per_sqrt_hz = 60.0 * kMps2PerMicroG;
constexpr GaussMarkovConfig kIndustrialGyroBias{10.0 * kRadPerDeg / kSecondsPerHour, 1000.0};
constexpr GaussMarkovConfig kIndustrialAccelBias{0.01, 1000.0};

Vector3 array_of(const Vector3d& v) { return {v.x(), v.y(), v.z()}; }

Vector3d normal3(imusim::Random& random) {
  const double x = random.normal();
  const double y = random.normal();
  const double z = random.normal();
  return {x, y, z};
}

imusim::ImuErrors industrial_errors() {
  imusim::ImuErrors errors;
  const auto triad = [](double density, const GaussMarkovConfig& bias) {
    const double sd = density * std::sqrt(WheeledDrive::kRate_hz);
    imusim::TriadErrors out;
    out.noise.fill(imusim::same_in_both({sd * sd, {{bias.sd * bias.sd, 1.0 / bias.time_constant_s}}}));
    return out;
  };
  errors.gyro = triad(kIndustrialArw_radps_per_sqrt_hz, kIndustrialGyroBias);
  errors.accel = triad(kIndustrialVrw_mps2_per_sqrt_hz, kIndustrialAccelBias);
  return errors;
}

Sample stamped(DeviceIndex device, SampleKind kind, std::uint64_t sequence, double t_s) {
  Sample sample{};
  sample.device = device;
  sample.kind = kind;
  sample.sequence = sequence;
  sample.time = host_time_from_ns(std::llround((kOrigin_s + t_s) * 1e9));
  sample.arrival = sample.time;
  return sample;
}

}  // namespace

WheeledDrive::WheeledDrive(const WheeledDriveOptions& options)
    : options_(options),
      motion_([&] {
        imusim::Scenario scenario;
        scenario.duration_s = options.duration_s;
        scenario.seed = options.road_seed;
        return std::make_shared<const imusim::Motion>(scenario);
      }()),
      mounting_{exp_so3(-options.mount_rad), options.r_vb_v_m},
      epochs_(static_cast<std::uint64_t>(options.duration_s * kRate_hz)),
      random_(options.seed, "wheeled drive") {
  const bool industrial = options.reference == ReferenceClass::kIndustrial;
  if (industrial) {
    reference_config_.gyro_white_radps_per_sqrt_hz = kIndustrialArw_radps_per_sqrt_hz;
    reference_config_.accel_white_mps2_per_sqrt_hz = kIndustrialVrw_mps2_per_sqrt_hz;
    reference_config_.gyro_bias = kIndustrialGyroBias;
    reference_config_.accel_bias = kIndustrialAccelBias;
  }
  reference_config_.device = kReference;
  const imusim::ImuErrors errors =
      industrial ? industrial_errors() : imusim::draw_reference({}, kRate_hz, random_);
  reference_ = std::make_unique<imusim::ImuModel>(*motion_, mounting_, errors, options.seed, "reference");
  for (const double side : {-kHalfTrack_m, kHalfTrack_m})
    wheels_.emplace_back(*motion_, Vector3d(0.0, side, 0.0), options.wheels, options.seed,
                         side < 0.0 ? "left" : "right");
  attitude_sd_rad_ = (industrial ? Vector3d(0.2, 0.2, 0.5) : Vector3d(0.01, 0.01, 0.03)) * kRadPerDeg;
  attitude_error_rad_ = normal3(random_).cwiseProduct(attitude_sd_rad_);
}

std::vector<Sample> WheeledDrive::next() {
  const double t_s = time_s();
  std::vector<Sample> samples;
  const imusim::ImuReading reading = reference_->sample_at(t_s);
  Sample imu = stamped(kReference, SampleKind::kImu, epoch_, t_s);
  imu.imu.omega_radps = array_of(reading.omega_radps);
  imu.imu.f_mps2 = array_of(reading.f_mps2);
  imu.imu.counter = static_cast<std::int64_t>(epoch_);
  imu.imu.flags = kGyroValid | kAccelValid;
  samples.push_back(imu);
  if (epoch_ % kWheelsEvery == 0) {
    Sample sample = stamped(kWheels, SampleKind::kOdometry, epoch_ / kWheelsEvery, t_s);
    for (imusim::WheelSpeed& wheel : wheels_)
      sample.odometry.speed_mps += wheel.shown_at(t_s) / static_cast<double>(wheels_.size());
    samples.push_back(sample);
  }
  if (epoch_ % kGnssEvery == 0) {
    Sample sample = stamped(kGnss, SampleKind::kGnss, epoch_ / kGnssEvery, t_s);
    // The antenna stands above the rear axle.
    const imusim::GeodeticPosition place =
        imusim::displaced(motion_->state_at(t_s).position, normal3(random_).cwiseProduct(kGnssSd_m));
    sample.gnss.latitude_rad = place.latitude_rad;
    sample.gnss.longitude_rad = place.longitude_rad;
    sample.gnss.height_m = place.height_m;
    sample.gnss.sd_position_m = array_of(kGnssSd_m);
    sample.gnss.solution = GnssSolution::kFixed;
    sample.gnss.flags = kPositionValid | kHasPositionSd;
    samples.push_back(sample);
  }
  ++epoch_;
  return samples;
}

WheeledDrive::Truth WheeledDrive::truth_at(double t_s) const {
  const imusim::MotionState state = motion_->state_at(t_s);
  return {imusim::position_at(state, mounting_.r_bs_b_m), imusim::velocity_at(state, mounting_.r_bs_b_m),
          state.C_b_n * mounting_.C_b_s.transpose()};
}

Vector3d WheeledDrive::r_bv_b_m() const { return -(mounting_.C_b_s * mounting_.r_bs_b_m); }

EstimatorConfig WheeledDrive::config(const Vector3d& axle_guess_b_m) const {
  EstimatorConfig config;
  config.reference = reference_config_;
  config.gnss.enabled = true;
  config.gnss.device = kGnss;
  config.gnss.antenna_lever_arm_b_m = array_of(r_bv_b_m());
  // True = estimate (+) error, with the error drawn about NED.
  const EulerAngles rpy = euler_from_rotation(exp_so3(-attitude_error_rad_) * truth_at(0.0).C_b_n);
  config.navigation.initial_rpy_rad = Vector3{rpy.roll_rad, rpy.pitch_rad, rpy.heading_rad};
  config.navigation.initial_rpy_sd_rad = array_of(attitude_sd_rad_);
  config.odometry.enabled = true;
  config.odometry.device = kWheels;
  config.odometry.rate_hz = kWheelRate_hz;
  config.odometry.prior_r_bv_b_m = array_of(axle_guess_b_m);
  config.odometry.prior_r_bv_b_sd_m.fill(kAxleSd_m);
  return config;
}

Vector3d position_error_n_m(const NavigationOutput& navigation, const WheeledDrive::Truth& truth) {
  return ned_offset({navigation.latitude_rad, navigation.longitude_rad, navigation.height_m},
                    {truth.position.latitude_rad, truth.position.longitude_rad, truth.position.height_m});
}

}  // namespace imuscope::study
