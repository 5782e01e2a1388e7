/// How well the estimator does what it claims: sample-level Monte-Carlo of a 15 min drive with three S-IMUs.
/// Prints errors beside the filter's own sd, NEES of (psi, r) and NIS per axis, with the goals.
///
/// Samples are instantaneous, the body is rigid, clocks are perfect; true errors are drawn from the filter's
/// priors in every run, the trajectory is one and the same.

#include <fmt/format.h>
#include <CLI/CLI.hpp>
#include <Eigen/Dense>
#include <cmath>
#include <ctime>
#include <string>
#include <vector>

#include "base/units.h"
#include "calibration/estimator.h"
#include "firmware_sim/imu/imu_model.h"
#include "firmware_sim/imu/sensor_classes.h"
#include "firmware_sim/motion/motion.h"
#include "navigation/so3.h"

namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using imuscope::kDegPerRad;
using imuscope::kRadPerDeg;

constexpr double kRate_hz = 100.0;
constexpr int kGnssEvery = 20;  // 5 Hz
constexpr double kTimeOffset_s = 0.004;
constexpr double kBoresightSd_rad = 2.0 * kRadPerDeg;
constexpr double kLeverArmSd_m = 0.05;
constexpr double kScaleSd = 0.003;
constexpr std::size_t kStudies = 3;
const Vector3d kGnssSd_m(0.01, 0.01, 0.02);
const Vector3d kAttitudeSd_rad(0.01 * kRadPerDeg, 0.01 * kRadPerDeg, 0.03 * kRadPerDeg);

struct Scenario {
  std::string name;
  std::string what;
  double duration_s = 900.0;
  double accel_white_mps2 = 0.03;
  std::uint32_t blocks = imuscope::kFullStudyBlocks;
  bool prior = true;  ///< false: nothing is known of the mounting and the time offset
  Vector3d goal_psi_mdeg = Vector3d::Zero();
  Vector3d goal_r_mm = Vector3d::Zero();
  double goal_t_d_us = 0.0;
};

std::vector<Scenario> scenarios() {
  Scenario k{"K",
             "all 19 states",
             900.0,
             0.03,
             imuscope::kFullStudyBlocks,
             true,
             {9.5, 8.5, 7.5},
             {0.65, 0.55, 0.45},
             30.0};
  Scenario n = k;
  n.name = "N";
  n.what = "no prior: coarse alignment first";
  n.prior = false;
  Scenario v{"V",          "vibration, 0.15 m/s^2", 900.0, 0.15, imuscope::kFullStudyBlocks, true,
             {30, 26, 27}, {3.3, 3.3, 3.3},         120.0};
  Scenario l{"L", "first 5 min", 300.0, 0.03, imuscope::kFullStudyBlocks, true, {17, 17, 17}, {}, 0.0};
  Scenario s{"S", "standstill, 59 s", 59.0, 0.03, imuscope::kFullStudyBlocks, true, {}, {}, 0.0};
  Scenario d{
      "D", "the paper's 6 states, biased sensors", 900.0, 0.03, imuscope::kPaperStudyBlocks, true, {}, {},
      0.0};
  return {k, n, v, l, s, d};
}

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

imuscope::Vector3 to_array(const Vector3d& v) { return {v.x(), v.y(), v.z()}; }

imuscope::Matrix3 to_array(const Matrix3d& m) {
  imuscope::Matrix3 out;
  Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(out.data()) = m;
  return out;
}

/// Of this thread, so that other load on the machine does not count.
double processor_time_s() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

/// Sums of one scenario.
struct Totals {
  int n = 0;
  Vector3d psi2 = Vector3d::Zero();
  Vector3d psi_var = Vector3d::Zero();
  Vector3d r2 = Vector3d::Zero();
  Vector3d r_var = Vector3d::Zero();
  double t_d2 = 0.0;
  double t_d_var = 0.0;
  double nees = 0.0;
  double vertical_sd = 0.0;  ///< of the angle about gravity
  double gyro_scale2 = 0.0;
  std::array<Vector3d, 2> nis{Vector3d::Zero(), Vector3d::Zero()};
  std::array<double, 2> nis_n{};
  double attitude2 = 0.0;
  int not_started = 0;
  double estimator_s = 0.0;
  double epochs = 0.0;
};

imuscope::Sample imu_sample(imuscope::DeviceIndex device, std::uint64_t k, double t_s,
                            const imusim::ImuReading& reading) {
  imuscope::Sample sample{};
  sample.kind = imuscope::SampleKind::kImu;
  sample.device = device;
  sample.sequence = k;
  sample.time = imuscope::host_time_from_ns(std::llround(t_s * 1e9));
  sample.arrival = sample.time;
  sample.imu.omega_radps = to_array(reading.omega_radps);
  sample.imu.f_mps2 = to_array(reading.f_mps2);
  sample.imu.counter = static_cast<std::int64_t>(k);
  sample.imu.flags = imuscope::kGyroValid | imuscope::kAccelValid;
  return sample;
}

imuscope::Sample gnss_sample(imuscope::DeviceIndex device, double t_s, const imusim::MotionState& state,
                             imusim::Random& random) {
  const Vector3d noise = normal3(random).cwiseProduct(kGnssSd_m);
  const imusim::GeodeticPosition p = imusim::displaced(state.position, noise);
  imuscope::Sample sample{};
  sample.kind = imuscope::SampleKind::kGnss;
  sample.device = device;
  sample.time = imuscope::host_time_from_ns(std::llround(t_s * 1e9));
  sample.arrival = sample.time;
  sample.gnss.latitude_rad = p.latitude_rad;
  sample.gnss.longitude_rad = p.longitude_rad;
  sample.gnss.height_m = p.height_m;
  sample.gnss.sd_position_m = to_array(kGnssSd_m);
  sample.gnss.solution = imuscope::GnssSolution::kFixed;
  sample.gnss.flags = imuscope::kPositionValid | imuscope::kHasPositionSd;
  return sample;
}

constexpr imuscope::DeviceIndex kReferenceDevice = 0;
constexpr imuscope::DeviceIndex kFirstStudyDevice = 1;
constexpr imuscope::DeviceIndex kGnssDevice = 1 + kStudies;

imuscope::EstimatorConfig configure(const Scenario& scenario, const imusim::Motion& motion,
                                    imusim::Random& random) {
  imuscope::EstimatorConfig config;
  config.reference.device = kReferenceDevice;
  config.gnss.enabled = true;
  config.gnss.device = kGnssDevice;
  const imusim::MotionState start = motion.state_at(0.0);
  // True = estimate (+) error, with the error drawn about NED.
  const Vector3d phi = normal3(random).cwiseProduct(kAttitudeSd_rad);
  const imuscope::EulerAngles rpy = imuscope::euler_from_rotation(imuscope::exp_so3(-phi) * start.C_b_n);
  config.navigation.initial_rpy_rad = imuscope::Vector3{rpy.roll_rad, rpy.pitch_rad, rpy.heading_rad};
  for (std::size_t i = 0; i < kStudies; ++i) {
    imuscope::StudyConfig study;
    study.device = static_cast<imuscope::DeviceIndex>(kFirstStudyDevice + i);
    study.blocks = scenario.blocks;
    study.noise.gyro[0] = study.noise.gyro[1];  // the truth is dynamic throughout
    for (imuscope::TriadNoise& accel : study.noise.accel) accel.white_sd.fill(scenario.accel_white_mps2);
    study.prior_boresight_sd_rad.fill(kBoresightSd_rad);
    study.prior_r_bs_b_sd_m.fill(kLeverArmSd_m);
    study.prior_gyro_scale_sd.fill(kScaleSd);
    study.prior_accel_scale_sd.fill(kScaleSd);
    const Vector3d psi = kBoresightSd_rad * normal3(random);
    const Vector3d dr = kLeverArmSd_m * normal3(random);
    study.prior_r_bs_b_m = to_array(Vector3d(lever_arm_of(i) - dr));
    if (scenario.prior) {
      study.prior_C_b_s = to_array(Matrix3d(mounting_of(i) * imuscope::exp_so3(psi)));
      study.prior_t_d_s = (scenario.blocks & imuscope::kTimeOffsetBlock) != 0 ? 0.0 : kTimeOffset_s;
    }
    config.studies.push_back(study);
  }
  return config;
}

void account(const Scenario& scenario, const imuscope::Estimator& estimator,
             const std::vector<imusim::ImuErrors>& errors, const imusim::MotionState& end, Totals& totals) {
  for (std::size_t i = 0; i < kStudies; ++i) {
    const imuscope::StudyOutput& out = estimator.study(i);
    if (out.status < imuscope::StudyStatus::kConverging) {
      ++totals.not_started;
      continue;
    }
    const Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>> C(out.C_b_s.data());
    Eigen::Matrix<double, 6, 1> error;
    error.head<3>() = -imuscope::log_so3(C.transpose() * mounting_of(i));
    error.tail<3>() = lever_arm_of(i) - Vector3d(out.r_bs_b_m[0], out.r_bs_b_m[1], out.r_bs_b_m[2]);
    const Eigen::Map<const Eigen::Matrix<double, 6, 6>> P(out.covariance_psi_r.data());
    totals.nees += error.dot(P.ldlt().solve(error));
    totals.psi2 += error.head<3>().cwiseAbs2();
    totals.r2 += error.tail<3>().cwiseAbs2();
    totals.psi_var += P.diagonal().head<3>();
    totals.r_var += P.diagonal().tail<3>();
    const Vector3d about_gravity = end.f_b_mps2.normalized();
    totals.vertical_sd += std::sqrt(about_gravity.dot(P.topLeftCorner<3, 3>() * about_gravity));
    const double t_d_error = kTimeOffset_s - out.t_d_s;
    totals.t_d2 += t_d_error * t_d_error;
    totals.t_d_var += out.sd_t_d_s * out.sd_t_d_s;
    if ((scenario.blocks & imuscope::kGyroScaleBlock) != 0) {
      const double scale_error = errors[i].gyro.scale.z() - out.gyro_scale[2];
      totals.gyro_scale2 += scale_error * scale_error;
    }
    ++totals.n;
  }
}

void run(const Scenario& scenario, const imusim::Motion& motion, std::uint64_t seed, Totals& totals) {
  imusim::Random random(seed, "study");
  imuscope::Estimator estimator(configure(scenario, motion, random));

  imusim::ImuModel reference(motion, imusim::Mounting{}, imusim::draw_airins({}, kRate_hz, random), seed,
                             "reference");
  imusim::MtxClass mtx;
  mtx.gyro_noise = imusim::GyroNoiseChoice::kAllDynamic;
  mtx.accel_white_sd_mps2 = scenario.accel_white_mps2;
  std::vector<imusim::ImuErrors> errors;
  std::vector<imusim::ImuModel> studies;
  for (std::size_t i = 0; i < kStudies; ++i) {
    errors.push_back(imusim::draw_mtx(mtx, random));
    studies.emplace_back(motion, imusim::Mounting{mounting_of(i), lever_arm_of(i)}, errors.back(), seed,
                         fmt::format("study{}", i));
  }

  const auto epochs = static_cast<std::uint64_t>(scenario.duration_s * kRate_hz);
  std::vector<imuscope::Sample> tick;
  for (std::uint64_t k = 0; k < epochs; ++k) {
    const double t_s = static_cast<double>(k) / kRate_hz;
    tick.clear();
    tick.push_back(imu_sample(kReferenceDevice, k, t_s, reference.sample_at(t_s)));
    for (std::size_t i = 0; i < kStudies; ++i) {
      tick.push_back(imu_sample(static_cast<imuscope::DeviceIndex>(kFirstStudyDevice + i), k, t_s,
                                studies[i].sample_at(t_s + kTimeOffset_s)));
    }
    if (k % kGnssEvery == 0) tick.push_back(gnss_sample(kGnssDevice, t_s, motion.state_at(t_s), random));

    const double begin_s = processor_time_s();
    for (const imuscope::Sample& sample : tick) estimator.add(sample);
    estimator.advance(tick.front().arrival);
    totals.estimator_s += processor_time_s() - begin_s;
    totals.epochs += 1.0;

    for (const imuscope::StudyEpoch& epoch : estimator.epochs()) {
      if (!epoch.calibrating) continue;
      for (std::size_t a = 0; a < 3; ++a) {
        const auto axis = static_cast<Eigen::Index>(a);
        totals.nis[0](axis) +=
            epoch.innovation_gyro_radps[a] * epoch.innovation_gyro_radps[a] / epoch.variance_gyro[a];
        totals.nis[1](axis) +=
            epoch.innovation_accel_mps2[a] * epoch.innovation_accel_mps2[a] / epoch.variance_accel[a];
      }
      totals.nis_n[0] += 1.0;
      totals.nis_n[1] += 1.0;
    }
  }
  const double end_s = static_cast<double>(epochs - 1) / kRate_hz;
  const imusim::MotionState end = motion.state_at(end_s);
  account(scenario, estimator, errors, end, totals);
  const imuscope::NavigationOutput& navigation = estimator.navigation();
  const Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>> C_b_n(navigation.C_b_n.data());
  totals.attitude2 += imuscope::log_so3(end.C_b_n * C_b_n.transpose()).squaredNorm();
}

Vector3d rms(const Vector3d& sum, int n) { return (sum / n).cwiseSqrt(); }

std::string three(const Vector3d& v, int digits) {
  return fmt::format("{:.{}f} / {:.{}f} / {:.{}f}", v.x(), digits, v.y(), digits, v.z(), digits);
}

void print(const Scenario& scenario, const Totals& t, int seeds) {
  if (t.n == 0) {
    fmt::print("{}  {}: no S-IMU got past the coarse alignment\n", scenario.name, scenario.what);
    return;
  }
  constexpr double kMdeg = 1e3 * kDegPerRad;
  fmt::print("{}  {} ({} seeds, {} results, {} not started)\n", scenario.name, scenario.what, seeds, t.n,
             t.not_started);
  fmt::print("   psi  mdeg  rms {:24} sd {:24} goal {}\n", three(kMdeg * rms(t.psi2, t.n), 2),
             three(kMdeg * rms(t.psi_var, t.n), 2), three(scenario.goal_psi_mdeg, 1));
  fmt::print("   r    mm    rms {:24} sd {:24} goal {}\n", three(1e3 * rms(t.r2, t.n), 3),
             three(1e3 * rms(t.r_var, t.n), 3), three(scenario.goal_r_mm, 2));
  fmt::print("   t_d  us    rms {:<24.1f} sd {:<24.1f} goal {:.0f}\n", 1e6 * std::sqrt(t.t_d2 / t.n),
             1e6 * std::sqrt(t.t_d_var / t.n), scenario.goal_t_d_us);
  fmt::print("   NEES (6) mean {:.2f}, 95 % band of the mean {:.2f} to {:.2f}\n", t.nees / t.n,
             6.0 - 1.96 * std::sqrt(12.0 / t.n), 6.0 + 1.96 * std::sqrt(12.0 / t.n));
  fmt::print("   NIS  gyro {}   accel {}\n", three(t.nis[0] / t.nis_n[0], 3),
             three(t.nis[1] / t.nis_n[1], 3));
  fmt::print(
      "   sd about gravity {:.0f} mdeg, gyro scale z rms {:.4f} %, R attitude rms {:.2f} mdeg, "
      "{:.1f} us of processor an epoch\n\n",
      kMdeg * t.vertical_sd / t.n, 1e2 * std::sqrt(t.gyro_scale2 / t.n),
      kMdeg * std::sqrt(t.attitude2 / seeds), 1e6 * t.estimator_s / t.epochs);
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{"Monte-Carlo of the estimator: errors, sd, NEES and NIS beside the goals"};
  int seeds = 20;
  std::uint64_t first = 1;
  std::string names = "KNVLSD";
  app.add_option("--seeds", seeds, "runs per scenario");
  app.add_option("--first", first, "first seed");
  app.add_option("--scenarios", names,
                 "letters: K all states, N no prior, V vibration, L 5 min, S standstill, D paper's states");
  CLI11_PARSE(app, argc, argv);
  const imusim::Motion motion{imusim::Scenario{}};
  for (const Scenario& scenario : scenarios()) {
    if (names.find(scenario.name) == std::string::npos) continue;
    Totals totals;
    for (int i = 0; i < seeds; ++i) run(scenario, motion, first + static_cast<std::uint64_t>(i), totals);
    print(scenario, totals, seeds);
    std::fflush(stdout);
  }
  return 0;
}
