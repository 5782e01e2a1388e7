#include "tools/trials/standard_drive.h"

#include <fmt/format.h>
#include <cmath>

#include "estimation/navigation/so3.h"

namespace standard_drive {

namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using imuscope::kRadPerDeg;

constexpr std::size_t kGnssEvery = 20;  // 5 Hz
const Vector3d kGnssSd_m(0.01, 0.01, 0.02);

imuscope::Sample stamped(imuscope::DeviceIndex device, std::size_t k, imuscope::SampleKind kind) {
  imuscope::Sample sample{};
  sample.kind = kind;
  sample.device = device;
  sample.sequence = k;
  sample.time = imuscope::host_time_from_ns(static_cast<std::int64_t>(k) * 10'000'000);
  sample.arrival = sample.time;
  return sample;
}

imuscope::Sample imu_sample(imuscope::DeviceIndex device, std::size_t k, const imusim::ImuReading& reading) {
  imuscope::Sample sample = stamped(device, k, imuscope::SampleKind::kImu);
  sample.imu.omega_radps = imuscope::to_array(reading.omega_radps);
  sample.imu.f_mps2 = imuscope::to_array(reading.f_mps2);
  sample.imu.counter = static_cast<std::int64_t>(k);
  sample.imu.flags = imuscope::kGyroValid | imuscope::kAccelValid;
  return sample;
}

imuscope::Sample gnss_sample(std::size_t k, const imusim::GeodeticPosition& position) {
  imuscope::Sample sample = stamped(kGnssDevice, k, imuscope::SampleKind::kGnss);
  sample.gnss.latitude_rad = position.latitude_rad;
  sample.gnss.longitude_rad = position.longitude_rad;
  sample.gnss.height_m = position.height_m;
  sample.gnss.sd_position_m = imuscope::to_array(kGnssSd_m);
  sample.gnss.solution = imuscope::GnssSolution::kFixed;
  sample.gnss.flags = imuscope::kPositionValid | imuscope::kHasPositionSd;
  return sample;
}

imusim::Mounting mounting(std::size_t study) { return {mounting_of(study), lever_arm_of(study)}; }

double time_of(std::size_t k) { return static_cast<double>(k) / kRate_hz; }

}  // namespace

Matrix3d mounting_of(std::size_t study) {
  const std::array<Vector3d, kStudies> vectors{Vector3d(0, 0, 0), Vector3d(0, 0, 90.0),
                                               Vector3d(180.0, 0, 0)};
  return imuscope::exp_so3(-vectors[study] * kRadPerDeg);
}

Vector3d lever_arm_of(std::size_t study) {
  const std::array<Vector3d, kStudies> arms{Vector3d(0.35, -0.22, 0.12), Vector3d(-0.30, 0.25, 0.10),
                                            Vector3d(0.10, 0.40, -0.25)};
  return arms[study];
}

Vector3d normal3(imusim::Random& random) {
  const double x = random.normal();
  const double y = random.normal();
  const double z = random.normal();
  return {x, y, z};
}

Truth::Truth(const imusim::Scenario& scenario, double duration_s, imusim::WorldKind world)
    : motion_([&] {
        imusim::Scenario shaken = scenario;
        if (world != imusim::WorldKind::kHarsh) return shaken;
        shaken.engine_runs = true;
        shaken.rough_road_to_hz = imusim::kWheelHop_hz;
        return shaken;
      }()),
      world_(world),
      ticks_(static_cast<std::size_t>(std::lround(duration_s * kRate_hz))) {
  for (std::size_t k = 0; k < ticks_; ++k) {
    if (world_ == imusim::WorldKind::kHarsh && k % kGnssEvery != 0) continue;
    const imusim::MotionState now = motion_.state_at(time_of(k));
    if (k % kGnssEvery == 0) antenna_.push_back(now.position);
    if (world_ == imusim::WorldKind::kHarsh) continue;
    reference_.push_back(imusim::ideal_reading(now, imusim::Mounting{}));
    const imusim::MotionState then = motion_.state_at(time_of(k) + kTimeOffset_s);
    for (std::size_t i = 0; i < kStudies; ++i)
      studies_[i].push_back(imusim::ideal_reading(then, mounting(i)));
  }
}

imusim::MotionState Truth::end() const { return motion_.state_at(time_of(ticks() - 1)); }

Draw draw(const DrawOptions& options, imusim::Random& random, std::uint64_t seed) {
  Draw errors;
  errors.reference =
      imusim::draw_reference(imusim::reference_class(options.reference_class), kRate_hz, random);
  for (imusim::ImuErrors& study : errors.studies) study = imusim::draw_mtx(options.mtx, random);
  imusim::Random unseen(seed, "imperfections");
  imusim::draw_imperfections(
      imusim::reference_imperfections(options.world, imusim::reference_class(options.reference_class)),
      unseen, errors.reference);
  for (imusim::ImuErrors& study : errors.studies)
    imusim::draw_imperfections(imusim::study_imperfections(options.world), unseen, study);
  return errors;
}

s_imu_score::SImuTruth truth_of(const Draw& draw, std::size_t study) {
  const imusim::ImuErrors& errors = draw.studies[study];
  // How much later than the reference's.
  const double gyro_delay_s = imusim::slow_delay_s(errors.gyro) - imusim::slow_delay_s(draw.reference.gyro);
  const double accel_delay_s =
      imusim::slow_delay_s(errors.accel) - imusim::slow_delay_s(draw.reference.accel);
  s_imu_score::SImuTruth truth;
  // A crooked triad's frame is that of its axes, as it is published.
  const Matrix3d accel_frame = imusim::triad_frame(imusim::triad_matrix(errors.accel) * mounting_of(study));
  truth.C_b_s = imusim::triad_frame(imusim::triad_matrix(errors.gyro) * mounting_of(study));
  truth.r_bs_b_m = lever_arm_of(study);
  truth.t_d_s = kTimeOffset_s - gyro_delay_s;
  truth.gyro_scale = errors.gyro.scale;
  truth.accel_scale = errors.accel.scale;
  truth.C_s_accel = accel_frame * truth.C_b_s.transpose();
  truth.accel_t_d_s = gyro_delay_s - accel_delay_s;
  return truth;
}

Instruments::Instruments(const Truth& truth, const Draw& draw, std::uint64_t seed)
    : truth_(truth),
      gnss_noise_(seed, "gnss"),
      reference_(truth.motion_, imusim::Mounting{}, draw.reference, seed, "reference") {
  for (std::size_t i = 0; i < kStudies; ++i)
    studies_.emplace_back(truth.motion_, mounting(i), draw.studies[i], seed, fmt::format("study{}", i));
}

const Tick& Instruments::next() {
  // The noise of the S-IMUs does not depend on the regime.
  constexpr imusim::Regime kAny = imusim::Regime::kDynamic;
  tick_.clear();
  const bool harsh = truth_.world_ == imusim::WorldKind::kHarsh;
  const auto read = [&](imusim::ImuModel& imu, const std::vector<imusim::IdealReading>& ideal, double t_s) {
    return harsh ? imu.sample_at(t_s) : imu.sample_of(ideal[k_], ideal[k_], kAny, t_s);
  };
  tick_.push_back(imu_sample(kReferenceDevice, k_, read(reference_, truth_.reference_, time_of(k_))));
  for (std::size_t i = 0; i < kStudies; ++i) {
    tick_.push_back(imu_sample(static_cast<imuscope::DeviceIndex>(kFirstStudyDevice + i), k_,
                               read(studies_[i], truth_.studies_[i], time_of(k_) + kTimeOffset_s)));
  }
  if (k_ % kGnssEvery == 0) {
    const Vector3d noise = normal3(gnss_noise_).cwiseProduct(kGnssSd_m);
    tick_.push_back(gnss_sample(k_, imusim::displaced(truth_.antenna_[k_ / kGnssEvery], noise)));
  }
  ++k_;
  return tick_;
}

imuscope::EstimatorConfig configuration(const imusim::Motion& motion, int reference_class) {
  imuscope::EstimatorConfig config;
  const imusim::ReferenceClass reference = imusim::reference_class(reference_class);
  config.reference.gyro_white_radps_per_sqrt_hz = reference.gyro_white_radps_per_sqrt_hz;
  config.reference.accel_white_mps2_per_sqrt_hz = reference.accel_white_mps2_per_sqrt_hz;
  config.reference.gyro_bias.sd = reference.gyro_bias_sd_radps;
  config.reference.accel_bias.sd = reference.accel_bias_sd_mps2;
  config.reference.device = kReferenceDevice;
  config.gnss.enabled = true;
  config.gnss.device = kGnssDevice;
  const imusim::MotionState start = motion.state_at(0.0);
  config.navigation.initial_rpy_rad = imuscope::Vector3{start.roll_rad, start.pitch_rad, start.heading_rad};
  for (std::size_t i = 0; i < kStudies; ++i) {
    imuscope::SImuConfig study;
    study.device = static_cast<imuscope::DeviceIndex>(kFirstStudyDevice + i);
    study.noise.gyro[0] = study.noise.gyro[1];  // the simulated noise is dynamic throughout
    config.studies.push_back(study);
  }
  return config;
}

}  // namespace standard_drive
