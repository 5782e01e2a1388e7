#include "study/noise_study.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

#include "models/noise/model.h"

namespace imuscope {
namespace {

using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr double kNoiseRate_hz = 100.0;
const std::vector<std::string> kRegimes{"static", "dynamic"};

Configuration one_imu_and_its_reference() {
  Configuration configuration;
  DeviceConfig reference;
  reference.name = "airins";
  reference.role = DeviceRole::kReference;
  DeviceConfig study;
  study.name = "mtx1";
  study.role = DeviceRole::kStudy;
  study.rate_hz = kNoiseRate_hz;
  configuration.devices = {reference, study};
  return configuration;
}

/// White noise of its own sd in each regime; regime 0 for the first `static_samples`.
NoiseSeries series_of(std::size_t n, std::size_t static_samples, double static_sd, double dynamic_sd,
                      double line_amplitude = 0.0) {
  NoiseSeries series;
  std::mt19937 random(4);
  std::normal_distribution<double> normal;
  for (std::size_t k = 0; k < n; ++k) {
    ErrorRow row{};
    row.counter = static_cast<std::int64_t>(k);
    row.time = HostTime{} + from_seconds(static_cast<double>(k) / kNoiseRate_hz);
    row.gyro_valid = row.accel_valid = true;
    const bool stands = k < static_samples;
    const double line = stands ? 0.0
                               : line_amplitude * std::sin(2.0 * std::numbers::pi * 31.0 *
                                                           static_cast<double>(k) / kNoiseRate_hz);
    for (std::size_t i = 0; i < 3; ++i) {
      row.e_gyro_radps[i] = (stands ? static_sd : dynamic_sd) * normal(random) + line;
      row.e_accel_mps2[i] = normal(random);
    }
    series.add(row, stands ? 0u : 1u);
  }
  return series;
}

NoiseStudy study_of(const NoiseSeries& series) {
  return study_noise(one_imu_and_its_reference(), {series}, kRegimes, noise::parse_model("WN").value(), {});
}

TEST(NoiseStudy, RegimesThatDifferAreToldApartAndThoseThatDoNotAreNot) {
  const auto study = study_of(series_of(40'000, 20'000, 1.0, 1.3));
  EXPECT_EQ(study.models.size(), 6u * 3u);
  const auto document = comparison_json(study, kRegimes);
  ASSERT_EQ(document.at("comparisons").size(), 6u);
  for (const auto& c : document.at("comparisons")) {
    const bool gyro = c.at("axis").get<std::string>().starts_with("gyro");
    const auto& p = c.at("parameters")[0];
    EXPECT_EQ(p.at("verdict"), gyro ? "differs" : "no difference shown") << c.at("axis");
    EXPECT_GE(p.at("p_holm").get<double>(), p.at("p_value").get<double>());
    EXPECT_LT(p.at("ratio_ci_low").get<double>(), gyro ? 1.69 : 1.0);
    EXPECT_GT(p.at("ratio_ci_high").get<double>(), gyro ? 1.69 : 1.0);
    EXPECT_EQ(c.at("joint").at("dof"), 1);
  }
}

TEST(NoiseStudy, LevelsThatARegimesStretchesAreTooShortForAreLeftOutAndSaid) {
  const auto study = study_of(series_of(40'000, 3'000, 1.0, 1.0));
  ASSERT_EQ(study.left_out.size(), 6u) << "six axes; 37,000 samples in motion have every level of 40,000";
  const auto& first = study.left_out[0];
  EXPECT_EQ(first.at("regime"), "static");
  EXPECT_EQ(first.at("above_level"), 11);  // 2^11 = 2048 of 3000 samples
  EXPECT_DOUBLE_EQ(first.at("above_tau_s").get<double>(), 20.48);
  EXPECT_THAT(study.remarks,
              Contains(HasSubstr("mtx1, static: no stretch is long enough for scales above 20.48 s")));
}

TEST(NoiseStudy, ARegimeTooShortForAModelHasNoneAndThatIsSaid) {
  const auto series = series_of(40'000, 3, 1.0, 1.0);
  const auto study =
      study_noise(one_imu_and_its_reference(), {series}, kRegimes, noise::parse_model("WN+2*GM").value(), {});
  for (const auto& model : study.models) EXPECT_NE(model.regime, "static");
  EXPECT_THAT(study.remarks, Contains(HasSubstr("mtx1 gyro_x, static: no noise model")));
  EXPECT_THAT(comparison_json(study, kRegimes).at("comparisons"), IsEmpty());
}

/// A drive whose noise changes from minute to minute by a tenth, as roads and engines do, and one whose does
/// not.
TEST(NoiseStudy, PartsOfARegimeThatDifferWidenItsIntervalsAndAreTold) {
  std::mt19937 random(31);
  std::normal_distribution<double> normal;
  constexpr int kPartSamples = 6000;
  constexpr int kParts = 8;
  int widened_hold = 0;
  constexpr int kDrives = 40;
  for (int drive = 0; drive < kDrives; ++drive) {
    NoiseSeries series;
    double factor = 1.0;
    for (int i = 0; i < kParts * kPartSamples; ++i) {
      if (i % kPartSamples == 0) factor = std::exp(0.1 * normal(random));
      ErrorRow row{};
      row.counter = i;
      row.time = HostTime{} + from_seconds(i / 100.0);
      row.regime = Regime::kDynamic;
      row.gyro_valid = row.accel_valid = true;
      row.e_gyro_radps = {factor * normal(random), normal(random), normal(random)};
      row.e_accel_mps2 = {normal(random), normal(random), normal(random)};
      series.add(row);
    }
    for (const auto& model : study_of(series).models) {
      if (model.regime != "dynamic" || model.axis > 1) continue;
      const auto& wn = model.fit.parameters.front();
      const bool told = std::any_of(model.fit.warnings.begin(), model.fit.warnings.end(),
                                    [](const auto& w) { return w.starts_with("its 8 parts differ"); });
      EXPECT_EQ(told, model.axis == 0) << drive;
      // ln sigma2 of a part has mean 0 and sd 0.2: the mean of such parts is 1 on the scale of the interval.
      if (model.axis == 0) widened_hold += *wn.ci_low <= 1.0 && 1.0 <= *wn.ci_high ? 1 : 0;
      if (model.axis == 1) {
        EXPECT_LT(*wn.ci_high - *wn.ci_low, 0.04);
      }
    }
  }
  // 38 expected; 33 and fewer have a chance of 3e-3.
  EXPECT_GE(widened_hold, 34);
}

TEST(NoiseStudy, ALineIsSaidAndDoesNotEnterTheModel) {
  const auto study = study_of(series_of(40'000, 20'000, 1.0, 1.0, 0.5));
  ASSERT_EQ(study.lines.size(), 3u) << "one for each gyroscope";
  EXPECT_EQ(study.lines[0].at("regime"), "dynamic");
  EXPECT_NEAR(study.lines[0].at("frequency_hz").get<double>(), 31.0, 0.005);
  EXPECT_NEAR(study.lines[0].at("amplitude").get<double>(), 0.5, 0.05);
  EXPECT_THAT(study.remarks, Contains(HasSubstr("a line at 31 Hz")));
  for (const auto& model : study.models) {
    if (model.axis == 0) {
      EXPECT_NEAR(model.fit.parameters[0].value, 1.0, 0.05) << model.regime;
    }
  }
}

TEST(NoiseStudy, ALineIsASinusoidOfItsModelWithIntervalsAndItsWaveletVariance) {
  constexpr double kAmplitude = 0.5;
  const auto study = study_of(series_of(40'000, 20'000, 1.0, 1.0, kAmplitude));
  int found = 0;
  for (const auto& model : models_json(study)) {
    const bool has_line = model.at("axis") == "gyro_y" && model.at("regime") == "dynamic";
    if (model.at("axis").get<std::string>().starts_with("accel") || model.at("regime") == "static") {
      EXPECT_FALSE(model.contains("sinusoids"));
    }
    if (!has_line) continue;
    ++found;
    ASSERT_EQ(model.at("sinusoids").size(), 1U);
    const auto& line = model.at("sinusoids")[0];
    EXPECT_EQ(line.at("process"), "SIN1");
    for (const auto& [name, truth] : {std::pair{"alpha", kAmplitude}, std::pair{"frequency", 31.0}}) {
      const auto& p = line.at("parameters")[std::string(name) == "alpha" ? 0 : 1];
      EXPECT_EQ(p.at("name"), name);
      const double sd = p.at("sd").get<double>();
      EXPECT_NEAR(p.at("value").get<double>(), truth, 4.0 * sd);
      EXPECT_LT(sd, 0.1 * truth);
      EXPECT_NEAR(p.at("ci_high").get<double>() - p.at("ci_low").get<double>(), 3.92 * sd, 0.01 * sd);
    }
    // Level 1 of a sinusoid: alpha^2 / 2 sin^2(b/2), b its phase a sample.
    const double b = 2.0 * std::numbers::pi * 31.0 / kNoiseRate_hz;
    const double expected = 0.5 * kAmplitude * kAmplitude * std::pow(std::sin(0.5 * b), 2);
    EXPECT_NEAR(line.at("wv")[0].get<double>(), expected, 0.1 * expected);
    EXPECT_EQ(line.at("wv").size(), model.at("wv").size());
  }
  EXPECT_EQ(found, 1);
}

TEST(NoiseStudy, AnImuThatMissesHalfOfTheRunIsSaid) {
  const auto series = series_of(20'000, 10'000, 1.0, 1.0);
  EXPECT_EQ(coverage_remark("mtx1", series, kNoiseRate_hz, 200.0, HostTime{}), "");
  EXPECT_EQ(coverage_remark("mtx1", series, kNoiseRate_hz, 400.0, HostTime{}),
            "mtx1: has samples for 200 s of the run's 400 s, between 0 s and 200 s; its models and "
            "regressions are of that part alone");
  EXPECT_THAT(coverage_remark("mtx2", NoiseSeries{}, kNoiseRate_hz, 400.0, HostTime{}),
              HasSubstr("has no sample"));
}

TEST(NoiseSeries, ACounterThatJumpsAndJumpsTakesNoMemoryThatTheRecordingDoesNotHave) {
  NoiseSeries series;
  ErrorRow row{};
  for (int i = 0; i < 100; ++i) {
    series.add(row, std::nullopt);
    row.counter += 1'000'000'000;
  }
  EXPECT_LE(series.size(), 360'000U + 3 * 100U);
  EXPECT_EQ(series.missing() + 100, series.size());
}

}  // namespace
}  // namespace imuscope
