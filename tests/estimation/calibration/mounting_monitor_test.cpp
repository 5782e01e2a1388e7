#include "estimation/calibration/mounting_monitor.h"

#include <gtest/gtest.h>
#include <Eigen/Core>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <functional>
#include <vector>

#include "base/units.h"
#include "estimation/navigation/so3.h"
#include "sample/eigen_arrays.h"

namespace imuscope {
namespace {

using Eigen::Vector3d;
using Monitor = MountingMonitor;
using std::chrono::nanoseconds;
using std::chrono::seconds;

constexpr DeviceIndex kMonitored = 5;
constexpr HostTime kMonitoredAt = host_time_from_ns(1'234'567'890'123);
constexpr double kMonitoredGate = 20.0;
/// Low, so that a minute of motion is no more than 600 samples.
constexpr double kMonitoredRate_hz = 10.0;
constexpr double kMinute = 60.0 * kMonitoredRate_hz;
/// Every component has another, so that none passes for its neighbour.
constexpr Monitor::PriorSd kBegunWith{.psi_r = {0.1, 0.2, 0.3, 0.4, 0.5, 0.6}, .t_d_s = 0.01};
constexpr MountingGoal kMonitoredGoal{0.001, 0.002, 0.0003};

/// The monitor of one S-IMU whose estimate has begun and meets its goal, with what it is told and what it
/// tells.
struct MonitoredSImu {
  Monitor monitor;
  SImuConfig config;
  SImuLayout layout = SImuLayout::make(kFullSImuBlocks, 15);
  SImuOutput now;
  Monitor::Update update;
  EventLog log;

  MonitoredSImu() {
    config.device = kMonitored;
    config.rate_hz = kMonitoredRate_hz;
    now.time = kMonitoredAt;
    now.regime = Regime::kDynamic;
    now.goal = kMonitoredGoal;
    now.sd_psi_rad.fill(kMonitoredGoal.boresight_sd_rad);
    now.sd_r_bs_b_m.fill(kMonitoredGoal.lever_arm_sd_m);
    now.sd_t_d_s = kMonitoredGoal.time_offset_sd_s;
    now.weakest_direction[0] = 1.0;
    update.triad = Monitor::Triad::kGyro;
    update.regime = Regime::kDynamic;
    update.time = kMonitoredAt;
    update.samples = 2;
    update.gate = kMonitoredGate;
    update.y.setZero();
    update.S.setConstant(1e6);
    update.plain.setOnes();
    update.known.setZero();
    update.used = {true, true, true};
    monitor.begin(kBegunWith);
  }

  /// @return what was told of this kind; all of it names the device and its time
  template <typename Kind>
  std::vector<Kind> told() const {
    std::vector<Kind> found;
    for (const EstimatorEvent& event : log.events()) {
      if (!is<Kind>(event)) continue;
      EXPECT_EQ(event.device, kMonitored);
      EXPECT_EQ(event.time, kMonitoredAt);
      found.push_back(std::get<Kind>(event.what));
    }
    return found;
  }

  void rest(const Vector3& f_mps2, int samples, double dt_s, Regime regime = Regime::kStatic,
            std::uint32_t flags = kAccelValid) {
    Sample sample{};
    sample.time = kMonitoredAt;
    sample.imu.f_mps2 = f_mps2;
    sample.imu.flags = flags;
    for (int i = 0; i < samples; ++i) monitor.watch_gravity(sample, regime, dt_s, config, log);
  }

  /// Updates whose squared innovations are, axis by axis, so many of their plain variances.
  void innovate(const Vector3d& ratio, int updates) {
    update.y = ratio.cwiseProduct(update.plain).cwiseSqrt();
    for (int i = 0; i < updates; ++i) monitor.watch_update(update, config, log);
  }
  void innovate(double ratio, int updates) { innovate(Vector3d::Constant(ratio), updates); }

  /// An update of which one axis was beyond the gate, or none.
  void gate(bool gated) {
    update.used[1] = !gated;
    monitor.watch_update(update, config, log);
  }
  /// @return whether the last of so many samples says that the mounting changed
  bool drive(int samples, double dt_s) {
    bool changed = false;
    for (int i = 0; i < samples; ++i) changed = monitor.watch_mounting(now, layout, dt_s, config, log);
    return changed;
  }
  /// Motion enough for anything to be called observable.
  void prove() { drive(100, 1.0); }

  Monitor::Verdict verdict() const { return monitor.judge(now, layout); }
  bool observes(std::size_t component) const { return verdict().observable[component]; }
  bool observes_everything() const {
    const Monitor::Verdict said = verdict();
    return said.t_d_observable && std::ranges::all_of(said.observable, std::identity{});
  }
  /// And calls nothing calibrated either.
  bool observes_nothing() const {
    const Monitor::Verdict said = verdict();
    return !said.is_calibrated && !said.t_d_observable &&
           std::ranges::none_of(said.observable, std::identity{});
  }
};

/// Of a running mean that moves by `share` of what is left: steps from `from` until it is beyond `to`, on its
/// way to `end`.
int steps_of_mean(double from, double to, double end, double share) {
  return static_cast<int>(std::ceil(std::log((to - end) / (from - end)) / std::log(1.0 - share)));
}

/// C-24 of one axis.
double surplus_factor(double nis, double updates) {
  return std::clamp(nis / (1.0 + 3.0 * std::sqrt(2.0 / updates)), 1.0, 100.0);
}

// Gravity

TEST(MountingMonitor, AForceAtRestThatIsNotGravityIsToldOnceAfterFiveSecondsAlsoOfTheNextEstimate) {
  MonitoredSImu s;
  constexpr double kStep_s = 1.0 / 128.0;
  // The first sample of all has none before it.
  s.rest({0.0, 0.0, -12.0}, 1, 0.0);
  s.rest({0.0, 0.0, -12.0}, 639, kStep_s);
  EXPECT_TRUE(s.log.events().empty());
  s.rest({0.0, 0.0, -12.0}, 1, kStep_s);
  const auto told = s.told<event::GravityMagnitudeWrong>();
  ASSERT_EQ(told.size(), 1U);
  EXPECT_DOUBLE_EQ(told[0].f_mps2, 12.0);
  s.rest({0.0, 0.0, -12.0}, 10, 0.0, Regime::kDynamic);
  s.monitor.begin(kBegunWith);
  s.rest({0.0, 0.0, -12.0}, 2000, kStep_s);
  EXPECT_EQ(s.log.events().size(), 1U);
}

TEST(MountingMonitor, GravityIsTheMeanOfAStandstillOnAnyAxisToAMetrePerSecondSquaredOnBothSides) {
  const auto is_told = [](const Vector3& f, const Vector3& next) {
    MonitoredSImu s;
    for (int i = 0; i < 400; ++i) {
      s.rest(f, 1, 1.0 / 64.0);
      s.rest(next, 1, 1.0 / 64.0);
    }
    return !s.told<event::GravityMagnitudeWrong>().empty();
  };
  for (const double off : {-0.99, 0.0, 0.99}) {
    const double f = kNominalGravity_mps2 + off;
    EXPECT_FALSE(is_told({f, 0.0, 0.0}, {f, 0.0, 0.0})) << off;
    EXPECT_FALSE(is_told({0.0, -f, 0.0}, {0.0, -f, 0.0})) << off;
    EXPECT_FALSE(is_told({0.6 * f, 0.0, 0.8 * f}, {0.6 * f, 0.0, 0.8 * f})) << off;
  }
  for (const double off : {-1.01, 1.0, 1.01}) {
    const double f = kNominalGravity_mps2 + off;
    EXPECT_TRUE(is_told({0.0, f, 0.0}, {0.0, f, 0.0})) << off;
  }
  // The mean of vibration is nothing, however large the force of each sample.
  EXPECT_FALSE(is_told({7.0, 0.0, kNominalGravity_mps2}, {-7.0, 0.0, kNominalGravity_mps2}));
}

TEST(MountingMonitor, GravityIsNotLookedForInMotionWithoutAnAccelerometerOrInSamplesAfterGaps) {
  MonitoredSImu s;
  s.rest({0.0, 0.0, 1.0}, 1000, 0.01, Regime::kDynamic);
  s.rest({0.0, 0.0, 1.0}, 1000, 0.01, Regime::kStatic, kGyroValid);
  s.rest({0.0, 0.0, 1.0}, 1000, 0.11);
  // Either of them ends a standstill, and what it showed is no part of the next.
  s.rest({0.0, 0.0, 1.0}, 49, 0.1);
  s.rest({0.0, 0.0, 1.0}, 1, 0.1, Regime::kDynamic);
  s.rest({0.0, 0.0, 1.0}, 49, 0.1);
  s.rest({0.0, 0.0, 1.0}, 1, 0.1, Regime::kStatic, kGyroValid);
  s.rest({0.0, 0.0, kNominalGravity_mps2}, 60, 0.1);
  EXPECT_TRUE(s.log.events().empty());
  // A gap does not.
  s.rest({0.0, 0.0, 1.0}, 1, 0.1, Regime::kDynamic);
  s.rest({0.0, 0.0, 1.0}, 30, 0.1);
  s.rest({0.0, 0.0, 1.0}, 1, 0.11);
  s.rest({0.0, 0.0, 1.0}, 30, 0.1);
  EXPECT_EQ(s.told<event::GravityMagnitudeWrong>().size(), 1U);
}

// C-24: the factor of R

TEST(MountingMonitor, NoNoiseIsTakenForLargerUntilMoreThanChanceShows) {
  MonitoredSImu s;
  EXPECT_EQ(s.monitor.noise_factor(Monitor::Triad::kGyro, Regime::kDynamic), Vector3d::Ones());
  s.innovate(4.0, 2);
  EXPECT_EQ(s.monitor.noise_factor(Monitor::Triad::kGyro, Regime::kDynamic), Vector3d::Ones());
  s.innovate(4.0, 1);
  EXPECT_NEAR(s.monitor.noise_factor(Monitor::Triad::kGyro, Regime::kDynamic).x(), surplus_factor(4.0, 3),
              1e-12);
  s.monitor.begin(kBegunWith);
  EXPECT_EQ(s.monitor.noise_factor(Monitor::Triad::kGyro, Regime::kDynamic), Vector3d::Ones());
}

TEST(MountingMonitor, NoiseIsWhatTheMeanInnovationOfAMinuteSaysBeyondThreeOfItsSd) {
  MonitoredSImu s;
  s.update.plain = Vector3d(1.0, 2.0, 3.0);
  const auto factor = [&] { return s.monitor.noise_factor(Monitor::Triad::kGyro, Regime::kDynamic); };
  for (int k = 1; k <= 40; ++k) {
    s.innovate(Vector3d(30.0, 10.0 * k, 0.0), 1);
    EXPECT_NEAR(factor().x(), surplus_factor(30.0, k), 1e-9) << k;
    EXPECT_NEAR(factor().y(), surplus_factor(5.0 * (k + 1), k), 1e-9) << k;
    EXPECT_EQ(factor().z(), 1.0);
  }
  // Of a minute of samples, two of them to an update.
  constexpr int kOfAMinute = 300;
  s.innovate(30.0, kOfAMinute - 41);
  EXPECT_NEAR(factor().x(), surplus_factor(30.0, kOfAMinute - 1), 1e-9);
  s.innovate(30.0, 100);
  EXPECT_NEAR(factor().x(), surplus_factor(30.0, kOfAMinute), 1e-9);
  s.innovate(2.0, 50);
  EXPECT_NEAR(factor().x(), surplus_factor(2.0 + 28.0 * std::pow(1.0 - 1.0 / kOfAMinute, 50), kOfAMinute),
              1e-9);
}

TEST(MountingMonitor, AnInnovationBeyondTheGateCountsAsIfAtItAndNoNoiseIsMoreThanTenTimesTheConfigured) {
  MonitoredSImu s;
  s.update.S = Vector3d(4.0, 1000.0, 40.0);
  s.update.plain = Vector3d(2.0, 1.0, 2.0);
  s.innovate(Vector3d(1e6, 1e6, 100.0), 50);
  const Vector3d factor = s.monitor.noise_factor(Monitor::Triad::kGyro, Regime::kDynamic);
  EXPECT_NEAR(factor.x(), surplus_factor(kMonitoredGate * 4.0 / 2.0, 50), 1e-9);
  EXPECT_EQ(factor.y(), 100.0);
  EXPECT_NEAR(factor.z(), surplus_factor(100.0, 50), 1e-9);
}

TEST(MountingMonitor, NoiseIsKeptApartByAxisTriadAndRegimeAndClippedAxesHaveNone) {
  for (const Monitor::Triad triad : {Monitor::Triad::kGyro, Monitor::Triad::kAccel}) {
    for (const Regime regime : {Regime::kStatic, Regime::kDynamic}) {
      MonitoredSImu s;
      s.update.triad = triad;
      s.update.regime = regime;
      s.innovate(Vector3d(5.0, 6.0, 7.0), 100);
      s.update.clipped = {false, false, true};
      s.innovate(Vector3d(5.0, 6.0, 1e5), 50);
      for (const Monitor::Triad other : {Monitor::Triad::kGyro, Monitor::Triad::kAccel}) {
        for (const Regime at : {Regime::kStatic, Regime::kDynamic}) {
          const Vector3d factor = s.monitor.noise_factor(other, at);
          const bool seen = other == triad && at == regime;
          EXPECT_NEAR(factor.x(), seen ? surplus_factor(5.0, 150) : 1.0, 1e-9);
          EXPECT_NEAR(factor.y(), seen ? surplus_factor(6.0, 150) : 1.0, 1e-9);
          EXPECT_NEAR(factor.z(), seen ? surplus_factor(7.0, 100) : 1.0, 1e-9);
        }
      }
    }
  }
}

// C-24: what is told of the configured noise

TEST(MountingMonitor, ANoiseThatIsConfiguredTooSmallIsToldOnceAfterAMinuteWithTheOneThatWouldFit) {
  MonitoredSImu s;
  for (auto* triad : {&s.config.noise.gyro, &s.config.noise.accel}) {
    for (TriadNoise& noise : *triad) noise.white_sd = {7.0, 8.0, 9.0};
  }
  s.config.noise.gyro[static_cast<std::size_t>(Regime::kDynamic)].white_sd = {0.1, 0.5, 0.3};
  s.update.plain = Vector3d(1.0, 2.0, 4.0);
  s.innovate(Vector3d(1.0, 0.0, 1.5), 150);
  s.innovate(Vector3d(1.0, 6.0, 1.5), 149);
  EXPECT_TRUE(s.log.events().empty());
  s.innovate(Vector3d(1.0, 6.0, 1.5), 1);
  const auto told = s.told<event::NoiseTooSmall>();
  ASSERT_EQ(told.size(), 1U);
  EXPECT_TRUE(told[0].gyro);
  EXPECT_NEAR(told[0].factor, std::sqrt(3.0), 1e-9);
  // What is too much in a sample: an update takes a mean over twice two, weighted (C-15).
  const double excess = 2.0 / 0.75 * (3.0 * 2.0 - 2.0);
  EXPECT_NEAR(told[0].white_sd, std::sqrt(0.5 * 0.5 + excess), 1e-9);
  s.innovate(Vector3d(1.0, 6.0, 1.5), 1000);
  EXPECT_EQ(s.log.events().size(), 1U);
}

TEST(MountingMonitor, AnAccelerometersNoiseIsToldAsSuchAndNeverAsLessThanTheConfigured) {
  MonitoredSImu s;
  for (auto* triad : {&s.config.noise.gyro, &s.config.noise.accel}) {
    for (TriadNoise& noise : *triad) noise.white_sd = {7.0, 8.0, 9.0};
  }
  s.config.noise.accel[static_cast<std::size_t>(Regime::kDynamic)].white_sd = {0.1, 0.2, 0.3};
  s.update.samples = 1;
  const auto innovate_by_turns = [&](double large_plain, int updates) {
    for (int i = 0; i < updates; ++i) {
      // The gyro fits all the while.
      s.update.triad = Monitor::Triad::kGyro;
      s.innovate(1.0, 1);
      s.update.triad = Monitor::Triad::kAccel;
      s.update.plain(2) = i % 2 == 0 ? 1.0 : large_plain;
      s.innovate(Vector3d(1.0, 1.0, i % 2 == 0 ? 10.0 : 0.0), 1);
    }
  };
  innovate_by_turns(1.0, 599);
  EXPECT_TRUE(s.log.events().empty());
  innovate_by_turns(1.0, 1);
  ASSERT_EQ(s.told<event::NoiseTooSmall>().size(), 1U);
  EXPECT_FALSE(s.told<event::NoiseTooSmall>()[0].gyro);
  // Each sample by itself; the last one was large.
  const double mean = 10.0 * 301.0 / 600.0;
  EXPECT_NEAR(s.told<event::NoiseTooSmall>()[0].factor, std::sqrt(mean), 1e-9);
  EXPECT_NEAR(s.told<event::NoiseTooSmall>()[0].white_sd, std::sqrt(0.3 * 0.3 + mean - 1.0), 1e-9);

  s.monitor.begin(kBegunWith);
  innovate_by_turns(1000.0, 600);
  ASSERT_EQ(s.told<event::NoiseTooSmall>().size(), 2U);
  EXPECT_NEAR(s.told<event::NoiseTooSmall>()[1].factor, std::sqrt(5.0), 1e-9);
  EXPECT_DOUBLE_EQ(s.told<event::NoiseTooSmall>()[1].white_sd, 0.3);
}

TEST(MountingMonitor, TheNoisiestAxisMustHaveSeenItsOwnMinute) {
  MonitoredSImu s;
  for (int i = 0; i < 599; ++i) {
    ASSERT_TRUE(s.log.events().empty()) << i;
    s.update.used[2] = i % 2 == 0;
    s.innovate(Vector3d(1.0, 1.0, 3.0), 1);
  }
  EXPECT_EQ(s.told<event::NoiseTooSmall>().size(), 1U);
}

TEST(MountingMonitor, OnlyMotionWhoseInnovationsAreMostlyNoiseSpeaksAgainstTheConfiguredNoise) {
  using Change = std::function<void(Monitor::Update&)>;
  const auto told_with = [](const Change& change) {
    MonitoredSImu s;
    s.prove();
    s.update.S.setConstant(100.0);
    change(s.update);
    s.innovate(9.0, 1000);
    EXPECT_EQ(s.observes_everything(), s.told<event::NoiseTooSmall>().empty());
    return s.told<event::NoiseTooSmall>().size();
  };
  EXPECT_EQ(told_with([](Monitor::Update& /*as it is*/) {}), 1U);
  EXPECT_EQ(told_with([](Monitor::Update& u) { u.regime = Regime::kStatic; }), 0U);
  EXPECT_EQ(told_with([](Monitor::Update& u) { u.used = {}; }), 0U);
  EXPECT_EQ(told_with([](Monitor::Update& u) { u.clipped = {true, true, true}; }), 0U);
  EXPECT_EQ(told_with([](Monitor::Update& u) { u.known.setConstant(0.2 * 100.0); }), 0U);
  EXPECT_EQ(told_with([](Monitor::Update& u) { u.known.setConstant(0.19 * 100.0); }), 1U);
}

TEST(MountingMonitor, NothingIsObservableFromTwiceTheVarianceUntilItIsBelowOneAndAHalf) {
  for (const Monitor::Triad triad : {Monitor::Triad::kGyro, Monitor::Triad::kAccel}) {
    constexpr double kShare = 2.0 / kMinute;
    MonitoredSImu s;
    s.prove();
    s.update.triad = triad;
    s.update.plain.setConstant(2.0);  // twice of which has a root without rounding
    s.innovate(1.95, 1000);
    EXPECT_TRUE(s.observes_everything());
    EXPECT_TRUE(s.verdict().is_calibrated);
    EXPECT_TRUE(s.log.events().empty());

    for (const double ratio : {2.0, 4.0}) {
      s.monitor.begin(kBegunWith);
      s.prove();
      s.innovate(ratio, 300);
      EXPECT_TRUE(s.observes_nothing()) << ratio;
    }
    ASSERT_EQ(s.told<event::NoiseTooSmall>().size(), 2U);
    const int until_it_fits = steps_of_mean(4.0, 1.5, 0.0, kShare);
    s.innovate(0.0, until_it_fits - 1);
    EXPECT_TRUE(s.observes_nothing());
    s.innovate(0.0, 1);
    EXPECT_TRUE(s.observes_everything());
    EXPECT_TRUE(s.verdict().is_calibrated);
    // And it may be told again.
    const double fits = 4.0 * std::pow(1.0 - kShare, until_it_fits);
    const int until_it_does_not = steps_of_mean(fits, 2.0, 4.0, kShare);
    s.innovate(4.0, until_it_does_not - 1);
    EXPECT_TRUE(s.observes_everything());
    EXPECT_EQ(s.log.events().size(), 2U);
    s.innovate(4.0, 1);
    EXPECT_TRUE(s.observes_nothing());
    EXPECT_EQ(s.log.events().size(), 3U);

    s.monitor.begin(kBegunWith);
    s.prove();
    s.innovate(2.0, 1);
    s.update.plain.setConstant(4.0);
    s.innovate(1.0, 1);
    EXPECT_TRUE(s.observes_nothing()) << "at one and a half";
  }
}

// E-19: a mounting that changed

TEST(MountingMonitor, AMountingHasChangedWhenFourFifthsOfThreeSecondsAreGatedOnAnyTriad) {
  const int until_changed = steps_of_mean(0.0, 0.8, 1.0, 0.01);
  for (const Monitor::Triad triad : {Monitor::Triad::kGyro, Monitor::Triad::kAccel}) {
    MonitoredSImu s;
    s.now.nis_gyro = {0.1, 0.2, 0.3};
    s.now.nis_accel = {0.4, 0.9, 0.5};
    s.update.triad = triad;
    s.gate(true);
    // The other triad fits all the time.
    s.update.triad = triad == Monitor::Triad::kGyro ? Monitor::Triad::kAccel : Monitor::Triad::kGyro;
    s.gate(false);
    EXPECT_FALSE(s.drive(until_changed - 1, 0.03));
    EXPECT_TRUE(s.told<event::MountingChanged>().empty());
    EXPECT_TRUE(s.drive(1, 0.03));
    ASSERT_EQ(s.told<event::MountingChanged>().size(), 1U);
    EXPECT_EQ(s.told<event::MountingChanged>()[0].mean_nis, 0.9);
    s.now.nis_gyro[0] = 1.2;
    EXPECT_TRUE(s.drive(1, 0.03));
    ASSERT_EQ(s.told<event::MountingChanged>().size(), 2U);
    EXPECT_EQ(s.told<event::MountingChanged>()[1].mean_nis, 1.2);
    // The next one begins with nothing against it.
    s.monitor.begin(kBegunWith);
    EXPECT_FALSE(s.drive(500, 0.03));
    s.update.triad = triad;
    s.gate(true);
    EXPECT_FALSE(s.drive(until_changed - 1, 0.03));
  }
}

TEST(MountingMonitor, AMountingHasNotChangedWhereSamplesFitAgainOrAreClippedOrItIsNotEstimated) {
  MonitoredSImu s;
  s.gate(true);
  s.drive(150, 0.03);
  s.gate(false);
  EXPECT_FALSE(s.drive(500, 0.03));
  s.update.clipped[1] = true;
  s.gate(true);
  EXPECT_FALSE(s.drive(500, 0.03));
  s.update.clipped[1] = false;
  s.layout.psi = SImuLayout::kAbsent;
  s.gate(true);
  EXPECT_FALSE(s.drive(500, 0.03));
  EXPECT_TRUE(s.told<event::MountingChanged>().empty());
}

/// One gated update and a cable that is pulled out: half a second of it counts, at most.
TEST(MountingMonitor, ASilenceCountsAsHalfASecondWhateverItsLength) {
  MonitoredSImu s;
  s.gate(true);
  s.drive(1, 0.03);
  EXPECT_FALSE(s.drive(1, 100.0)) << "a share of a sixth, not all of it";
  const int more = steps_of_mean(1.0 - 0.99 * (1.0 - 0.5 / 3.0), 0.8, 1.0, 0.01);
  EXPECT_FALSE(s.drive(more - 1, 0.03));
  EXPECT_TRUE(s.drive(1, 0.03));

  MonitoredSImu other;
  other.layout = SImuLayout::make(kBiasSImuBlocks, 15);
  other.gate(true);
  other.drive(1, 1e4);
  EXPECT_FALSE(other.monitor.misfits()) << "nor does one sample after a silence make a device misfit";
  other.drive(30, 0.3);
  ASSERT_TRUE(other.monitor.misfits());
  other.gate(false);
  other.drive(1, 1e4);
  EXPECT_TRUE(other.monitor.misfits()) << "and one that fits proves nothing";
}

// E-19: a device that is not what is configured

TEST(MountingMonitor, ADeviceMisfitsFromATenthOfHalfAMinuteIsToldFromAFifthAndFitsAgainAfterMinutes) {
  constexpr double kShare = 0.3 / 30.0;
  MonitoredSImu s;
  s.layout = SImuLayout::make(kBiasSImuBlocks, 15);
  const auto misfits_after = [&](int samples) {
    s.drive(samples, 0.3);
    return s.monitor.misfits();
  };
  for (std::size_t round = 0; round < 2; ++round) {
    const double left = round == 0 ? 0.0 : 0.002;
    const int until_misfit = steps_of_mean(left, 0.1, 1.0, kShare);
    const int until_told = steps_of_mean(left, 0.2, 1.0, kShare);
    s.gate(true);
    EXPECT_FALSE(misfits_after(until_misfit - 1));
    EXPECT_TRUE(misfits_after(1));
    s.drive(until_told - until_misfit - 1, 0.3);
    EXPECT_EQ(s.log.events().size(), round);
    s.drive(1, 0.3);
    ASSERT_EQ(s.told<event::SImuInconsistent>().size(), round + 1);
    const double share = 1.0 - (1.0 - left) * std::pow(1.0 - kShare, until_told);
    EXPECT_NEAR(s.told<event::SImuInconsistent>()[round].share, share, 1e-4);
    s.drive(10, 0.3);
    // At rest everything fits, and a new estimate is of the same device.
    s.gate(false);
    s.now.regime = Regime::kStatic;
    EXPECT_TRUE(misfits_after(10'000));
    s.now.regime = Regime::kDynamic;
    s.monitor.begin(kBegunWith);
    const double most = 1.0 - (1.0 - left) * std::pow(1.0 - kShare, until_told + 10);
    const int until_it_fits = steps_of_mean(most, 0.002, 0.0, kShare);
    EXPECT_TRUE(misfits_after(until_it_fits - 1));
    EXPECT_FALSE(misfits_after(1));
    EXPECT_EQ(s.log.events().size(), round + 1);
  }
}

TEST(MountingMonitor, AtRestAGatedSampleIsEvidenceAllTheSame) {
  for (const double share : {0.1, 0.2}) {
    MonitoredSImu s;
    s.layout = SImuLayout::make(kBiasSImuBlocks, 15);
    s.now.regime = Regime::kStatic;
    s.gate(true);
    s.drive(steps_of_mean(0.0, share, 1.0, 0.3 / 30.0), 0.3);
    EXPECT_TRUE(s.monitor.misfits()) << "a tenth of half a minute, at least";
    EXPECT_EQ(s.told<event::SImuInconsistent>().size(), share == 0.2 ? 1U : 0U);
  }
}

TEST(MountingMonitor, APoorCoarseAlignmentIsAMisfitUntilMinutesFitAndForgivesNone) {
  constexpr double kShare = 0.3 / 30.0;
  MonitoredSImu s;
  s.monitor.note_poor_alignment();
  EXPECT_TRUE(s.monitor.misfits());
  s.drive(steps_of_mean(0.1, 0.002, 0.0, kShare) - 1, 0.3);
  EXPECT_TRUE(s.observes_nothing());
  s.drive(1, 0.3);
  EXPECT_FALSE(s.monitor.misfits());
  EXPECT_TRUE(s.observes_everything());
  EXPECT_TRUE(s.log.events().empty());

  MonitoredSImu worse;
  worse.layout = SImuLayout::make(kBiasSImuBlocks, 15);
  worse.gate(true);
  worse.drive(50, 0.3);
  worse.monitor.note_poor_alignment();
  worse.gate(false);
  worse.drive(steps_of_mean(1.0 - std::pow(1.0 - kShare, 50), 0.002, 0.0, kShare) - 1, 0.3);
  EXPECT_TRUE(worse.monitor.misfits());
}

// E-8: priors

/// Sd whose root sum of squares is 5 / 1024, and no rounding.
constexpr double kUnit = 1.0 / 1024.0;
constexpr double kSdNow = 3.0 * kUnit;
constexpr double kSdThen = 4.0 * kUnit;
constexpr double kAtTheLimit = 25.0 * kUnit;
constexpr double kBeyondTheLimit = 26.0 * kUnit;

TEST(MountingMonitor, ALeverArmFiveSdFromTheConfiguredIsToldOnce) {
  for (std::size_t axis = 0; axis < 3; ++axis) {
    for (const double sign : {-1.0, 1.0}) {
      MonitoredSImu s;
      s.config.prior_r_bs_b_m = s.now.r_bs_b_m = {1.0, 2.0, -3.0};
      s.config.prior_r_bs_b_sd_m.fill(kSdThen);
      s.now.sd_r_bs_b_m.fill(kSdNow);
      s.now.r_bs_b_m[axis] += sign * kAtTheLimit;
      s.monitor.watch_priors(s.now, s.config, s.log);
      EXPECT_TRUE(s.log.events().empty());
      EXPECT_FALSE(s.monitor.contradicts_prior());
      s.now.r_bs_b_m[axis] += sign * kUnit;
      s.now.r_bs_b_m[(axis + 1) % 3] -= sign * kUnit;
      for (int i = 0; i < 3; ++i) s.monitor.watch_priors(s.now, s.config, s.log);
      s.monitor.begin(kBegunWith);
      s.monitor.watch_priors(s.now, s.config, s.log);
      const auto told = s.told<event::LeverArmPriorWrong>();
      ASSERT_EQ(told.size(), 1U);
      EXPECT_NEAR(told[0].distance_m, std::hypot(kBeyondTheLimit, kUnit), 1e-12);
      EXPECT_EQ(s.log.events().size(), 1U);
      EXPECT_TRUE(s.monitor.contradicts_prior());
    }
  }
}

/// An S-IMU that is `off`, in b, from where it is configured, and nothing is wrong with its lever arm.
MonitoredSImu turned_by(const Vector3d& off) {
  const Eigen::Matrix3d configured = exp_so3(Vector3d(0.0, 0.0, 0.5 * kPi));
  MonitoredSImu s;
  s.config.prior_C_b_s = to_array(configured);
  s.now.C_b_s = to_array(Eigen::Matrix3d(configured * exp_so3(off)));
  s.now.sd_psi_rad.fill(kSdNow);
  s.config.prior_boresight_sd_rad.fill(kSdThen);
  return s;
}

TEST(MountingMonitor, ABoresightFiveSdFromTheConfiguredIsToldOnceAsSoonAsItIsKnownToADegree) {
  const auto told = [](MonitoredSImu& s) {
    s.monitor.watch_priors(s.now, s.config, s.log);
    EXPECT_EQ(s.monitor.contradicts_prior(), !s.log.events().empty());
    return s.told<event::BoresightPriorWrong>();
  };
  for (const double sign : {-1.0, 1.0}) {
    MonitoredSImu within = turned_by(Vector3d(0.0, sign * 0.99 * kAtTheLimit, 0.0));
    EXPECT_TRUE(told(within).empty());
    MonitoredSImu beyond = turned_by(Vector3d(0.0, sign * 1.01 * kAtTheLimit, 0.0));
    ASSERT_EQ(told(beyond).size(), 1U);
    EXPECT_NEAR(told(beyond)[0].angle_rad, 1.01 * kAtTheLimit, 1e-9);
  }
  MonitoredSImu far = turned_by(Vector3d(0.3, 0.0, 0.4));
  far.now.sd_psi_rad = {0.001, 0.001, 1.0 * kRadPerDeg};
  EXPECT_TRUE(told(far).empty());
  far.now.sd_psi_rad[2] = 0.99 * kRadPerDeg;
  const auto prior = far.config.prior_C_b_s;
  far.config.prior_C_b_s.reset();
  EXPECT_TRUE(told(far).empty());
  far.config.prior_C_b_s = prior;
  ASSERT_EQ(told(far).size(), 1U);
  EXPECT_NEAR(told(far)[0].angle_rad, 0.5, 1e-9);
  far.monitor.begin(kBegunWith);
  EXPECT_EQ(told(far).size(), 1U);
  // Of the lever arm all the same.
  far.now.r_bs_b_m[0] = 100.0;
  told(far);
  EXPECT_EQ(far.told<event::LeverArmPriorWrong>().size(), 1U);
}

TEST(MountingMonitor, ABoresightIsHeldAgainstItsSdAxisByAxisOfB) {
  MonitoredSImu s = turned_by(Vector3d(0.1, 0.0, 0.0));
  s.config.prior_boresight_sd_rad = {1.0, kSdThen, kSdThen};
  s.monitor.watch_priors(s.now, s.config, s.log);
  EXPECT_TRUE(s.log.events().empty());
  EXPECT_TRUE(Monitor::fits_prior_of(s.config, s.now));
  s.config.prior_boresight_sd_rad = {kSdThen, 1.0, 1.0};
  s.monitor.watch_priors(s.now, s.config, s.log);
  EXPECT_EQ(s.log.events().size(), 1U);
  EXPECT_FALSE(Monitor::fits_prior_of(s.config, s.now));
}

TEST(MountingMonitor, APlaceFitsWhereBothBoresightAndLeverArmAreWithinFiveSdOfIt) {
  MonitoredSImu s = turned_by(Vector3d(0.0, 0.99 * kAtTheLimit, 0.0));
  s.config.prior_r_bs_b_sd_m.fill(kSdThen);
  s.now.sd_r_bs_b_m.fill(kSdNow);
  s.now.r_bs_b_m[2] = -kAtTheLimit;
  EXPECT_TRUE(Monitor::fits_prior_of(s.config, s.now));
  s.now.r_bs_b_m[2] = -kBeyondTheLimit;
  EXPECT_FALSE(Monitor::fits_prior_of(s.config, s.now));
  s.now.r_bs_b_m[2] = 0.0;
  s.config.prior_C_b_s = to_array(Eigen::Matrix3d(Eigen::Matrix3d::Identity()));
  EXPECT_FALSE(Monitor::fits_prior_of(s.config, s.now));
  s.config.prior_C_b_s.reset();
  EXPECT_FALSE(Monitor::fits_prior_of(s.config, s.now));
}

// E-9: a silence

TEST(MountingMonitor, BiasesThatAreNotThoseOfBeforeASilenceAreToldOnceTwentySecondsAfterIt) {
  for (std::size_t axis = 0; axis < 3; ++axis) {
    for (const double change : {-kBeyondTheLimit, -kAtTheLimit, kAtTheLimit, kBeyondTheLimit}) {
      for (const bool gyro : {true, false}) {
        MonitoredSImu s;
        SImuOutput before = s.now;
        before.gyro_bias_radps = {1.0, 2.0, 3.0};
        before.accel_bias_mps2 = {-4.0, -5.0, -6.0};
        before.sd_gyro_bias_radps.fill(kSdThen);
        before.sd_accel_bias_mps2.fill(kSdThen);
        s.now = before;
        s.now.sd_gyro_bias_radps.fill(kSdNow);
        s.now.sd_accel_bias_mps2.fill(kSdNow);
        (gyro ? s.now.gyro_bias_radps : s.now.accel_bias_mps2)[axis] += change;
        // Nothing to compare with yet.
        s.monitor.watch_return(s.now, s.config, s.log);
        EXPECT_TRUE(s.log.events().empty());
        s.monitor.note_return(before, kMonitoredAt - seconds{20}, 6.5, s.config, s.log);
        ASSERT_EQ(s.log.events().size(), 1U);
        ASSERT_TRUE(is<event::SImuReturned>(s.log.events()[0]));
        EXPECT_EQ(std::get<event::SImuReturned>(s.log.events()[0].what).gap_s, 6.5);
        EXPECT_EQ(s.log.events()[0].device, kMonitored);
        EXPECT_EQ(s.log.events()[0].time, kMonitoredAt - seconds{20});
        s.now.time = kMonitoredAt - nanoseconds{1};
        s.monitor.watch_return(s.now, s.config, s.log);
        EXPECT_EQ(s.log.events().size(), 1U);
        s.now.time = kMonitoredAt;
        for (int i = 0; i < 3; ++i) s.monitor.watch_return(s.now, s.config, s.log);
        const bool is_told = std::abs(change) > kAtTheLimit;
        const auto gyro_told = s.told<event::GyroBiasChanged>();
        const auto accel_told = s.told<event::AccelBiasChanged>();
        ASSERT_EQ(gyro_told.size(), is_told && gyro ? 1U : 0U);
        ASSERT_EQ(accel_told.size(), is_told && !gyro ? 1U : 0U);
        if (is_told && gyro) {
          EXPECT_DOUBLE_EQ(gyro_told[0].change_radps, kBeyondTheLimit);
        }
        if (is_told && !gyro) {
          EXPECT_DOUBLE_EQ(accel_told[0].change_mps2, kBeyondTheLimit);
        }
      }
    }
  }
}

// C-25: the class

constexpr double kAxesSd_rad = 1.0 / 1024.0;
constexpr double kAlphaSd_rad = 2.0 / 1024.0;
constexpr double kGSensitivitySd = 1e-4;  // rad/s per m/s^2

/// One kind of imperfection: where its states stand, how many, its prior sd, and how to set one.
struct Imperfection {
  std::size_t SImuLayout::*first;
  std::size_t count;
  double sd;
  std::function<void(SImuState&, std::size_t, double)> set;
};

/// Two S-IMUs, of which the second has imperfections.
struct OfAClass {
  EstimatorConfig config;
  FilterCore core;
  MonitoredSImu s;

  static EstimatorConfig two() {
    EstimatorConfig config;
    config.studies.resize(2);
    config.studies[1].blocks = kCompleteSImuBlocks;
    config.studies[1].prior_axes_sd_rad = kAxesSd_rad;
    config.studies[1].prior_accel_boresight_sd_rad.fill(kAlphaSd_rad);
    config.studies[1].prior_g_sensitivity_sd = kGSensitivitySd;
    return config;
  }
  OfAClass() : config(two()), core(config) { s.prove(); }

  [[nodiscard]] static std::vector<Imperfection> imperfections() {
    const auto index = [](std::size_t i) { return static_cast<Eigen::Index>(i); };
    return {{&SImuLayout::gyro_axes, 3, kAxesSd_rad,
             [=](SImuState& state, std::size_t i, double x) { state.gyro_axes(index(i)) = x; }},
            {&SImuLayout::accel_axes, 3, kAxesSd_rad,
             [=](SImuState& state, std::size_t i, double x) { state.accel_axes(index(i)) = x; }},
            {&SImuLayout::accel_boresight, 3, kAlphaSd_rad,
             [=](SImuState& state, std::size_t i, double x) {
               Vector3d alpha = log_so3(state.accel_turn);
               alpha(index(i)) = x;
               state.accel_turn = exp_so3(alpha);
             }},
            {&SImuLayout::g_sensitivity, 9, kGSensitivitySd, [=](SImuState& state, std::size_t i, double x) {
               state.g_sensitivity(index(i / 3), index(i % 3)) = x;
             }}};
  }
  /// Of one state this share of the prior's variance is gone.
  void learn(const Imperfection& kind, std::size_t i, double share) {
    const std::size_t state = core.layout(1).*kind.first + i;
    core.covariance().set(state, state, (1.0 - share) * kind.sd * kind.sd);
  }
  double factor() { return s.monitor.watch_class(core, 1, config.studies[1]); }
};

TEST(MountingMonitor, AnImperfectionFiveSdBeyondItsClassWidensTheMountingsSdAndCalibratesNothing) {
  for (const Imperfection& kind : OfAClass::imperfections()) {
    for (std::size_t i = 0; i < kind.count; ++i) {
      OfAClass sensor;
      const auto n = static_cast<double>(kind.count);
      // 0.64 of the variance learned: estimates scatter by 0.8 of the prior's sd.
      const double scatter = 0.8 * kind.sd;
      sensor.learn(kind, i, 0.64);
      kind.set(sensor.core.study(1), i, 4.99 * scatter);
      EXPECT_EQ(sensor.factor(), 1.0);
      EXPECT_TRUE(sensor.s.verdict().is_calibrated);
      kind.set(sensor.core.study(1), i, -6.0 * scatter);
      EXPECT_NEAR(sensor.factor(), std::sqrt((3.0 + 36.0) / (3.0 + n)), 1e-9) << kind.count << ", " << i;
      EXPECT_FALSE(sensor.s.verdict().is_calibrated);
      EXPECT_TRUE(sensor.s.observes_everything());
      EXPECT_EQ(sensor.s.monitor.watch_class(sensor.core, 0, sensor.config.studies[0]), 1.0);
      EXPECT_TRUE(sensor.s.verdict().is_calibrated);
      // The others of its kind count, too, as far as they were learned.
      for (std::size_t k = 0; k < kind.count; ++k) {
        if (k == i) continue;
        sensor.learn(kind, k, 0.64);
        kind.set(sensor.core.study(1), k, 2.0 * scatter);
      }
      EXPECT_NEAR(sensor.factor(), std::sqrt((3.0 + 36.0 + 4.0 * (n - 1.0)) / (3.0 + n)), 1e-9);
    }
  }
  OfAClass at_the_limit;
  const Imperfection axes = OfAClass::imperfections()[0];
  at_the_limit.learn(axes, 0, 1.0);
  axes.set(at_the_limit.core.study(1), 0, 5.0 * axes.sd);
  EXPECT_EQ(at_the_limit.factor(), 1.0);
}

TEST(MountingMonitor, AnImperfectionOfWhichLessThanATwentiethWasLearnedSpeaksAgainstNoClass) {
  for (const Imperfection& kind : OfAClass::imperfections()) {
    OfAClass sensor;
    for (std::size_t i = 0; i < kind.count; ++i) {
      kind.set(sensor.core.study(1), i, 100.0 * kind.sd);
      EXPECT_EQ(sensor.factor(), 1.0);
      sensor.learn(kind, i, 0.049);
      EXPECT_EQ(sensor.factor(), 1.0);
    }
    sensor.learn(kind, 1, 0.051);
    EXPECT_NEAR(sensor.factor(), std::sqrt((3.0 + 1e4 / 0.051) / (3.0 + static_cast<double>(kind.count))),
                1e-6);
  }
}

TEST(MountingMonitor, OfSeveralKindsTheOneFarthestBeyondItsClassCounts) {
  const auto kinds = OfAClass::imperfections();
  for (const std::size_t worst : {0U, 1U, 2U}) {
    OfAClass sensor;
    for (const std::size_t kind : {0U, 1U, 2U}) {
      sensor.learn(kinds[kind], 0, 0.64);
      kinds[kind].set(sensor.core.study(1), 0, (kind == worst ? 9.0 : 7.0) * 0.8 * kinds[kind].sd);
    }
    EXPECT_NEAR(sensor.factor(), std::sqrt((3.0 + 81.0) / (3.0 + 3.0)), 1e-9);
  }
}

TEST(MountingMonitor, WhatIsNotEstimatedOfAClassOrTakenToBeNothingContradictsNone) {
  OfAClass sensor;
  sensor.core.study(0).gyro_axes.setConstant(1.0);
  sensor.core.study(0).g_sensitivity.setConstant(1.0);
  EXPECT_EQ(sensor.s.monitor.watch_class(sensor.core, 0, sensor.config.studies[0]), 1.0);
  sensor.config.studies[1].prior_axes_sd_rad = 0.0;
  sensor.learn(OfAClass::imperfections()[0], 0, 1.0);
  sensor.core.study(1).gyro_axes.setConstant(1.0);
  EXPECT_EQ(sensor.factor(), 1.0);
}

// C-22 and verdicts

TEST(MountingMonitor, ALeverArmOfWhoseSdTheReferencesNoiseMakesMoreThanThreeTenthsIsNotObservable) {
  MonitoredSImu s;
  s.prove();
  s.now.sd_r_bs_b_m = {0.001, 0.002, 0.001};
  s.monitor.watch_attenuation(Vector3d(0.3 * 0.001, -0.29 * 0.002, 0.0), s.now.sd_r_bs_b_m);
  EXPECT_TRUE(s.observes_everything());
  EXPECT_TRUE(s.verdict().is_calibrated);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    for (const double sign : {-1.0, 1.0}) {
      Vector3d lost = Vector3d::Zero();
      lost(static_cast<Eigen::Index>(axis)) = sign * 0.31 * s.now.sd_r_bs_b_m[axis];
      s.monitor.watch_attenuation(lost, s.now.sd_r_bs_b_m);
      for (std::size_t i = 0; i < 6; ++i) EXPECT_EQ(s.observes(i), i != 3 + axis) << i;
      EXPECT_TRUE(s.verdict().t_d_observable);
      EXPECT_FALSE(s.verdict().is_calibrated);
    }
  }
  s.monitor.watch_attenuation(Vector3d::Zero(), s.now.sd_r_bs_b_m);
  EXPECT_TRUE(s.verdict().is_calibrated);
}

TEST(MountingMonitor, AComponentIsObservableWithLessThanHalfOfItsPriorLeftOrAtItsGoal) {
  MonitoredSImu s;
  s.prove();
  for (std::size_t i = 0; i < 6; ++i) {
    double& sd = i < 3 ? s.now.sd_psi_rad[i] : s.now.sd_r_bs_b_m[i - 3];
    double& goal = i < 3 ? s.now.goal.boresight_sd_rad : s.now.goal.lever_arm_sd_m;
    sd = 0.5 * kBegunWith.psi_r[i];
    for (std::size_t k = 0; k < 6; ++k) EXPECT_EQ(s.observes(k), k != i) << k;
    EXPECT_TRUE(s.verdict().t_d_observable);
    goal = sd;
    EXPECT_TRUE(s.observes_everything());
    s.now.goal = kMonitoredGoal;
    sd = std::nextafter(sd, 0.0);
    EXPECT_TRUE(s.observes_everything());
    EXPECT_FALSE(s.verdict().is_calibrated);
    sd = i < 3 ? kMonitoredGoal.boresight_sd_rad : kMonitoredGoal.lever_arm_sd_m;
    EXPECT_TRUE(s.verdict().is_calibrated);
  }
}

TEST(MountingMonitor, ATimeOffsetIsObservableWithLessThanHalfOfItsPriorLeftOrAtItsGoalAndWhereItIsEstimated) {
  MonitoredSImu s;
  s.prove();
  s.now.sd_t_d_s = 0.5 * kBegunWith.t_d_s;
  EXPECT_FALSE(s.verdict().t_d_observable);
  // It is no part of the mounting's goal.
  EXPECT_TRUE(s.verdict().is_calibrated);
  s.now.goal.time_offset_sd_s = s.now.sd_t_d_s;
  EXPECT_TRUE(s.verdict().t_d_observable);
  s.now.goal = kMonitoredGoal;
  s.now.sd_t_d_s = 0.49 * kBegunWith.t_d_s;
  EXPECT_TRUE(s.verdict().t_d_observable);
  s.layout.t_d = SImuLayout::kAbsent;
  EXPECT_FALSE(s.verdict().t_d_observable);
  EXPECT_TRUE(s.observes(0));
}

TEST(MountingMonitor, NothingIsObservableBeforeTwentySecondsOfMotionSpokeForTheMounting) {
  MonitoredSImu s;
  for (int round = 0; round < 2; ++round) {
    s.now.regime = Regime::kStatic;
    s.drive(1000, 0.25);
    s.now.regime = Regime::kDynamic;
    s.drive(79, 0.25);
    EXPECT_TRUE(s.observes_nothing());
    s.drive(1, 0.25);
    EXPECT_TRUE(s.observes_everything());
    EXPECT_TRUE(s.verdict().is_calibrated);
    s.monitor.begin(kBegunWith);
  }
}

TEST(MountingMonitor, NoMountingIsCalibratedThatIsNotEstimated) {
  MonitoredSImu s;
  s.prove();
  s.layout.r = SImuLayout::kAbsent;
  EXPECT_TRUE(s.verdict().is_calibrated);
  s.layout.psi = SImuLayout::kAbsent;
  EXPECT_FALSE(s.verdict().is_calibrated);
  s.layout.r = 18;
  EXPECT_TRUE(s.verdict().is_calibrated);
}

TEST(MountingMonitor, TheWeakestDirectionIsTheOneWithMostOfItsPriorLeft) {
  using OfPairs = Eigen::Matrix<double, 6, 6>;
  using OfComponents = Eigen::Matrix<double, 6, 1>;
  MonitoredSImu s;
  const OfComponents prior = Eigen::Map<const OfComponents>(kBegunWith.psi_r.data());
  const auto set = [&](const OfPairs& scaled) {
    Eigen::Map<OfPairs>(s.now.covariance_psi_r.data()) = prior.asDiagonal() * scaled * prior.asDiagonal();
  };
  struct Pair {
    Eigen::Index larger;
    Eigen::Index smaller;
    SImuDirection component;  ///< the larger
  };
  for (const Pair& pair : {Pair{0, 4, SImuDirection::kPsiX}, Pair{4, 0, SImuDirection::kRY},
                           Pair{2, 3, SImuDirection::kPsiZ}, Pair{5, 1, SImuDirection::kRZ}}) {
    for (const double sign : {-1.0, 1.0}) {
      // 0.7 of the prior's sd is left in one direction, a tenth in all others.
      OfComponents weak = OfComponents::Zero();
      weak(pair.larger) = 0.8;
      weak(pair.smaller) = sign * 0.6;
      set(0.01 * OfPairs::Identity() + (0.49 - 0.01) * weak * weak.transpose());
      const Monitor::Weakest found = s.monitor.weakest_direction(s.now, s.layout);
      EXPECT_NEAR(found.relative_sd, 0.7, 1e-12);
      EXPECT_EQ(found.component, pair.component);
      const OfComponents direction = Eigen::Map<const OfComponents>(found.direction.data());
      EXPECT_NEAR(std::abs(direction.dot(weak)), 1.0, 1e-12);
      EXPECT_NEAR(direction.norm(), 1.0, 1e-12);
    }
  }
  // A covariance that is none has nothing left, and is no reason for a root of a negative number.
  set(-OfPairs::Identity());
  EXPECT_EQ(s.monitor.weakest_direction(s.now, s.layout).relative_sd, 0.0);
}

TEST(MountingMonitor, WithoutBoresightOrLeverArmThereIsNoWeakestDirection) {
  MonitoredSImu s;
  for (std::size_t i = 0; i < 6; ++i) s.now.covariance_psi_r[i * 7] = 1e-4;
  for (std::size_t SImuLayout::*part : {&SImuLayout::psi, &SImuLayout::r}) {
    SImuLayout layout = s.layout;
    layout.*part = SImuLayout::kAbsent;
    const Monitor::Weakest found = s.monitor.weakest_direction(s.now, layout);
    EXPECT_EQ(found.relative_sd, 1.0);
    EXPECT_EQ(found.component, SImuDirection::kPsiX);
    EXPECT_EQ(found.direction, (std::array<double, 6>{}));
  }
}

}  // namespace
}  // namespace imuscope
