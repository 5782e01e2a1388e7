#include "service/pipeline/model_book.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "models/noise/wavelet_variance.h"
#include "service/pipeline/live_models.h"
#include "service/pipeline/noise_series.h"
#include "tests/support/error_rows.h"

namespace imuscope {
namespace {

using test::fed;
using test::row_of;
using test::two_devices;

TEST(ModelBook, RefitsByCountAndAgreesWithTheBatchOverTheSameGapsAndRegimes) {
  ModelBook book(two_devices(), *noise::parse_model("WN"));
  NoiseSeries batch;
  std::mt19937 random(3);
  std::int64_t counter = 65'500;
  std::optional<Refit> refit;
  for (int i = 0; i < 1000; ++i) {
    EXPECT_FALSE(book.refit()) << "a refit falls due with 10 s of samples, not before";
    // A hole of seven samples, and three regimes in turn.
    counter += i == 300 ? 8 : 1;
    const auto row = row_of(counter, i < 400 || i >= 800 ? Regime::kStatic : Regime::kDynamic, random);
    book.add({0, HostTime{}, row}, row.regime);
    batch.add(row);
  }
  refit = book.refit();
  ASSERT_TRUE(refit);
  EXPECT_FALSE(book.refit());
  EXPECT_EQ(batch.missing(), 7U);
  ASSERT_EQ(refit->axes.size(), 2 * kAxisCount);
  for (std::size_t k = 0; k < refit->axes.size(); ++k) {
    const auto& streamed = refit->axes[k].wv;
    noise::WvOptions options;
    const auto mask = batch.mask(k / 2, k % 2 == 0 ? Regime::kStatic : Regime::kDynamic);
    options.mask = mask;
    const auto expected = noise::haar_wavelet_variance(batch.values(k / 2), options);
    ASSERT_TRUE(expected);
    ASSERT_EQ(streamed.levels.size(), expected->levels.size()) << k;
    for (std::size_t j = 0; j < streamed.levels.size(); ++j) {
      EXPECT_NEAR(streamed.levels[j].value, expected->levels[j].value, 1e-12 * expected->levels[j].value);
      EXPECT_EQ(streamed.levels[j].n_coefficients, expected->levels[j].n_coefficients);
    }
  }
}

TEST(ModelBook, ARefitSaysOfWhichSensorAndTimeItIs) {
  ModelBook book(two_devices(), *noise::parse_model("WN"));
  std::mt19937 random(5);
  std::optional<Refit> refit;
  for (int i = 0; i < 1000; ++i) {
    auto row = row_of(i, i < 300 ? Regime::kStatic : Regime::kDynamic, random);
    row.time = HostTime{} + from_seconds(100.0 + 0.01 * i);
    row.utc.utc = utc_time_from_ns(1'700'000'000'000'000'000) + from_seconds(0.01 * i);
    row.utc.is_known = true;
    book.add({0, HostTime{} + from_seconds(42.0), row}, row.regime);
    if (auto one = book.refit()) refit = std::move(one);
  }
  ASSERT_TRUE(refit);
  EXPECT_EQ(refit->study, 0U);
  EXPECT_EQ(refit->name, "s");
  EXPECT_EQ(refit->time, HostTime{} + from_seconds(109.99));
  EXPECT_TRUE(refit->utc.is_known);
  EXPECT_EQ(to_ns(refit->utc.utc), 1'700'000'009'990'000'000);
  EXPECT_EQ(refit->first_reference_time, HostTime{} + from_seconds(42.0));
  EXPECT_EQ(refit->samples, 1000);
  EXPECT_EQ(refit->motion.n_static, 300);
  EXPECT_EQ(refit->motion.n_dynamic, 700);
  EXPECT_GE(refit->duration_s, 0.0);
}

TEST(ModelBook, TellsAChangeOfBehaviourAtTheRefitAfterItAndNoneBefore) {
  ModelBook book(two_devices(), *noise::parse_model("WN"));
  std::mt19937 random(17);
  std::int64_t counter = 0;
  const auto first = fed(book, counter, 10, 1.0, random);
  ASSERT_EQ(first.axes.size(), kAxisCount);
  EXPECT_FALSE(first.axes[0].change) << "there is nothing before to compare with";
  for (int quiet = 0; quiet < 10; ++quiet) {
    const auto refit = fed(book, counter, 10, 1.0, random);
    for (const auto& axis : refit.axes) {
      ASSERT_TRUE(axis.change);
      EXPECT_FALSE(axis.changed) << axis.axis << " p " << axis.change->p_value;
      EXPECT_GT(axis.change->dof, 5);
    }
  }
  // A fifth more noise in ten seconds of 1000 samples.
  const auto louder = fed(book, counter, 10, 1.2, random);
  EXPECT_EQ(louder.axes.size(), kAxisCount);
  for (const auto& axis : louder.axes) {
    EXPECT_TRUE(axis.changed) << axis.axis << " p " << axis.change->p_value;
  }
}

TEST(ModelBook, AWarmRefitEndsWhereASearchOverAllRatesDoes) {
  const auto spec = *noise::parse_model("WN+GM");
  ModelBook book(two_devices(), spec);
  NoiseSeries batch;
  std::mt19937 random(23);
  std::normal_distribution<double> normal;
  double state = 0.0;
  std::optional<Refit> last;
  for (int i = 0; i < 5000; ++i) {
    auto row = row_of(i, Regime::kStatic, random);
    state = 0.98 * state + 0.2 * normal(random);
    row.e_gyro_radps[0] += state;
    book.add({0, HostTime{}, row}, row.regime);
    batch.add(row);
    if (auto refit = book.refit()) last = std::move(refit);
  }
  ASSERT_TRUE(last);
  const auto wv = noise::haar_wavelet_variance(batch.values(0)).value();
  const auto cold = noise::fit(wv, spec, 100.0).value();
  ASSERT_TRUE(last->axes[0].fit);
  const auto& warm = *last->axes[0].fit;
  ASSERT_EQ(warm.parameters.size(), cold.parameters.size());
  for (std::size_t i = 0; i < cold.parameters.size(); ++i) {
    ASSERT_TRUE(cold.parameters[i].sd);
    EXPECT_NEAR(warm.parameters[i].value, cold.parameters[i].value, 0.05 * *cold.parameters[i].sd);
  }
}

/// Twelve stops of five seconds in a drive, whose errors are three times as large in motion: each regime's
/// white noise is its own and no mixture. What the row says of its regime, late as it is told live, counts
/// for nothing.
TEST(LiveModels, GiveEachRowToTheRegimeThatHeldThere) {
  std::mt19937 random(29);
  std::normal_distribution<double> normal;
  Refit last;
  int refits = 0;
  LiveModels models(two_devices(), *noise::parse_model("WN"), [&](Refit refit) {
    last = std::move(refit);
    ++refits;
  });
  constexpr int kRate_hz = 100;
  constexpr int kRounds = 12;
  constexpr int kRound_s = 25;
  constexpr int kStop_s = 5;
  for (int k = 0; k < kRate_hz * kRounds * kRound_s; ++k) {
    const bool stands = (k / kRate_hz) % kRound_s < kStop_s;
    auto row = row_of(k, Regime::kDynamic, random);
    row.time = HostTime{} + from_seconds(10.0 + 0.01 * k);
    for (auto* triad : {&row.e_gyro_radps, &row.e_accel_mps2}) {
      for (double& e : *triad) e *= stands ? 1.0 : 3.0;
    }
    row.predicted_f_s_mps2 = {stands ? 0.0 : 0.5 * normal(random), 0.0, -9.81};
    row.predicted_omega_s_radps = {0.0, 0.0, stands ? 0.0 : 0.05 * normal(random)};
    ErrorRecord record{0, HostTime{}, row};
    if (k % 10 == 0) record.speed = VehicleSpeed{row.time, stands ? 0.0 : 8.0, 0.02};
    models.add(record);
  }
  const int before = refits;
  models.finish();
  EXPECT_EQ(before, kRounds * kRound_s / 10 - 1) << "the last seconds waited for what came after them";
  EXPECT_EQ(refits, kRounds * kRound_s / 10);
  EXPECT_NEAR(static_cast<double>(last.motion.n_static) / kRate_hz, kRounds * (kStop_s - 0.6), 3.0);
  EXPECT_NEAR(static_cast<double>(last.motion.n_dynamic) / kRate_hz, kRounds * (kRound_s - kStop_s - 0.6),
              3.0);
  ASSERT_EQ(last.axes.size(), 2 * kAxisCount);
  for (const AxisRefit& axis : last.axes) {
    ASSERT_TRUE(axis.fit);
    const double truth = axis.regime == Regime::kStatic ? 1.0 : 9.0;
    const auto& wn = axis.fit->parameters.front();
    EXPECT_NEAR(wn.value, truth, 4.0 * *wn.sd) << axis.axis;
    EXPECT_LT(*wn.sd, 0.05 * truth);
  }
}

}  // namespace
}  // namespace imuscope
