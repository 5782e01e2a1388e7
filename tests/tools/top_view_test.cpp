#include "tools/imuscope/top/view.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <cstdlib>
#include <limits>
#include <nlohmann/json.hpp>
#include <regex>

#include "example_messages.h"
#include "tools/imuscope/top/colours.h"
#include "tools/imuscope/top/terminal.h"

namespace imuscope::top {
namespace {

using testing::AllOf;
using testing::Contains;
using testing::HasSubstr;
using testing::Not;

Heard example() {
  Heard heard;
  heard.status = test::example_status();
  heard.calibrations["mtx1"] = test::example_calibration();
  heard.models["mtx1"] = test::example_noise_model();
  return heard;
}

std::string page(const Heard& heard) {
  std::string text;
  for (const auto& line : lines_of(heard)) text += line + "\n";
  return text;
}

TEST(TopView, WhatANetworkSendsMovesNoCursorAndIsStillJson) {
  Heard heard = example();
  heard.status->state = "\x1b[2Jrunning";
  heard.status->last_event = "first\n!! forged";
  heard.status->devices[0].name = "\xff\xfe";
  const auto lines = lines_of(heard);
  for (const auto& line : lines) {
    EXPECT_THAT(line, Not(HasSubstr("\x1b")));
    EXPECT_THAT(line, Not(HasSubstr("\n")));
    EXPECT_THAT(line, Not(HasSubstr("\xff")));
  }
  EXPECT_THAT(lines, Contains(HasSubstr("?[2Jrunning")));
  const auto json = nlohmann::json::parse(json_of(heard));
  EXPECT_EQ(json["last_event"], "first\n!! forged") << "JSON has escapes of its own";
}

TEST(TopView, ShowsStateDevicesCalibrationModelsRingsAndAlarms) {
  const auto text = page(example());
  for (const char* part : {"run 'demo'  degraded: mtx2 is silent",
                           "run/capture.lcm",
                           "lost 4",
                           "last event: roundabout",
                           "streaming",
                           "99.9",
                           "4.20",
                           "25",
                           "-11.5",
                           "converging",
                           "0.5730/0.0573",
                           "20.00/2",
                           "3.000/0.3",
                           "usable with limits",
                           "weakest psi_z (50 % of its prior left); still missing: brake",
                           "fifo 80",
                           "13 us",
                           "18 us",
                           "1024",
                           "!! no route (for 0:00:21, 22 times)",
                           "   run ip route add"}) {
    EXPECT_THAT(text, HasSubstr(part));
  }
}

TEST(TopView, SaysWhatAMountingIsGoodForOnTheScaleOfConsoleAndReport) {
  auto heard = example();
  auto& study = heard.status->studies[0];
  study.sd_psi_deg = 0.09;
  study.sd_r_m = 0.009;
  study.sd_t_d_ms = 0.9;
  EXPECT_THAT(page(heard), AllOf(HasSubstr("usable"), Not(HasSubstr("usable with limits"))));
  study.sd_psi_deg = 1.1;
  EXPECT_THAT(page(heard), HasSubstr("not usable"));
  study.sd_psi_deg = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT(page(heard), Not(HasSubstr("usable")));
}

TEST(TopView, OdometryShowsSpeedStateAndScaleWhereThereIsAny) {
  auto heard = example();
  EXPECT_THAT(page(heard), Not(HasSubstr("ODOMETRY")));
  heard.odometry = test::example_odometry();
  EXPECT_THAT(page(heard), HasSubstr("ODOMETRY    +12.25 m/s  at rest, zero velocity in use  scale +1.20"));
  EXPECT_THAT(page(heard), HasSubstr("speed 21/22  no slip 23/24  zero velocity 25/26"));
  heard.odometry->zero_velocity = 0;
  EXPECT_THAT(page(heard), HasSubstr("standing"));
  heard.odometry->lost = 1;
  EXPECT_THAT(page(heard), HasSubstr("lost: no speed comes"));
  EXPECT_EQ(nlohmann::json::parse(json_of(heard)).at("odometry").at("speed_rejected"), 22);
}

TEST(TopView, AVirtualImuShowsItsErrorAndWhyItSaysNothing) {
  auto heard = example();
  EXPECT_THAT(page(heard), Not(HasSubstr("VIRTUAL")));
  heard.virtual_imu = test::example_virtual_imu();
  heard.virtual_imu->rows.push_back(heard.virtual_imu->rows.front());
  heard.virtual_imu->rows.back().e_gyro_z_radps = 3e-3;
  EXPECT_THAT(page(heard), HasSubstr("VIRTUAL     of mtx1, mtx2  usable"));
  EXPECT_THAT(page(heard), HasSubstr("error 0 0 0.115 deg/s"));  // 2 mrad/s
  EXPECT_EQ(nlohmann::json::parse(json_of(heard)).at("virtual_imu").at("e_gyro_radps").at(2), 2e-3);
  heard.virtual_imu->validity = virtual_imu_t::CONVERGING;
  EXPECT_THAT(page(heard), HasSubstr("converging"));
  heard.virtual_imu_age_s = 5.0;
  EXPECT_THAT(page(heard), AllOf(HasSubstr("silent"), Not(HasSubstr("rows missing"))));
  heard.virtual_imu->rows.clear();
  EXPECT_EQ(nlohmann::json::parse(json_of(heard)).at("virtual_imu").at("e_gyro_radps").at(0), nullptr);
}

TEST(TopView, FramesThatThisPcLostAreShown) {
  auto heard = example();
  heard.status->devices[0].frames_dropped = 4711;
  EXPECT_THAT(page(heard), HasSubstr("4711"));
  EXPECT_EQ(nlohmann::json::parse(json_of(heard)).at("devices").at(0).at("frames_dropped"), 4711);
}

TEST(TopView, AlarmsThatAreOverSayHowLongTheyLasted) {
  auto heard = example();
  heard.status->alarms[0].active = 0;
  heard.status->utime = heard.status->alarms[0].since_utime + 61'000'000;
  EXPECT_THAT(page(heard), HasSubstr("over: no route (lasted 0:00:21, began 0:01:01 ago, 22 times)"));
  const auto json = nlohmann::json::parse(json_of(heard)).at("alarms").at(0);
  EXPECT_EQ(json.at("kind"), "bus");
  EXPECT_EQ(json.at("active"), false);
  EXPECT_EQ(json.at("remedy"), "run ip route add");
}

TEST(TopView, EveryRingStandsInTheJsonOnce) {
  EXPECT_EQ(nlohmann::json::parse(json_of(example())).at("rings").size(), 1U);
}

TEST(TopView, SaysWhatToDoBeforeAnythingIsHeard) {
  EXPECT_THAT(page({}), HasSubstr("no service has been heard yet"));
}

TEST(TopView, AServiceThatFellSilentIsToldToBeOld) {
  auto heard = example();
  EXPECT_THAT(page(heard), Not(HasSubstr("silent for")));
  heard.status_age_s = 12.0;
  EXPECT_THAT(page(heard), HasSubstr("!! silent for 12 s"));
}

TEST(TopView, UnknownNumbersAreDashesAndNulls) {
  auto heard = example();
  heard.status->devices[0].clock_drift_ppm = std::nan("");
  heard.status->devices[0].latency_ms = std::nan("");
  const auto json = nlohmann::json::parse(json_of(heard));
  EXPECT_TRUE(json.at("devices").at(0).at("latency_ms").is_null());
  EXPECT_DOUBLE_EQ(json.at("devices").at(1).at("latency_ms").get<double>(), 4.2);
  EXPECT_THAT(page(heard), Not(HasSubstr("nan")));
}

TEST(TopHistogram, BarsGrowWithTheLogarithmOfTheirCount) {
  EXPECT_EQ(histogram_bars({0, 1, 1000}), " \u2582\u2588");
  EXPECT_EQ(histogram_bars({}), "");
  EXPECT_EQ(histogram_bars({0, 0}), "  ");
}

TEST(TopTerminal, CutsAtCharactersNotAtBytes) {
  EXPECT_EQ(cut("\u2588\u2588\u2588", 2), "\u2588\u2588");
  EXPECT_EQ(cut("abc", 5), "abc");
  EXPECT_EQ(cut("abc", 0), "");
}

/// What a terminal shows of a coloured line.
std::string without_colours(const std::string& line) {
  return std::regex_replace(line, std::regex("\x1b\\[[0-9;]*m"), "");
}

TEST(TopColours, TheWordsStayAsTheyAreAndTheStateAloneIsColoured) {
  for (const auto& line : lines_of(example())) EXPECT_EQ(without_colours(coloured(line)), line);
  EXPECT_EQ(coloured("mtx1        study      streaming      99.9"),
            "mtx1        study      \033[32mstreaming\033[0m      99.9");
  EXPECT_EQ(coloured("mtx2  converging  running late"), "mtx2  \033[33mconverging\033[0m  running late");
  EXPECT_EQ(coloured("not-running-yet"), "not-running-yet") << "a part of a word is none";
  EXPECT_EQ(coloured("!! mtx2 is silent"), "\033[1;31m!! mtx2 is silent\033[0m");
  EXPECT_EQ(coloured("DEVICE  role"), "\033[1mDEVICE  role\033[0m");
}

TEST(TopColours, AFileAndAPersonWhoSaysSoGetNone) {
  // Standard output of a test is no terminal.
  ASSERT_EQ(setenv("TERM", "xterm", 1), 0);
  if (isatty(STDOUT_FILENO) == 0) {
    EXPECT_FALSE(colours_wanted());
  }
  ASSERT_EQ(setenv("NO_COLOR", "1", 1), 0);
  EXPECT_FALSE(colours_wanted());
  unsetenv("NO_COLOR");
}

}  // namespace
}  // namespace imuscope::top
