/// The wavelet variance of records with missing samples against the truth, by many draws: its mean, and its
/// covariance matrix.

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <random>
#include <string>

#include "models/noise/model.h"
#include "models/noise/wavelet_variance.h"
#include "models/noise/wv_covariance.h"

namespace imuscope::noise {
namespace {

using Mask = std::vector<std::uint8_t>;

/// Single samples lost at random.
Mask drop_outs(std::size_t n, double share, std::mt19937_64& random) {
  Mask mask(n, 1);
  for (auto& m : mask) m = std::bernoulli_distribution(share)(random) ? 0 : 1;
  mask.front() = mask.back() = 1;
  return mask;
}

/// Holes of 5 to 40 samples, some 400 samples apart.
Mask gaps(std::size_t n, std::mt19937_64& random) {
  Mask mask(n, 1);
  std::size_t at = 0;
  while (true) {
    at += 200 + random() % 400;
    const std::size_t length = 5 + random() % 36;
    if (at + length + 1 >= n) return mask;
    std::fill_n(mask.begin() + static_cast<std::ptrdiff_t>(at), length, std::uint8_t{0});
    at += length;
  }
}

struct Truth {
  std::string name;
  Model model;
  double white;
  double quantization;
  double walk;
  double beta;  ///< per sample; 0: no Gauss-Markov process
  double markov;
};

std::vector<double> draw(const Truth& truth, std::size_t n, std::mt19937_64& random) {
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> uniform(-std::sqrt(3.0), std::sqrt(3.0));
  std::vector<double> x(n);
  const double phi = std::exp(-truth.beta);
  double state = std::sqrt(truth.markov) * normal(random);
  double walk = 0.0;
  double before = uniform(random);
  for (double& v : x) {
    const double now = uniform(random);
    v = std::sqrt(truth.white) * normal(random) + std::sqrt(truth.quantization) * (now - before) + walk +
        state;
    before = now;
    walk += std::sqrt(truth.walk) * normal(random);
    state = phi * state + std::sqrt(truth.markov * (1.0 - phi * phi)) * normal(random);
  }
  return x;
}

const std::vector<Truth>& truths() {
  static const std::vector<Truth> all{
      {"WN", {{{ProcessKind::kWhiteNoise, 1.0, {}}}}, 1.0, 0.0, 0.0, 0.0, 0.0},
      {"WN+RW",
       {{{ProcessKind::kWhiteNoise, 1.0, {}}, {ProcessKind::kRandomWalk, 1e-3, {}}}},
       1.0,
       0.0,
       1e-3,
       0.0,
       0.0},
      {"WN+GM",
       {{{ProcessKind::kWhiteNoise, 1.0, {}}, {ProcessKind::kGaussMarkov, 0.3, {0.02, 0}}}},
       1.0,
       0.0,
       0.0,
       0.02,
       0.3},
      {"QN+WN",
       {{{ProcessKind::kQuantization, 1.0, {}}, {ProcessKind::kWhiteNoise, 0.3, {}}}},
       0.3,
       1.0,
       0.0,
       0.0,
       0.0},
  };
  return all;
}

struct Loss {
  std::string name;
  std::function<Mask(std::size_t, std::mt19937_64&)> mask;
};

class MissingSamples : public testing::TestWithParam<int> {};

TEST_P(MissingSamples, LeaveTheWaveletVarianceUnbiasedAndItsCovarianceTold) {
  constexpr std::size_t kSamples = 4096;
  constexpr std::size_t kLevels = 9;
  constexpr int kDraws = 400;
  const std::vector<Loss> losses{
      {"1 % of drop-outs", [](std::size_t n, std::mt19937_64& random) { return drop_outs(n, 0.01, random); }},
      {"5 % of drop-outs", [](std::size_t n, std::mt19937_64& random) { return drop_outs(n, 0.05, random); }},
      {"gaps", [](std::size_t n, std::mt19937_64& random) { return gaps(n, random); }},
  };
  const Truth& truth = truths()[static_cast<std::size_t>(GetParam())];
  for (const Loss& loss : losses) {
    std::mt19937_64 random(11);
    WvOptions options;
    const Mask mask = loss.mask(kSamples, random);
    options.mask = mask;
    std::vector<double> sum(kLevels, 0.0);
    std::vector<double> squares(kLevels, 0.0);
    Eigen::MatrixXd v;
    for (int k = 0; k < kDraws; ++k) {
      const auto wv = haar_wavelet_variance(draw(truth, kSamples, random), options).value();
      ASSERT_GE(wv.levels.size(), kLevels) << loss.name;
      if (k == 0) v = wv_covariance(truth.model, wv, kLevels);
      for (std::size_t j = 0; j < kLevels; ++j) {
        sum[j] += wv.levels[j].value;
        squares[j] += wv.levels[j].value * wv.levels[j].value;
      }
    }
    for (std::size_t j = 0; j < kLevels; ++j) {
      const double mean = sum[j] / kDraws;
      const double variance = squares[j] / kDraws - mean * mean;
      const double expected = model_wv(truth.model, static_cast<int>(j) + 1);
      const double told = v(static_cast<Eigen::Index>(j), static_cast<Eigen::Index>(j));
      EXPECT_NEAR(mean, expected, 3.3 * std::sqrt(variance / kDraws))
          << truth.name << ", " << loss.name << ", level " << j + 1;
      // Of 400 draws a standard deviation is known to 3.5 %. Above level 8 a coefficient stands for an eighth
      // of the record, and which samples of it are missing is no average any more.
      if (j < 8) {
        EXPECT_NEAR(std::sqrt(variance / told), 1.0, 0.17)
            << truth.name << ", " << loss.name << ", level " << j + 1;
      }
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Truths, MissingSamples, testing::Range(0, 4), [](const auto& truth) {
  std::string name = truths()[static_cast<std::size_t>(truth.param)].name;
  name.erase(std::remove(name.begin(), name.end(), '+'), name.end());
  return name;
});

}  // namespace
}  // namespace imuscope::noise
