#include "study/dependence_study.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "models/noise/model.h"

namespace imuscope {
namespace {

using ::testing::AllOf;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;

constexpr double kRate_hz = 20.0;
constexpr double kLength_s = 1000.0;
constexpr double kBlow_s = 904.0;
constexpr double kSlope = 0.05;  // of the logarithm of the variance, per degC

HostTime at(double t_s) { return HostTime{} + from_seconds(t_s); }

Configuration one_imu() {
  Configuration configuration;
  DeviceConfig study;
  study.name = "mtx1";
  study.role = DeviceRole::kStudy;
  study.rate_hz = kRate_hz;
  configuration.devices = {study};
  return configuration;
}

double temperature_at(double t_s, double warming_degC) { return 25.0 + warming_degC * t_s / kLength_s; }

/// White noise whose variance follows the temperature, a part of it multiplied: `blow`.
DependenceStudy study_of(double warming_degC, bool tells_temperature, double blow = 1.0) {
  std::mt19937 random(8);
  std::normal_distribution<double> normal;
  NoiseSeries series;
  TemperatureTrack temperature;
  MotionLevels levels;
  for (int k = 0; k < static_cast<int>(kLength_s * kRate_hz); ++k) {
    const double t_s = k / kRate_hz;
    const double degC = temperature_at(t_s, warming_degC);
    const bool is_blow = t_s >= kBlow_s && t_s < kBlow_s + 2.0;
    const double sd = (is_blow ? blow : 1.0) * std::exp(0.5 * kSlope * (degC - 25.0));
    ErrorRow row{};
    row.counter = k;
    row.time = at(t_s);
    row.gyro_valid = row.accel_valid = true;
    for (std::size_t i = 0; i < 3; ++i) {
      row.e_gyro_radps[i] = sd * normal(random);
      row.e_accel_mps2[i] = normal(random);
    }
    series.add(row, 1U);
    levels.add(row.time, {0.1 * normal(random), 0.0, 0.0}, {0.0, 0.0, -9.8 + 0.1 * normal(random)});
    // The device sends it once in two seconds.
    if (tells_temperature && k % 40 == 0) temperature.add(row.time, degC);
  }
  const std::vector<std::string> names{"static", "dynamic"};
  const RegimeTrack motion(names, {{at(0.0), at(kLength_s), 1}});
  const auto models = study_noise(one_imu(), {series}, names, noise::parse_model("WN").value(), {});
  return study_dependence(one_imu(), {series}, {temperature}, levels, motion, models, at(0.0));
}

TEST(DependenceStudy, WhatFollowsTheTemperatureIsFoundOnTheAxesThatDoAlone) {
  const auto study = study_of(30.0, true);
  EXPECT_THAT(study.remarks, Not(Contains(HasSubstr("temperature"))));
  int of_temperature = 0;
  for (const auto& entry : study.document.at("dependences")) {
    if (entry.at("driver") != "temperature") continue;
    ++of_temperature;
    EXPECT_EQ(entry.at("driver_unit"), "degC");
    EXPECT_NEAR(entry.at("mean_driver").get<double>(), 40.0, 0.5);
    const bool follows = entry.at("axis").get<std::string>().starts_with("gyro");
    const double truth = follows ? kSlope : 0.0;
    EXPECT_NEAR(entry.at("slope").get<double>(), truth, 4.0 * entry.at("slope_sd").get<double>());
    EXPECT_EQ(entry.at("p_holm").get<double>() < 1e-3, follows) << entry.at("axis");
    const auto& beside = entry.at("beside_others");
    ASSERT_TRUE(beside.is_object()) << "rate, vibration and temperature are known throughout";
    EXPECT_NEAR(beside.at("slope").get<double>(), truth, 4.0 * beside.at("slope_sd").get<double>());
    EXPECT_EQ(beside.at("p_holm").get<double>() < 1e-3, follows) << entry.at("axis");
  }
  EXPECT_EQ(of_temperature, 6);
}

TEST(DependenceStudy, ABlowOfTwoSecondsMakesNoDependenceAndIsToldOnce) {
  const auto study = study_of(0.0, false, 30.0);
  ASSERT_FALSE(study.document.at("dependences").empty());
  for (const auto& entry : study.document.at("dependences")) {
    const bool hit = entry.at("axis").get<std::string>().starts_with("gyro");
    EXPECT_EQ(entry.at("n_windows_far"), hit ? 1 : 0) << entry;
    EXPECT_GT(entry.at("p_holm").get<double>(), 0.05) << entry;
  }
  EXPECT_THAT(study.remarks,
              Contains(AllOf(HasSubstr("count less than half: 1 of"), HasSubstr("mtx1 gyro"))));
  EXPECT_THAT(study_of(0.0, false).remarks, Not(Contains(HasSubstr("count less than half"))));
}

TEST(DependenceStudy, ARecordWithoutTemperatureSaysSoOnceForTheSensor) {
  const auto study = study_of(30.0, false);
  EXPECT_THAT(study.remarks,
              Contains("mtx1: no temperature in this record: noise parameters are not held against it"));
  EXPECT_EQ(std::count_if(study.remarks.begin(), study.remarks.end(),
                          [](const std::string& r) { return r.find("temperature") != std::string::npos; }),
            1);
  for (const auto& entry : study.document.at("dependences")) EXPECT_NE(entry.at("driver"), "temperature");
  for (const auto& point : study.document.at("points"))
    EXPECT_TRUE(point.at("driver").at("temperature").is_null());
}

TEST(DependenceStudy, ASensorThatNeverSentAnythingIsPassedOver) {
  Configuration configuration = one_imu();
  configuration.devices.push_back(configuration.devices.front());
  configuration.devices.back().name = "mtx2";
  const std::vector<std::string> names{"static", "dynamic"};
  const RegimeTrack motion(names, {{at(0.0), at(kLength_s), 1}});
  MotionLevels levels;
  for (int k = 0; k < static_cast<int>(kLength_s * kRate_hz); ++k)
    levels.add(at(k / kRate_hz), {0.1 * std::sin(0.1 * k), 0.0, 0.0}, {0.0, 0.0, -9.8});
  const auto study = study_dependence(configuration, {{}, {}}, {{}, {}}, levels, motion, {}, at(0.0));
  EXPECT_THAT(study.remarks, ::testing::IsEmpty());
  EXPECT_TRUE(study.document.at("points").empty());
}

TEST(DependenceStudy, ATemperatureThatStaysIsNoDriverAndThatIsSaidOnce) {
  const auto study = study_of(0.4, true);
  EXPECT_THAT(study.remarks, Contains(HasSubstr("mtx1: its temperature changed by 0.4 degC over the drive")));
  EXPECT_EQ(std::count_if(study.remarks.begin(), study.remarks.end(),
                          [](const std::string& r) { return r.find("temperature") != std::string::npos; }),
            1);
}

}  // namespace
}  // namespace imuscope
