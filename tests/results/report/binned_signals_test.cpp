#include "results/report/binned_signals.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

namespace imuscope::report {
namespace {

TEST(BinnedSignals, SmallestMeanAndLargestOfEachStretchAreThoseOfItsSamples) {
  constexpr double kPeriod_s = 0.01;
  constexpr int kSamples = 12345;
  BinnedSignals binned(1, 100, 0.05);
  std::minstd_rand random(7);
  std::normal_distribution<double> normal;
  std::vector<double> samples;
  for (int k = 0; k < kSamples; ++k) {
    samples.push_back(normal(random));
    binned.add(k * kPeriod_s, std::array{samples.back()});
  }
  ASSERT_GE(binned.size(), 50U);
  ASSERT_LE(binned.size(), 100U);
  const double n_per_bin = binned.width_s() / kPeriod_s;
  for (std::size_t i = 0; i < binned.size(); ++i) {
    // Stretch i holds the samples k with i <= k / n_per_bin < i + 1; by time of its middle for rounding.
    std::vector<double> inside;
    for (int k = 0; k < kSamples; ++k) {
      if (std::floor((k + 0.01) / n_per_bin) == static_cast<double>(i))
        inside.push_back(samples[static_cast<std::size_t>(k)]);
    }
    const auto& bin = binned.bin(0, i);
    ASSERT_NEAR(static_cast<double>(bin.n), static_cast<double>(inside.size()), 1.0);
    if (bin.n != inside.size()) continue;  // a sample on the border, counted on the other side of it
    EXPECT_EQ(bin.smallest, *std::min_element(inside.begin(), inside.end()));
    EXPECT_EQ(bin.largest, *std::max_element(inside.begin(), inside.end()));
    double sum = 0.0;
    for (const double value : inside) sum += value;
    EXPECT_NEAR(bin.mean(), sum / static_cast<double>(inside.size()), 1e-12);
    EXPECT_EQ(bin.last, inside.back());
  }
}

TEST(BinnedSignals, TenHoursNeedNoMoreStretchesThanAMinute) {
  BinnedSignals binned(1, 1000, 0.05);
  for (int k = 0; k < 36000 * 10; ++k) binned.add(k * 0.1, std::array{1.0});
  EXPECT_LE(binned.size(), 1000U);
  EXPECT_GE(binned.size(), 500U);
}

TEST(BinnedSignals, AGapStaysEmpty) {
  BinnedSignals binned(1, 1000, 0.05);
  for (int k = 0; k < 6000; ++k) {
    const double t = k * 0.01;
    if (t < 20.0 || t >= 30.0) binned.add(t, std::array{1.0});
  }
  binned.coarsen();
  for (std::size_t i = 0; i < binned.size(); ++i) {
    const bool in_gap =
        binned.time_s(i) - binned.width_s() > 20.0 && binned.time_s(i) + binned.width_s() < 30.0;
    const bool outside =
        binned.time_s(i) + binned.width_s() < 20.0 || binned.time_s(i) - binned.width_s() > 30.0;
    if (in_gap) {
      EXPECT_EQ(binned.bin(0, i).n, 0U) << binned.time_s(i);
    }
    if (outside) {
      EXPECT_GT(binned.bin(0, i).n, 0U) << binned.time_s(i);
    }
  }
}

TEST(BinnedSignals, ASlowSignalHasNoEmptyStretchAfterCoarsening) {
  BinnedSignals binned(1, 1000, 0.05);
  for (int k = 0; k < 300; ++k) binned.add(k * 0.1, std::array{1.0});
  binned.coarsen();
  for (std::size_t i = 0; i < binned.size(); ++i) EXPECT_GT(binned.bin(0, i).n, 0U) << i;
  EXPECT_GE(binned.size(), 100U);
}

TEST(BinnedSignals, AnUnknownValueOfOneSignalLeavesTheOtherOne) {
  BinnedSignals binned(2, 10, 1.0);
  binned.add(0.0, std::array{std::nan(""), 2.0});
  EXPECT_EQ(binned.bin(0, 0).n, 0U);
  EXPECT_EQ(binned.bin(1, 0).n, 1U);
}

}  // namespace
}  // namespace imuscope::report
