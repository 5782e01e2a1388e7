#include "tests/estimation/calibration/simulated_drive.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "estimation/navigation/so3.h"
#include "firmware_sim/imu/sensor_classes.h"

namespace imuscope::test {
namespace {

constexpr double kOrigin_s = 10.0;
constexpr std::uint64_t kGnssEvery = 20;

Vector3 array_of(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }

Sample stamped(DeviceIndex device, SampleKind kind, std::uint64_t sequence, double t_s) {
  Sample sample{};
  sample.device = device;
  sample.kind = kind;
  sample.sequence = sequence;
  sample.time = host_time_from_ns(std::llround((kOrigin_s + t_s) * 1e9));
  sample.arrival = sample.time;
  return sample;
}

Sample imu_sample(DeviceIndex device, std::uint64_t sequence, double t_s, const imusim::ImuReading& reading) {
  Sample sample = stamped(device, SampleKind::kImu, sequence, t_s);
  sample.imu.omega_radps = array_of(reading.omega_radps);
  sample.imu.f_mps2 = array_of(reading.f_mps2);
  sample.imu.counter = static_cast<std::int64_t>(sequence);
  sample.imu.flags = kGyroValid | kAccelValid;
  return sample;
}

}  // namespace

SimulatedDrive::SimulatedDrive(double duration_s, std::vector<SimulatedStudy> studies, std::uint64_t seed,
                               imusim::ScenarioKind kind)
    : motion_([&] {
        imusim::Scenario scenario;
        scenario.kind = kind;
        scenario.duration_s = duration_s;
        return scenario;
      }()),
      seed_(seed),
      epochs_(static_cast<std::uint64_t>(duration_s * kRate_hz)),
      truth_(std::move(studies)),
      random_(seed, "drive") {
  reference_ = std::make_unique<imusim::ImuModel>(
      motion_, imusim::Mounting{}, imusim::draw_reference({}, kRate_hz, random_), seed, "reference");
  imusim::MtxClass mtx;
  mtx.gyro_noise = imusim::GyroNoiseChoice::kAllDynamic;
  for (std::size_t i = 0; i < truth_.size(); ++i) {
    errors_.push_back(imusim::draw_mtx(mtx, random_));
    errors_.back().accel.misalignment = -skew(truth_[i].C_b_s * truth_[i].alpha_rad);
    studies_.emplace_back(motion_, imusim::Mounting{truth_[i].C_b_s, truth_[i].r_bs_b_m}, errors_.back(),
                          seed, "study" + std::to_string(i));
    accels_.emplace_back(motion_, imusim::Mounting{truth_[i].C_b_s, truth_[i].r_bs_b_m}, errors_.back(), seed,
                         "accel" + std::to_string(i));
  }
}

std::vector<Sample> SimulatedDrive::next() {
  const double t_s = time_s();
  std::vector<Sample> samples;
  samples.push_back(imu_sample(kReference, epoch_, t_s, reference_->sample_at(t_s)));
  for (std::size_t i = 0; i < studies_.size(); ++i) {
    imusim::ImuReading reading = studies_[i].sample_at(t_s + truth_[i].t_d_s);
    if (truth_[i].accel_t_d_s != 0.0)
      reading.f_mps2 = accels_[i].sample_at(t_s + truth_[i].t_d_s + truth_[i].accel_t_d_s).f_mps2;
    samples.push_back(imu_sample(static_cast<DeviceIndex>(kFirstStudy + i), epoch_, t_s, reading));
  }
  if (epoch_ % kGnssEvery == 0) {
    Sample sample = stamped(kGnss, SampleKind::kGnss, epoch_ / kGnssEvery, t_s);
    const imusim::MotionState state = motion_.state_at(t_s);
    const double north = random_.normal();
    const double east = random_.normal();
    const double down = random_.normal();
    const imusim::GeodeticPosition p =
        imusim::displaced(state.position, Eigen::Vector3d(0.01 * north, 0.01 * east, 0.02 * down));
    sample.gnss.latitude_rad = p.latitude_rad;
    sample.gnss.longitude_rad = p.longitude_rad;
    sample.gnss.height_m = p.height_m;
    sample.gnss.sd_position_m = {0.01, 0.01, 0.02};
    sample.gnss.solution = GnssSolution::kFixed;
    sample.gnss.flags = kPositionValid | kHasPositionSd;
    samples.push_back(sample);
  }
  ++epoch_;
  return samples;
}

EstimatorConfig SimulatedDrive::config() const {
  EstimatorConfig config;
  config.reference.device = kReference;
  config.reference.grade = {};  // this reference has straight axes and no scale
  config.gnss.enabled = true;
  config.gnss.device = kGnss;
  const imusim::MotionState start = motion_.state_at(0.0);
  config.navigation.initial_rpy_rad = Vector3{start.roll_rad, start.pitch_rad, start.heading_rad};
  for (std::size_t i = 0; i < truth_.size(); ++i) {
    SImuConfig study;
    study.device = static_cast<DeviceIndex>(kFirstStudy + i);
    study.noise.gyro[0] = study.noise.gyro[1];  // the simulated noise is dynamic throughout
    config.studies.push_back(study);
  }
  return config;
}

void SimulatedDrive::remount(std::size_t study, const Eigen::Matrix3d& C_b_s) {
  truth_[study].C_b_s = C_b_s;
  studies_[study] = imusim::ImuModel(motion_, imusim::Mounting{C_b_s, truth_[study].r_bs_b_m}, errors_[study],
                                     seed_, "remounted" + std::to_string(study));
}

Eigen::Vector3d mounting_error_rad(const SImuOutput& out, const Eigen::Matrix3d& C_b_s_true) {
  const Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>> C(out.C_b_s.data());
  return -log_so3(C.transpose() * C_b_s_true);
}

double worst_in_sd(const SImuOutput& out, const SimulatedStudy& truth) {
  const Eigen::Vector3d psi = mounting_error_rad(out, truth.C_b_s);
  double worst = 0.0;
  for (std::size_t i = 0; i < 3; ++i) {
    const auto k = static_cast<Eigen::Index>(i);
    worst = std::max({worst, std::abs(psi(k)) / out.sd_psi_rad[i],
                      std::abs(truth.r_bs_b_m(k) - out.r_bs_b_m[i]) / out.sd_r_bs_b_m[i]});
  }
  return worst;
}

double horizontal_error_m(const NavigationOutput& out, const imusim::MotionState& truth) {
  constexpr double kEarthRadius_m = 6.37e6;
  return kEarthRadius_m *
         std::hypot(out.latitude_rad - truth.position.latitude_rad,
                    (out.longitude_rad - truth.position.longitude_rad) * std::cos(out.latitude_rad));
}

void run(SimulatedDrive& drive, Estimator& estimator, double until_s) {
  while (!drive.done() && drive.time_s() < until_s) {
    const std::vector<Sample> samples = drive.next();
    for (const Sample& sample : samples) estimator.add(sample);
    estimator.advance(samples.back().arrival);
  }
}

}  // namespace imuscope::test
