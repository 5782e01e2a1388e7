// Means over tenths of a second, the motion that positions tell, and where checks of positions and of pairs begin to
// find something.
#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include "base/limits.h"
#include "base/units.h"
#include "by_ranges.h"
#include "check/bins.h"
#include "check/check.h"
#include "check/config_lines.h"
#include "check/signed_axes.h"
#include "tests/support/recorded_answer.h"

namespace imuscope::check {
namespace {

std::string of(const Eigen::VectorXd& v) {
  std::string text;
  for (const double x : v) text += fmt::format(" {:.7g}", std::abs(x) < 1e-12 ? 0.0 : x);
  return text;
}

Sample sample_of(std::size_t device, SampleKind kind, double time_s) {
  Sample sample{};
  sample.kind = kind;
  sample.device = static_cast<DeviceIndex>(device);
  sample.time = HostTime{} + from_seconds(time_s);
  return sample;
}

Sample imu_sample_at(double time_s, std::uint32_t flags = kGyroValid | kAccelValid) {
  Sample sample = sample_of(kReference, SampleKind::kImu, time_s);
  sample.imu.omega_radps = {0.1, 0.2, 0.3};
  sample.imu.f_mps2 = {1.0, 2.0, 3.0};
  sample.imu.counter = 7;
  sample.imu.flags = flags;
  return sample;
}

TEST(Tracks, TakeWhatIsWholeAndFinite) {
  const test::DriveInMemory made = made_drive({.length_s = 0.0});
  Drive drive(made.configuration);
  EXPECT_FALSE(drive.has_origin());
  const std::uint32_t valid = kGyroValid | kAccelValid;
  drive.add(imu_sample_at(50.0, kGyroValid));
  EXPECT_TRUE(drive.has_origin());
  drive.add(imu_sample_at(50.0, kAccelValid));
  drive.add(imu_sample_at(50.5));
  for (std::size_t axis = 0; axis < 3; ++axis) {
    for (Vector3 ImuData::*triad : {&ImuData::omega_radps, &ImuData::f_mps2}) {
      Sample sample = imu_sample_at(51.0);
      (sample.imu.*triad)[axis] = std::nan("");
      drive.add(sample);
    }
  }
  for (const std::uint32_t clip :
       {kGyroClipX, kGyroClipY, kGyroClipZ, kAccelClipX, kAccelClipY, kAccelClipZ, kGapBefore})
    drive.add(imu_sample_at(52.0, valid | clip));
  drive.add(sample_of(kReference, SampleKind::kOdometry, 53.0));
  const ImuTrack& track = drive.imu(kReference);
  ASSERT_EQ(track.size(), 8U);
  EXPECT_EQ(track.clipped, 6U);
  EXPECT_DOUBLE_EQ(track.time_s[0], 0.5);
  EXPECT_DOUBLE_EQ(track.time_s[1], 2.0);
  EXPECT_EQ(track.omega_radps[0], Eigen::Vector3f(0.1F, 0.2F, 0.3F));
  EXPECT_EQ(track.f_mps2[7], Eigen::Vector3f(1.0F, 2.0F, 3.0F));
  EXPECT_EQ(track.counter[3], 7);
  EXPECT_EQ(drive.gnss(kGnss).size(), 0U);
}

TEST(Tracks, APositionIsMetresOfTheFirstWithTheLargerSd) {
  test::DriveInMemory made = made_drive({.length_s = 0.0});
  made.configuration.devices[kGnss].gnss.position_sd_m = {0.4, 0.3, 9.0};
  made.configuration.devices[kGnss].gnss.position_sd_floor_m = 0.25;
  Drive drive(made.configuration);
  const GeodeticPosition home{0.8, 0.1, 300.0};
  const auto add = [&](double north_m, double east_m, std::uint32_t flags, const Vector3& sd_m) {
    Sample sample = sample_of(kGnss, SampleKind::kGnss, 10.0);
    const GeodeticPosition position = displaced(home, {north_m, east_m, 0.0});
    sample.gnss.latitude_rad = position.latitude_rad;
    sample.gnss.longitude_rad = position.longitude_rad;
    sample.gnss.height_m = position.height_m;
    sample.gnss.flags = flags;
    sample.gnss.sd_position_m = sd_m;
    drive.add(sample);
  };
  add(5.0, 5.0, kVelocityValid, {});
  add(0.0, 0.0, kPositionValid, {});
  add(30.0, -40.0, kPositionValid | kHasPositionSd, {0.5, 0.6, 7.0});
  add(1.0, 2.0, kPositionValid | kHasPositionSd, {0.7, 0.6, 7.0});
  add(1.0, 2.0, kPositionValid | kHasPositionSd, {0.1, 0.2, 7.0});
  Sample nowhere = sample_of(kGnss, SampleKind::kGnss, 10.0);
  nowhere.gnss.latitude_rad = 2.0;
  nowhere.gnss.flags = kPositionValid;
  drive.add(nowhere);
  const GnssTrack& track = drive.gnss(kGnss);
  ASSERT_EQ(track.size(), 4U);
  EXPECT_NEAR(track.position_m[1].x(), 30.0, 1e-6);
  EXPECT_NEAR(track.position_m[1].y(), -40.0, 1e-6);
  EXPECT_NEAR(track.first.latitude_rad, 0.8, 1e-12);
  EXPECT_EQ(track.claimed_sd_m, (std::vector<double>{0.4, 0.6, 0.7, 0.25}));
}

TEST(Tracks, NoMoreIsLookedAtThanIsAskedFor) {
  const test::DriveInMemory made = made_drive({.length_s = 0.0});
  EXPECT_EQ(kLongest_s, 3600.0);
  for (const auto& [asked_s, taken_s] : {std::pair(5.0, 5.0), {4000.0, 3600.0}}) {
    Drive drive(made.configuration, asked_s);
    drive.add(sample_of(kStudy, SampleKind::kImu, 1.0));
    drive.add(imu_sample_at(100.0));
    drive.add(imu_sample_at(100.0 + taken_s));
    EXPECT_FALSE(drive.is_full(kReference));
    drive.add(imu_sample_at(100.001 + taken_s));
    EXPECT_TRUE(drive.is_full(kReference));
    drive.add(imu_sample_at(100.5));
    EXPECT_EQ(drive.imu(kReference).size(), 2U);
    EXPECT_FALSE(drive.is_full(kStudy));
  }
  Drive drive(made.configuration, 0.01);
  const auto most = static_cast<std::size_t>(0.01 * kMaxRate_hz);
  for (std::size_t i = 0; i <= most; ++i) drive.add(imu_sample_at(100.0));
  EXPECT_EQ(drive.imu(kReference).size(), most);
  EXPECT_TRUE(drive.is_full(kReference));
}

ImuTrack numbered_track(const std::vector<double>& times_s) {
  ImuTrack track;
  for (const double time_s : times_s) {
    const auto n = static_cast<float>(track.size());
    track.time_s.push_back(time_s);
    track.omega_radps.emplace_back(n, 2.0F * n, n * n);
    track.f_mps2.emplace_back(-n, 1.0F, 0.5F * n * n);
    track.counter.push_back(0);
  }
  return track;
}

TEST(Bins, AreMeansOverTenthsOfASecondAndThenOverSoManyOfThem) {
  const ImuTrack track = numbered_track(
      {-0.31, -0.29, -0.21, -0.15, 0.05, 0.11, 0.12, 0.19, 0.25, 0.33, 0.45, 0.51, 0.02, -0.5, 0.65, 0.79});
  std::string text;
  for (const int width : {1, 3, 5}) {
    const ImuBins bins = bins_of(track, width);
    text += fmt::format("width {}, first {}\n", width, bins.first);
    for (std::size_t i = 0; i < bins.valid.size(); ++i)
      text += fmt::format("  {}{} |{}\n", static_cast<int>(bins.valid[i]), of(bins.omega_radps[i]),
                          of(bins.f_mps2[i]));
    for (std::int64_t bin = bins.first - 1; bin < 10; ++bin)
      text += bins.has(bin) ? fmt::format(" {}:{}", bin, bins.index(bin)) : " -";
    text += '\n';
  }
  const ImuBins one = bins_of(numbered_track({3.0}), 1);
  text += fmt::format("one: {} {} {}\n", one.first, one.valid.size(), static_cast<int>(one.valid[0]));
  const ImuBins none = bins_of({}, 3);
  text += fmt::format("none: {} {}\n", none.first, none.valid.size());
  const ImuBins backwards = bins_of(numbered_track({3.0, 2.0}), 1);
  text += fmt::format("backwards: {} {}\n", backwards.first, backwards.valid.size());
  const ImuBins longest = bins_of(numbered_track({5.0, 1e9}), 1);
  text += fmt::format("longest: {} {}\n", longest.first, longest.valid.size());
  test::expect_recorded("check/bins.txt", text);
}

TEST(Bins, TheUsualRateIsTheMedianOfEachAxisWhereItIsMoreThanMotion) {
  ImuTrack track;
  for (const float w : {0.3F, 0.1F, 0.2F, 9.0F}) {
    track.time_s.push_back(0.0);
    track.omega_radps.emplace_back(w, -w, 2.0F * w);
  }
  EXPECT_TRUE(usual_rate(track).isApprox(Eigen::Vector3f(0.3F, -0.2F, 0.6F)));
  for (const auto& [size, is_offset] : {std::pair(0.0174F, false), {0.0176F, true}, {0.034F, true}}) {
    for (Eigen::Vector3f& omega : track.omega_radps) omega = {0.0F, -size, 0.0F};
    EXPECT_EQ(plain_offset(track), Eigen::Vector3f(0.0F, is_offset ? -size : 0.0F, 0.0F)) << size;
  }
}

GnssTrack circle(double period_s, std::size_t n, double speed_mps) {
  GnssTrack track;
  constexpr double kRadius_m = 40.0;
  for (std::size_t i = 0; i < n; ++i) {
    const double time_s = 2.0 + period_s * static_cast<double>(i);
    const double angle = speed_mps / kRadius_m * time_s + 0.004 * time_s * time_s;
    track.time_s.push_back(time_s);
    track.position_m.emplace_back(kRadius_m * std::cos(angle), kRadius_m * std::sin(angle));
    track.claimed_sd_m.push_back(0.02);
  }
  return track;
}

TEST(Bins, PositionsTellSpeedAndTheAccelerationAlongAndAcrossTheCourse) {
  std::string text;
  const auto tell = [&](const std::string& title, const GnssTrack& track) {
    const GnssMotion motion = motion_of(track);
    text += fmt::format("{}: first {}, half a window {:.6g} s, {} bins\n", title, motion.first,
                        motion.half_window_s, motion.valid.size());
    for (std::size_t k = 0; k < motion.valid.size(); k += 3)
      text += fmt::format("  {} {:.7g} {:.7g} {:.7g}\n", static_cast<int>(motion.valid[k]),
                          motion.speed_mps[k], motion.forward_mps2[k], motion.right_mps2[k]);
  };
  tell("5 Hz", circle(0.2, 40, 8.0));
  tell("1 Hz", circle(1.0, 9, 5.0));
  tell("slow", circle(0.2, 40, 1.5));
  tell("three", circle(0.2, 3, 8.0));
  tell("four", circle(0.5, 4, 8.0));
  GnssTrack hole = circle(0.2, 60, 8.0);
  for (std::vector<double>* values : {&hole.time_s, &hole.claimed_sd_m})
    values->erase(values->begin() + 20, values->begin() + 34);
  hole.position_m.erase(hole.position_m.begin() + 20, hole.position_m.begin() + 34);
  tell("with a hole", hole);
  test::expect_recorded("check/motion_of_positions.txt", text, 1e-6, 1e-9);
}

std::string positions_of(Empty& empty) {
  std::vector<Finding> findings;
  check_positions(empty.drive(), kGnss, findings);
  return words_of(findings);
}

double wiggle(std::size_t i, double frequency) {
  return std::sin(frequency * static_cast<double>(i) * static_cast<double>(i));
}

/// Errors that nobody foresees, at the speed that is asked for.
void drive_on(Empty& empty, std::size_t n, double period_s, double speed_mps, double error_m,
              double sd_m = 0.02) {
  for (std::size_t i = 0; i < n; ++i)
    empty.add_gnss(period_s * static_cast<double>(i),
                   speed_mps * period_s * static_cast<double>(i) + error_m * wiggle(i, 0.7),
                   error_m * wiggle(i, 1.1), sd_m);
}

TEST(LimitsOfPositions, AreWhereTheyWere) {
  std::string text;
  text += by_ranges("scatter at rest, m", ratios(0.01, 3.0, 400), [](double error_m) {
    Empty empty;
    drive_on(empty, 60, 0.1, 0.0, error_m);
    return positions_of(empty);
  });
  text += by_ranges("scatter in motion, m", ratios(0.01, 30.0, 400), [](double error_m) {
    Empty empty;
    drive_on(empty, 60, 0.1, 12.0, error_m);
    return positions_of(empty);
  });
  text += by_ranges("speed of a claim that is too small, m/s", ratios(0.01, 20.0, 400), [](double speed_mps) {
    Empty empty;
    drive_on(empty, 60, 0.1, speed_mps, 0.3);
    return positions_of(empty);
  });
  text += by_ranges("size of one jump, m", ratios(0.02, 10.0, 400), [](double jump_m) {
    Empty empty;
    drive_on(empty, 60, 0.1, 12.0, 0.01);
    empty.gnss().position_m[30].y() += jump_m;
    return positions_of(empty);
  });
  text += by_ranges("time before a jump of 10 m, s", ratios(0.05, 2.0, 400), [](double gap_s) {
    Empty empty;
    drive_on(empty, 60, 0.1, 0.5, 0.01);
    for (std::size_t i = 30; i < 60; ++i) {
      empty.gnss().time_s[i] += gap_s - 0.1;
      empty.gnss().position_m[i].y() += 10.0;
    }
    return positions_of(empty);
  });
  text += by_ranges("jumps among 100 positions", steps(0, 25, 25), [](double n) {
    Empty empty;
    drive_on(empty, 100, 0.1, 12.0, 0.01);
    for (std::size_t i = 0; i < static_cast<std::size_t>(n); ++i)
      empty.gnss().position_m[4 * i + 3].y() += 30.0;
    return positions_of(empty);
  });
  text += by_ranges("decimal step, m", ratios(1e-4, 3.0, 400), [](double step_m) {
    Empty empty;
    drive_on(empty, 60, 0.1, 6.0, 0.3);
    for (Eigen::Vector2d& position : empty.gnss().position_m)
      position = step_m * (position / step_m).array().round();
    return positions_of(empty);
  });
  text += by_ranges("share of steps between digits, of 100", steps(0, 30, 30), [](double n) {
    Empty empty;
    for (std::size_t i = 0; i <= 100; ++i)
      empty.add_gnss(0.1 * static_cast<double>(i), static_cast<double>(i % 2), 0.0);
    for (std::size_t i = 0; i < static_cast<std::size_t>(n); ++i)
      empty.gnss().position_m[100 - i].x() += 10.5 * static_cast<double>(n - static_cast<double>(i));
    return positions_of(empty);
  });
  text += by_ranges("stretch of a step, of its length", ratios(1e-4, 0.1, 300), [](double share) {
    Empty empty;
    for (std::size_t i = 0; i <= 100; ++i)
      empty.add_gnss(0.1 * static_cast<double>(i), i % 4 < 2 ? 0.0 : 2.0 + (i % 8 < 4 ? 2.0 * share : 0.0),
                     0.0);
    return positions_of(empty);
  });
  text += by_ranges("time without a new position, s", steps(0.5, 6.0, 110), [](double held_s) {
    Empty empty;
    drive_on(empty, 120, 0.1, 12.0, 0.01);
    for (std::size_t i = 31; i < 120 && empty.gnss().time_s[i] <= empty.gnss().time_s[30] + held_s; ++i)
      empty.gnss().position_m[i] = empty.gnss().position_m[30];
    return positions_of(empty);
  });
  text += by_ranges("distance after four seconds without, m", ratios(0.5, 20.0, 200), [](double jump_m) {
    Empty empty;
    for (std::size_t i = 0; i < 80; ++i)
      empty.add_gnss(0.1 * static_cast<double>(i),
                     i < 20   ? 0.1 * wiggle(i, 0.3)
                     : i < 60 ? 0.5
                              : 0.5 + jump_m,
                     0.1 * wiggle(i < 20   ? i
                                  : i < 60 ? 20
                                           : i,
                                  0.5));
    return positions_of(empty);
  });
  text += by_ranges("rows of one position within four seconds", steps(1, 7, 6), [](double rows) {
    constexpr double kHeld_s = 4.0;
    Empty empty;
    drive_on(empty, 60, 0.1, 12.0, 0.01);
    const auto end = 30 + static_cast<std::size_t>(rows);
    for (std::size_t i = 31; i < 60; ++i) {
      empty.gnss().time_s[i] += kHeld_s;
      if (i < end) empty.gnss().position_m[i] = empty.gnss().position_m[30];
      if (i < end) empty.gnss().time_s[i] = empty.gnss().time_s[30] + 0.1 * static_cast<double>(i - 30);
    }
    return positions_of(empty);
  });
  text += by_ranges("positions", steps(15, 30, 15), [](double n) {
    Empty empty;
    drive_on(empty, static_cast<std::size_t>(n), 0.1, 0.0, 2.0);
    return positions_of(empty);
  });
  test::expect_recorded("check/limits_of_positions.txt", text);
}

TEST(LimitsOfPositions, NumbersAreThoseOfTheTrack) {
  std::string text;
  const auto tell = [&](const std::string& title, Empty& empty) {
    std::vector<Finding> findings;
    check_positions(empty.drive(), kGnss, findings);
    text += title + '\n' + findings_text(findings);
  };
  for (const double error_m : {0.5, 5.0}) {
    Empty empty;
    drive_on(empty, 100, 0.2, 0.0, error_m, 0.03);
    tell(fmt::format("at rest with {} m", error_m), empty);
    Empty moving;
    drive_on(moving, 100, 0.2, 9.0, error_m, 0.03);
    tell(fmt::format("in motion with {} m", error_m), moving);
  }
  Empty uneven;
  double time_s = 0.0;
  for (std::size_t i = 0; i < 60; ++i) {
    uneven.add_gnss(time_s, 10.0 * time_s + (i == 40 ? 7.0 : 0.0), 0.003 * static_cast<double>(i));
    time_s += i % 3 == 0 ? 0.15 : 0.1;
  }
  tell("a jump among uneven steps", uneven);
  test::expect_recorded("check/positions.txt", text);
}

TEST(LimitsOfTime, OfTwoFilesOfOneClockAreWhereTheyWere) {
  const auto answer = [](double apart_s, std::size_t device, bool text_file = true, bool with_shift = false) {
    Empty empty;
    if (!text_file)
      empty.configuration().devices[device].protocol = device == kGnss ? Protocol::kUbx : Protocol::kXsensMt;
    empty.configuration().devices[device].csv.time_offset_s = 2.5;
    empty.fill(kReference, 101, 1.0, 20000.0);
    empty.fill(device, 51, 1.0, 20000.0 + apart_s);
    std::vector<Finding> findings;
    const bool there = check_overlap(empty.drive(), device, findings);
    const double first_s = device == kGnss ? empty.gnss().time_s[0] : empty.imu(device).time_s[0];
    return with_shift ? fmt::format("{} {:.6g}\n{}", there, first_s, findings_text(findings))
                      : fmt::format("{} {}", there, findings.size());
  };
  std::string text;
  for (const std::size_t device : {kStudy, kGnss}) {
    text += by_ranges(fmt::format("device {} so much later, s", device), steps(-120.0, 180.0, 600),
                      [&](double apart_s) { return answer(apart_s, device); });
    for (const double apart_s : {3600.0, -5400.0, 1790.0, 50400.0, 51300.0, -50400.0, 250.0})
      text += fmt::format("{} {}: {}", device, apart_s, answer(apart_s, device, true, true));
    text += answer(3600.0, device, false, true);
  }
  text += by_ranges("off the hour, s", steps(3400.0, 3800.0, 400),
                    [&](double apart_s) { return answer(apart_s, kStudy); });
  Empty empty;
  empty.fill(kReference, 30, 1.0);
  std::vector<Finding> findings;
  EXPECT_TRUE(check_overlap(empty.drive(), kReference, findings));
  empty.fill(kStudy, 1, 1.0, 5000.0);
  EXPECT_TRUE(check_overlap(empty.drive(), kStudy, findings)) << "one sample has no length";
  empty.fill(kStudy, 20, 1.0, 5001.0);
  empty.drive().set_time_scale(kStudy, TimeScale::kOwn);
  EXPECT_TRUE(check_overlap(empty.drive(), kStudy, findings)) << "of a clock of its own";
  EXPECT_TRUE(findings.empty());
  empty.drive().set_time_scale(kStudy, TimeScale::kShared);
  EXPECT_FALSE(check_overlap(empty.drive(), kStudy, findings));
  test::expect_recorded("check/limits_of_overlap.txt", text);
}

TEST(LimitsOfTime, HalfOfTheShorterFileIsEnoughWhicheverThatIs) {
  for (const auto& [longer, shorter] : {std::pair{kReference, kStudy}, std::pair{kStudy, kReference}}) {
    Empty empty;
    empty.fill(longer, 601, 1.0, 20000.0);
    empty.fill(shorter, 11, 1.0, 20595.0);
    std::vector<Finding> findings;
    EXPECT_TRUE(check_overlap(empty.drive(), kStudy, findings));
    EXPECT_TRUE(findings.empty());
  }
}

TEST(LimitsOfOffsets, AGyroIsOffWhereItStaysFarFromZero) {
  const auto answer = [](double offset_degps, std::size_t away = 0) {
    Empty empty;
    empty.fill(kReference, 100, 100.0);
    for (std::size_t i = 0; i < 100; ++i)
      empty.imu().omega_radps[i] =
          Eigen::Vector3f(0.0F, 0.0F, -static_cast<float>(offset_degps * kRadPerDeg)) *
          (i < away ? 1.6F : 1.0F);
    std::vector<Finding> findings;
    check_gyro_offset(empty.drive(), kReference, findings);
    return findings.empty() ? "-"
                            : fmt::format("{} {:.6g}", findings[0].what, findings[0].value / offset_degps);
  };
  test::expect_recorded("check/limits_of_offsets.txt",
                        by_ranges("offset, deg/s", ratios(1.0, 100.0, 500), [&](double offset) {
                          return answer(offset);
                        }) + by_ranges("samples of 100 that are away", steps(0, 49, 49), [&](double n) {
                          return answer(15.0, static_cast<std::size_t>(n));
                        }));
}

using Change = std::function<void(test::DriveInMemory&, double)>;

/// Of a healthy drive with one thing that grows.
std::string grown(const std::string& title, const test::DriveInMemory& healthy,
                  const std::vector<double>& values, const Change& change) {
  return by_ranges(title, values, [&](double value) {
    test::DriveInMemory drive = healthy;
    change(drive, value);
    return words_of(look_at(drive));
  });
}

test::DriveInMemory without_receiver(test::DriveInMemory drive) {
  drive.samples[kGnss].clear();
  return drive;
}

void scale(std::vector<Sample>& samples, double gyro, double accel) {
  for (Sample& sample : samples) {
    for (double& w : sample.imu.omega_radps) w *= gyro;
    for (double& f : sample.imu.f_mps2) f *= accel;
  }
}

void shift(std::vector<Sample>& samples, double shift_s, double stretch = 1.0) {
  for (Sample& sample : samples)
    sample.time =
        HostTime{} + from_seconds(100.0 + stretch * (to_seconds(sample.time - HostTime{}) - 100.0) + shift_s);
}

void mix_in_the_reference(test::DriveInMemory& drive, double share) {
  auto& study = drive.samples[kStudy];
  for (std::size_t i = 0; i < study.size(); ++i) {
    if (static_cast<double>(i * 7 % study.size()) >= share * static_cast<double>(study.size())) continue;
    const ImuData& same = drive.samples[kReference][i].imu;
    study[i].imu.omega_radps = {same.omega_radps[1], -same.omega_radps[2], same.omega_radps[0]};
    study[i].imu.f_mps2 = {-same.f_mps2[2], same.f_mps2[0], same.f_mps2[1]};
  }
}

void turn_half_way(test::DriveInMemory& drive, double turn_deg) {
  auto& study = drive.samples[kStudy];
  const Eigen::AngleAxisd turn(turn_deg * kRadPerDeg, Eigen::Vector3d::UnitX());
  for (std::size_t i = study.size() / 2; i < study.size(); ++i) {
    for (Vector3* v : {&study[i].imu.omega_radps, &study[i].imu.f_mps2})
      Eigen::Map<Eigen::Vector3d>(v->data()) = turn * Eigen::Vector3d(v->data());
  }
}

void scatter(test::DriveInMemory& drive, double error_m) {
  constexpr double kEarth_m = 6.4e6;
  for (std::size_t i = 0; i < drive.samples[kGnss].size(); ++i) {
    GnssData& gnss = drive.samples[kGnss][i].gnss;
    gnss.latitude_rad += error_m / kEarth_m * wiggle(i, 0.7);
    gnss.longitude_rad += 1.4 * error_m / kEarth_m * wiggle(i, 1.3);
    gnss.sd_position_m = {error_m, error_m, error_m};
  }
}

constexpr MadeDrive kBrief{.length_s = 50.0, .reference_hz = 20.0, .study_hz = 25.0};

TEST(LimitsOfMotion, OfUnitsAreWhereTheyWere) {
  const test::DriveInMemory healthy = made_drive({.length_s = 50.0, .reference_hz = 100.0, .study_hz = 20.0});
  const test::DriveInMemory two = without_receiver(healthy);
  test::expect_recorded("check/limits_of_units.txt",
                        grown("rates of the reference, of their size", healthy, ratios(4e-3, 150.0, 90),
                              [](auto& drive, double size) { scale(drive.samples[kReference], size, 1.0); }) +
                            grown("rates of the S-IMU, of their size", two, ratios(4e-3, 150.0, 80),
                                  [](auto& drive, double size) { scale(drive.samples[kStudy], size, 1.0); }) +
                            grown("thousandths of a degree, of their size", two, ratios(0.4, 2.0, 20),
                                  [](auto& drive, double size) {
                                    scale(drive.samples[kStudy], 1e3 * kDegPerRad * size, 1.0);
                                  }));
}

TEST(LimitsOfMotion, OfTimesAreWhereTheyWere) {
  const test::DriveInMemory healthy = made_drive(kBrief);
  test::DriveInMemory common = without_receiver(healthy);
  common.has_own_clock[kStudy] = false;
  const test::DriveInMemory lengthy =
      without_receiver(made_drive({.length_s = 200.0, .reference_hz = 25.0, .study_hz = 20.0}));
  const Change later = [](auto& drive, double late_s) { shift(drive.samples[kGnss], late_s); };
  test::expect_recorded(
      "check/limits_of_times.txt",
      grown("positions later, s", healthy, steps(-1.55, 1.55, 31), later) +
          grown("positions later by about 18, s", healthy, steps(17.05, 19.05, 20), later) +
          grown("S-IMU of the same clock later, s", common, steps(-2.0, 2.0, 80),
                [](auto& drive, double late_s) { shift(drive.samples[kStudy], late_s - 3.3); }) +
          grown("rate of the S-IMU's clock, ppm", lengthy, steps(-800.0, 800.0, 32),
                [](auto& drive, double ppm) { shift(drive.samples[kStudy], 0.0, 1.0 + 1e-6 * ppm); }));
}

TEST(LimitsOfMotion, OfTheDriveAreWhereTheyWere) {
  const auto seen = [](const MadeDrive& how) { return words_of(look_at(made_drive(how))); };
  test::expect_recorded(
      "check/limits_of_drives.txt",
      by_ranges("turns and tilts, of the usual ones", ratios(0.01, 1.0, 40), [&](double share) {
        return seen(
            {.length_s = 50.0, .reference_hz = 20.0, .study_hz = 25.0, .turns = share, .tilts = share});
      }) + by_ranges("time at rest, s", steps(0.0, 24.0, 48), [&](double rest_s) {
        return seen({.length_s = 60.0, .reference_hz = 20.0, .study_hz = 25.0, .rest_s = rest_s});
      }) + by_ranges("length, s", steps(15.0, 60.0, 45), [&](double length_s) {
        return seen({.length_s = length_s, .reference_hz = 20.0, .study_hz = 25.0});
      }));
}

TEST(LimitsOfMotion, OfPairsAreWhereTheyWere) {
  const test::DriveInMemory two = without_receiver(made_drive(kBrief));
  const test::DriveInMemory alike =
      without_receiver(made_drive({.length_s = 30.0, .reference_hz = 20.0, .study_hz = 20.0}));
  const Change offset = [](auto& drive, double offset_mps2) {
    for (Sample& sample : drive.samples[kStudy]) sample.imu.f_mps2[1] += offset_mps2;
  };
  const Change noise = [](auto& drive, double sd_radps) {
    for (std::size_t i = 0; i < drive.samples[kStudy].size(); ++i) {
      for (std::size_t k = 0; k < 3; ++k)
        drive.samples[kStudy][i].imu.omega_radps[k] +=
            sd_radps * wiggle(i, 0.7 + 0.2 * static_cast<double>(k));
    }
  };
  test::expect_recorded(
      "check/limits_of_pairs.txt",
      grown("offset of the S-IMU's y forces, m/s2", two, steps(-9.0, 9.0, 180), offset) +
          grown("share of the S-IMU's samples that are the reference's", alike, steps(0.8, 1.0, 40),
                mix_in_the_reference) +
          grown("noise of the S-IMU's rates, rad/s", two, ratios(0.01, 1.0, 60), noise) +
          grown("turn of the S-IMU half-way, deg", two, steps(0.0, 12.0, 60), turn_half_way) +
          grown("scatter of the positions, m", made_drive(kBrief), ratios(0.01, 5.0, 40), scatter));
}

}  // namespace
}  // namespace imuscope::check
