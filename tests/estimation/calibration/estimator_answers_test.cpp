/// Everything that the estimator shows on drives with every kind of trouble in them: what is right about it, the tests
/// beside this one prove.

#include <gtest/gtest.h>
#include <cmath>
#include <functional>
#include <limits>
#include <optional>
#include <set>
#include <vector>

#include "estimation/calibration/fixed_lag.h"
#include "estimation/calibration/smoother.h"
#include "estimation/navigation/so3.h"
#include "estimator_text.h"
#include "tests/estimation/calibration/simulated_drive.h"
#include "tests/support/recorded_answer.h"

namespace imuscope {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using test::Answer;
using test::SimulatedDrive;
using test::SimulatedStudy;

/// Of quantities in SI: less than that of any is nothing.
constexpr double kNothing = 1e-8;
constexpr DeviceIndex kStudyA = SimulatedDrive::kFirstStudy;
constexpr DeviceIndex kStudyB = SimulatedDrive::kFirstStudy + 1;
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

/// What a test does with a sample; false takes it away.
using Trouble = std::function<bool(double t_s, Sample& sample)>;

struct Story {
  std::set<int> tell_at_s{};  ///< whole seconds at which everything is told
  int epoch_every = 1733;     ///< of the processed samples
  std::function<void(double t_s, Estimator& estimator)> act = [](double, Estimator&) {};
};

void tell(Answer& lines, SimulatedDrive& drive, Estimator& estimator, const Story& story,
          const Trouble& trouble) {
  int epochs = 0;
  while (!drive.done()) {
    const double t_s = drive.time_s();
    std::vector<Sample> samples = drive.next();
    const HostTime arrival = samples.back().arrival;
    story.act(t_s, estimator);
    for (Sample& sample : samples)
      if (trouble(t_s, sample)) estimator.add(sample);
    estimator.advance(arrival);
    for (const EstimatorEvent& event : estimator.events()) test::add_event(lines, event);
    for (const SImuEpoch& epoch : estimator.epochs())
      if (++epochs % story.epoch_every == 0) test::add_epoch(lines, epoch);
    const auto epoch = std::lround(t_s * SimulatedDrive::kRate_hz);
    if (epoch % 100 == 99 && story.tell_at_s.contains(static_cast<int>((epoch + 1) / 100))) {
      lines.line("after", (epoch + 1) / 100);
      test::add_estimator(lines, estimator);
    }
  }
}

bool within(double t_s, double from_s, double to_s) { return t_s > from_s - 1e-6 && t_s < to_s - 1e-6; }

SimulatedStudy study_with_own_accelerometers() {
  SimulatedStudy study{exp_so3(Vector3d(0.1, 0.2, -1.5)), {0.35, -0.22, 0.12}, 0.004};
  study.alpha_rad = Vector3d(0.003, -0.002, 0.004);
  study.accel_t_d_s = 0.003;
  return study;
}

/// A receiver that does everything receivers do.
void trouble_gnss(double t_s, Sample& sample) {
  GnssData& gnss = sample.gnss;
  gnss.v_n_mps = {0.02 * std::sin(t_s), 0.02 * std::cos(2.0 * t_s), 0.01};
  if (within(t_s, 50.0, 53.0)) gnss.latitude_rad += 5e-6;
  if (within(t_s, 60.0, 63.0)) {
    gnss.solution = GnssSolution::kFloat;
    gnss.flags = kPositionValid;
  }
  if (within(t_s, 63.0, 66.0)) gnss.solution = GnssSolution::kSingle;
  if (within(t_s, 66.0, 68.0)) {
    gnss.solution = GnssSolution::kDifferential;
    gnss.sd_position_m = {0.5, kNan, 0.7};
  }
  if (within(t_s, 70.0, 70.3)) gnss.longitude_rad = kNan;
  if (within(t_s, 71.0, 72.0)) gnss.flags = 0;
  if (within(t_s, 73.0, 73.5)) gnss.height_m = 2e5;
  if (within(t_s, 74.0, 74.5)) gnss.solution = GnssSolution::kNone;
  if (within(t_s, 75.0, 76.0)) sample.time -= std::chrono::seconds{8};
}

TEST(EstimatorAnswers, DriveWithEveryKindOfTrouble) {
  SimulatedDrive drive(
      112.0,
      {study_with_own_accelerometers(), {exp_so3(Vector3d(0.02, -0.03, 0.01)), {-0.4, 0.3, 0.2}, -0.006}},
      21);
  EstimatorConfig config = drive.config();
  config.instruction_set = InstructionSet::kBaseline;
  config.gnss.latency_s = 0.05;
  config.gnss.latency_sd_s = 0.03;
  config.gnss.antenna_lever_arm_b_m = {0.01, -0.02, 0.015};
  config.studies[0].blocks = kCompleteSImuBlocks;
  config.studies[1].prior_C_b_s = Matrix3{1, 0, 0, 0, 1, 0, 0, 0, 1};
  config.studies[1].prior_t_d_s = -0.004;
  config.studies[1].prior_r_bs_b_m = {-0.35, 0.25, 0.1};
  config.studies[1].average_samples = 4;
  config.studies[1].boresight_creep_rad_per_sqrt_s = 1e-5;
  Estimator estimator(config);
  Story story{.tell_at_s = {12, 30, 48, 58, 69, 84, 92, 112}};
  story.act = [&](double t_s, Estimator& e) {
    if (std::lround(t_s * 100.0) == 7700) {
      SImuNoise noise = mtx_class_noise();
      noise.gyro[1].white_sd = {0.02, 1e-6, 0.01};
      noise.accel[1].white_sd = {0.04, 0.05, 1e-6};
      noise.gyro_bias[0].sd *= 3.0;
      noise.accel_bias[2] = {0.08, 300.0};
      e.set_noise(1, noise);
    }
    if (std::lround(t_s * 100.0) == 9400) drive.remount(1, exp_so3(Vector3d(0.3, -0.2, 0.1)));
  };
  Answer lines;
  tell(lines, drive, estimator, story, [](double t_s, Sample& sample) {
    if (sample.kind == SampleKind::kGnss) {
      if (within(t_s, 40.0, 45.0)) return false;
      sample.time += std::chrono::milliseconds{60};
      trouble_gnss(t_s, sample);
      return true;
    }
    if (sample.device == SimulatedDrive::kReference) {
      if (within(t_s, 55.0, 55.3) || within(t_s, 86.0, 87.6)) return false;
      if (within(t_s, 57.0, 57.02)) sample.imu.omega_radps[1] = kNan;
      if (within(t_s, 58.0, 58.01)) sample.time -= std::chrono::milliseconds{15};
      return true;
    }
    if (sample.device == kStudyA) {
      if (within(t_s, 33.0, 33.5)) sample.imu.flags |= kGyroClipX | kAccelClipZ;
      if (within(t_s, 34.0, 34.4)) sample.imu.flags &= ~static_cast<std::uint32_t>(kGyroValid);
      if (within(t_s, 35.0, 35.05)) sample.imu.f_mps2[2] += 40.0;
      if (within(t_s, 70.0, 70.05)) sample.imu.f_mps2[0] = kNan;
      if (within(t_s, 71.0, 71.01)) sample.time -= std::chrono::milliseconds{30};
      if (within(t_s, 72.0, 72.01)) sample.device = 77;
    }
    return sample.device != kStudyB || !within(t_s, 62.0, 68.0);
  });
  test::expect_recorded("estimation/calibration/every_trouble.txt", lines.text(), 1e-6, kNothing);
}

TEST(EstimatorAnswers, TagsPulsesAndVelocities) {
  SimulatedDrive drive(62.0, {{exp_so3(Vector3d(0.0, 0.01, 1.57)), {0.3, 0.2, -0.1}, 0.002}}, 22);
  EstimatorConfig config = drive.config();
  config.instruction_set = InstructionSet::kBaseline;
  config.gnss.latency_sd_s = 0.02;
  config.studies[0].prior_t_d_s = 0.0;
  Estimator estimator(config);
  estimator.set_pc_clock(host_time_from_ns(10'000'000'000), utc_time_from_ns(1'767'225'590'000'000'000));
  Answer lines;
  const auto utc_of = [](HostTime time) {
    return utc_time_from_ns(1'767'225'580'500'000'000 + to_ns(time) + to_ns(time) / 50'000);
  };
  tell(lines, drive, estimator, {.tell_at_s = {20, 38, 50, 62}}, [&](double t_s, Sample& sample) {
    if (sample.kind == SampleKind::kGnss) {
      const imusim::MotionState state = drive.motion().state_at(t_s);
      sample.gnss.v_n_mps = {state.v_n_mps.x() + 0.01 * std::sin(9.0 * t_s), state.v_n_mps.y(),
                             state.v_n_mps.z()};
      sample.gnss.sd_velocity_mps = {0.03, 0.04, 0.05};
      sample.gnss.flags |= kVelocityValid | (within(t_s, 0.0, 40.0) ? kHasVelocitySd : 0U);
      sample.has_utc = within(t_s, 15.0, 55.0);
      sample.utc = utc_of(sample.time);
      sample.time += std::chrono::milliseconds{90};
      if (within(t_s, 30.0, 31.0)) sample.utc += std::chrono::seconds{1};
      if (within(t_s, 36.0, 36.5)) sample.gnss.flags &= ~static_cast<std::uint32_t>(kPositionValid);
      if (within(t_s, 39.0, 39.5)) sample.gnss.v_n_mps[0] += 3.0;
    } else {
      sample.has_utc = sample.device == SimulatedDrive::kReference && within(t_s, 22.0, 45.0);
      sample.utc = utc_of(sample.time);
    }
    if (sample.device == SimulatedDrive::kReference && std::lround(t_s * 100.0) % 100 == 50 && t_s > 40.0) {
      Sample pulse = sample;
      pulse.kind = SampleKind::kPulse;
      pulse.has_utc = false;
      pulse.pulse.wall_ns = to_ns(utc_of(sample.time));
      estimator.add(pulse);
    }
    return true;
  });
  test::expect_recorded("estimation/calibration/tags_and_pulses.txt", lines.text(), 1e-6, kNothing);
}

TEST(EstimatorAnswers, NoisyReferenceOfIncrementsWithItsOwnAttitude) {
  SimulatedDrive drive(75.0,
                       {{exp_so3(Vector3d(0.0, 0.01, 3.1)), {0.9, -0.4, 0.3}, 0.01},
                        {Matrix3d::Identity(), {0.1, 0.6, 0.1}, 0.0}},
                       23);
  EstimatorConfig config = drive.config();
  config.instruction_set = InstructionSet::kBaseline;
  config.navigation.initial_rpy_rad.reset();
  config.reference.differentiator_points = 9;
  config.reference.gyro_white_radps_per_sqrt_hz = 4e-4;
  config.reference.accel_white_mps2_per_sqrt_hz = 3e-3;
  config.reference.gyro_bias = {2e-4, 500.0};
  config.reference.accel_bias = {0.01, 700.0};
  config.gate_probability = 0.999;
  config.studies[0].blocks = kCompleteSImuBlocks & ~kTimeOffsetBlock;
  config.studies[1].blocks = kPaperSImuBlocks;
  config.studies[1].prior_C_b_s = Matrix3{1, 0, 0, 0, 1, 0, 0, 0, 1};
  config.studies[1].prior_t_d_s = 0.0;
  Estimator estimator(config);
  Answer lines;
  tell(lines, drive, estimator, {.tell_at_s = {6, 24, 45, 75}}, [&](double t_s, Sample& sample) {
    if (sample.device == SimulatedDrive::kReference) {
      sample.imu.flags |= kIsIncrement;
      for (std::size_t i = 0; i < 3; ++i) {
        sample.imu.omega_radps[i] += 2e-3 * std::sin(311.0 * t_s + static_cast<double>(i));
        sample.imu.f_mps2[i] += 0.02 * std::cos(277.0 * t_s + static_cast<double>(i));
      }
      if (within(t_s, 3.0, 12.0) && std::lround(t_s * 100.0) % 50 == 0) {
        Sample attitude = sample;
        attitude.kind = SampleKind::kAttitude;
        const imusim::MotionState state = drive.motion().state_at(t_s);
        attitude.attitude = {state.roll_rad,
                             state.pitch_rad,
                             state.heading_rad,
                             {1e-3, 1e-3, 3e-3},
                             kRollPitchValid | kHasAttitudeSd | (t_s > 5.0 ? kHeadingValid : 0U)};
        estimator.add(attitude);
      }
    }
    // Forces in half of their unit: what it shows at rest is not gravity.
    if (sample.device == kStudyB && t_s < 9.0)
      for (double& f : sample.imu.f_mps2) f *= 0.5;
    if (sample.device == kStudyA) sample.imu.flags |= kIsIncrement;
    return true;
  });
  test::expect_recorded("estimation/calibration/noisy_reference.txt", lines.text(), 1e-6, kNothing);
}

TEST(EstimatorAnswers, WithoutNavigationSwappedSensorsOfWrongNoise) {
  const Matrix3d quarter = exp_so3(Vector3d(0.0, 0.0, 0.5 * kPi));
  SimulatedDrive drive(
      100.0, {{Matrix3d::Identity(), {0.8, -0.2, 0.1}, 0.004}, {quarter, {-0.7, 0.2, 0.1}, 0.004}}, 24);
  EstimatorConfig config = drive.config();
  config.instruction_set = InstructionSet::kBaseline;
  config.gnss.enabled = false;
  for (std::size_t i = 0; i < 2; ++i) {
    SImuConfig& study = config.studies[i];
    // Each is configured where the other is.
    study.prior_C_b_s = i == 0 ? Matrix3{0, -1, 0, 1, 0, 0, 0, 0, 1} : Matrix3{1, 0, 0, 0, 1, 0, 0, 0, 1};
    study.prior_r_bs_b_m = i == 0 ? Vector3{-0.7, 0.2, 0.1} : Vector3{0.8, -0.2, 0.1};
    study.prior_r_bs_b_sd_m = {0.02, 0.02, 0.02};
    study.prior_boresight_sd_rad = {1.0, 1.0, 1.0};
    study.prior_t_d_s = 0.004;
    for (TriadNoise& noise : study.noise.gyro)
      for (double& sd : noise.white_sd) sd *= i == 0 ? 0.4 : 1.0;
  }
  config.studies[1].blocks = kCompleteSImuBlocks;
  Estimator estimator(config);
  Answer lines;
  tell(lines, drive, estimator, {.tell_at_s = {20, 60, 100}}, [](double t_s, Sample& sample) {
    // Late beyond what is waited for, before there is an estimate.
    return sample.device != SimulatedDrive::kReference || !within(t_s, 0.2, 1.5);
  });
  test::expect_recorded("estimation/calibration/swapped.txt", lines.text(), 1e-6, kNothing);
}

/// Notes the smoothed track in full.
void add_smoothed(Answer& lines, const SmoothedEpoch& epoch) {
  lines.line("smoothed", test::seconds_of(epoch.time), epoch.navigating);
  lines.line(" height and velocity", epoch.navigation.position.height_m, epoch.navigation.v_n_mps);
  lines.line(" attitude", epoch.navigation.C_b_n);
  lines.line(" biases e3", 1e3 * epoch.navigation.gyro_bias_b_radps,
             1e3 * epoch.navigation.accel_bias_b_mps2);
  lines.line(" sd e3", 1e3 * epoch.sd);
  lines.line(" P_phi", 1e9 * epoch.P_phi);
  for (std::size_t i = 0; i < epoch.studies.size(); ++i) {
    const SImuState& s = epoch.studies[i];
    lines.line(" study", epoch.calibrating[i] ? 1 : 0, s.t_d_s, s.accel_t_d_s, s.r_bs_b_m,
               s.gyro_bias_s_radps, s.accel_bias_s_mps2);
    lines.line("  shapes", s.gyro_scale, s.accel_scale, s.gyro_axes, s.accel_axes, s.places_s_m);
    lines.line("  turns", s.C_b_s, s.accel_turn);
    lines.line("  g", 1e3 * s.g_sensitivity);
  }
}

/// Hands the history to a smoother of the whole run and to one of some seconds.
class BothSmoothers final : public HistorySink {
 public:
  explicit BothSmoothers(Answer& lines) : lines_(lines) {}
  void on_history(const HistoryEpoch& epoch) noexcept override {
    whole.on_history(epoch);
    const std::size_t states = epoch.core.covariance().dimension();
    if (!lagged_) {
      lagged_.emplace(std::vector<SImuLayout>{epoch.core.layout(0)}, states);
      record_.resize(history::history_doubles(states, 1));
    }
    history::pack(epoch, record_);
    lagged_->add(record_, [&](const SmoothedEpoch& smoothed) {
      if (given_++ % 40 == 0) add_smoothed(lines_, smoothed);
    });
  }
  Smoother whole{{std::size_t{1} << 30U, testing::TempDir()}};

 private:
  Answer& lines_;
  std::optional<FixedLagSmoother> lagged_;
  std::vector<double> record_;
  std::size_t given_ = 0;
};

TEST(EstimatorAnswers, SmoothedTracks) {
  SimulatedDrive drive(44.0, {study_with_own_accelerometers()}, 25);
  EstimatorConfig config = drive.config();
  config.instruction_set = InstructionSet::kBaseline;
  config.studies[0].blocks = kCompleteSImuBlocks;
  Answer lines;
  BothSmoothers smoothers(lines);
  Estimator estimator(config, &smoothers);
  tell(lines, drive, estimator, {.epoch_every = 1 << 30}, [](double t_s, Sample& sample) {
    return !(sample.device == SimulatedDrive::kReference && within(t_s, 35.0, 35.4));
  });
  const Result<SmoothedTrack> track = smoothers.whole.smooth();
  ASSERT_TRUE(track) << track.error().text();
  lines.line("track", track->size(), track->study_count(), track->layout(0).size);
  for (std::size_t i = 0; i < track->size(); i += 31) add_smoothed(lines, track->at(i).value());
  test::expect_recorded("estimation/calibration/smoothed.txt", lines.text(), 1e-5, kNothing);
}

}  // namespace
}  // namespace imuscope
