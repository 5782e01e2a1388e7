#include "models/noise/tails.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "models/noise/fit.h"

namespace imuscope::noise {
namespace {

constexpr double kTailsRate_hz = 100.0;

/// White noise, a Gauss-Markov process, and spikes of 15 sd in a share of the samples.
std::vector<double> spiked(std::size_t n, double share, unsigned seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  std::bernoulli_distribution spike(share);
  std::vector<double> x(n);
  double state = 0.0;
  for (double& v : x) {
    state = 0.98 * state + 0.1 * normal(random);
    v = normal(random) + state;
    if (spike(random)) v += normal(random) > 0.0 ? 15.0 : -15.0;
  }
  return x;
}

std::optional<TailTest> test_of(const std::vector<double>& x, const WvOptions& options = {}) {
  const auto wv = haar_wavelet_variance(x, options).value();
  const auto fitted = fit(wv, parse_model("WN+GM").value(), kTailsRate_hz).value();
  return test_tails(x, options, fitted.model);
}

/// Of 200 series, how many are called spiky.
int called(std::size_t n, double share) {
  int count = 0;
  for (unsigned seed = 1; seed <= 200; ++seed)
    count += spike_warning(test_of(spiked(n, share, seed)), kTailsRate_hz) ? 1 : 0;
  return count;
}

TEST(Tails, CleanSeriesAreSeldomCalledSpiky) {
  // 7 % and 3.3 binomial sd of 200 are 26.
  EXPECT_LE(called(1U << 14U, 0.0), 26);
  EXPECT_LE(called(1U << 16U, 0.0), 26);
}

TEST(Tails, OneSpikeInAThousandIsTold) {
  EXPECT_GE(called(1U << 14U, 0.001), 190);
  const auto test = test_of(spiked(1U << 16U, 0.001, 7));
  const auto warning = spike_warning(test, kTailsRate_hz);
  ASSERT_TRUE(warning);
  EXPECT_NE(warning->find("fit --robust"), std::string::npos);
  // 0.001 * 15^2 beside a variance of one, of 65 spikes.
  EXPECT_NEAR(test->excess, 0.225, 3.3 * 0.225 / std::sqrt(65.0));
}

TEST(Tails, AreLookedForWithSamplesMissingAndInTheWholeOfALongSignal) {
  auto x = spiked(1U << 19U, 0.0, 3);
  EXPECT_FALSE(spike_warning(test_of(x), kTailsRate_hz));
  std::mt19937_64 random(9);
  for (std::size_t i = x.size() / 2; i < x.size(); ++i) x[i] += random() % 500 == 0 ? 15.0 : 0.0;
  std::vector<std::uint8_t> mask(x.size(), 1);
  for (auto& m : mask) m = random() % 100 == 0 ? 0 : 1;
  WvOptions options;
  options.mask = mask;
  EXPECT_TRUE(spike_warning(test_of(x, options), kTailsRate_hz));
}

TEST(Tails, OfFewerLargeValuesThanAGaussianSignalHasNothingIsSaid) {
  std::mt19937_64 random(5);
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  std::vector<double> x(1U << 16U);
  for (double& v : x) v = uniform(random);
  EXPECT_FALSE(spike_warning(test_of(x), kTailsRate_hz));
}

TEST(Tails, QuantizationAloneIsNotTested) {
  std::mt19937_64 random(6);
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  std::vector<double> x(1U << 14U);
  double before = 0.0;
  for (double& v : x) {
    const double now = uniform(random);
    v = now - before;
    before = now;
  }
  const auto wv = haar_wavelet_variance(x).value();
  const auto fitted = fit(wv, parse_model("QN").value(), kTailsRate_hz).value();
  EXPECT_FALSE(test_tails(x, {}, fitted.model));
}

}  // namespace
}  // namespace imuscope::noise
