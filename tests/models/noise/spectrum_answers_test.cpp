/// What is seen in a spectrum, in the tails, and by several signals together, as it was once.

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>
#include <random>
#include <span>
#include <vector>

#include "answer.h"
#include "made_series.h"
#include "models/noise/covariance_table.h"
#include "models/noise/cross_variance.h"
#include "models/noise/lines.h"
#include "models/noise/resonances.h"
#include "models/noise/signal.h"
#include "models/noise/simulated_noise.h"
#include "models/noise/spectrum.h"
#include "models/noise/tails.h"
#include "tests/support/recorded_answer.h"

namespace imuscope::noise::spectrum_answers {
namespace {

using imuscope::test::expect_recorded;
using test::Answer;

constexpr double kRate_hz = 100.0;

void add_sine(std::vector<double>& x, double frequency_hz, double amplitude) {
  for (std::size_t i = 0; i < x.size(); ++i)
    x[i] +=
        amplitude * std::sin(2.0 * std::numbers::pi * frequency_hz / kRate_hz * static_cast<double>(i) + 0.4);
}

/// Noise that falls with frequency, and lines near both ends of the range, close to each other, and weak.
std::vector<double> with_lines(std::size_t n) {
  std::mt19937_64 random(31);
  const Model model{{{ProcessKind::kWhiteNoise, 1.0, {}}, {ProcessKind::kGaussMarkov, 2.0, {0.02, 0.0}}}};
  auto x = simulated_noise(model, n, random);
  add_sine(x, 0.11, 0.9);
  add_sine(x, 0.61, 0.7);
  add_sine(x, 7.32, 0.4);
  add_sine(x, 7.55, 0.5);
  add_sine(x, 21.0, 0.15);
  add_sine(x, 33.3, 0.09);
  add_sine(x, 49.6, 0.5);
  return x;
}

std::vector<std::uint8_t> with_holes(std::size_t n) {
  std::vector<std::uint8_t> mask(n, 1);
  for (std::size_t i = 0; i < n; ++i) {
    if (i % 83 == 5 || (i % 9000 >= 4000 && i % 9000 < 4100) || (i >= 20'000 && i < 23'000)) mask[i] = 0;
  }
  return mask;
}

void add_lines(Answer& answer, const std::vector<Line>& lines) {
  for (const Line& line : lines) {
    answer.line(line.frequency_hz, line.frequency_sd_hz, line.amplitude, line.amplitude_sd,
                line.share_of_variance, line.p_value, line.segment);
    answer.line(in_words(line, "m/s^2"), line_wv(line, kRate_hz, 1), line_wv(line, kRate_hz, 6));
  }
}

void add_sample_of(Answer& answer, const std::vector<double>& x) {
  for (std::size_t i = 0; i < x.size(); i += 1777) answer.line(i, x[i]);
  answer.line("squares", std::inner_product(x.begin(), x.end(), x.begin(), 0.0));
}

TEST(SpectrumAnswers, Lines) {
  Answer answer;
  const auto x = with_lines(80'000);
  const auto mask = with_holes(x.size());
  LineOptions options;
  options.rate_hz = kRate_hz;
  for (const bool whole : {true, false}) {
    const std::span<const std::uint8_t> there = whole ? std::span<const std::uint8_t>{} : mask;
    options = {};
    options.rate_hz = kRate_hz;
    const auto lines = find_lines(x, there, options);
    add_lines(answer, lines);
    auto rest = x;
    remove_lines(rest, there, lines, kRate_hz);
    add_sample_of(answer, rest);
    options.most_lines = 2;
    options.false_alarm = 1e-9;
    add_lines(answer, find_lines(x, there, options));
    options = {};
    options.rate_hz = kRate_hz;
    options.segment = 1024;
    options.lowest_hz = 0.5;
    add_lines(answer, find_lines(x, there, options));
    options.lowest_hz = 5.0;
    add_lines(answer, find_lines(x, there, options));
  }
  options = {};
  answer.line("too short", find_lines(std::span(x).first(4095), {}, options).size(),
              find_lines(std::span(x).first(4096), {}, options).size());
  auto rest = x;
  remove_lines(rest, {}, {}, kRate_hz);
  EXPECT_EQ(rest, x);
  // A stretch too short for a piece by itself is left as it is.
  std::vector<std::uint8_t> two(x.size(), 0);
  std::fill_n(two.begin() + 100, 1500, std::uint8_t{1});
  std::fill_n(two.begin() + 2'700, 1000, std::uint8_t{1});
  std::fill_n(two.begin() + 5'000, 6'000, std::uint8_t{1});
  Line line;
  line.frequency_hz = 7.55;
  line.segment = 4096;
  remove_lines(rest, two, {line}, kRate_hz);
  for (const std::size_t i :
       {99, 100, 800, 1'599, 1'600, 2'700, 3'200, 3'699, 5'000, 9'000, 9'096, 10'999, 11'000})
    answer.line(i, rest[i] - x[i]);
  expect_recorded("models/noise/lines.txt", answer.text(), 1e-6, 1e-10);
}

TEST(Spectra, MadeInAnyOrderAreThoseOfEachLengthAlone) {
  const auto x = with_lines(80'000);
  const auto mask = with_holes(x.size());
  LineOptions options;
  options.rate_hz = kRate_hz;
  Spectra spectra(x, mask);
  spectra.make(segments_of_lines(spectra, options));
  spectra.make(segments_of_density(spectra), [](std::size_t n, const std::function<void(std::size_t)>& work) {
    for (std::size_t i = n; i > 0; --i) work(i - 1);
  });
  const Present present(x, mask);
  for (const std::size_t length : {256, 1024, 4096, 16'384, 512}) {
    const Spectrum alone = spectrum_of(x, present, length);
    EXPECT_EQ(spectra.of(length).power, alone.power) << length;
    EXPECT_EQ(spectra.of(length).segments, alone.segments) << length;
  }
  const auto shared = find_lines(spectra, options);
  const auto alone = find_lines(x, mask, options);
  ASSERT_EQ(shared.size(), alone.size());
  ASSERT_FALSE(alone.empty());
  for (std::size_t i = 0; i < alone.size(); ++i) {
    EXPECT_EQ(shared[i].frequency_hz, alone[i].frequency_hz);
    EXPECT_EQ(shared[i].amplitude, alone[i].amplitude);
  }
}

TEST(Spectra, NoSpectrumIsAskedForBeyondThoseThatAreNamed) {
  const auto x = with_lines(80'000);
  const LineOptions options;
  const Spectra spectra(x, {});
  EXPECT_EQ(segments_of_lines(spectra, options), (std::vector<std::size_t>{4096, 16'384}));
  EXPECT_EQ(segments_of_density(spectra), (std::vector<std::size_t>{256, 1024, 4096, 16'384, 65'536}));
  EXPECT_TRUE(segments_of_density(Spectra(std::span<const double>(x).first(255), {})).empty());
}

TEST(SpectrumAnswers, NoiseAloneHasNoLines) {
  LineOptions options;
  options.rate_hz = kRate_hz;
  EXPECT_TRUE(find_lines(test::white(40'000, 32), {}, options).empty());
  EXPECT_TRUE(find_lines(std::vector<double>(8'192, 3.0), {}, options).empty());
}

TEST(SpectrumAnswers, Densities) {
  Answer answer;
  const auto x = with_lines(12'000);
  auto mask = with_holes(x.size());
  const auto add_density = [&](const std::vector<DensityPoint>& points) {
    for (const DensityPoint& p : points) answer.line(p.frequency_hz, p.density, p.ci_low, p.ci_high);
  };
  for (const bool whole : {true, false}) {
    const std::span<const std::uint8_t> there = whole ? std::span<const std::uint8_t>{} : mask;
    const Present present(x, there);
    test::add_places(answer, "runs", present.runs());
    answer.line(present.at(5), present.at(6), present.count(0, 100), present.count(4'000, 4'100));
    for (const std::size_t length : {64, 256, 1000, 8'000, 12'000, 12'001})
      answer.line("segments of", length, present.segments(length).size());
    answer.line(present.segments(1024));
    const Spectrum spectrum = spectrum_of(x, present, 64);
    answer.line(spectrum.length, spectrum.segments);
    for (std::size_t k = 0; k < spectrum.power.size(); ++k)
      answer.line(k, spectrum.power[k], density_at(spectrum, k, kRate_hz));
    Spectra spectra(x, there);
    add_density(density_of(spectra, kRate_hz));
    add_density(density_of(spectra, kRate_hz, 0.8, 2, 64));
    Spectra of_few{std::span(x).first(200), there.first(std::min<std::size_t>(there.size(), 200))};
    answer.line("of too few", density_of(of_few, kRate_hz).size());
  }
  answer.line(degrees_of_freedom(1.0), degrees_of_freedom(2.0), degrees_of_freedom(100.0));
  answer.line("none", spectrum_of(std::span(x).first(10), Present(std::span(x).first(10), {}), 64).power);
  expect_recorded("models/noise/densities.txt", answer.text());
}

void add_resonances(Answer& answer, const std::vector<double>& x, std::span<const std::uint8_t> mask,
                    double false_alarm) {
  Spectra spectra(x, mask);
  for (const Resonance& r : find_resonances(spectra, kRate_hz, false_alarm)) {
    answer.line(r.frequency_hz, r.width_hz, r.rms, r.height, r.p_value);
    answer.line(in_words(r, "rad/s"));
  }
  answer.line("low pass", low_pass_hz(spectra, kRate_hz));
}

TEST(SpectrumAnswers, ResonancesAndTheEndOfTheBand) {
  Answer answer;
  std::mt19937_64 random(33);
  const Model model{{{ProcessKind::kWhiteNoise, 1.0, {}},
                     {ProcessKind::kResonance, 0.5, {0.08, 1.3}},
                     {ProcessKind::kResonance, 0.1, {0.05, 2.2}},
                     {ProcessKind::kGaussMarkov, 1.0, {0.05, 0.0}}}};
  const auto x = simulated_noise(model, 60'000, random);
  const auto mask = with_holes(x.size());
  add_resonances(answer, x, {}, 1e-3);
  add_resonances(answer, x, mask, 1e-3);
  add_resonances(answer, x, {}, 1e-40);
  auto filtered = test::white(30'000, 34);
  for (int pass = 0; pass < 3; ++pass) {
    for (std::size_t i = filtered.size() - 1; i > 0; --i) filtered[i] = 0.5 * (filtered[i] + filtered[i - 1]);
  }
  add_resonances(answer, filtered, {}, 1e-3);
  // From so many segments on: 20 of 512 samples that overlap by half.
  for (const std::size_t n : {511, 512, 5'375, 5'376})
    add_resonances(answer, {x.begin(), x.begin() + static_cast<std::ptrdiff_t>(n)}, {}, 1e-3);
  for (const std::size_t n : {511, 512, 5'375, 5'376})
    add_resonances(answer, {filtered.begin(), filtered.begin() + static_cast<std::ptrdiff_t>(n)}, {}, 1e-3);
  expect_recorded("models/noise/resonances.txt", answer.text(), 1e-6, 1e-300);
}

void add_tails(Answer& answer, const std::optional<TailTest>& test) {
  answer.line("tails", test.has_value());
  if (test) answer.line(test->statistic, test->dof, test->p_value, test->level, test->excess);
  answer.line(spike_warning(test, kRate_hz));
}

TEST(SpectrumAnswers, Tails) {
  Answer answer;
  auto x = test::white(20'000, 35);
  const Model white{{{ProcessKind::kWhiteNoise, 1.0, {}}}};
  const Model quantized{{{ProcessKind::kWhiteNoise, 1.0, {}}, {ProcessKind::kQuantization, 0.06, {}}}};
  const Model coarse{{{ProcessKind::kQuantization, 1.0, {}}}};
  add_tails(answer, test_tails(x, {}, white));
  add_tails(answer, test_tails(x, {}, quantized));
  add_tails(answer, test_tails(x, {}, coarse));
  for (std::size_t i = 7; i < x.size(); i += 131) x[i] *= 5.0;
  add_tails(answer, test_tails(x, {}, white));
  const auto mask = with_holes(x.size());
  WvOptions options;
  options.mask = mask;
  add_tails(answer, test_tails(x, options, white));
  for (std::size_t i = 7; i < x.size(); i += 131) x[i] *= 20.0;
  add_tails(answer, test_tails(x, {}, white));
  add_tails(answer, test_tails(std::span(x).first(9), {}, white));
  add_tails(answer, test_tails(std::span(x).first(1), {}, white));
  expect_recorded("models/noise/tails.txt", answer.text(), 1e-6, 1e-300);
}

TEST(SpectrumAnswers, ExcerptsForTheTails) {
  Answer answer;
  std::vector<double> x(700'000);
  std::iota(x.begin(), x.end(), 0.0);
  std::vector<std::uint8_t> mask(x.size(), 1);
  mask[3] = 0;
  for (const std::size_t n : {100UL, 8'192UL, 262'144UL, 262'145UL, 524'288UL, 524'289UL, 700'000UL}) {
    const TailExcerpt excerpt = tail_excerpt(std::span(x).first(n), std::span(mask).first(n));
    const TailExcerpt whole = tail_excerpt(std::span(x).first(n), {});
    EXPECT_EQ(excerpt.values, whole.values);
    answer.line(n, excerpt.values.size(), std::accumulate(excerpt.values.begin(), excerpt.values.end(), 0.0),
                std::accumulate(excerpt.mask.begin(), excerpt.mask.end(), 0), excerpt.values.back(),
                std::accumulate(whole.mask.begin(), whole.mask.end(), 0));
  }
  expect_recorded("models/noise/excerpts.txt", answer.text());
}

TEST(SpectrumAnswers, SignalsAtFirstSight) {
  Answer answer;
  auto x = with_lines(9'000);
  auto mask = with_holes(x.size());
  x[77] = std::numeric_limits<double>::quiet_NaN();
  mask[77] = 0;
  WvOptions options;
  const auto add_look = [&](Lines lines) {
    const auto look = look_at_signal(x, options, kRate_hz, lines);
    if (!look) {
      answer.line(look.error().text());
      return;
    }
    add_lines(answer, look->lines);
    answer.line(look->spikes);
    test::add_wv(answer, look->wv);
  };
  add_look(Lines::kStay);
  options.mask = mask;
  add_look(Lines::kStay);
  add_look(Lines::kTakenOut);
  options.mask = {};
  options.nan_is_gap = true;
  for (std::size_t i = 100; i < x.size(); i += 301) x[i] += 12.0;
  add_look(Lines::kTakenOut);
  options.robust = RobustOptions{};
  add_look(Lines::kTakenOut);
  expect_recorded("models/noise/first_sight.txt", answer.text(), 1e-5);
}

/// Three signals with a part in common, the third scaled and correlated otherwise.
std::vector<std::vector<double>> three_signals(std::size_t n) {
  const auto common = test::white(n, 36);
  std::vector<std::vector<double>> out;
  for (unsigned k = 0; k < 3; ++k) {
    out.push_back(test::white(n, 40 + k));
    double walk = 0.0;
    for (std::size_t i = 0; i < n; ++i) {
      walk += 0.02 * (k + 1.0) * out[k][i];
      out[k][i] = (k == 2 ? 1000.0 : 1.0) * (out[k][i] + 0.7 * (k + 1.0) * common[i] + walk);
    }
  }
  return out;
}

void add_estimate(Answer& answer, std::string_view what, const Estimate& e) {
  answer.line(what, e.value, e.ci_low, e.ci_high);
}

void add_cross(Answer& answer, const std::vector<CrossLevel>& levels, double confidence) {
  for (const CrossLevel& level : levels) {
    answer.line(level.level, level.tau_samples, level.dof, level.covariance);
    add_estimate(answer, "common", common_of(level, confidence));
    for (Eigen::Index i = 0; i < level.covariance.rows(); ++i) {
      add_estimate(answer, "own", own_of(level, i, confidence));
      for (Eigen::Index k = 0; k < i; ++k) {
        add_estimate(answer, "pair", cross_covariance_of(level, i, k, confidence));
        const Coherence c = coherence_of(level, i, k, confidence);
        answer.line("coherence", c.value, c.ci_low, c.ci_high, c.p_value);
      }
    }
  }
  const Eigen::VectorXd weights = quietest_weights(levels);
  answer.line("weights", weights, weighted_variance(levels.front(), weights));
}

TEST(SpectrumAnswers, SeveralSignalsTogether) {
  Answer answer;
  auto signals = three_signals(2'000);
  const std::vector<std::span<const double>> spans(signals.begin(), signals.end());
  std::vector<FitResult> fits;
  for (const auto& signal : signals)
    fits.push_back(
        fit(haar_wavelet_variance(signal).value(), parse_model("WN+RW").value(), kRate_hz, {.levels = 8})
            .value());
  add_cross(answer, cross_variance(spans, {}, fits).value(), 0.95);
  CovarianceTables tables;
  add_cross(answer, cross_variance(std::span(spans).first(2), {}, fits, &tables).value(), 0.8);
  auto mask = with_holes(2'000);
  signals[1][999] = std::numeric_limits<double>::infinity();
  add_cross(answer, cross_variance(spans, mask, fits).value(), 0.95);
  mask.pop_back();
  answer.line(cross_variance(spans, mask, fits).error().text());
  const std::vector<std::span<const double>> uneven{spans[0], spans[1].first(1'999)};
  answer.line(cross_variance(uneven, {}, fits).error().text());
  const std::vector<std::uint8_t> none(2'000, 0);
  answer.line(cross_variance(spans, none, fits).error().text());
  // The same signal twice, and one that stands still.
  const std::vector<double> still(2'000, 1.0);
  add_cross(answer, cross_variance(std::vector{spans[0], spans[0]}, {}, fits).value(), 0.95);
  add_cross(answer, cross_variance(std::vector{spans[0], std::span<const double>(still)}, {}, fits).value(),
            0.95);
  expect_recorded("models/noise/cross.txt", answer.text(), 1e-5, 1e-9);
}

TEST(SpectrumAnswers, CoherenceOfFewSquares) {
  Answer answer;
  CrossLevel level;
  level.level = 3;
  for (const double dof : {0.7, 1.0, 1.9, 2.0, 2.1, 30.0}) {
    for (const double c : {-1.2, -1.0, -0.4, 0.0, 0.9, 1.0}) {
      level.dof = dof;
      level.covariance = (Eigen::Matrix2d() << 4.0, 6.0 * c, 6.0 * c, 9.0).finished();
      const Coherence of = coherence_of(level, 0, 1, 0.9);
      answer.line(dof, c, of.value, of.ci_low, of.ci_high, of.p_value);
    }
  }
  level.covariance.setZero();
  const Coherence of = coherence_of(level, 0, 1, 0.9);
  answer.line("nothing", of.value, of.ci_low, of.ci_high, of.p_value);
  expect_recorded("models/noise/coherence.txt", answer.text());
}

}  // namespace
}  // namespace imuscope::noise::spectrum_answers
