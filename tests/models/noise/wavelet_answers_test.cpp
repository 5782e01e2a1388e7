/// Whole wavelet variances as they were once: by runs, with holes, robust, streaming, and Allan deviations.

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <limits>
#include <numeric>
#include <vector>

#include "answer.h"
#include "made_series.h"
#include "models/noise/allan.h"
#include "models/noise/covariance_table.h"
#include "models/noise/robust_scale.h"
#include "models/noise/streaming_wv.h"
#include "models/noise/wavelet_variance.h"
#include "tests/support/recorded_answer.h"

namespace imuscope::noise::wavelet_answers {
namespace {

using imuscope::test::expect_recorded;
using test::Answer;

constexpr double kMissing = std::numeric_limits<double>::quiet_NaN();

/// White noise and its sum, about an offset: every level has its own value.
std::vector<double> wandering(std::size_t n, unsigned seed) {
  std::vector<double> x = test::white(n, seed);
  double sum = 0.0;
  for (double& v : x) {
    sum += 0.05 * v;
    v += 20.0 + sum;
  }
  return x;
}

/// Single samples, short and long stretches are missing; a run of one stands between two holes.
std::vector<std::uint8_t> holes(std::size_t n) {
  std::vector<std::uint8_t> mask(n, 1);
  for (std::size_t i = 0; i < n; ++i) {
    const bool single = i % 97 == 13 || i % 61 == 40;
    const bool stretch = i % 1000 >= 700 && i % 1000 < 704;
    const bool is_long = i % 5000 >= 3000 && i % 5000 < 3150;
    if (single || stretch || is_long || i % 1000 == 706) mask[i] = 0;
  }
  return mask;
}

TEST(WaveletAnswers, RunsOfEveryLength) {
  Answer answer;
  for (const std::size_t n :
       {2,    3,    4,     5,     7,     8,     9,     15,    16,    17,    31,    33,
        64,   100,  511,   512,   513,   1000,  1537,  4095,  4096,  4097,  8191,  8192,
        8193, 8200, 12289, 16391, 32767, 32768, 32769, 36863, 36864, 40000, 70001, 150000}) {
    const auto x = wandering(n, 3);
    std::vector<LevelSum> sums(static_cast<std::size_t>(highest_level(n)));
    add_squares(x, sums);
    answer.line("run of", n);
    for (const LevelSum& sum : sums) answer.line(sum.count, sum.sum_of_squares);
  }
  expect_recorded("models/noise/runs.txt", answer.text());
}

TEST(WaveletAnswers, FewerLevelsThanThereAre) {
  Answer answer;
  for (const std::size_t n : {300, 4096, 9000, 33000}) {
    for (const std::size_t levels : {1, 2, 3, 11, 12, 13, 14, 15, 16}) {
      auto x = wandering(n, 4);
      std::vector<LevelSum> sums(levels);
      add_squares_in_place(x, sums);
      answer.line("run of", n, "levels", levels);
      // What was there before stays, and comes on top.
      add_squares(wandering(n, 5), sums);
      for (const LevelSum& sum : sums) answer.line(sum.count, sum.sum_of_squares);
    }
  }
  answer.line(highest_level(0), highest_level(1), highest_level(2), highest_level(3), highest_level(4));
  expect_recorded("models/noise/fewer_levels.txt", answer.text());
}

TEST(WaveletAnswers, WholeAndWithHoles) {
  Answer answer;
  const auto x = wandering(20'000, 6);
  const auto mask = holes(x.size());
  WvOptions options;
  test::add_wv(answer, haar_wavelet_variance(x, options).value());
  options.confidence = 0.8;
  options.levels = 9;
  test::add_wv(answer, haar_wavelet_variance(x, options).value());
  options = {};
  options.mask = mask;
  test::add_wv(answer, haar_wavelet_variance(x, options).value());
  // One run that does not begin at the first sample, and two.
  std::vector<std::uint8_t> late(x.size(), 1);
  std::fill_n(late.begin(), 37, std::uint8_t{0});
  std::fill_n(late.end() - 5, 5, std::uint8_t{0});
  options.mask = late;
  test::add_wv(answer, haar_wavelet_variance(x, options).value());
  late[10'000] = 0;
  test::add_wv(answer, haar_wavelet_variance(x, options).value());
  expect_recorded("models/noise/wavelet_variance.txt", answer.text());
}

TEST(WaveletAnswers, ValuesThatAreNoNumbers) {
  Answer answer;
  auto x = wandering(600, 7);
  x[100] = kMissing;
  x[101] = std::numeric_limits<double>::infinity();
  x[300] = -std::numeric_limits<double>::infinity();
  const auto refused = haar_wavelet_variance(x, {});
  ASSERT_FALSE(refused);
  answer.line(refused.error().what, refused.error().remedy);
  WvOptions options;
  options.nan_is_gap = true;
  test::add_wv(answer, haar_wavelet_variance(x, options).value());
  // Where the mask takes them out, they are no error either.
  std::vector<std::uint8_t> mask(x.size(), 1);
  mask[100] = mask[101] = mask[300] = 0;
  options.nan_is_gap = false;
  options.mask = mask;
  test::add_wv(answer, haar_wavelet_variance(x, options).value());
  mask[101] = 1;
  const auto first = haar_wavelet_variance(x, options);
  ASSERT_FALSE(first);
  answer.line(first.error().what);
  expect_recorded("models/noise/no_numbers.txt", answer.text());
}

TEST(WaveletAnswers, WhatIsRefused) {
  Answer answer;
  const auto x = wandering(100, 8);
  const auto refuse = [&](const WvOptions& options, std::size_t n) {
    const auto wv = haar_wavelet_variance(std::span(x).first(n), options);
    if (wv)
      answer.line("taken with", wv->levels.size(), "levels");
    else
      answer.line(static_cast<int>(wv.error().kind), wv.error().text());
  };
  WvOptions options;
  for (const std::size_t n : {0, 1, 2, 3}) refuse(options, n);
  for (const int levels : {-1, 1, 5, 6, 7, 32, 33}) {
    options.levels = levels;
    refuse(options, 100);
  }
  options.levels = 0;
  for (const double efficiency : {0.19, 0.2, 0.6, 0.99, 0.991}) {
    options.robust = RobustOptions{efficiency, std::nullopt};
    refuse(options, 100);
  }
  options = {};
  const std::vector<std::uint8_t> mask(99, 1);
  options.mask = mask;
  refuse(options, 100);
  refuse(options, 99);
  expect_recorded("models/noise/wv_refused.txt", answer.text());
}

TEST(WaveletAnswers, RobustOnes) {
  Answer answer;
  auto x = wandering(3'000, 9);
  for (std::size_t i = 50; i < x.size(); i += 211) x[i] += i % 2 == 0 ? 30.0 : -25.0;
  const auto mask = holes(x.size());
  for (const double efficiency : {0.3, 0.6, 0.9}) {
    WvOptions options;
    options.robust = RobustOptions{efficiency, std::nullopt};
    test::add_wv(answer, haar_wavelet_variance(x, options).value());
    options.mask = mask;
    options.levels = 5;
    test::add_wv(answer, haar_wavelet_variance(x, options).value());
  }
  WvOptions options;
  options.robust = RobustOptions{0.6, 4.685};
  options.confidence = 0.68;
  test::add_wv(answer, haar_wavelet_variance(x, options).value());
  expect_recorded("models/noise/robust_wv.txt", answer.text());
}

TEST(WaveletAnswers, BiweightByItsConstant) {
  Answer answer;
  for (const double efficiency : {0.2, 0.25, 0.4, 0.6, 0.8, 0.95, 0.99}) {
    const double c = biweight_constant(efficiency);
    answer.line(efficiency, c, biweight_efficiency(c), biweight_expectation(c));
    answer.line("terms", biweight_correlation_terms(efficiency));
  }
  for (const double c : {1.0, 2.0, 3.5, 6.0, 12.0, 40.0})
    answer.line(c, biweight_efficiency(c), biweight_expectation(c));
  // The last terms are what cancellation leaves of sums of a million.
  expect_recorded("models/noise/biweight.txt", answer.text(), 1e-6, 1e-9);
}

void add_scale(Answer& answer, const std::vector<double>& w, double c) {
  const RobustScale scale = biweight_scale(w, c);
  answer.line(w.size(), c, scale.s2, scale.rejected_share);
}

TEST(WaveletAnswers, ScalesOfFewAndOfOddNumbers) {
  Answer answer;
  for (const double c : {2.5, 4.2, 9.0}) {
    for (const std::size_t n : {1, 2, 3, 4, 5, 6, 7, 8, 9, 50, 401}) add_scale(answer, test::white(n, 11), c);
    // Zeros: up to a half of the values.
    for (const std::size_t zeros : {98, 99, 100, 101, 102}) {
      auto w = test::white(200, 12);
      std::fill_n(w.begin(), zeros, 0.0);
      add_scale(answer, w, c);
    }
    // Two sizes, of which the larger root counts, and one that is far from the rest.
    for (const std::size_t large : {20, 60, 100, 140, 180}) {
      auto w = test::white(200, 13);
      for (std::size_t i = 0; i < large; ++i) w[i] *= 40.0;
      add_scale(answer, w, c);
    }
    auto w = test::white(64, 14);
    w[3] = 1e8;
    add_scale(answer, w, c);
    add_scale(answer, std::vector<double>(7, 3.0), c);
    add_scale(answer, std::vector<double>(7, 0.0), c);
  }
  expect_recorded("models/noise/scales.txt", answer.text());
}

void add_sums(Answer& answer, const WvSums& sums) {
  answer.line("samples", sums.n_samples);
  for (const auto& level : sums.levels)
    answer.line(level.squares, level.weight, level.weight_squares, level.excess.own, level.excess.common);
  test::add_wv(answer, sums.wavelet_variance(0.9));
}

TEST(WaveletAnswers, Streams) {
  Answer answer;
  const auto x = wandering(5'000, 15);
  for (const double forgetting : {0.0, 0.01}) {
    StreamingWv stream({8, forgetting, 0.9});
    for (std::size_t i = 0; i < x.size(); ++i) {
      // Holes of all lengths about the longest support of 256, and values that are no numbers.
      if (i % 700 == 300) stream.miss(i / 20);
      if (i == 1'000) stream.miss(1);
      if (i % 53 == 20) stream.push(i % 2 == 0 ? kMissing : -std::numeric_limits<double>::infinity());
      if (i == 1'500 || i == 1'900) stream.gap();
      if (i == 1'901) stream.miss(3);
      stream.push(x[i]);
      if (i == 3 || i == 200 || i == 1'023 || i == 1'024 || i == 1'600 || i == 2'600)
        add_sums(answer, stream.sums());
    }
    add_sums(answer, stream.sums());
    test::add_wv(answer, stream.wavelet_variance());
    WvSums taken;
    taken.levels.resize(8);
    stream.take(taken);
    add_sums(answer, taken);
    add_sums(answer, stream.sums());
    for (std::size_t i = 0; i < 300; ++i) {
      if (i == 200) stream.miss(2);
      stream.push(x[i]);
    }
    WvSums after = stream.sums();
    add_sums(answer, after);
    taken.merge(after);
    add_sums(answer, taken);
    after.levels.resize(2);
    after.merge(taken);
    add_sums(answer, after);
    stream.reset();
    stream.miss(5);
    for (std::size_t i = 0; i < 40; ++i) stream.push(x[i]);
    add_sums(answer, stream.sums());
  }
  expect_recorded("models/noise/streams.txt", answer.text());
}

TEST(WaveletAnswers, SlidingWindows) {
  Answer answer;
  const auto x = wandering(1'000, 16);
  WindowedWv window(5, 64, 3);
  for (std::size_t i = 0; i < x.size(); ++i) {
    if (i == 300) window.miss(2);
    if (i == 500) window.gap();
    if (!window.push(x[i])) continue;
    answer.line("block ends at", i);
    if (i < 250 || i > 450) test::add_wv(answer, window.wavelet_variance(0.9));
  }
  expect_recorded("models/noise/windows.txt", answer.text());
}

void add_allan(Answer& answer, const std::vector<AllanPoint>& points) {
  for (const AllanPoint& p : points)
    answer.line(p.n, p.tau_s, p.deviation, p.n_differences, p.degrees_of_freedom, p.ci_low, p.ci_high);
}

TEST(WaveletAnswers, AllanDeviations) {
  Answer answer;
  const auto x = wandering(20'000, 17);
  const auto mask = holes(x.size());
  for (const bool whole : {true, false}) {
    WvOptions options;
    if (!whole) options.mask = mask;
    const auto wv = haar_wavelet_variance(x, options).value();
    auto points = allan_deviation(x, wv, 50.0);
    add_allan(answer, points);
    add_allan(answer, allan_deviation(x, wv, 50.0, 7));
    const auto fitted = fit(wv, parse_model("WN+RW").value(), 50.0).value();
    set_allan_intervals(points, &fitted, 0.8);
    add_allan(answer, points);
  }
  // Of a record that is too short for any level, all of them.
  const auto few = wandering(5, 18);
  add_allan(answer, allan_deviation(few, haar_wavelet_variance(few).value(), 50.0));
  // Runs without the first and the last samples.
  std::vector<std::uint8_t> middle(400, 1);
  for (const std::size_t i : {0, 1, 2, 398, 399}) middle[i] = 0;
  WvOptions options;
  options.mask = middle;
  const auto part = wandering(400, 19);
  add_allan(answer, allan_deviation(part, haar_wavelet_variance(part, options).value(), 10.0));
  const Model model{{{ProcessKind::kWhiteNoise, 2.0, {}}, {ProcessKind::kRandomWalk, 1e-3, {}}}};
  for (const double n : {0.5, 1.0, 1.3, 2.0, 5.0, 100.0, 1e6, 2147483648.0, 1e12})
    answer.line("model", n, model_allan_deviation(model, n));
  expect_recorded("models/noise/allan.txt", answer.text(), 1e-5);
}

TEST(WaveletAnswers, WhatMissingSamplesAdd) {
  Answer answer;
  for (const std::size_t n : {8, 16, 64}) {
    for (const std::size_t older : {n, n - 1, least_valid(n)}) {
      for (const std::size_t newer : {n, n - 1, least_valid(n)}) {
        const MissingExcess excess = missing_excess(n, older, newer);
        answer.line(n, older, newer, excess.own, excess.common);
      }
    }
  }
  const std::vector<double> below{1.0, 0.6, 0.37, 0.2, 0.13, 0.07};
  const MissingExcess excess{0.02, 0.003};
  HoleLengths holes;
  answer.line("none", holes.variance_of(excess, below));
  for (const std::uint64_t length : {0, 1, 1, 3, 5, 8, 9, 100}) {
    holes.add(length);
    answer.line("with", length, holes.variance_of(excess, below),
                holes.variance_of(excess, std::span(below).first(4)),
                holes.variance_of(excess, std::span(below).first(3)));
  }
  HoleLengths others;
  others.add(std::uint64_t{1} << 45U);
  others.add(2);
  others.add(7);
  answer.line("others", others.variance_of(excess, below));
  others.merge(holes);
  answer.line("together", others.variance_of(excess, below));
  HoleLengths longer;
  longer.add(9);
  answer.line("longer ones alone", longer.variance_of(excess, below));
  expect_recorded("models/noise/missing.txt", answer.text());
}

}  // namespace
}  // namespace imuscope::noise::wavelet_answers
