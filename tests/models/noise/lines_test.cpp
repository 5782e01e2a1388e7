#include "models/noise/lines.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <numbers>
#include <random>
#include <string>

#include "models/noise/allan.h"
#include "models/noise/process.h"
#include "models/noise/spectrum.h"
#include "models/noise/wavelet_variance.h"

namespace imuscope::noise {
namespace {

constexpr double kLineRate_hz = 100.0;

/// White noise of variance 1 over a slow Gauss-Markov process, as an axis at rest has it.
std::vector<double> noise_of(std::size_t n, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  std::vector<double> x(n);
  double slow = 0.0;
  for (double& value : x) {
    slow = 0.99 * slow + 0.1 * normal(random);
    value = normal(random) + slow;
  }
  return x;
}

void add_line(std::vector<double>& x, double frequency_hz, double amplitude) {
  for (std::size_t i = 0; i < x.size(); ++i)
    x[i] += amplitude *
            std::sin(2.0 * std::numbers::pi * frequency_hz * static_cast<double>(i) / kLineRate_hz + 0.4);
}

std::vector<std::uint8_t> all_valid(std::size_t n) { return std::vector<std::uint8_t>(n, 1); }

TEST(Lines, AreFoundWhereTheyAreWithTheirAmplitude) {
  for (const double frequency_hz : {27.31, 12.0, 41.118}) {
    auto x = noise_of(120'000, 1);
    add_line(x, frequency_hz, 0.3);
    const auto lines = find_lines(x, all_valid(x.size()), {});
    ASSERT_EQ(lines.size(), 1u) << frequency_hz;
    EXPECT_NEAR(lines[0].frequency_hz, frequency_hz, 0.1 * kLineRate_hz / 4096.0);
    EXPECT_NEAR(lines[0].amplitude, 0.3, 0.03);
    EXPECT_LT(lines[0].p_value, 1e-6);
    EXPECT_LT(lines[0].frequency_sd_hz, 0.1 * kLineRate_hz / 4096.0);
  }
}

// Sd of amplitude and frequency over many records with one line; the bound is nearly reached.
TEST(Lines, SayHowWellTheyAreKnown) {
  constexpr int kSeries = 60;
  constexpr double kFrequency_hz = 17.77;
  constexpr double kAmplitude = 0.3;
  double amplitude_nees = 0.0;
  double frequency_nees = 0.0;
  for (unsigned seed = 1; seed <= kSeries; ++seed) {
    auto x = noise_of(40'000, 100 + seed);
    add_line(x, kFrequency_hz, kAmplitude);
    const auto lines = find_lines(x, all_valid(x.size()), {});
    ASSERT_EQ(lines.size(), 1u) << seed;
    amplitude_nees += std::pow((lines[0].amplitude - kAmplitude) / lines[0].amplitude_sd, 2) / kSeries;
    frequency_nees +=
        std::pow((lines[0].frequency_hz - kFrequency_hz) / lines[0].frequency_sd_hz, 2) / kSeries;
  }
  // 60 draws of a right sd: 0.6 to 1.5 but for one in a thousand; a bound may be missed by half as much
  // again.
  EXPECT_GT(amplitude_nees, 0.5);
  EXPECT_LT(amplitude_nees, 2.0);
  EXPECT_GT(frequency_nees, 0.3);
  EXPECT_LT(frequency_nees, 3.0);
}

TEST(Lines, ContributeTheWaveletVarianceOfASinusoid) {
  std::vector<double> x(50'000, 0.0);
  add_line(x, 17.77, 0.3);
  Line line;
  line.frequency_hz = 17.77;
  line.amplitude = 0.3;
  const auto wv = haar_wavelet_variance(x).value();
  for (int level = 1; level <= 6; ++level) {
    const double observed = wv.levels[static_cast<std::size_t>(level - 1)].value;
    EXPECT_NEAR(line_wv(line, kLineRate_hz, level), observed, 2e-3 * observed) << level;
  }
}

TEST(Lines, NoiseAloneRarelyHasOne) {
  int found = 0;
  constexpr int kSeries = 200;
  for (unsigned seed = 1; seed <= kSeries; ++seed) {
    const auto x = noise_of(40'000, seed);
    LineOptions options;
    options.false_alarm = 0.02;
    found += find_lines(x, all_valid(x.size()), options).empty() ? 0 : 1;
  }
  // Four expected; eleven or more have a chance below 0.5 %.
  EXPECT_LT(found, 11);
}

struct SlowNoise {
  const char* name;
  double markov_sd;
  double time_constant_s;
  double walk_sd;  ///< of a step
};

class SlowSpectrum : public testing::TestWithParam<SlowNoise> {
 protected:
  static std::vector<double> draw(std::size_t n, unsigned seed) {
    const SlowNoise& noise = GetParam();
    std::mt19937_64 random(seed);
    std::normal_distribution<double> normal;
    const double phi = std::exp(-1.0 / (noise.time_constant_s * kLineRate_hz));
    std::vector<double> x(n);
    double markov = noise.markov_sd * normal(random);
    double walk = 0.0;
    for (double& value : x) {
      markov = phi * markov + noise.markov_sd * std::sqrt(1.0 - phi * phi) * normal(random);
      value = normal(random) + markov + (walk += noise.walk_sd * normal(random));
    }
    return x;
  }
};

TEST_P(SlowSpectrum, RarelyHasALineDownToATwentiethOfAHertz) {
  int found = 0;
  constexpr int kSeries = 40;
  for (unsigned seed = 1; seed <= kSeries; ++seed) {
    const auto x = draw(300'000, seed);
    LineOptions options;
    options.rate_hz = kLineRate_hz;
    options.false_alarm = 0.02;
    found += find_lines(x, all_valid(x.size()), options).empty() ? 0 : 1;
  }
  // One expected at most; five or more have a chance of 1e-3.
  EXPECT_LT(found, 5);
}

TEST_P(SlowSpectrum, HidesNoLineThatStandsOutOfIt) {
  for (const double frequency_hz : {0.062, 0.13, 0.27, 0.565, 1.69}) {
    auto x = draw(600'000, 77);
    std::mt19937_64 random(5);
    std::vector<std::uint8_t> mask(x.size());
    for (auto& there : mask) there = std::uniform_real_distribution(0.0, 1.0)(random) < 0.99 ? 1 : 0;
    add_line(x, frequency_hz, 0.8);
    const auto lines = find_lines(x, mask, {});
    ASSERT_EQ(lines.size(), 1U) << frequency_hz;
    EXPECT_NEAR(lines[0].frequency_hz, frequency_hz,
                0.2 * kLineRate_hz / static_cast<double>(lines[0].segment));
    EXPECT_NEAR(lines[0].amplitude, 0.8, 0.08) << frequency_hz;
  }
}

INSTANTIATE_TEST_SUITE_P(Noises, SlowSpectrum,
                         testing::Values(SlowNoise{"Markov1s", 0.7, 1.0, 0.0},
                                         SlowNoise{"Markov10s", 0.5, 10.0, 0.0},
                                         SlowNoise{"Walk", 0.0, 1.0, 0.005},
                                         SlowNoise{"All", 0.5, 3.0, 0.002}),
                         [](const auto& noise) { return std::string(noise.param.name); });

// Single samples are lost on a serial line, and a drive's stretches have holes.
TEST(Lines, OfARecordWithMissingSamplesAreFoundAndTakenOut) {
  const auto clean = noise_of(400'000, 11);
  auto x = clean;
  add_line(x, 0.4, 0.5);
  add_line(x, 21.3, 1.0);
  std::mt19937_64 random(12);
  std::vector<std::uint8_t> mask(x.size());
  for (auto& there : mask) there = std::uniform_real_distribution(0.0, 1.0)(random) < 0.95 ? 1 : 0;
  std::fill(mask.begin() + 50'000, mask.begin() + 56'000, std::uint8_t{0});
  auto lines = find_lines(x, mask, {});
  ASSERT_EQ(lines.size(), 2U);
  EXPECT_NEAR(lines[0].frequency_hz, 21.3, 0.003);
  EXPECT_NEAR(lines[0].amplitude, 1.0, 0.03);
  EXPECT_NEAR(lines[1].frequency_hz, 0.4, 2e-4);
  EXPECT_NEAR(lines[1].amplitude, 0.5, 0.05);
  remove_lines(x, mask, lines, kLineRate_hz);
  WvOptions options;
  options.mask = mask;
  const auto after = haar_wavelet_variance(x, options).value();
  const auto truth = haar_wavelet_variance(clean, options).value();
  for (std::size_t j = 0; j < 11; ++j)
    EXPECT_NEAR(after.levels[j].value, truth.levels[j].value, 0.03 * truth.levels[j].value)
        << "level " << j + 1;
}

TEST(Lines, ABroadPeakIsNoLine) {
  // A resonance of 20 Hz, 1 Hz wide: an AR(2) process.
  std::mt19937 random(7);
  std::normal_distribution<double> normal;
  const double r = std::exp(-std::numbers::pi * 1.0 / kLineRate_hz);
  const double a1 = 2.0 * r * std::cos(2.0 * std::numbers::pi * 20.0 / kLineRate_hz);
  std::vector<double> x(120'000);
  double y1 = 0.0;
  double y2 = 0.0;
  for (double& value : x) {
    const double y = a1 * y1 - r * r * y2 + 0.2 * normal(random);
    y2 = y1;
    y1 = y;
    value = y + normal(random);
  }
  EXPECT_TRUE(find_lines(x, all_valid(x.size()), {}).empty());
}

TEST(Lines, TakenOutTheyLeaveTheWaveletVarianceOfTheNoise) {
  const auto clean = noise_of(120'000, 3);
  auto x = clean;
  add_line(x, 23.4, 1.0);
  const auto lines = find_lines(x, all_valid(x.size()), {});
  ASSERT_EQ(lines.size(), 1u);
  const auto before = haar_wavelet_variance(x).value();
  remove_lines(x, all_valid(x.size()), lines, kLineRate_hz);
  const auto after = haar_wavelet_variance(x).value();
  const auto truth = haar_wavelet_variance(clean).value();
  EXPECT_GT(before.levels[1].value, 1.3 * truth.levels[1].value) << "the line shows";
  for (std::size_t j = 0; j < 8; ++j)
    EXPECT_NEAR(after.levels[j].value, truth.levels[j].value, 0.01 * truth.levels[j].value)
        << "level " << j + 1;
}

TEST(Lines, WhoIsThereIsCountedFromAndToEveryPlace) {
  for (const std::size_t n : {63U, 64U, 65U, 200U}) {
    std::vector<double> x(n, 1.0);
    auto mask = all_valid(n);
    for (std::size_t i = 5; i < n; i += 7) mask[i] = 0;
    x[n - 2] = std::nan("");
    const Present present(x, mask);
    for (std::size_t begin = 0; begin <= n; ++begin) {
      std::size_t count = 0;
      for (std::size_t end = begin; end <= n; ++end) {
        EXPECT_EQ(present.count(begin, end), count) << begin << " to " << end << " of " << n;
        if (end == n) break;
        const bool is_there = mask[end] != 0 && std::isfinite(x[end]);
        EXPECT_EQ(present.at(end), is_there) << end << " of " << n;
        count += is_there ? 1 : 0;
      }
    }
  }
}

TEST(Lines, ASignalShorterThanASegmentHasNone) {
  auto x = noise_of(4000, 1);
  add_line(x, 20.0, 3.0);
  EXPECT_TRUE(find_lines(x, all_valid(x.size()), {}).empty());
}

/// The variance of one level, mean over records: of noise, of the same with a line that was taken out, and of that
/// with what was left and taken put right.
struct LevelMeans {
  double noise = 0.0;
  double without = 0.0;
  double put_right = 0.0;
};

/// @param wander_rad  sd of the phase's step from sample to sample
LevelMeans means_about_a_line(int level, double frequency_hz, double amplitude, double wander_rad,
                              int records) {
  LevelMeans means;
  for (int record = 0; record < records; ++record) {
    auto x = noise_of(200'000, 900U + static_cast<unsigned>(record));
    const auto at = static_cast<std::size_t>(level - 1);
    means.noise += haar_wavelet_variance(x).value().levels[at].value / records;
    std::mt19937 random(70U + static_cast<unsigned>(record));
    std::normal_distribution<double> normal;
    double phase = 0.0;
    for (double& value : x) {
      phase += 2.0 * std::numbers::pi * frequency_hz / kLineRate_hz + wander_rad * normal(random);
      value += amplitude * std::sin(phase);
    }
    const auto mask = all_valid(x.size());
    const auto lines = find_lines(x, mask, {});
    EXPECT_FALSE(lines.empty()) << record;
    remove_lines(x, mask, lines, kLineRate_hz);
    auto wv = haar_wavelet_variance(x).value();
    means.without += wv.levels[at].value / records;
    Spectra spectra(x, mask);
    Remainders(spectra, lines, kLineRate_hz).take_out_of(wv, 0.95);
    means.put_right += wv.levels[at].value / records;
  }
  return means;
}

// 0.56 Hz lies in the midst of level 7. A phase that walks at random has a spectrum whose skirts have no end: most of
// what a block leaves is found.
TEST(Lines, OneThatWandersLeavesLittleInTheWaveletVariance) {
  for (const double wander_rad : {1.5e-3, 2.5e-3, 3.5e-3}) {
    const LevelMeans means = means_about_a_line(7, 0.56, 1.0, wander_rad, 40);
    EXPECT_GT(means.without, 1.01 * means.noise) << wander_rad;
    EXPECT_NEAR(means.put_right, means.noise, 0.4 * (means.without - means.noise)) << wander_rad;
  }
}

TEST(Lines, OneThatStandsStillTakesNoNoiseAlong) {
  const LevelMeans means = means_about_a_line(7, 0.56, 1.0, 0.0, 40);
  EXPECT_LT(means.without, 0.997 * means.noise);
  EXPECT_NEAR(means.put_right, means.noise, 0.002 * means.noise);
}

TEST(Lines, RemaindersAreTakenOutOfTheAllanDeviationToo) {
  auto x = noise_of(200'000, 5);
  const auto mask = all_valid(x.size());
  add_line(x, 0.56, 1.0);
  const auto lines = find_lines(x, mask, {});
  ASSERT_EQ(lines.size(), 1U);
  remove_lines(x, mask, lines, kLineRate_hz);
  Spectra spectra(x, mask);
  const Remainders remainders(spectra, lines, kLineRate_hz);
  auto wv = haar_wavelet_variance(x).value();
  const auto without = allan_deviation(x, wv, kLineRate_hz);
  remainders.take_out_of(wv, 0.95);
  const auto put_right = allan_deviation(x, wv, kLineRate_hz, 4, remainders);
  ASSERT_EQ(put_right.size(), without.size());
  const auto square = [](double value) { return value * value; };
  for (std::size_t i = 0; i < without.size(); ++i) {
    const double remainder = 2.0 * remainders.wv(static_cast<double>(put_right[i].n));
    EXPECT_NEAR(square(put_right[i].deviation), square(without[i].deviation) - remainder, 1e-12) << i;
  }
  // Between the levels, too.
  EXPECT_LT(remainders.wv(76.0), 0.0);
  EXPECT_GT(std::count_if(without.begin(), without.end(),
                          [](const AllanPoint& point) { return !std::has_single_bit(point.n); }),
            10);
}

// Segments of two lengths tell of the same bins: together they tell what one does, not the sum of both.
TEST(Lines, TwoThatShareBinsArePutRightOnce) {
  auto x = noise_of(200'000, 8);
  const auto mask = all_valid(x.size());
  Line near;
  near.frequency_hz = 1.10;
  near.segment = 4096;
  Line same = near;
  same.segment = 4 * near.segment;
  remove_lines(x, mask, {near}, kLineRate_hz);
  Spectra spectra(x, mask);
  const double twice = Remainders(spectra, {near, same}, kLineRate_hz).wv(32.0);
  const double once = Remainders(spectra, {same}, kLineRate_hz).wv(32.0);
  const double coarse = Remainders(spectra, {near}, kLineRate_hz).wv(32.0);
  ASSERT_LT(once, 0.0);
  ASSERT_LT(coarse, 0.0);
  EXPECT_NEAR(twice, coarse, 0.05 * std::abs(coarse));
  EXPECT_EQ(Remainders(spectra, {near, near}, kLineRate_hz).wv(32.0), coarse);
}

TEST(Lines, NoLineLeavesNothing) {
  auto x = noise_of(40'000, 6);
  Spectra spectra(x, {});
  const Remainders none(spectra, {}, kLineRate_hz);
  EXPECT_TRUE(none.empty());
  EXPECT_EQ(none.wv(64.0), 0.0);
}

// Means of 48 samples against their neighbours, by the sum over a whole number of periods.
TEST(Lines, ASinusoidsWaveletVarianceAtAnyLength) {
  constexpr double kOmega_rad = 2.0 * std::numbers::pi / 75.0;
  for (const std::size_t n : {std::size_t{1}, std::size_t{3}, std::size_t{48}}) {
    double sum = 0.0;
    for (std::size_t place = 0; place < 75; ++place) {
      double difference = 0.0;
      for (std::size_t i = 0; i < n; ++i) {
        difference += std::sin(kOmega_rad * static_cast<double>(place + n + i)) -
                      std::sin(kOmega_rad * static_cast<double>(place + i));
      }
      const double half_of_means = 0.5 * difference / static_cast<double>(n);
      sum += half_of_means * half_of_means / 75.0;
    }
    EXPECT_NEAR(sinusoid_wv(kOmega_rad, static_cast<double>(n)), sum, 1e-12) << n;
  }
}

}  // namespace
}  // namespace imuscope::noise
