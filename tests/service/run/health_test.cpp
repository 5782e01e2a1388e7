#include "service/run/health.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <ctime>
#include <thread>

#include "base/units.h"
#include "publish/message_codec.h"
#include "rt/host_clock.h"
#include "rt/thread_setup.h"
#include "service/pipeline/observability.h"

namespace imuscope {
namespace {

double processor_time_of_this_thread_s() {
  timespec time{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

using testing::ElementsAre;
using testing::HasSubstr;

device_status_t device(const std::string& name, const std::string& role, const std::string& state) {
  device_status_t d{};
  d.name = name;
  d.role = role;
  d.state = state;
  return d;
}

alarm_t alarm(const char* kind, const char* what, const char* remedy) {
  alarm_t a{};
  a.kind = kind;
  a.what = what;
  a.remedy = remedy;
  a.active = 1;
  return a;
}

status_t healthy() {
  status_t report{};
  report.devices = {device("airins", "reference", "streaming"), device("mtx1", "study", "streaming"),
                    device("mtx2", "study", "streaming")};
  report.studies.resize(2);
  for (auto& study : report.studies) study.state = "converging";
  report.rings.resize(1);
  report.rings[0].name = "raw bytes";
  return report;
}

TEST(Health, RunningWhenAllStreamAndCalibrate) { EXPECT_EQ(judge(healthy()).state, "running"); }

TEST(Health, ACountThatGrowsIsNoNews) {
  EXPECT_TRUE(says_the_same("degraded: mtx1 lost 9 samples", "degraded: mtx1 lost 1234 samples"));
  EXPECT_FALSE(says_the_same("degraded: left lost 9 samples", "degraded: right lost 9 samples"));
  EXPECT_FALSE(says_the_same("running: all is well", ""));
}

TEST(Health, AligningUntilOneMountingIsFound) {
  auto report = healthy();
  for (auto& study : report.studies) study.state = "looking for its mounting";
  EXPECT_EQ(judge(report).state, "aligning");
}

TEST(Health, StartingWhileADeviceIsSetUpAndDegradedWhenOneFallsSilentLater) {
  auto report = healthy();
  report.devices[1].state = "configuring";
  for (auto& study : report.studies) study.state = "waiting for samples";
  EXPECT_EQ(judge(report).state, "starting");
  EXPECT_EQ(judge(report).reason, "mtx1: configuring");
  for (auto& study : report.studies) study.state = "converging";
  report.devices[1].problem = "no answer; check its cable";
  EXPECT_EQ(judge(report).state, "degraded");
  EXPECT_EQ(judge(report).reason, "mtx1: configuring: no answer; check its cable");
}

TEST(Health, FailedWithoutAReferenceOrWithoutAnyStudy) {
  auto report = healthy();
  report.devices[0].state = "failed";
  report.devices[0].problem = "wrong protocol";
  EXPECT_EQ(judge(report).state, "failed");
  EXPECT_THAT(judge(report).reason, HasSubstr("airins: failed: wrong protocol"));
  report = healthy();
  report.devices[1].state = report.devices[2].state = "failed";
  EXPECT_EQ(judge(report).state, "failed");
  report.devices[2].state = "streaming";
  EXPECT_EQ(judge(report).state, "degraded") << "the other S-IMU is still worth the run";
}

TEST(Health, DegradedWhenAnythingIsLostOrRefused) {
  auto report = healthy();
  report.capture_lost = 3;
  EXPECT_EQ(judge(report).state, "degraded");
  EXPECT_THAT(judge(report).reason, HasSubstr("3 records"));
  report = healthy();
  report.rings[0].refused = 7;
  EXPECT_EQ(judge(report).reason, "the ring 'raw bytes' refused 7 elements");
  report = healthy();
  report.devices[2].samples_refused = 2;
  EXPECT_THAT(judge(report).reason, HasSubstr("2 samples of mtx2"));
  report = healthy();
  report.alarms = {alarm("privilege", "memory is not locked", "...")};
  EXPECT_EQ(judge(report).state, "degraded");
  EXPECT_EQ(judge(report).reason, "memory is not locked; ...");
  report.alarms[0].active = 0;
  EXPECT_EQ(judge(report).state, "running") << "it is over";
}

TEST(Health, SaysOneReasonForEachState) {
  // Ordered as they are looked for: each stands after all that may come before it.
  auto report = healthy();
  EXPECT_EQ(judge(report).reason, "all devices stream");
  for (auto& study : report.studies) study.state = "waiting for samples";
  EXPECT_EQ(judge(report).reason, "waiting for motion that shows how the S-IMUs sit");
  report.alarms = {alarm("bus", "no route", "run ip route add")};
  EXPECT_EQ(judge(report).state, "degraded") << "even before there is a mounting";
  EXPECT_EQ(judge(report).reason, "no route; run ip route add");
  report.devices[2].frames_dropped = 5;
  EXPECT_EQ(judge(report).reason, "5 frames of mtx2 were lost by this PC before they could be read");
  report.rings[0].refused = 1;
  EXPECT_EQ(judge(report).reason, "the ring 'raw bytes' refused 1 elements");
  report.capture_lost = 2;
  EXPECT_EQ(judge(report).reason, "2 records could not be kept in the capture");
  report.devices[1].state = "line down";
  EXPECT_EQ(judge(report).state, "starting");
  EXPECT_EQ(judge(report).reason, "mtx1: line down");
  report.devices[1].state = "failed";
  EXPECT_EQ(judge(report).state, "degraded") << "the other S-IMU goes on";
  EXPECT_EQ(judge(report).reason, "mtx1: failed");
  report.devices[2].state = "failed";
  EXPECT_EQ(judge(report).state, "failed");
  EXPECT_EQ(judge(report).reason, "no IMU under study can be set up");
  report.devices[0].state = "failed";
  EXPECT_EQ(judge(report).reason, "airins: failed");
}

TEST(Beat, QuantilesAreThoseOfAThousandKnownValues) {
  // 1 us to 1 ms in steps of 1 us: 500, 990, 999 and 1000 us, each at most an eighth of an octave above.
  PeriodicStatistics beat;
  beat.ticks = 1000;
  beat.overruns = 11;
  beat.skipped = 12;
  for (int us = 1; us <= 1000; ++us) {
    beat.lateness.add(std::chrono::microseconds(us));
    beat.done.add(std::chrono::microseconds(10 * us));
  }
  thread_status_t thread{};
  set_beat(beat, std::chrono::microseconds(30), thread);
  EXPECT_THAT((std::array{thread.ticks, thread.overruns, thread.skipped}), ElementsAre(1000, 11, 12));
  constexpr double kBucket = 1.0 + 1.0 / 8.0;
  const auto expect_near_above = [](double value_us, double truth_us, double offset_us) {
    EXPECT_GE(value_us - offset_us, truth_us);
    EXPECT_LE(value_us - offset_us, truth_us * kBucket);
  };
  expect_near_above(thread.lateness_p50_us, 500, 0);
  expect_near_above(thread.lateness_p99_us, 990, 0);
  expect_near_above(thread.lateness_p999_us, 999, 0);
  EXPECT_DOUBLE_EQ(thread.lateness_max_us, 1000);
  // Work is counted from the instant that it is of, lateness from the deadline.
  expect_near_above(thread.done_p50_us, 5000, 30);
  expect_near_above(thread.done_p99_us, 9900, 30);
  expect_near_above(thread.done_p999_us, 9990, 30);
  EXPECT_DOUBLE_EQ(thread.done_max_us, 10'030);
  const auto octaves = beat.lateness.octaves();
  EXPECT_EQ(thread.lateness_octaves, std::vector<std::int64_t>(octaves.begin(), octaves.end()));
}

TEST(Beat, QuantilesAreUnknownWithoutAValue) {
  thread_status_t thread{};
  set_beat({}, Duration::zero(), thread);
  EXPECT_TRUE(std::isnan(thread.lateness_p50_us));
  EXPECT_TRUE(std::isnan(thread.lateness_max_us));
  EXPECT_TRUE(std::isnan(thread.done_p999_us));
}

TEST(CalibrationStatus, ShowsTheLargestSdTheGoalsAndTheManoeuvreForTheWeakestDirection) {
  SImuOutput study;
  study.status = CalibrationStatus::kConverging;
  study.sd_psi_rad = {0.1, 0.3, 0.2};
  study.sd_r_bs_b_m = {0.6, 0.4, 0.5};
  study.sd_t_d_s = 0.7;
  study.weakest_direction = {0.0, 0.0, 1.0, 0.0, 0.0, 0.0};
  study.observable = {true, true, false, true, true, true};
  study.t_d_observable = true;
  study.weakest_relative_sd = 0.9;
  study.counters.gated_gyro = {1, 2, 3};
  study.counters.gated_accel = {4, 5, 6};
  const auto status = study_status("mtx1", study);
  EXPECT_DOUBLE_EQ(status.sd_psi_deg, 0.3 * kDegPerRad);
  EXPECT_DOUBLE_EQ(status.sd_r_m, 0.6);
  EXPECT_DOUBLE_EQ(status.sd_t_d_ms, 700.0);
  EXPECT_DOUBLE_EQ(status.goal_psi_deg, kFinestGoal.boresight_sd_rad * kDegPerRad);
  EXPECT_DOUBLE_EQ(status.goal_r_m, kFinestGoal.lever_arm_sd_m);
  EXPECT_DOUBLE_EQ(status.goal_t_d_ms, kFinestGoal.time_offset_sd_s * 1e3);
  EXPECT_EQ(status.weakest, "boresight about down");
  EXPECT_DOUBLE_EQ(status.weakest_relative, 0.9);
  EXPECT_THAT(status.manoeuvre, HasSubstr("brake"));
  EXPECT_EQ(status.gated, 21);
  EXPECT_EQ(status.manoeuvre, observability_of(study).advice) << "said in one way everywhere";
  study.status = CalibrationStatus::kCalibrated;
  study.observable.fill(true);
  study.sd_psi_rad.fill(0.5 * kFinestGoal.boresight_sd_rad);
  study.sd_r_bs_b_m.fill(0.5 * kFinestGoal.lever_arm_sd_m);
  study.sd_t_d_s = 0.5 * kFinestGoal.time_offset_sd_s;
  EXPECT_EQ(study_status("mtx1", study).manoeuvre, "") << "nothing is missing any more";
  study.status = CalibrationStatus::kCoarse;
  const auto coarse = study_status("mtx1", study);
  EXPECT_TRUE(std::isnan(coarse.sd_psi_deg)) << "what is not estimated has no sd";
  EXPECT_THAT(coarse.manoeuvre, HasSubstr("turn in both directions"));
}

TEST(ThreadWatch, KnowsEachThreadsNameSchedulingAndProcessorTime) {
  ThreadWatch watch;
  std::atomic<bool> stop{false};
  std::atomic<double> busy_s{-1.0};
  std::atomic<bool> asleep_named{false};
  std::thread busy([&] {
    (void)setup_this_thread({"watch-busy", Scheduling::kIdle, 0, {}});
    while (!stop.load()) busy_s = processor_time_of_this_thread_s();
  });
  std::thread asleep([&] {
    (void)setup_this_thread({"watch-asleep", Scheduling::kNormal, 0, {}});
    asleep_named = true;
    stop.wait(false);
  });
  // Until the busy one has had a share of a processor that others may be using, too.
  const auto wait_for_busy = [&](double until_s) {
    while (busy_s < until_s || !asleep_named) std::this_thread::sleep_for(std::chrono::milliseconds(5));
  };
  wait_for_busy(0.0);
  (void)watch.look(host_now());
  constexpr double kTicks_s = 0.05;  // the kernel counts a thread's time in steps of 10 ms
  wait_for_busy(busy_s + kTicks_s);
  const auto threads = watch.look(host_now());
  stop.store(true);
  stop.notify_all();
  busy.join();
  asleep.join();
  const auto named = [&](const std::string& name) {
    const auto found =
        std::find_if(threads.begin(), threads.end(), [&](const auto& t) { return t.name == name; });
    return found == threads.end() ? thread_status_t{} : *found;
  };
  EXPECT_EQ(named("watch-busy").scheduling, "idle");
  EXPECT_EQ(named("watch-asleep").scheduling, "normal");
  EXPECT_GT(named("watch-busy").cpu_percent, named("watch-asleep").cpu_percent);
  EXPECT_LE(named("watch-busy").cpu_percent, 110.0);
}

TEST(Status, KnowsItsDevicesAndNothingElseBeforeTheRun) {
  Configuration configuration;
  configuration.run_name = "demo";
  configuration.sha256 = "abc";
  configuration.devices.resize(2);
  configuration.devices[1].name = "mtx1";
  const status_t status = status_of(configuration, "0.1.0");
  EXPECT_EQ(status.run + status.version + status.configuration_hash, "demo0.1.0abc");
  ASSERT_EQ(status.devices.size(), 2U);
  EXPECT_EQ(status.devices[1].name, "mtx1");
  EXPECT_TRUE(std::isnan(status.devices[1].latency_ms));
  EXPECT_TRUE(std::isnan(status.devices[1].data_age_s));
  EXPECT_TRUE(std::isnan(status.devices[1].clock_drift_ppm));
  EXPECT_TRUE(std::isnan(status.devices[1].clock_sd_us));
  EXPECT_TRUE(std::isnan(status.devices[1].sd_t_d_ms));
  EXPECT_TRUE(std::isnan(status.refit_duration_s));
  EXPECT_EQ(status.refit_utime, 0);
}

TEST(Status, CountsEveryArraySoThatAListenerGetsAllOfIt) {
  status_t status = healthy();
  status.threads.resize(3);
  status.threads[1].lateness_octaves = {4, 5, 6, 7};
  status.alarms.resize(5);
  count_elements(status);
  const auto heard = decode_message<status_t>(encode_message(status));
  ASSERT_TRUE(heard);
  EXPECT_THAT((std::array{heard->devices.size(), heard->studies.size(), heard->threads.size(),
                          heard->rings.size(), heard->alarms.size()}),
              ElementsAre(3, 2, 3, 1, 5));
  EXPECT_THAT(heard->threads[1].lateness_octaves, ElementsAre(4, 5, 6, 7));
}

}  // namespace
}  // namespace imuscope
