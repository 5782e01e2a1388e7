#include "service/modeller.h"

#include <gtest/gtest.h>
#include <random>

#include "noise/wavelet_variance.h"
#include "service/noise_series.h"

namespace imuscope {
namespace {

Configuration two_devices() {
  return *parse_configuration(R"(
[noise]
refit_interval_s = 10.0
[[device]]
name = "r"
role = "reference"
protocol = "csv_imu"
[[device]]
name = "s"
role = "study"
protocol = "csv_imu"
)",
                              "test.toml");
}

ErrorRow row_of(std::int64_t counter, Regime regime, std::mt19937& random) {
  std::normal_distribution<double> normal;
  ErrorRow row{};
  row.counter = counter;
  row.regime = regime;
  row.gyro_valid = row.accel_valid = true;
  for (auto* triad : {&row.e_gyro_radps, &row.e_accel_mps2}) {
    for (double& e : *triad) e = normal(random);
  }
  return row;
}

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
    book.add({0, HostTime{}, row});
    batch.add(row);
  }
  refit = book.refit();
  ASSERT_TRUE(refit);
  EXPECT_FALSE(book.refit());
  EXPECT_EQ(batch.missing(), 7U);
  ASSERT_EQ(refit->wavelet_variance.axes.size(), 2 * kAxisCount);
  for (std::size_t k = 0; k < refit->wavelet_variance.axes.size(); ++k) {
    const auto& streamed = refit->wavelet_variance.axes[k];
    noise::WvOptions options;
    const auto mask = batch.mask(k / 2, k % 2 == 0 ? Regime::kStatic : Regime::kDynamic);
    options.mask = mask;
    const auto expected = noise::haar_wavelet_variance(batch.values(k / 2), options);
    ASSERT_TRUE(expected);
    ASSERT_EQ(streamed.levels.size(), expected->levels.size()) << streamed.axis << " " << streamed.regime;
    for (std::size_t j = 0; j < streamed.levels.size(); ++j) {
      EXPECT_NEAR(streamed.levels[j].value, expected->levels[j].value, 1e-12 * expected->levels[j].value);
      EXPECT_EQ(streamed.levels[j].n_coefficients,
                static_cast<std::int64_t>(expected->levels[j].n_coefficients));
    }
  }
}

}  // namespace
}  // namespace imuscope
