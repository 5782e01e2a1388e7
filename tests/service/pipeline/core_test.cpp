#include "service/pipeline/core.h"

#include <gtest/gtest.h>
#include <optional>

#include "one_study.h"

namespace imuscope {
namespace {

using test::one_study;

class Notes final : public CoreSink {
 public:
  void on_error(const ErrorRecord&) noexcept override {}
  void on_event(const EstimatorEvent&) noexcept override {}
  void on_snapshot(const Snapshot& snapshot) noexcept override { snapshots.push_back(snapshot); }
  void on_late_sample(const LateSample& sample) noexcept override { late.push_back(sample); }
  std::vector<Snapshot> snapshots;
  void on_noise_applied(const AppliedNoise& applied) noexcept override { noises.push_back(applied); }
  std::vector<LateSample> late;
  std::vector<AppliedNoise> noises;
};

HostTime at_ms(double ms) { return HostTime{from_seconds(1.0 + ms * 1e-3)}; }

Sample imu_sample(DeviceIndex device, std::uint64_t sequence, double arrival_ms) {
  Sample sample{};
  sample.kind = SampleKind::kImu;
  sample.device = device;
  sample.sequence = sequence;
  sample.arrival = at_ms(arrival_ms);
  sample.time = at_ms(arrival_ms - 1.0);
  sample.imu.f_mps2 = {0.0, 0.0, -9.8};
  sample.imu.counter = static_cast<std::int64_t>(sequence);
  sample.imu.flags = kGyroValid | kAccelValid;
  return sample;
}

TEST(Core, ATickTakesWhatArrivedByItsCutAndLeavesTheRest) {
  Core core(one_study(), 2);
  Notes notes;
  ASSERT_TRUE(core.ring(0).try_push(imu_sample(0, 0, 10.0)));
  ASSERT_TRUE(core.ring(0).try_push(imu_sample(0, 1, 10.001)));
  core.tick(1, at_ms(10.0), notes);
  EXPECT_EQ(core.estimator().counters().reference_samples, 1U);
  EXPECT_EQ(core.ring(0).counters().level, 1U);
  core.tick(2, at_ms(20.0), notes);
  EXPECT_EQ(core.estimator().counters().reference_samples, 2U);
  EXPECT_TRUE(notes.late.empty());
}

TEST(Core, ASamplePushedAfterItsTickIsNotedAndAReplayTakesItAtTheSameTick) {
  Notes live;
  Core first(one_study(), 2);
  ASSERT_TRUE(first.ring(0).try_push(imu_sample(0, 0, 5.0)));
  first.tick(1, at_ms(10.0), live);
  // Stamped before the cut of tick 1, pushed after its tick.
  ASSERT_TRUE(first.ring(0).try_push(imu_sample(0, 1, 9.9)));
  first.tick(2, at_ms(20.0), live);
  ASSERT_EQ(live.late.size(), 1U);
  EXPECT_EQ(live.late[0].sequence, 1U);
  EXPECT_EQ(live.late[0].tick, 2);

  Notes replayed;
  Core second(one_study(), 2, {live.late, {}});
  ASSERT_TRUE(second.ring(0).try_push(imu_sample(0, 0, 5.0)));
  ASSERT_TRUE(second.ring(0).try_push(imu_sample(0, 1, 9.9)));
  second.tick(1, at_ms(10.0), replayed);
  EXPECT_EQ(second.estimator().counters().reference_samples, 1U) << "taken before the live run took it";
  second.tick(2, at_ms(20.0), replayed);
  EXPECT_EQ(second.estimator().counters().reference_samples, 2U);
}

TEST(Core, ARefitsModelIsTakenOverAtTheNextTickAndAReplayTakesItThere) {
  Notes live;
  Core first(one_study(), 2);
  SImuNoise noise = mtx_class_noise();
  noise.gyro[0].white_sd[1] = 0.123;
  first.tick(1, at_ms(10.0), live);
  first.offer_noise(0, {6000, mtx_class_noise()});
  first.offer_noise(0, {12000, noise});  // the older one was never taken over
  first.tick(2, at_ms(20.0), live);
  first.tick(3, at_ms(30.0), live);
  ASSERT_EQ(live.noises.size(), 1U);
  EXPECT_EQ(live.noises[0].tick, 2);
  EXPECT_EQ(live.noises[0].model.samples, 12000);
  EXPECT_DOUBLE_EQ(live.noises[0].model.noise.gyro[0].white_sd[1], 0.123);

  Notes replayed;
  Core second(one_study(), 2, {{}, live.noises});
  second.tick(1, at_ms(10.0), replayed);
  EXPECT_TRUE(replayed.noises.empty());
  second.tick(2, at_ms(20.0), replayed);
  ASSERT_EQ(replayed.noises.size(), 1U);
  EXPECT_DOUBLE_EQ(replayed.noises[0].model.noise.gyro[0].white_sd[1], 0.123);
}

TEST(Core, ANavigationWhoseReferenceIsGoneIsNotNew) {
  EstimatorConfig config = one_study();
  config.gnss.enabled = true;
  config.gnss.device = 2;
  config.navigation.enabled = true;
  config.navigation.initial_rpy_rad = Vector3{};
  Core core(config, 3);
  Notes notes;
  for (std::int64_t tick = 1; tick <= 100; ++tick) {
    const double now_ms = 10.0 * static_cast<double>(tick);
    if (tick <= 60) {
      const auto sequence = static_cast<std::uint64_t>(tick);
      ASSERT_TRUE(core.ring(0).try_push(imu_sample(0, sequence, now_ms - 2.0)));
      Sample fix{};
      fix.kind = SampleKind::kGnss;
      fix.device = 2;
      fix.sequence = sequence;
      fix.arrival = at_ms(now_ms - 1.0);
      fix.time = at_ms(now_ms - 3.0);
      fix.gnss.latitude_rad = 0.8;
      fix.gnss.sd_position_m = {0.01, 0.01, 0.02};
      fix.gnss.solution = GnssSolution::kFixed;
      fix.gnss.flags = kPositionValid | kHasPositionSd;
      ASSERT_TRUE(core.ring(2).try_push(fix));
    }
    core.tick(tick, at_ms(now_ms), notes);
  }
  ASSERT_EQ(notes.snapshots.size(), 10U);
  ASSERT_EQ(notes.snapshots.back().navigation.status, NavigationStatus::kNavigating);
  for (const Snapshot& snapshot : notes.snapshots)
    EXPECT_EQ(snapshot.has_new_navigation, snapshot.tick > 0 && snapshot.tick <= 60) << snapshot.tick;
}

// ------------------------------------------------------------------------------------ a host that stood
// still

constexpr double kPeriod_ms = 10.0;

/// Both IMUs at 100 Hz from `first` to `last` (sample numbers), read at `arrival_ms` or as they come.
void fill(Core& core, DeviceIndex device, int first, int last, std::optional<double> arrival_ms) {
  for (int k = first; k < last; ++k) {
    Sample sample = imu_sample(device, static_cast<std::uint64_t>(k), kPeriod_ms * k + 2.0);
    if (arrival_ms) sample.arrival = at_ms(*arrival_ms);
    ASSERT_TRUE(core.ring(device).try_push(sample)) << k;
  }
}

/// Runs the ticks from `first` on, `n` of them.
void run_ticks(Core& core, std::int64_t first, std::int64_t n, Notes& notes) {
  for (std::int64_t tick = first; tick < first + n; ++tick)
    core.tick(tick, at_ms(kPeriod_ms * static_cast<double>(tick)), notes);
}

const SImuCounters& counters_of(const Core& core) { return core.estimator().study(0).counters; }

/// Samples that went neither to the reference's instant nor to a loss.
std::uint64_t given_up(const Core& core) {
  const SImuCounters& counters = counters_of(core);
  return counters.late + counters.no_reference + counters.refused_full;
}

constexpr int kStart = 100;
/// The reference's window has to be filled at the start.
constexpr std::uint64_t kOfStart = 3;

class CoreAfterAStall : public testing::TestWithParam<double> {};

TEST_P(CoreAfterAStall, UsesEverySampleThatWasReadLate) {
  const int samples = static_cast<int>(GetParam() * 1e3 / kPeriod_ms);
  const int end = kStart + samples;
  // The S-IMU's line is read first, and a tick falls between: whatever the order of the reads.
  for (const bool between : {false, true}) {
    Core core(one_study(), 2);
    Notes notes;
    fill(core, 0, 0, kStart, std::nullopt);
    fill(core, 1, 0, kStart, std::nullopt);
    run_ticks(core, 0, kStart, notes);
    const double back_ms = kPeriod_ms * end + 3.0;
    const int catch_up = samples / 8 + 50;
    fill(core, 1, kStart, end, back_ms);
    fill(core, 1, end, end + catch_up, std::nullopt);  // and from then on as ever
    if (between) run_ticks(core, end + 1, 1, notes);
    fill(core, 0, kStart, end + 1, between ? back_ms + kPeriod_ms : back_ms);
    fill(core, 0, end + 1, end + catch_up, std::nullopt);
    run_ticks(core, end + 2, catch_up, notes);
    EXPECT_FALSE(core.catches_up());
    EXPECT_LE(given_up(core), kOfStart) << between;
    EXPECT_GE(counters_of(core).samples, static_cast<std::uint64_t>(end + catch_up - 10));
    EXPECT_EQ(core.estimator().counters().reference_gaps, 0U);
    EXPECT_TRUE(notes.late.empty());
  }
}
INSTANTIATE_TEST_SUITE_P(Seconds, CoreAfterAStall, testing::Values(0.5, 1.5, 5.0, 11.0, 15.0, 60.0, 118.0));

/// A study with a mounting that is known: its samples are rows from the first on.
EstimatorConfig calibrating_study() {
  EstimatorConfig config = one_study();
  config.studies[0].prior_C_b_s = std::array<double, 9>{1, 0, 0, 0, 1, 0, 0, 0, 1};
  config.studies[0].prior_t_d_s = 0.0;
  config.studies[0].prior_t_d_sd_s = 0.001;
  return config;
}

TEST_P(CoreAfterAStall, OfTheLineOfAnImuAloneUsesEverySample) {
  const int samples = static_cast<int>(GetParam() * 1e3 / kPeriod_ms);
  const int end = kStart + samples;
  const int catch_up = samples / 8 + 50;
  Core core(calibrating_study(), 2);
  Notes notes;
  fill(core, 0, 0, end + catch_up, std::nullopt);
  fill(core, 1, 0, kStart, std::nullopt);
  fill(core, 1, kStart, end, kPeriod_ms * end + 3.0);
  fill(core, 1, end, end + catch_up, std::nullopt);
  run_ticks(core, 0, end + catch_up, notes);
  EXPECT_FALSE(core.catches_up());
  EXPECT_LE(given_up(core), kOfStart);
  EXPECT_GE(counters_of(core).samples, static_cast<std::uint64_t>(end + catch_up - 10));
  EXPECT_TRUE(notes.late.empty());
}

TEST_P(CoreAfterAStall, OfTheReferencesLineAloneUsesEverySample) {
  const int samples = static_cast<int>(GetParam() * 1e3 / kPeriod_ms);
  const int end = kStart + samples;
  const int catch_up = samples / 8 + 50;
  Core core(calibrating_study(), 2);
  Notes notes;
  fill(core, 1, 0, end + catch_up, std::nullopt);
  fill(core, 0, 0, kStart, std::nullopt);
  fill(core, 0, kStart, end, kPeriod_ms * end + 3.0);
  fill(core, 0, end, end + catch_up, std::nullopt);
  run_ticks(core, 0, end + catch_up, notes);
  EXPECT_FALSE(core.catches_up());
  EXPECT_LE(given_up(core), kOfStart);
  EXPECT_LE(counters_of(core).waiting, 10U);
  EXPECT_GE(counters_of(core).samples, static_cast<std::uint64_t>(end + catch_up - 10));
  EXPECT_EQ(core.estimator().counters().reference_gaps, 0U);
  EXPECT_TRUE(notes.late.empty());
}

TEST(Core, SamplesWaitWhileNobodyIsHeardAndAreGivenUpWhereTheReferenceAloneIsSilent) {
  for (const bool is_heard : {false, true}) {
    Core core(one_study(), 2);
    Notes notes;
    fill(core, 0, 0, kStart, std::nullopt);
    fill(core, 1, 0, kStart, std::nullopt);
    constexpr int kSilent = 500;
    if (is_heard) fill(core, 1, kStart, kStart + kSilent, std::nullopt);
    run_ticks(core, 0, kStart + kSilent, notes);
    if (is_heard) {
      EXPECT_GT(counters_of(core).late, static_cast<std::uint64_t>(kSilent - 20));
    } else {
      EXPECT_EQ(counters_of(core).late, 0U);
    }
  }
}

// A solution has nothing to be applied to before the reference has come that far; a speed is of its moment.
TEST(Core, ASolutionWaitsForTheReferenceAndASpeedDoesNot) {
  constexpr int kAhead = 2 * kStart;
  for (const SampleKind kind : {SampleKind::kGnss, SampleKind::kOdometry}) {
    Core core(one_study(), 3);
    Notes notes;
    fill(core, 0, 0, kStart, std::nullopt);
    run_ticks(core, 0, kStart + 1, notes);
    Sample sample = imu_sample(2, 0, kPeriod_ms * (kStart + kAhead));
    sample.kind = kind;
    if (kind == SampleKind::kGnss) sample.gnss = {};
    if (kind == SampleKind::kOdometry) sample.odometry = {};
    ASSERT_TRUE(core.ring(2).try_push(sample));
    run_ticks(core, kStart + 1, kAhead, notes);
    EXPECT_EQ(core.ring(2).front() != nullptr, kind == SampleKind::kGnss);
    fill(core, 0, kStart, kStart + kAhead, kPeriod_ms * (kStart + kAhead) + 1.0);
    run_ticks(core, kStart + kAhead + 1, kAhead, notes);
    EXPECT_EQ(core.ring(2).front(), nullptr);
    EXPECT_TRUE(notes.late.empty());
  }
}

TEST(Core, AReplayCatchesUpAtTheSameTicks) {
  constexpr int kEnd = kStart + 1500;
  constexpr int kTicks = 400;
  const auto run = [&](Core& core, Notes& notes, bool as_recorded) {
    fill(core, 0, 0, kStart, std::nullopt);
    fill(core, 1, 0, kStart, std::nullopt);
    run_ticks(core, 0, kStart, notes);
    // Read just before a cut, and pushed after its tick: live, that tick did not see them.
    const double back_ms = kPeriod_ms * (kEnd + 1) - 0.01;
    const auto push = [&] {
      fill(core, 1, kStart, kEnd, back_ms);
      fill(core, 0, kStart, kEnd, back_ms);
    };
    if (as_recorded) push();
    run_ticks(core, kEnd + 1, 1, notes);
    if (!as_recorded) push();
    run_ticks(core, kEnd + 2, kTicks, notes);
  };
  Notes live;
  Core first(one_study(), 2);
  run(first, live, false);
  EXPECT_GT(live.late.size(), 0U);
  Notes replayed;
  Core second(one_study(), 2, {live.late, {}});
  run(second, replayed, true);
  ASSERT_EQ(live.snapshots.size(), replayed.snapshots.size());
  for (std::size_t i = 0; i < live.snapshots.size(); ++i) {
    EXPECT_EQ(live.snapshots[i].counters.reference_samples, replayed.snapshots[i].counters.reference_samples)
        << i;
    EXPECT_EQ(live.snapshots[i].studies[0].counters.samples,
              replayed.snapshots[i].studies[0].counters.samples)
        << i;
    EXPECT_EQ(live.snapshots[i].studies[0].time, replayed.snapshots[i].studies[0].time) << i;
  }
}

TEST(Core, TheOriginOfTimesIsTheFirstReferenceEpoch) {
  Core core(one_study(), 2);
  Notes notes;
  ASSERT_TRUE(core.ring(1).try_push(imu_sample(1, 0, 1.0)));
  ASSERT_TRUE(core.ring(0).try_push(imu_sample(0, 0, 3.0)));
  core.tick(10, at_ms(10.0), notes);
  ASSERT_EQ(notes.snapshots.size(), 1U);
  EXPECT_TRUE(notes.snapshots[0].has_reference);
  EXPECT_EQ(notes.snapshots[0].first_reference_time, at_ms(2.0));
}

}  // namespace
}  // namespace imuscope
