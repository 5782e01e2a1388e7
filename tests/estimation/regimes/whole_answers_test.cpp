/// Everything that regimes say of rich drives and files: what is right about it, the tests beside this one prove.

#include <gtest/gtest.h>
#include <array>
#include <optional>
#include <string>
#include <vector>

#include "estimation/regimes/labels.h"
#include "estimation/regimes/motion_regimes.h"
#include "estimation/regimes/recent_regimes.h"
#include "stopping_drive.h"
#include "tests/support/answer.h"
#include "tests/support/recorded_answer.h"

namespace imuscope {
namespace {

using test::Answer;

constexpr double kOrigin_s = 1000.0;

double since_origin_s(HostTime time) { return to_seconds(time - HostTime{}) - kOrigin_s; }

void add_track(Answer& lines, std::string_view name, const RegimeTrack& track) {
  lines.line(name, track.names());
  for (std::size_t i = 0; i < track.names().size(); ++i)
    lines.line("total", i, track.total_s(i), track.longest_s(i));
  for (const RegimeStretch& s : track.stretches())
    lines.line(" ", since_origin_s(s.begin), since_origin_s(s.end), s.regime);
}

/// Changes of the regime as it settles while the drive goes on.
void add_settled(Answer& lines, const test::Driven& driven) {
  RecentRegimes recent({});
  std::optional<HostTime> told_until;
  std::size_t next = 0;
  std::optional<std::size_t> before = 99;
  const auto tell = [&] {
    for (; next < driven.samples.size() && driven.samples[next].time < *recent.settled_until(); next += 10) {
      const auto now = recent.at(driven.samples[next].time);
      if (now != before)
        lines.line("settled", since_origin_s(driven.samples[next].time), now ? double(*now) : -1.0);
      before = now;
    }
  };
  for (const test::DrivenSample& sample : driven.samples) {
    recent.add(sample.time, sample.omega_radps, sample.f_mps2);
    if (sample.speed_mps) recent.add_speed(sample.time, *sample.speed_mps, test::kDrivenSpeedSd_mps);
    if (recent.settled_until() == told_until) continue;
    told_until = recent.settled_until();
    lines.line("until", since_origin_s(*told_until));
    tell();
  }
  recent.settle();
  lines.line("until", since_origin_s(*recent.settled_until()));
  tell();
}

void add_cells(Answer& lines, const std::vector<MotionCell>& cells, std::size_t every) {
  for (std::size_t i = 0; i < cells.size(); i += every) {
    const MotionCell& c = cells[i];
    lines.line("cell", i, c.n, c.omega_radps, c.f_mps2, c.vibration_mps2, c.rate_rms_radps,
               c.rate_scatter_radps, c.speed_mps.value_or(-1.0), c.speed_sd_mps);
  }
}

TEST(RegimeAnswers, StoppingDrives) {
  Answer lines;
  struct StoppingWorld {
    const char* name;
    test::StoppingDrive drive;
  };
  const std::array worlds{
      StoppingWorld{"mems", {.duration_s = 300.0, .seed = 3}},
      StoppingWorld{"mems without speed", {.duration_s = 300.0, .has_speed = false, .seed = 4}},
      StoppingWorld{"noisy",
                    {.duration_s = 300.0,
                     .gyro_density_radps = 0.08 * kRadPerDeg,
                     .accel_density_mps2 = 4e-3,
                     .seed = 5}},
      StoppingWorld{"noisy without speed",
                    {.duration_s = 300.0,
                     .has_speed = false,
                     .gyro_density_radps = 0.08 * kRadPerDeg,
                     .accel_density_mps2 = 4e-3,
                     .seed = 6}},
      StoppingWorld{"quiet, short stops",
                    {.duration_s = 300.0,
                     .longest_stop_s = 1.6,
                     .engine_runs = false,
                     .gyro_density_radps = 1e-6,
                     .accel_density_mps2 = 5e-5,
                     .seed = 7}}};
  for (const StoppingWorld& world : worlds) {
    lines.line(world.name);
    const test::Driven driven = test::driven(world.drive);
    const std::vector<MotionCell> cells = driven.levels.cells();
    const CellNoise noise = cell_noise(cells);
    lines.line("noise", noise.omega_radps, noise.f_mps2);
    for (const Standstill& stop : find_standstills(cells, {}, noise))
      lines.line("stands", stop.first, stop.last);
    const RegimeTrack motion = static_and_dynamic(driven.levels, {});
    add_track(lines, "motion", motion);
    const MotionLimits others{0.3, 0.5, 0.004, 0.009, 0.05, 0.3, 0.2, 0.5, 2.5, 0.5};
    add_track(lines, "other limits", static_and_dynamic(driven.levels, others));
    for (const Intensity intensity : {Intensity::kRate, Intensity::kVibration, Intensity::kSpeed})
      add_track(lines, "intensity", intensity_bins(driven.levels, motion, intensity, 4, 7.0));
    add_settled(lines, driven);
    add_cells(lines, cells, 217);
  }
  test::expect_recorded("estimation/regimes/stopping_drives.txt", lines.text());
}

TEST(RegimeAnswers, HolesAndSpeedsThatCome) {
  Answer lines;
  MotionLevels levels;
  const auto at = [](double t) { return HostTime{} + from_seconds(kOrigin_s + t); };
  for (int k = 0; k < 9000; ++k) {
    const double t = 0.01 * k;
    const bool lost = (t >= 20.0 && t < 23.0) || (t >= 57.05 && t < 57.32) || t >= 86.0;
    const bool drives = (t > 12.0 && t < 40.0) || (t > 55.0 && t < 71.0);
    const double size = drives ? 1.0 : 0.0;
    if (!lost)
      levels.add(
          at(t), {0.02 * size * std::sin(3.0 * t), 1e-3 * std::cos(31.0 * t), size * 0.1 * std::sin(t)},
          {size * std::sin(0.7 * t), 0.02 * std::sin(50.0 * t), -9.81 + 0.3 * size * std::cos(45.0 * t)});
    if (k % 50 == 0 && t > 30.0) levels.add_speed(at(t), drives ? -6.0 : 0.01 * t, 0.02 + 1e-4 * t);
  }
  levels.add(at(89.999), {}, {0.0, 0.0, -9.81});
  add_cells(lines, levels.cells(), 23);
  const RegimeTrack motion = static_and_dynamic(levels, {});
  add_track(lines, "motion", motion);
  add_track(lines, "speed", intensity_bins(levels, motion, Intensity::kSpeed, 2, 3.0));
  levels.forget_before(at(31.05));
  lines.line("begins", since_origin_s(levels.begin_of(0)), levels.cells().size());
  add_cells(lines, levels.cells(), 41);
  levels.forget_before(at(10.0));
  lines.line("forgets no more", since_origin_s(levels.begin_of(0)), levels.cells().size());
  levels.forget_before(at(500.0));
  lines.line("forgets all", levels.cells().size());
  test::expect_recorded("estimation/regimes/holes.txt", lines.text());
}

void add_labels(Answer& lines, std::string_view text) {
  const Result<std::vector<Label>> labels = parse_labels(text, "l.csv");
  if (!labels) {
    lines.line("error", labels.error().text());
    return;
  }
  lines.line("labels");
  // UTC since 2026-03-14: of the whole number, nine digits are no second.
  for (const Label& label : *labels) {
    const double since_s = label.in_utc ? 1'773'446'400.0 : 0.0;
    lines.line(" ", label.begin_s - since_s, label.end_s - since_s, label.name, label.in_utc);
  }
}

TEST(RegimeAnswers, FilesOfLabels) {
  Answer lines;
  const std::string in_seconds = "begin_s,end_s,regime\n";
  for (const char* rows :
       {"1,2,a", "-1e9,1e9,long", "-1.0000001e9,2,a", "1,1.0000001e9,a", "1,1,a", "2,1,a", "1,2,a\n2,3,b",
        "1,2,a\n1.999,3,b", "1,2", "1", "1,2,\"a\"", "1,2,a,b", "x,2,a", "1,2x,a", "1,inf,a",
        "\n# comment\n\t1 ,\t2 , a b \r\n", "2026-03-14T09:30:00Z,2026-03-14T09:30:01Z,a"})
    add_labels(lines, in_seconds + rows);
  const std::string in_utc = "begin_utc,end_utc,regime\n";
  for (const char* begin : {"2026-03-14T09:30:00Z",
                            "2026-03-14T23:59:60.5Z",
                            "2026-03-14T23:59:61Z",
                            "2026-03-14T24:00:00Z",
                            "2026-03-14T09:60:00Z",
                            "2026-03-14T09:59:-1Z",
                            "2024-02-29T00:00:00Z",
                            "2026-02-29T00:00:00Z",
                            "2026-3-14T09:30:00Z",
                            "2026-03-1409:30:00Z",
                            "2026-03-14T09-30:00Z",
                            "2026-03-14T09:30-00Z",
                            "2026/03-14T09:30:00Z",
                            "2026-03/14T09:30:00Z",
                            "2026-03-14T09:30:00",
                            "2026-03-14T09:30:00.25Z",
                            "20x6-03-14T09:30:00Z",
                            "1773480600.5",
                            "-9e9",
                            "-9.1e9",
                            "2026",
                            ""})
    add_labels(lines, in_utc + begin + ",8999999999,road");
  add_labels(lines, in_utc + "0,9.1e9,road");
  for (const char* text :
       {"", "# only a comment\n", "begin,end,regime\n1,2,a\n", "begin_s,end_s,regime", "1,2,a\n"})
    add_labels(lines, text);
  test::expect_recorded("estimation/regimes/labels.txt", lines.text());
}

TEST(RegimeAnswers, OnlyTheFirstNamesAreKept) {
  std::vector<Label> labels{{0.0, 1.0, "a"}, {1.0, 2.0, "b"}, {2.0, 3.0, "c"},
                            {3.0, 4.0, "a"}, {4.0, 5.0, "d"}, {5.0, 6.0, "c"}};
  EXPECT_EQ(keep_first_names(labels, 2), 2U);
  ASSERT_EQ(labels.size(), 3U);
  EXPECT_EQ(labels[0].name, "a");
  EXPECT_EQ(labels[1].name, "b");
  EXPECT_EQ(labels[2].name, "a");
  EXPECT_EQ(labels[2].begin_s, 3.0);
  EXPECT_EQ(keep_first_names(labels, 2), 0U);
  EXPECT_EQ(keep_first_names(labels, 0), 2U);
  EXPECT_TRUE(labels.empty());
}

TEST(RegimeAnswers, AStretchHoldsItsBeginAndNotItsEnd) {
  const auto at = [](int s) { return host_time_from_ns(s * 1'000'000'000LL); };
  const RegimeTrack track(
      {"a", "b"},
      {{at(1), at(2), 0}, {at(2), at(2), 1}, {at(2), at(4), 0}, {at(5), at(7), 1}, {at(7), at(8), 0}});
  ASSERT_EQ(track.stretches().size(), 3U);
  EXPECT_EQ(track.at(at(1) - Duration{1}), std::nullopt);
  EXPECT_EQ(track.at(at(1)), 0U);
  EXPECT_EQ(track.at(at(4) - Duration{1}), 0U);
  EXPECT_EQ(track.at(at(4)), std::nullopt);
  EXPECT_EQ(track.at(at(5)), 1U);
  EXPECT_EQ(track.at(at(7)), 0U);
  EXPECT_EQ(track.at(at(8)), std::nullopt);
  EXPECT_EQ(track.total_s(0), 4.0);
  EXPECT_EQ(track.longest_s(0), 3.0);
  EXPECT_EQ(track.total_s(1), 2.0);
  EXPECT_EQ(track.index_of("b"), 1U);
  EXPECT_EQ(RegimeTrack().at(at(1)), std::nullopt);
}

}  // namespace
}  // namespace imuscope
