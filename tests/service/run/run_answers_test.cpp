/// What a run writes and says, whole.

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <map>

#include "publish/lcm_publisher.h"
#include "rich_run.h"
#include "service/run/alarms.h"
#include "service/run/broadcast.h"
#include "service/run/describe.h"
#include "service/run/health.h"
#include "service/run/models_file.h"
#include "service/run/run_folder.h"
#include "service/run/run_record.h"
#include "service/run/telemetry.h"
#include "tests/support/answer.h"
#include "tests/support/file_content.h"
#include "tests/support/lcm_text.h"
#include "tests/support/recorded_answer.h"

namespace imuscope {
namespace {

using test::Answer;

std::string type_of(std::string_view channel) {
  static const std::map<std::string, std::string, std::less<>> kTypes{
      {"NAVIGATION", "navigation_t"}, {"ODOMETRY", "odometry_t"}, {"CALIBRATION", "calibration_t"},
      {"ERROR", "error_t"},           {"POSE", "pose_t"},         {"INS", "ins_t"},
      {"WV", "wavelet_variance_t"},   {"NOISE", "noise_model_t"}, {"DYNAMICS", "dynamics_t"},
      {"PC", "pc_clock_t"},           {"STATUS", "status_t"},     {"VIRTUAL", "virtual_imu_t"}};
  const std::string_view kind = channel.substr(channel.find('_') + 1);
  return kTypes.find(kind.substr(0, kind.find('_')))->second;
}

PcClockLog::News news() {
  return {test::rich_clock(),
          WallClockStep{test::kRichFirst + std::chrono::seconds(3),
                        test::kRichFirst + std::chrono::seconds(4), 0.5},
          PcSuspend{test::kRichFirst + std::chrono::seconds(5), test::kRichFirst + std::chrono::seconds(65),
                    60.0}};
}

/// Everything that is said of a run of a second and a half, message by message.
std::string said(bool bridge) {
  const test::LcmText reader;
  const Configuration configuration = test::rich_configuration();
  Broadcast broadcast(configuration);
  std::string text;
  broadcast.on_snapshot(test::rich_snapshot(0));  // nobody listens yet
  broadcast.on_error(test::rich_error(0, 0));
  broadcast.open(LcmPublisher::unconnected("IMUSCOPE"), bridge);
  broadcast.set_tap([&](std::string_view channel, std::int64_t utime, std::span<const std::uint8_t> message) {
    text += fmt::format("{} at {} us ", channel, utime - 1'700'000'000'000'000);
    text += reader.text(type_of(channel), message);
  });
  int sample = 0;
  for (const int tick : {0, 1, 5}) {
    for (; sample < 14 * std::min(tick, 2); ++sample) {
      broadcast.on_error(test::rich_error(0, sample));
      broadcast.on_error(test::rich_error(1, sample));
    }
    Snapshot snapshot = test::rich_snapshot(tick);
    if (tick == 1) {
      snapshot.has_new_study[0] = snapshot.has_new_odometry = false;
      snapshot.studies[1].observable.fill(false);
      snapshot.studies[1].t_d_observable = false;
    }
    if (tick == 5) snapshot.has_new_navigation = snapshot.has_new_study[1] = false;
    broadcast.on_snapshot(snapshot);
  }
  broadcast.on_refit(test::rich_refit());
  broadcast.on_pc_clock(news(), test::kRichUtc);
  PcClockLog::News bare;
  bare.state.reading = test::rich_clock().reading;
  broadcast.on_pc_clock(bare, test::kRichUtc);
  broadcast.on_error(test::rich_error(1, 150));
  broadcast.finish();
  const UtcStamp utc = broadcast.utc_at(test::kRichFirst + std::chrono::seconds(2));
  return text + fmt::format("utc {} us {} {}\n", utc.utc.time_since_epoch().count() / 1000 % 1'000'000'000,
                            utc.gps_minus_utc_s, utc.is_known);
}

TEST(RunWhole, WhatIsSaid) { test::expect_recorded("service/run/said.txt", said(true)); }

TEST(RunWhole, WithoutABridgeTheSameIsSaidButPoseAndIns) {
  const std::string text = said(false);
  EXPECT_EQ(text.find("IMUSCOPE_POSE"), std::string::npos);
  EXPECT_EQ(text.find("IMUSCOPE_INS"), std::string::npos);
  EXPECT_NE(text.find("IMUSCOPE_NAVIGATION"), std::string::npos);
}

TEST(RunWhole, FilesOfARun) {
  const auto folder = test::scratch_folder();
  for (const bool write_errors : {true, false}) {
    const auto out = folder / (write_errors ? "all" : "without_errors");
    auto run = RunFolder::create(out, {{"left", 0.0}, {"right", 0.25}}, write_errors);
    ASSERT_TRUE(run) << run.error().text();
    Snapshot none{};
    (*run)->on_snapshot(none);
    for (int sample = 0; sample < 20; ++sample) {
      (*run)->on_error(test::rich_error(0, sample));
      if (sample % 3 == 0) (*run)->on_error(test::rich_error(1, sample));
    }
    (*run)->write_error(test::rich_error(1, 200), "");
    (*run)->on_event({event::SImuReturned{2.5}, 1, test::kRichFirst});
    (*run)->on_late_sample({1, 17, 99});
    for (int tick = 0; tick < 6; ++tick) {
      Snapshot snapshot = test::rich_snapshot(tick);
      snapshot.has_new_navigation = tick != 1;
      snapshot.has_new_odometry = tick != 2;
      snapshot.has_new_study[1] = tick != 3;
      if (tick == 4) snapshot.time_scale = {};
      if (tick == 5) {
        snapshot.studies[0].sd_accel_boresight_rad = {};
        snapshot.studies[0].sd_accel_t_d_s = 0.0;
        snapshot.studies[0].status = CalibrationStatus::kCoarse;
      }
      (*run)->on_snapshot(snapshot);
    }
    EXPECT_EQ((*run)->events().size(), 1U);
    EXPECT_EQ((*run)->late_samples().size(), 1U);
    EXPECT_FALSE((*run)->problem());
    ASSERT_TRUE((*run)->write_calibration());
    ASSERT_TRUE((*run)->close());
    EXPECT_EQ(std::filesystem::exists(out / "errors_left.csv"), write_errors);
    if (!write_errors) continue;
    std::string text;
    for (const char* name :
         {"navigation.csv", "odometry.csv", "calibration_left.csv", "calibration_right.csv",
          "errors_left.csv", "errors_right.csv", "calibration.json"})
      text += fmt::format("{}\n{}\n", name, test::content_of(out / name));
    test::expect_recorded("service/run/files.txt", text);
  }
}

TEST(RunWhole, ALineThroughTheSamples) {
  SampleTimeLine line;
  EXPECT_FALSE(line.valid());
  line.add(1000, 5.0);
  EXPECT_FALSE(line.valid());
  line.add(1000, 5.5);
  EXPECT_FALSE(line.valid()) << "one counter has no slope";
  SampleTimeLine exact;
  for (const int i : {0, 1, 2, 5, 9, 30}) exact.add(1000 + i, 5.0 + 0.01 * i);
  ASSERT_TRUE(exact.valid());
  EXPECT_EQ(exact.counter0(), 1000);
  EXPECT_EQ(exact.n(), 6.0);
  EXPECT_NEAR(exact.period_s(), 0.01, 1e-12);
  EXPECT_NEAR(exact.t0_s(), 5.0, 1e-12);
}

RunRecord rich_record(const Configuration& configuration) {
  RunRecord run{configuration, "1.2.3", {"capture.lcm", "more.lcm"}, {}, 12'345};
  for (std::size_t i = 0; i < configuration.devices.size(); ++i) {
    const auto n = 10 * static_cast<std::uint64_t>(i + 1);
    DeviceRecord device;
    device.counters = {n + 1, n + 2, n + 3, n + 4, n + 5, n + 6, n + 7, n + 8, n + 9};
    device.refused = 100 + n;
    device.frames_dropped = 200 + n;
    device.clock_shift_s = 0.5 * static_cast<double>(i);
    run.devices.push_back(device);
  }
  TimeBudget& budget = run.devices[1].time_budget.emplace();
  budget.stamped_by = StampedBy::kKernel;
  for (double* value : {&budget.stamp_lead_s, &budget.stamp_lead_sd_s, &budget.wire_s, &budget.adapter_s,
                        &budget.latency_s, &budget.clock_sd_s, &budget.clock_drift_ppm, &budget.t_d_s,
                        &budget.sd_t_d_s, &budget.delay_s, &budget.sd_delay_s})
    *value = 0.001 * static_cast<double>(value - &budget.stamp_lead_s + 1);
  run.devices[2].time_budget.emplace();
  run.devices[2].problem = "it is silent; look at its cable";
  run.warnings = {"a warning"};
  run.notes = {"a note"};
  run.findings.emplace();
  run.findings->push_back({check::Harm::kWrong,
                           "gravity norm",
                           "left",
                           "its forces are those of g",
                           1.0,
                           9.81,
                           "m/s2",
                           "look at its unit",
                           {{"left", "csv.accel_unit", "\"g\""}}});
  run.findings->push_back({check::Harm::kNote, "turns", "right", "no turns", 0.5, 30.0, "deg", "turn", {}});
  run.static_s = 11.5;
  run.dynamic_s = 22.25;
  run.error_process_mounting = "filter";
  return run;
}

std::string without_build(nlohmann::json json) {
  json.erase("build");
  json.erase("configuration_text");
  return json.dump(1) + '\n';
}

TEST(RunWhole, RecordOfARun) {
  const Configuration configuration = test::rich_configuration();
  std::string text;
  RunRecord run = rich_record(configuration);
  text += without_build(run_json(run));  // no tick came
  Snapshot last = test::rich_snapshot(9);
  run.last = &last;
  PcClockRecord clock;
  clock.first = test::rich_clock();
  clock.last = {test::rich_clock().reading, std::nullopt, {}};
  clock.steps = {*news().step};
  clock.steps_left_out = 3;
  clock.suspends = {*news().suspend};
  run.pc_clock = &clock;
  UtcTrack utc;
  utc.add(last.time_scale);
  run.utc = &utc;
  run.events = {{event::ReferenceGap{0.25}, 0, test::kRichFirst + std::chrono::seconds(8)},
                {event::SImuReturned{2.5}, 1, test::kRichFirst + std::chrono::milliseconds(9500)}};
  text += without_build(run_json(run));
  last.time_scale.source = UtcSource::kPcClock;
  last.time_scale.pulses.is_known = false;
  last.navigation.has_gnss = last.odometry.enabled = last.has_utc = false;
  run.findings.reset();
  run.static_s.reset();
  text += without_build(run_json(run));
  test::expect_recorded("service/run/record.txt", text);
}

TEST(RunWhole, WarningsOfARun) {
  Answer answer;
  const Configuration configuration = test::rich_configuration();
  const auto tell = [&](const char* what, const Snapshot& last) {
    answer.line("-", what);
    for (const auto& warning : warnings_of(configuration, last)) answer.line(warning);
  };
  Snapshot last = test::rich_snapshot(3);
  last.counters.gnss_used = 70;
  last.counters.gnss_rejected = 30;
  last.counters.gnss_positions_rejected = 5;
  tell("all is well", last);
  last.counters.gnss_positions_rejected = 6;
  tell("positions are refused", last);
  last.counters = {};
  for (const auto source :
       {UtcSource::kNone, UtcSource::kReference, UtcSource::kGnss, UtcSource::kPcClock, UtcSource::kPulses}) {
    last.time_scale.source = source;
    tell(std::string(name_of(source)).c_str(), last);
  }
  for (const auto status :
       {NavigationStatus::kNotOffered, NavigationStatus::kInitialising, NavigationStatus::kAligning}) {
    last.navigation.status = status;
    tell("no navigation", last);
  }
  for (const auto status : {CalibrationStatus::kWaiting, CalibrationStatus::kCoarse,
                            CalibrationStatus::kConverging, CalibrationStatus::kCalibrated}) {
    last.studies[1].status = status;
    tell("an S-IMU", last);
  }
  test::expect_recorded("service/run/warnings.txt", answer.text());
}

TEST(RunWhole, HealthInNumbers) {
  const test::LcmText reader;
  Configuration configuration = test::rich_configuration();
  configuration.sha256 = "abc";
  status_t status = status_of(configuration, "1.2.3");
  status.build = "compiler";
  set_time_scale({}, status);
  count_elements(status);
  std::string text = test::lcm_text(reader, status);
  set_time_scale(test::rich_scale(test::kRichFirst), status);
  const Snapshot snapshot = test::rich_snapshot(2);
  SImuOutput none;
  status.studies = {study_status("left", none), study_status("right", snapshot.studies[1])};
  set_time_budget(*rich_record(configuration).devices[1].time_budget, status.devices[2]);
  PeriodicStatistics beat;
  beat.ticks = 11;
  beat.overruns = 12;
  beat.skipped = 13;
  for (const int us : {1, 5, 20, 100, 3000}) {
    beat.lateness.add(std::chrono::microseconds(us));
    beat.done.add(std::chrono::microseconds(2 * us));
  }
  status.threads.resize(2);
  set_beat(beat, std::chrono::microseconds(30), status.threads[0]);
  set_beat({}, Duration::zero(), status.threads[1]);
  status.rings.resize(3);
  status.alarms.resize(4);
  count_elements(status);
  text += test::lcm_text(reader, status);
  test::expect_recorded("service/run/health.txt", text);
}

TEST(RunWhole, AlarmsComeGoAndAreTold) {
  const test::LcmText reader;
  std::string text;
  AlarmBook book;
  const auto look = [&](int second, const std::vector<Condition>& holding) {
    const auto fresh = book.look(holding, test::kRichUtc + std::chrono::seconds(second),
                                 test::kRichFirst + std::chrono::seconds(second));
    text += fmt::format("second {}: {} began, {} ended\n", second, fresh.began.size(), fresh.ended.size());
    for (const auto& alarm : fresh.began) text += "began " + test::lcm_text(reader, alarm);
    for (const auto& alarm : fresh.ended) text += "ended " + test::lcm_text(reader, alarm);
    for (const auto& alarm : book.list()) text += "listed " + test::lcm_text(reader, alarm);
  };
  const Condition bus = condition_of(alarm_kind::kBus, "LCM", "no route; run ip route add; then again");
  const Condition disk = condition_of(alarm_kind::kDisk, "capture", "it is full");
  look(0, {bus});
  look(5, {bus, disk});
  look(7, {{disk.kind, disk.subject, "fuller", "make room"}});
  look(20, {bus});
  look(31, {});
  test::expect_recorded("service/run/alarms.txt", text);
}

TEST(RunWhole, OfManyAlarmsTheFirstAreKept) {
  AlarmBook book;
  std::vector<Condition> holding;
  for (std::size_t i = 0; i <= AlarmBook::kMost; ++i)
    holding.push_back({"ring", std::to_string(i), "full", ""});
  EXPECT_EQ(book.look(holding, test::kRichUtc, test::kRichFirst).began.size(), AlarmBook::kMost);
  EXPECT_EQ(book.list().size(), AlarmBook::kMost);
}

TEST(RunWhole, ACountIsAnAlarmWhileItGrowsAndTenSecondsAfter) {
  GrowingCounts counts;
  const auto at = [](double s) { return test::kRichFirst + from_seconds(s); };
  EXPECT_FALSE(counts.grows("a", 0, at(0.0)));
  EXPECT_TRUE(counts.grows("a", 1, at(1.0)));
  EXPECT_TRUE(counts.grows("a", 1, at(10.999)));
  EXPECT_FALSE(counts.grows("a", 1, at(11.0)));
  EXPECT_TRUE(counts.grows("a", 2, at(12.0)));
  EXPECT_FALSE(counts.grows("b", 0, at(12.0)));
  EXPECT_TRUE(counts.grows("c", 5, at(12.0))) << "from zero on";
}

TEST(RunWhole, WhatIsWrongWithDevicesAndQueues) {
  Answer answer;
  status_t status = status_of(test::rich_configuration(), "1");
  for (auto& device : status.devices) device.state = "streaming";
  status.devices[1].frames_dropped = 3;
  status.devices[1].samples_refused = 4;
  status.devices[2].state = "failed";
  status.devices[2].problem = "it says nothing; look at its cable";
  status.devices[3].state = "line down";
  status.capture_lost = 5;
  status.rings.resize(2);
  status.rings[0].name = "errors";
  status.rings[0].refused = 6;
  status.rings[1].name = "events";
  GrowingCounts counts;
  for (const int second : {0, 9, 10}) {
    answer.line("second", second);
    for (const auto& condition :
         conditions_of(status, counts, test::kRichFirst + std::chrono::seconds(second)))
      answer.line(condition.kind, "|", condition.subject, "|", condition.what, "|", condition.remedy);
  }
  test::expect_recorded("service/run/conditions.txt", answer.text());
}

TEST(RunWhole, EveryEventInWords) {
  const Configuration configuration = test::rich_configuration();
  Answer answer;
  const auto tell = [&](const EventPayload& what) {
    answer.line(describe(configuration, {what, 1, HostTime{}}));
  };
  for (const auto method : {InitialisationMethod::kNone, InitialisationMethod::kConfigured,
                            InitialisationMethod::kReferenceAttitude, InitialisationMethod::kGyrocompass,
                            InitialisationMethod::kInMotion})
    tell(event::NavigationStarted{method});
  tell(event::NavigationStopped{1.25});
  tell(event::ReferenceGap{0.125});
  tell(event::ReferenceGravityWrong{9.75});
  tell(event::GravityMagnitudeWrong{1.02});
  tell(event::CoarseAlignmentDone{0.02});
  tell(event::CoarseAlignmentPoor{0.55});
  tell(event::MountingChanged{12.34});
  tell(event::SImuReturned{3.21});
  tell(event::GnssRejected{123.4});
  tell(event::GnssRejected{std::numeric_limits<double>::infinity()});
  tell(event::GnssReacquired{4.56});
  tell(event::GnssInconsistent{0.25});
  tell(event::OdometryLost{0.75});
  tell(event::OdometryReturned{0.85});
  tell(event::OdometryRejected{-1.5});
  tell(event::OdometryAccepted{6.7});
  for (const std::size_t state : {0U, 8U, 15U, 20U, 27U, 40U}) tell(event::CovarianceRepaired{state});
  tell(event::BoresightPriorWrong{0.1});
  tell(event::LeverArmPriorWrong{0.4});
  tell(event::SImusSwapped{2});
  tell(event::GyroBiasChanged{0.01});
  tell(event::AccelBiasChanged{0.5});
  tell(event::SImuInconsistent{0.75});
  tell(event::NoiseTooSmall{true, 3.1, 0.01});
  tell(event::NoiseTooSmall{false, 4.2, 0.05});
  test::expect_recorded("service/run/events.txt", answer.text());
}

}  // namespace
}  // namespace imuscope
