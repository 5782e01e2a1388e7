#include "models/noise/covariance_table.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "models/noise/wv_covariance.h"

namespace imuscope::noise {
namespace {

/// As of one run of `n` samples.
WaveletVariance record_of(std::uint64_t n, int levels) {
  WaveletVariance wv;
  wv.n_samples = wv.n_valid = n;
  for (int level = 1; level <= levels; ++level) {
    WvLevel l;
    l.level = level;
    l.tau_samples = std::ldexp(1.0, level);
    l.n_coefficients = n - (std::uint64_t{1} << static_cast<unsigned>(level)) + 1;
    l.value = 1.0 / l.tau_samples;
    wv.levels.push_back(l);
  }
  wv.segments = {{0, n}};
  return wv;
}

/// Largest difference of an entry in the sds of its levels.
double distance(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b) {
  const Eigen::VectorXd sd = b.diagonal().cwiseSqrt();
  return (a - b).cwiseQuotient(sd * sd.transpose()).cwiseAbs().maxCoeff();
}

Component gm(double rate, double variance) { return {ProcessKind::kGaussMarkov, variance, {rate, 0.0}}; }

constexpr double kAgree = 1e-3;

TEST(CovarianceTable, AgreesWithTheSumForEachModelByItself) {
  const Component wn{ProcessKind::kWhiteNoise, 1.0, {}};
  const Component qn{ProcessKind::kQuantization, 2.0, {}};
  const Component rw{ProcessKind::kRandomWalk, 1e-7, {}};
  const Component dr{ProcessKind::kRamp, 1e-12, {}};
  const Component fn{ProcessKind::kFlicker, 1e-3, {}};
  const Component pl{ProcessKind::kPowerLaw, 1e-3, {1.3, 0.0}};
  const Component ma{ProcessKind::kMa1, 1.0, {-0.4, 0.0}};
  const Component arma{ProcessKind::kArma11, 1.0, {0.9, 0.2}};
  const Component sine{ProcessKind::kSinusoid, 0.01, {0.0355, 0.0}};
  const std::vector<std::pair<std::string, Model>> models{
      {"WN", {{wn}}},
      {"QN+WN+RW", {{qn, wn, rw}}},
      {"GM fast", {{gm(3.1, 1.0)}}},
      {"GM", {{gm(0.0713, 1.0)}}},
      {"GM slow", {{gm(2.3e-5, 1.0)}}},
      {"3 GM + DR", {{gm(0.71, 1.0), gm(0.013, 0.01), gm(1.7e-4, 0.02), dr}}},
      {"WN+FN+RW", {{wn, fn, rw}}},
      {"WN+PL", {{wn, pl}}},
      {"MA1+RW", {{ma, rw}}},
      {"ARMA11+RW", {{arma, rw}}},
      {"WN+SIN", {{wn, sine}}},
  };
  const WaveletVariance wv = record_of(300'001, 17);
  const CovarianceTable table(wv, wv.levels.size());
  for (const auto& [name, model] : models) {
    SCOPED_TRACE(name);
    EXPECT_LT(distance(table.of(model, wv), wv_covariance(model, wv, wv.levels.size())), kAgree);
  }
}

TEST(CovarianceTable, ResonancesAreSummedByThemselves) {
  const WaveletVariance wv = record_of(200'000, 16);
  const CovarianceTable table(wv, wv.levels.size());
  const Component wn{ProcessKind::kWhiteNoise, 1.0, {}};
  const Component fn{ProcessKind::kFlicker, 1e-3, {}};
  for (const Shape shape : {Shape{0.06, 1.25}, Shape{0.025, 0.6}, Shape{0.9, 0.4}, Shape{0.3, 3.1}}) {
    const Component res{ProcessKind::kResonance, 0.7, shape};
    for (const Model& model :
         {Model{{res}}, Model{{wn, res, gm(0.3, 0.4), gm(1e-3, 0.02)}}, Model{{res, fn}}}) {
      SCOPED_TRACE(std::to_string(shape[0]) + " " + std::to_string(model.components.size()));
      EXPECT_LT(distance(table.of(model, wv), wv_covariance(model, wv, wv.levels.size())), kAgree);
    }
  }
}

TEST(CovarianceTable, GivesTheSameWhoeverAskedBefore) {
  const WaveletVariance wv = record_of(50'000, 14);
  const CovarianceTable used(wv, wv.levels.size());
  const Model first{{gm(0.2, 1.0), {ProcessKind::kResonance, 0.7, {0.06, 1.25}}}};
  const Model second{{gm(0.02, 1.0), {ProcessKind::kResonance, 0.7, {0.07, 1.2}}}};
  (void)used.of(second, wv);
  const CovarianceTable fresh(wv, wv.levels.size());
  EXPECT_EQ(used.of(first, wv), fresh.of(first, wv));
}

TEST(CovarianceTable, OneIsSharedByRecordsOfOneLengthAndNoOthers) {
  CovarianceTables tables;
  const WaveletVariance wv = record_of(50'000, 12);
  const auto table = tables.of(wv, 12);
  WaveletVariance other = wv;
  for (WvLevel& level : other.levels) level.value *= 3.0;
  EXPECT_EQ(tables.of(other, 12), table);
  EXPECT_NE(tables.of(wv, 11), table);
  EXPECT_NE(tables.of(record_of(50'001, 12), 12), table);
  other.segments = {{0, 20'000}, {20'100, 50'000}};
  const auto of_stretches = tables.of(other, 12);
  ASSERT_NE(of_stretches, nullptr);
  EXPECT_NE(of_stretches, table);
  EXPECT_EQ(tables.of(other, 12), of_stretches);
  other.levels.back().places = {{30'000, 30'500}};
  EXPECT_NE(tables.of(other, 12), of_stretches);
  other = wv;
  other.efficiency = 0.6;
  EXPECT_EQ(tables.of(other, 12), nullptr) << "nor has a robust one";
}

/// Of white noise with holes: few, so that each of their lags is a break, or many, of which a share counts.
WaveletVariance with_holes(std::size_t samples, int holes, std::size_t longest) {
  std::mt19937_64 random(static_cast<unsigned>(holes));
  std::normal_distribution<double> normal;
  std::vector<double> x(samples);
  for (double& v : x) v = normal(random);
  std::uniform_int_distribution<std::size_t> place(0, samples - 1);
  std::uniform_int_distribution<std::size_t> length(1, longest);
  std::vector<std::uint8_t> mask(samples, 1);
  for (int i = 0; i < holes; ++i) {
    const std::size_t begin = place(random);
    const std::size_t end = std::min(samples, begin + length(random));
    std::fill(mask.begin() + static_cast<std::ptrdiff_t>(begin),
              mask.begin() + static_cast<std::ptrdiff_t>(end), std::uint8_t{0});
  }
  WvOptions options;
  options.mask = mask;
  WaveletVariance wv = haar_wavelet_variance(x, options).value();
  std::erase_if(wv.levels, [](const WvLevel& level) { return !has_enough_coefficients(level, 1.0); });
  return wv;
}

TEST(CovarianceTable, AgreesWithTheSumWhereSamplesAreMissing) {
  const Component wn{ProcessKind::kWhiteNoise, 1.0, {}};
  const Component qn{ProcessKind::kQuantization, 2.0, {}};
  const Component rw{ProcessKind::kRandomWalk, 1e-7, {}};
  const Component dr{ProcessKind::kRamp, 1e-12, {}};
  const Component fn{ProcessKind::kFlicker, 1e-3, {}};
  const Component res{ProcessKind::kResonance, 0.7, {0.06, 1.25}};
  for (const WaveletVariance& wv : {with_holes(60'000, 1, 2'000), with_holes(60'000, 3, 3'000),
                                    with_holes(100'000, 60, 400), with_holes(50'000, 500, 1)}) {
    SCOPED_TRACE(wv.segments.size());
    const CovarianceTable table(wv, wv.levels.size());
    for (const Model& model : {Model{{wn}}, Model{{qn, wn, rw}}, Model{{gm(0.0713, 1.0), dr}},
                               Model{{wn, fn, rw}}, Model{{wn, gm(2.3e-4, 1e-2)}}, Model{{wn, res, rw}}})
      EXPECT_LT(distance(table.of(model, wv), wv_covariance(model, wv, wv.levels.size())), kAgree);
  }
}

/// Models whose resonances ring for a few lags to a few hundred.
std::vector<Model> ringing_models() {
  std::vector<Model> models;
  for (double rate = 0.5; rate > 0.01; rate *= 0.7) {
    const Component res{ProcessKind::kResonance, 0.7, {rate, 1.2 + rate}};
    models.push_back({{{ProcessKind::kWhiteNoise, 1.0, {}}, res, gm(0.1 * rate, 0.3)}});
  }
  return models;
}

TEST(CovarianceTable, GivesTheSameWhateverItsMemoryHolds) {
  const WaveletVariance wv = record_of(50'000, 14);
  const CovarianceTable table(wv, wv.levels.size());
  for (const std::size_t bound : {std::size_t{0}, std::size_t{1'000}, std::size_t{100'000}}) {
    SCOPED_TRACE(bound);
    const CovarianceTable bounded(wv, wv.levels.size(), std::make_shared<CovarianceMemory>(bound));
    for (const Model& model : ringing_models()) EXPECT_EQ(bounded.of(model, wv), table.of(model, wv));
  }
}

TEST(CovarianceTable, HoldsNoMoreTheMoreResonancesAreTried) {
  constexpr std::size_t kBound = 150'000;
  const auto memory = std::make_shared<CovarianceMemory>(kBound);
  CovarianceTables tables(memory);
  const auto unbounded = std::make_shared<CovarianceMemory>(100 * kBound);
  CovarianceTables others(unbounded);
  for (const std::uint64_t length : {50'000U, 60'000U}) {
    const WaveletVariance wv = record_of(length, 14);
    for (const Model& model : ringing_models()) {
      (void)tables.of(wv, 14)->of(model, wv);
      (void)others.of(wv, 14)->of(model, wv);
      EXPECT_LE(memory->held(), kBound);
      EXPECT_GT(memory->held(), 0U);
    }
  }
  EXPECT_GT(unbounded->held(), 2 * kBound) << "so many were tried that the bound mattered";
}

/// Doubles that say whether they were made anew.
class CountedEntries {
 public:
  explicit CountedEntries(std::size_t bound) : memory_(bound) {}

  std::shared_ptr<const Eigen::VectorXd> get(int process) {
    return memory_.get<Eigen::VectorXd>({0, {}, process}, [&] {
      ++made_;
      return Eigen::VectorXd(Eigen::VectorXd::Constant(kSize, process));
    });
  }
  [[nodiscard]] int made() const { return made_; }
  [[nodiscard]] std::size_t held() const { return memory_.held(); }

  static constexpr std::size_t kSize = 10;

 private:
  CovarianceMemory memory_;
  int made_ = 0;
};

TEST(CovarianceMemory, ForgetsWhatWasAskedForLongestAgo) {
  CountedEntries entries(3 * CountedEntries::kSize);
  for (const int process : {1, 2, 3, 1}) (void)entries.get(process);
  EXPECT_EQ(entries.made(), 3);
  (void)entries.get(4);  // in the place of 2
  for (const int process : {1, 3, 4}) (void)entries.get(process);
  EXPECT_EQ(entries.made(), 4);
  (void)entries.get(2);
  EXPECT_EQ(entries.made(), 5);
  EXPECT_EQ(entries.held(), 3 * CountedEntries::kSize);
}

TEST(CovarianceMemory, AnEntryStaysWithWhoHoldsIt) {
  CountedEntries entries(CountedEntries::kSize);
  const auto first = entries.get(1);
  (void)entries.get(2);
  EXPECT_EQ((*first)[0], 1.0);
  EXPECT_EQ(entries.held(), CountedEntries::kSize);
}

TEST(CovarianceMemory, WhatIsLargerThanTheBoundIsMadeEachTime) {
  CountedEntries entries(CountedEntries::kSize - 1);
  EXPECT_EQ((*entries.get(7))[0], 7.0);
  EXPECT_EQ((*entries.get(7))[0], 7.0);
  EXPECT_EQ(entries.made(), 2);
  EXPECT_EQ(entries.held(), 0U);
}

TEST(CovarianceTable, AsksTheSumForWhatItDoesNotHold) {
  const WaveletVariance wv = record_of(5'000, 10);
  const CovarianceTable table(wv, wv.levels.size());
  const Model alternating{{{ProcessKind::kArma11, 1.0, {-0.5, 0.2}}}};
  EXPECT_EQ(table.of(alternating, wv), wv_covariance(alternating, wv, wv.levels.size()));
}

}  // namespace
}  // namespace imuscope::noise
