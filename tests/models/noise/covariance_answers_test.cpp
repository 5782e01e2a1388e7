/// Covariances of wavelet variances in closed form, and what tables tell of them, as they were once.

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "answer.h"
#include "made_series.h"
#include "models/noise/covariance_corrections.h"
#include "models/noise/covariance_table.h"
#include "models/noise/cross_covariance.h"
#include "models/noise/fixed_point.h"
#include "models/noise/pair_counts.h"
#include "models/noise/wv_covariance.h"
#include "tests/support/recorded_answer.h"

namespace imuscope::noise::covariance_answers {
namespace {

using imuscope::test::expect_recorded;
using test::Answer;

/// One process each, slow and fast ones, and some together.
const std::vector<Model> kModels{
    {{{ProcessKind::kWhiteNoise, 1.0, {}}}},
    {{{ProcessKind::kQuantization, 1.0, {}}}},
    {{{ProcessKind::kRandomWalk, 1.0, {}}}},
    {{{ProcessKind::kRamp, 1e-4, {}}, {ProcessKind::kWhiteNoise, 1.0, {}}}},
    {{{ProcessKind::kGaussMarkov, 1.0, {1e-4, 0.0}}}},
    {{{ProcessKind::kGaussMarkov, 1.0, {0.049, 0.0}}}},
    {{{ProcessKind::kGaussMarkov, 1.0, {0.2, 0.0}}}},
    {{{ProcessKind::kGaussMarkov, 1.0, {3.0, 0.0}}}},
    {{{ProcessKind::kGaussMarkov, 1.0, {45.0, 0.0}}}},
    {{{ProcessKind::kMa1, 1.0, {0.7, 0.0}}}},
    {{{ProcessKind::kMa1, 1.0, {-0.6, 0.0}}}},
    {{{ProcessKind::kArma11, 1.0, {0.9, -0.4}}}},
    {{{ProcessKind::kArma11, 1.0, {-0.8, 0.3}}}},
    {{{ProcessKind::kArma11, 1.0, {5e-7, 0.3}}}},
    {{{ProcessKind::kResonance, 1.0, {0.02, 0.9}}}},
    {{{ProcessKind::kResonance, 1.0, {0.4, 0.2}}, {ProcessKind::kWhiteNoise, 0.5, {}}}},
    {{{ProcessKind::kSinusoid, 0.5, {0.3, 0.0}},
      {ProcessKind::kWhiteNoise, 1.0, {}},
      {ProcessKind::kQuantization, 0.4, {}},
      {ProcessKind::kResonance, 0.7, {0.3, 1.0}},
      {ProcessKind::kGaussMarkov, 0.6, {0.05, 0.0}},
      {ProcessKind::kRandomWalk, 1e-3, {}}}},
    {{{ProcessKind::kFlicker, 1.0, {}}}},
    {{{ProcessKind::kPowerLaw, 1.0, {0.6, 0.0}}, {ProcessKind::kWhiteNoise, 0.0, {}}}},
    {{{ProcessKind::kQuantization, 0.3, {}},
      {ProcessKind::kWhiteNoise, 1.0, {}},
      {ProcessKind::kGaussMarkov, 0.5, {0.01, 0.0}},
      {ProcessKind::kGaussMarkov, 0.4, {0.7, 0.0}},
      {ProcessKind::kRandomWalk, 1e-4, {}},
      {ProcessKind::kRamp, 1e-7, {}}}}};

WaveletVariance whole(std::size_t n) { return haar_wavelet_variance(test::white(n, 51)).value(); }

/// Single samples and stretches are missing; of the first kind more than the places that are kept.
WaveletVariance with_holes(std::size_t n, bool robust) {
  std::vector<std::uint8_t> mask(n, 1);
  for (std::size_t i = 0; i < n; ++i)
    if (i % 40 == 11 || (i >= n / 3 && i < n / 3 + 70)) mask[i] = 0;
  WvOptions options;
  options.mask = mask;
  options.levels = 7;
  if (robust) options.robust = RobustOptions{};
  return haar_wavelet_variance(test::white(n, 52), options).value();
}

WaveletVariance two_runs(std::size_t n) {
  std::vector<std::uint8_t> mask(n, 1);
  for (std::size_t i = n / 2; i < n / 2 + 50; ++i) mask[i] = 0;
  WvOptions options;
  options.mask = mask;
  return haar_wavelet_variance(test::white(n, 53), options).value();
}

/// The lower triangle, a row a line.
void add_triangle(Answer& answer, const Eigen::MatrixXd& v) {
  EXPECT_TRUE(v.isApprox(v.transpose(), 1e-12));
  for (Eigen::Index i = 0; i < v.rows(); ++i) answer.line(v.row(i).head(i + 1));
}

/// The same by variance and what the levels have in common with the first, the next, and the third beside it.
void add_bands(Answer& answer, const Eigen::MatrixXd& v) {
  EXPECT_TRUE(v.isApprox(v.transpose(), 1e-12));
  for (const Eigen::Index off : {0, 1, 3}) answer.line(v.diagonal(off));
  answer.line(v.col(0));
}

TEST(CovarianceAnswers, OfWholeRecords) {
  Answer answer;
  const auto wv = whole(3'000);
  auto unknown = wv;
  unknown.segments.clear();
  for (const Model& model : kModels) {
    answer.line(component_names(model));
    add_bands(answer, wv_covariance(model, wv, 9));
    EXPECT_TRUE(wv_covariance(model, unknown, 9).isApprox(wv_covariance(model, wv, 9), 1e-9));
  }
  expect_recorded("models/noise/covariance_whole.txt", answer.text(), 1e-6, 1e-15);
}

TEST(CovarianceAnswers, OfRecordsWithHoles) {
  Answer answer;
  const auto holes = with_holes(4'000, false);
  const auto runs = two_runs(1'500);
  for (const Model& model : kModels) {
    answer.line(component_names(model));
    add_bands(answer, wv_covariance(model, holes, 7));
    add_bands(answer, wv_covariance(model, runs, 6));
  }
  expect_recorded("models/noise/covariance_holes.txt", answer.text(), 1e-6, 1e-15);
}

TEST(CovarianceAnswers, OfRobustOnes) {
  Answer answer;
  auto wv = whole(2'000);
  wv.efficiency = 0.6;
  const auto holes = with_holes(2'000, true);
  for (const std::size_t i : {0, 2, 5, 6, 11, 14, 16, 17, 19}) {
    answer.line(component_names(kModels[i]));
    add_bands(answer, wv_covariance(kModels[i], wv, 8));
    add_bands(answer, wv_covariance(kModels[i], holes, 6));
    add_bands(answer, robust_loss(kModels[i], wv, 6));
  }
  expect_recorded("models/noise/covariance_robust.txt", answer.text(), 1e-6, 1e-15);
}

TEST(CovarianceAnswers, OfCoefficients) {
  Answer answer;
  for (const Model& model : kModels) {
    answer.line(component_names(model));
    for (const auto& [j, k] : {std::pair{1, 1}, {1, 4}, {5, 3}}) {
      for (const double lag : {-40.0, -7.0, -1.0, 0.0, 1.0, 8.0, 14.0, 30.0, 100.0})
        answer.line(j, k, lag, coefficient_covariance(model, j, k, lag));
    }
  }
  expect_recorded("models/noise/covariance_coefficients.txt", answer.text(), 1e-6, 1e-15);
}

/// Between break points the prepared form is the plain one.
TEST(CovarianceAnswers, InsideIsWhatEveryLagHas) {
  for (const Model& model : kModels) {
    const Parts parts = parts_of(model);
    for (const auto& [n_j, n_k] : {std::pair{1.0, 8.0}, {16.0, 16.0}, {64.0, 4.0}}) {
      CrossCovariance c(parts, n_j, n_k);
      std::vector<double> lags;
      const double centre = n_k - n_j;
      for (const double b : breaks_of(n_j, n_k)) {
        lags.push_back(centre + b);
        lags.push_back(centre - b);
      }
      std::sort(lags.begin(), lags.end());
      lags.erase(std::unique(lags.begin(), lags.end()), lags.end());
      lags.insert(lags.begin(), lags.front() - 50.0);
      lags.push_back(lags.back() + 50.0);
      const double size = CrossCovariance(parts, n_j, n_j)(0.0) + CrossCovariance(parts, n_k, n_k)(0.0);
      for (std::size_t i = 0; i + 1 < lags.size(); ++i) {
        c.enter(lags[i], lags[i + 1]);
        for (double h = lags[i] + 1.0; h < lags[i + 1]; h += 1.0)
          ASSERT_NEAR(c.inside(h), c(h), 1e-10 * size) << n_j << ' ' << n_k << " at " << h;
      }
    }
  }
}

TEST(CovarianceAnswers, FromATable) {
  Answer answer;
  const auto wv = whole(3'000);
  const CovarianceTable table(wv, 9);
  for (const Model& model : kModels) {
    answer.line(component_names(model));
    const Eigen::MatrixXd v = table.of(model, wv);
    add_bands(answer, v);
    // Asked again, it says the same.
    EXPECT_EQ(table.of(model, wv), v);
  }
  expect_recorded("models/noise/covariance_table.txt", answer.text(), 1e-6, 1e-15);
}

TEST(CovarianceAnswers, WhichRecordsATableServes) {
  const auto wv = whole(3'000);
  const CovarianceTable table(wv, 9);
  EXPECT_TRUE(CovarianceTable::serves(wv));
  EXPECT_TRUE(table.fits(wv, 9));
  EXPECT_FALSE(table.fits(wv, 8));
  EXPECT_FALSE(table.fits(whole(3'001), 9));
  EXPECT_FALSE(table.fits(whole(5'000), 9));
  EXPECT_TRUE(CovarianceTable::serves(two_runs(1'500)));
  EXPECT_FALSE(table.fits(two_runs(1'500), 9));
  EXPECT_FALSE(CovarianceTable::serves({}));
  auto changed = wv;
  changed.levels[4].level = 6;
  EXPECT_FALSE(table.fits(changed, 9));
  changed = wv;
  changed.levels.back().places.push_back({0, 1});
  EXPECT_FALSE(table.fits(changed, 9));
  changed = wv;
  changed.efficiency = 0.6;
  EXPECT_FALSE(CovarianceTable::serves(changed));
  changed = wv;
  changed.segments.clear();
  EXPECT_FALSE(table.fits(changed, 9));
  CovarianceTables tables;
  const auto first = tables.of(wv, 9);
  ASSERT_TRUE(first);
  EXPECT_EQ(tables.of(wv, 9), first);
  EXPECT_NE(tables.of(wv, 8), first);
  EXPECT_EQ(tables.of(wv, 9), first);
  const auto of_runs = tables.of(two_runs(1'500), 6);
  ASSERT_TRUE(of_runs);
  EXPECT_NE(of_runs, first);
  EXPECT_EQ(tables.of(two_runs(1'500), 6), of_runs);
}

TEST(CovarianceAnswers, Parts) {
  Answer answer;
  for (const Model& model : kModels) {
    const class Parts parts = parts_of(model);
    answer.line(component_names(model), "white", parts.white, "walk", parts.walk, "quantization",
                parts.quantization, parts.uniform, "ramp", parts.ramp, "sinusoids", parts.sinusoids.size());
    for (const Exponential& e : parts.exponentials)
      answer.line("exponential", e.a, e.variance, e.phi, e.gain, e.linear, e.rest, e.is_approximate);
    for (const Oscillation& o : parts.oscillations)
      answer.line("oscillation", o.rate.real(), o.rate.imag(), o.variance.real(), o.variance.imag(),
                  o.gain.real(), o.gain.imag(), o.linear, rings_for(o), white_from(o));
  }
  for (const double z : {0.0, 1e-8, 1e-3, 0.3, 0.69, 0.7, 0.71, 5.0})
    answer.line("remainder", z, exponential_remainder(z));
  for (const double x : {-0.5, -0.01, 0.0, 0.2, 0.5})
    answer.line("tail", x, exponential_tail(x).even, exponential_tail(x).odd);
  answer.line("breaks", breaks_of(1.0, 1.0), "and", breaks_of(2.0, 16.0), "and", breaks_of(8.0, 4.0));
  expect_recorded("models/noise/covariance_parts.txt", answer.text(), 1e-6, 1e-40);
}

TEST(CovarianceAnswers, Corrections) {
  Answer answer;
  const auto wv = with_holes(2'000, false);
  const auto one = whole(500);
  const auto parts = parts_of(kModels[16]);
  for (std::size_t i = 0; i < 7; ++i) {
    for (std::size_t k = 0; k <= i; k += 2) {
      answer.line(i, k, sinusoid_covariance(parts, wv.levels[i], wv.levels[k]),
                  uniform_correction(0.7, wv.segments, wv.levels[i], wv.levels[k]),
                  uniform_correction(0.7, {}, one.levels[i], one.levels[k]),
                  uniform_correction(0.7, one.segments, one.levels[i], one.levels[k]),
                  white_of_missing(wv.levels[i], wv.levels[k]));
    }
  }
  Eigen::Matrix3d v;
  v << 4.0, 5.9, 0.3, 5.9, 9.0, 0.1, 0.3, 0.1, 1.0;
  add_triangle(answer, bounded_below(v));
  v(0, 1) = v(1, 0) = 1.0;
  EXPECT_EQ(bounded_below(v), v);
  expect_recorded("models/noise/covariance_corrections.txt", answer.text(), 1e-6, 1e-20);
}

TEST(CovarianceAnswers, CountsOfPairs) {
  Answer answer;
  for (const auto& wv : {whole(300), two_runs(300), with_holes(3'000, false)}) {
    for (const auto& [j, k] : {std::pair<std::size_t, std::size_t>{0, 0}, {3, 3}, {4, 2}, {1, 4}, {4, 3}}) {
      const LevelPlaces at_j = places_of(wv, wv.levels[j]);
      const LevelPlaces at_k = places_of(wv, wv.levels[k]);
      answer.line(j, k, at_j.places.size(), at_j.kept, at_j.width, at_j.bears_holes);
      const PairCounts counts(wv.levels[j], wv.levels[k], at_j, at_k);
      answer.line(counts.lowest(), counts.highest());
      for (const double h :
           {-500.0, -120.0, -20.0, -3.0, -1.0, 0.0, 1.0, 2.0, 17.0, 90.0, 155.0, 299.0, 1'200.0})
        answer.line(h, counts(h), counts.at_distance(4.0, std::abs(h)));
      answer.line("kinks", counts.kinks(3.0, 60.0), "far", counts.kinks(0.0, 2000.0).size());
    }
  }
  expect_recorded("models/noise/pair_counts.txt", answer.text());
}

TEST(CovarianceAnswers, MadePositiveDefinite) {
  Answer answer;
  const auto wv = whole(1'000);
  const CovarianceTable table(wv, 8);
  for (const std::size_t i : {0, 4, 13, 19}) {
    add_bands(answer, sampling_covariance(kModels[i], wv, 8));
    add_bands(answer, sampling_covariance(kModels[i], wv, 8, &table));
    const Eigen::MatrixXd v = sampling_covariance(kModels[i], wv, 4);
    const Eigen::MatrixXd w = whitener_of(v);
    EXPECT_TRUE((w * v * w.transpose()).isIdentity(1e-9));
    answer.line(w);
  }
  EXPECT_EQ(whitener_of(-Eigen::Matrix2d::Identity()).size(), 0);
  expect_recorded("models/noise/covariance_sampling.txt", answer.text(), 1e-5, 1e-12);
}

}  // namespace
}  // namespace imuscope::noise::covariance_answers
