#include "models/certificate/axis_certificate.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>
#include <random>

#include "made_record.h"
#include "models/certificate/json.h"
#include "models/noise/simulated_noise.h"

namespace imuscope::certificate {
namespace {

using noise::Knowledge;
using test::made_gyro;
using test::term_of;
using testing::HasSubstr;

TEST(AxisCertificate, WhiteNoiseIsAnAngleRandomWalkAndLeavesTheOthersBounded) {
  const auto axis = characterize_axis(made_gyro(1U << 16U, 1), {});
  ASSERT_TRUE(axis) << axis.error().text();
  // 0.2 deg/s a sample at 100 Hz: 0.02 deg/s/sqrt(Hz), 1.2 deg/sqrt(h).
  const TermValue& n = term_of(*axis, Term::kRandomWalk);
  EXPECT_EQ(n.knowledge, Knowledge::kFitted);
  EXPECT_EQ(n.unit, "deg/sqrt(h)");
  EXPECT_NEAR(n.value, 1.2, 0.02);
  EXPECT_LT(*n.ci_low, 1.2);
  EXPECT_GT(*n.ci_high, 1.2);
  for (const Term term : {Term::kBiasInstability, Term::kRateRandomWalk, Term::kRamp, Term::kQuantization}) {
    EXPECT_NE(term_of(*axis, term).knowledge, Knowledge::kFitted) << symbol_of(term);
    EXPECT_GT(term_of(*axis, term).value, 0.0) << symbol_of(term);
  }
  EXPECT_THAT(axis->warnings, testing::IsEmpty());
  EXPECT_THAT(axis->limits,
              testing::Contains(HasSubstr("bias instability: the Allan deviation still falls")));
}

TEST(AxisCertificate, ARandomWalkIsFoundWithTheMinimumThatItMakes) {
  const double step = 3e-4;
  const auto axis = characterize_axis(made_gyro(1U << 18U, 2, 0.2, step), {});
  ASSERT_TRUE(axis) << axis.error().text();
  // K = step sqrt(rate), deg/s per root of a second.
  const double k = step * 10.0 * 3600.0 * 60.0;
  const TermValue& walk = term_of(*axis, Term::kRateRandomWalk);
  ASSERT_EQ(walk.knowledge, Knowledge::kFitted);
  EXPECT_LT(*walk.ci_low, k);
  EXPECT_GT(*walk.ci_high, k);
  // N^2/tau + K^2 tau/3 is least at tau = sqrt(3) N/K, there 2 N K / sqrt(3).
  const double n_white = 0.02;
  const double b = 3600.0 * std::sqrt(2.0 * n_white * step * 10.0 / std::sqrt(3.0)) / 0.664;
  const TermValue& bias = term_of(*axis, Term::kBiasInstability);
  ASSERT_EQ(bias.knowledge, Knowledge::kFitted);
  EXPECT_NEAR(bias.value, b, 0.1 * b);
}

// A sensor's low-pass makes its white noise a fast Gauss-Markov process: what a filter feels is the same.
TEST(AxisCertificate, FastNoiseThatIsNoWhiteNoiseHasTheRandomWalkOfItsAllanDeviation) {
  std::mt19937_64 random(3);
  std::normal_distribution<double> normal;
  AxisRecord record = made_gyro(1, 1);
  record.values.clear();
  double state = 0.0;
  const double phi = std::exp(-0.7);
  for (int i = 0; i < (1 << 17); ++i) {
    state = phi * state + std::sqrt(1.0 - phi * phi) * 0.2 * normal(random);
    record.values.push_back(state);
  }
  const auto axis = characterize_axis(record, {});
  ASSERT_TRUE(axis) << axis.error().text();
  const TermValue& n = term_of(*axis, Term::kRandomWalk);
  for (const auto& point : axis->allan) {
    if (point.tau_s < 1.0 || point.tau_s > 4.0) continue;
    EXPECT_NEAR(n.value, 60.0 * point.deviation * std::sqrt(point.tau_s), 0.05 * n.value) << point.tau_s;
  }
}

TEST(AxisCertificate, ALineAndAResonanceAreNamed) {
  AxisRecord record = made_gyro(1U << 17U, 4);
  std::mt19937_64 random(5);
  std::normal_distribution<double> normal;
  double x = 0.0;
  double y = 0.0;
  const double a = 0.05;
  const double b = 2.0 * std::numbers::pi * 20.0 / 100.0;
  for (std::size_t i = 0; i < record.values.size(); ++i) {
    const double nx = std::exp(-a) * (std::cos(b) * x - std::sin(b) * y) + 0.03 * normal(random);
    y = std::exp(-a) * (std::sin(b) * x + std::cos(b) * y) + 0.03 * normal(random);
    x = nx;
    record.values[i] += x + 0.05 * std::sin(2.0 * std::numbers::pi * 0.565 * static_cast<double>(i) / 100.0);
  }
  const auto axis = characterize_axis(record, {});
  ASSERT_TRUE(axis) << axis.error().text();
  ASSERT_FALSE(axis->lines.empty());
  EXPECT_NEAR(axis->lines.front().frequency_hz, 0.565, 0.003);
  EXPECT_NEAR(axis->lines.front().amplitude, 0.05, 0.003);
  ASSERT_FALSE(axis->resonances.empty());
  EXPECT_NEAR(axis->resonances.front().frequency_hz, 20.0, 0.5);
  // Half of the power lies within +-a of the middle: 2 a / 2 pi of the rate.
  EXPECT_NEAR(axis->resonances.front().width_hz, 2.0 * a * 100.0 / (2.0 * std::numbers::pi), 0.8);
}

TEST(AxisCertificate, ABiasThatGoesWithTheTemperatureIsToldWithItsSd) {
  AxisRecord record = made_gyro(1U << 16U, 6);
  std::vector<float> temperature_c;
  for (std::size_t i = 0; i < record.values.size(); ++i) {
    const double t = 30.0 + 5.0 * std::sin(2.0 * std::numbers::pi * static_cast<double>(i) / 40'000.0);
    temperature_c.push_back(static_cast<float>(t));
    record.values[i] += 0.01 * (t - 30.0);
  }
  record.temperature_c = std::make_shared<const std::vector<float>>(std::move(temperature_c));
  const auto axis = characterize_axis(record, {});
  ASSERT_TRUE(axis) << axis.error().text();
  ASSERT_TRUE(axis->temperature);
  EXPECT_NEAR(axis->temperature->bias_per_c, 0.01, 4.0 * axis->temperature->bias_per_c_sd);
  EXPECT_NEAR(axis->temperature->highest_c, 35.0, 0.01);
}

AxisRecord simulated_gyro(const noise::Model& model, std::size_t samples, unsigned seed) {
  std::mt19937_64 random(seed);
  AxisRecord record;
  record.name = "gyro_x";
  record.unit = noise::SignalUnit::kDegps;
  record.rate_hz = 100.0;
  record.values = noise::simulated_noise(model, samples, random);
  return record;
}

// Beside white noise and a ramp stand models as good in which a Gauss-Markov process is white: its rate is not told,
// and the curve is told as well as without it.
TEST(AxisCertificate, BIsKnownAsWellWhereAModelAsGoodHasARateThatIsNotTold) {
  using enum noise::ProcessKind;
  const auto axis = characterize_axis(
      simulated_gyro({{{kWhiteNoise, 0.04, {}}, {kRamp, 1e-14, {}}}}, std::size_t{1} << 18U, 40'000), {});
  ASSERT_TRUE(axis) << axis.error().text();
  EXPECT_THAT(axis->rivals, testing::Contains("GM+DR"));
  const TermValue& bias = term_of(*axis, Term::kBiasInstability);
  ASSERT_EQ(bias.knowledge, Knowledge::kFitted);
  // The curve is lowest at tau^3 = 8 WN/DR, and a third of its variance there is the ramp's: of that the record
  // tells the root within 2 sqrt(12 WN/(DR n^3)) at best, B within a third of it, 3.5 %.
  EXPECT_GT(*bias.ci_low, 0.95 * bias.value);
  EXPECT_LT(*bias.ci_high, 1.05 * bias.value);
}

// No model of two terms is near this one, and what is first added to them gets nothing in them.
TEST(AxisCertificate, QuantizationBesideManySlowTermsIsFound) {
  using enum noise::ProcessKind;
  const noise::Model truth{{{kQuantization, 0.02, {}},
                            {kWhiteNoise, 0.04, {}},
                            {kGaussMarkov, 4e-5, {0.005, 0.0}},
                            {kFlicker, 1e-5, {}},
                            {kRandomWalk, 1e-9, {}}}};
  const auto axis = characterize_axis(simulated_gyro(truth, std::size_t{1} << 18U, 40'010), {});
  ASSERT_TRUE(axis) << axis.error().text();
  EXPECT_EQ(axis->fit.spec.count(kQuantization), 1) << axis->fit.spec.name();
  // Arc seconds: sqrt(0.02) deg/s over 100 Hz.
  const TermValue& q = term_of(*axis, Term::kQuantization);
  ASSERT_EQ(q.knowledge, Knowledge::kFitted);
  EXPECT_NEAR(q.value, 3600.0 * std::sqrt(0.02) / 100.0, 0.05 * q.value);
}

/// Of a sensor that rounds to steps as large as its noise and sends overlapping means of four: no model of ours.
AxisRecord rounded_then_averaged(std::size_t samples, unsigned seed) {
  constexpr double kStep = 0.2;
  std::mt19937_64 random(seed);
  std::normal_distribution<double> white;
  std::vector<double> x(samples);
  for (double& v : x) v = kStep * white(random);
  std::normal_distribution<double> steps;
  double walk = 0.0;
  for (double& v : x) v = kStep * std::round((v + (walk += 1e-4 * steps(random))) / kStep);
  AxisRecord record;
  record.name = "gyro_x";
  record.unit = noise::SignalUnit::kDegps;
  record.rate_hz = 100.0;
  for (std::size_t i = 0; i + 3 < x.size(); ++i)
    record.values.push_back(0.25 * (x[i] + x[i + 1] + x[i + 2] + x[i + 3]));
  return record;
}

// Along a correlation time that is hardly told, the gradient of another term leads out of all bounds: such ends were
// infinite.
TEST(AxisCertificate, AnEndOfNIsNeverFarFromWhatTheCurveShows) {
  const auto axis = characterize_axis(rounded_then_averaged(std::size_t{1} << 18U, 40'004), {});
  ASSERT_TRUE(axis) << axis.error().text();
  const TermValue& n = term_of(*axis, Term::kRandomWalk);
  ASSERT_EQ(n.knowledge, Knowledge::kFitted);
  EXPECT_LT(*n.ci_high, 1.2 * n.value);
  EXPECT_GT(*n.ci_low, 0.9 * n.value);
}

TEST(AxisCertificate, ARecordThatIsFetchedIsTheSame) {
  AxisRecord record = made_gyro(40'000, 8, 0.2, 2e-4);
  std::vector<float> temperature_c;
  for (std::size_t i = 0; i < record.values.size(); ++i) {
    record.values[i] += 0.05 * std::sin(2.0 * std::numbers::pi * 3.0 * static_cast<double>(i) / 100.0);
    temperature_c.push_back(30.0F + static_cast<float>(i) * 1e-4F);
  }
  record.temperature_c = std::make_shared<const std::vector<float>>(std::move(temperature_c));
  AxisRecord fetched = record;
  fetched.values.clear();
  fetched.fetch = [values = record.values]() -> Result<std::vector<double>> { return values; };
  fetched.read_with_temperature = [x = record.values,
                                   t = record.temperature_c](const auto& take) -> Result<void> {
    for (std::size_t at = 0; at < x.size(); at += 777) {
      const std::size_t n = std::min<std::size_t>(777, x.size() - at);
      take({std::span(x).subspan(at, n), {}, std::span(*t).subspan(at, n)});
    }
    return {};
  };
  fetched.temperature_c = nullptr;
  const std::vector records{fetched};
  const auto there = characterize_axis(record, {});
  const auto later = characterize_axes(records, {}).front();
  ASSERT_TRUE(there && later);
  const Origin origin{"a", {}, {}, "2026-01-01T00:00:00Z", "1"};
  EXPECT_EQ(to_json(origin, {*there}), to_json(origin, {*later}));
  EXPECT_FALSE(there->lines.empty());
  EXPECT_TRUE(there->temperature);
}

TEST(AxisCertificate, TemperaturesThatCannotBeFetchedAreTold) {
  AxisRecord record = made_gyro(40'000, 8);
  record.read_with_temperature = [](const auto&) -> Result<void> { return work_error("the disk is gone"); };
  const auto axis = characterize_axis(record, {});
  ASSERT_FALSE(axis);
  EXPECT_THAT(axis.error().text(), testing::HasSubstr("the disk is gone"));
}

TEST(AxisCertificate, RecordsThatAreFetchedOneAfterTheOtherKeepTheirPlacesAndAreToldInOrder) {
  std::vector<AxisRecord> records;
  for (const unsigned seed : {51U, 52U, 53U}) {
    records.push_back(made_gyro(1U << 15U, seed));
    records.back().fetch = [values = records.back().values]() -> Result<std::vector<double>> {
      return values;
    };
  }
  records[1].fetch = []() -> Result<std::vector<double>> { return work_error("the disk is gone"); };
  std::vector<std::size_t> told;
  const auto axes = characterize_axes(records, {}, [&](std::size_t done) { told.push_back(done); });
  EXPECT_EQ(told, (std::vector<std::size_t>{1, 2, 3}));
  ASSERT_EQ(axes.size(), 3U);
  EXPECT_FALSE(axes[1]);
  for (const std::size_t i : {std::size_t{0}, std::size_t{2}}) {
    records[i].fetch = {};
    const auto alone = characterize_axis(records[i], {});
    ASSERT_TRUE(axes[i] && alone);
    EXPECT_EQ(axes[i]->fit.criterion, alone->fit.criterion);
    EXPECT_EQ(axes[i]->terms.front().value, alone->terms.front().value);
  }
}

TEST(AxisCertificate, ARecordThatCannotBeFetchedIsAnError) {
  AxisRecord record = made_gyro(0, 1);
  record.fetch = []() -> Result<std::vector<double>> { return work_error("the disk is gone"); };
  const auto axis = characterize_axis(record, {});
  ASSERT_FALSE(axis);
  EXPECT_THAT(axis.error().text(), HasSubstr("gyro_x: the disk is gone"));
}

TEST(AxisCertificate, HalvesThatDifferAreTold) {
  AxisRecord record = made_gyro(1U << 16U, 7);
  for (std::size_t i = record.values.size() / 2; i < record.values.size(); ++i)
    record.values[i] = 0.5 + 1.3 * (record.values[i] - 0.5);
  const auto axis = characterize_axis(record, {});
  ASSERT_TRUE(axis) << axis.error().text();
  EXPECT_THAT(axis->warnings, testing::Contains(HasSubstr("halves of the record differ")));
  EXPECT_NEAR(axis->halves->ratio, 1.69, 0.1);
}

TEST(AxisCertificate, RecordsThatTellNothingAreRefusedInASentence) {
  AxisRecord stuck = made_gyro(1000, 8);
  std::fill(stuck.values.begin(), stuck.values.end(), 1.25);
  EXPECT_THAT(characterize_axis(stuck, {}).error().text(), HasSubstr("gyro_x: all values are 1.25"));
  EXPECT_THAT(characterize_axis(made_gyro(10, 8), {}).error().text(),
              HasSubstr("10 valid samples are too few"));
  AxisOptions options;
  options.model = "WN+XX";
  EXPECT_THAT(characterize_axis(made_gyro(1000, 8), options).error().text(), HasSubstr("unknown term 'XX'"));
}

TEST(AxisCertificate, MissingSamplesCostInformationAlone) {
  AxisRecord record = made_gyro(1U << 16U, 9);
  for (std::size_t i = 0; i < record.values.size(); i += 97) record.values[i] = std::nan("");
  const auto axis = characterize_axis(record, {});
  ASSERT_TRUE(axis) << axis.error().text();
  EXPECT_EQ(axis->n_missing, record.values.size() / 97 + 1);
  EXPECT_NEAR(term_of(*axis, Term::kRandomWalk).value, 1.2, 0.02);
}

TEST(AxisCertificate, TheResultDoesNotDependOnWhatIsCharacterizedBesideIt) {
  const std::vector<AxisRecord> records{made_gyro(20'000, 1), made_gyro(20'000, 2), made_gyro(20'000, 3)};
  const auto together = characterize_axes(records, {});
  for (std::size_t i = 0; i < records.size(); ++i) {
    ASSERT_TRUE(together[i]);
    const auto alone = characterize_axis(records[i], {});
    EXPECT_EQ(to_json({}, {*together[i]}).dump(), to_json({}, {*alone}).dump());
  }
}

}  // namespace
}  // namespace imuscope::certificate
