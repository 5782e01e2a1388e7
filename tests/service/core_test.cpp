#include "service/core.h"

#include <gtest/gtest.h>

#include "service/estimator_setup.h"

namespace imuscope {
namespace {

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

EstimatorConfig one_study() {
  return estimator_config(*parse_configuration(R"(
[[device]]
name = "r"
role = "reference"
protocol = "csv_imu"
[[device]]
name = "s"
role = "study"
protocol = "csv_imu"
)",
                                               "test.toml"));
}

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
  StudyNoise noise = mtx_class_noise();
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
