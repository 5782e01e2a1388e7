/// How often the intervals of what several sensors have in common, of what is each one's own and of their
/// coherence hold what was simulated, and how near the quietest mean comes to the best there is.

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include "goal_counts.h"
#include "models/noise/cross_variance.h"
#include "models/noise/model.h"
#include "models/noise/simulated_noise.h"

namespace {

using imuscope::noise::Component;
using imuscope::noise::CrossLevel;
using imuscope::noise::Estimate;
using imuscope::noise::Model;
using imuscope::noise::ProcessKind;

constexpr double kRate_hz = 100.0;
constexpr std::size_t kSamples = std::size_t{1} << 14U;
constexpr Eigen::Index kSensors = 3;
constexpr double kConfidence = 0.95;
/// An interval of a scale that is worth fewer squares says little, and its shape is not asked for.
constexpr double kFewestSquares = 5.0;
/// Scales that weights are made of.
constexpr double kSquaresOfWeights = 200.0;
constexpr double kBest = 1.03;

Component white(double sigma2) { return {ProcessKind::kWhiteNoise, sigma2, {}}; }
Component markov(double sigma2, double tau_s) {
  return {ProcessKind::kGaussMarkov, sigma2, {1.0 / (tau_s * kRate_hz), 0.0}};
}
Component walk(double gamma2) { return {ProcessKind::kRandomWalk, gamma2, {}}; }

/// A truth: what the sensors share, and what each has for itself. What is fitted knows neither.
struct Cell {
  const char* name;
  Model common;
  std::vector<Model> own;
};

std::vector<Cell> cells() {
  const Component flicker{ProcessKind::kFlicker, 2e-3, {}};
  const Component resonance{ProcessKind::kResonance, 0.3, {0.08, 1.25}};
  return {
      {"white", {{white(0.5)}}, {{{white(1.0)}}, {{white(1.5)}}, {{white(2.0)}}}},
      {"nothing in common", {{}}, {{{white(1.0)}}, {{white(1.0), markov(0.02, 2.0)}}, {{white(0.5)}}}},
      {"a common bias",
       {{markov(0.05, 5.0)}},
       {{{white(1.0)}}, {{white(1.0), walk(1e-7)}}, {{white(2.0), markov(0.02, 0.5)}}}},
      {"a quiet reference", {{white(0.02), walk(1e-8)}}, {{{white(1.0)}}, {{white(1.0)}}, {{white(1.0)}}}},
      {"flicker and resonances",
       {{flicker, white(0.1)}},
       {{{white(0.5), resonance}}, {{white(1.0), flicker}}, {{markov(0.5, 0.05), white(0.3)}}}}};
}

CrossLevel true_level(const Cell& cell, const CrossLevel& measured) {
  CrossLevel truth = measured;
  truth.covariance = Eigen::MatrixXd::Constant(kSensors, kSensors, model_wv(cell.common, measured.level));
  for (Eigen::Index i = 0; i < kSensors; ++i)
    truth.covariance(i, i) += model_wv(cell.own[static_cast<std::size_t>(i)], measured.level);
  return truth;
}

bool holds(const Estimate& estimate, double truth) {
  return estimate.ci_low <= truth && truth <= estimate.ci_high;
}

void count_level(imuscope::Counts& counts, const CrossLevel& level, const CrossLevel& truth) {
  const double common = truth.covariance(0, 1);
  count(counts, "pair", holds(cross_covariance_of(level, 0, 1, kConfidence), common));
  count(counts, "common", holds(common_of(level, kConfidence), common));
  count(counts, "own", holds(own_of(level, 0, kConfidence), truth.covariance(0, 0) - common));
  const auto coherence = coherence_of(level, 1, 2, kConfidence);
  const double true_coherence = common / std::sqrt(truth.covariance(1, 1) * truth.covariance(2, 2));
  count(counts, "coherence", coherence.ci_low <= true_coherence && true_coherence <= coherence.ci_high);
}

/// Weights from the first half of the series; what they are worth is known.
void count_weights(imuscope::Counts& counts, const Cell& cell, const std::vector<CrossLevel>& levels) {
  std::vector<CrossLevel> measured;
  std::vector<CrossLevel> truth;
  for (const CrossLevel& level : levels) {
    if (level.dof < kSquaresOfWeights) continue;
    measured.push_back(level);
    truth.push_back(true_level(cell, level));
  }
  if (measured.empty()) return;
  const auto cost = [&](const Eigen::VectorXd& weights) {
    double sum = 0.0;
    for (const CrossLevel& level : truth)
      sum += weighted_variance(level, weights) / level.covariance.diagonal().mean();
    return sum;
  };
  count(counts, "weights within 3 %",
        cost(quietest_weights(measured)) <= kBest * cost(quietest_weights(truth)));
}

imuscope::Counts counts_of(const Cell& cell, unsigned seed) {
  std::mt19937_64 random(seed);
  const auto common = cell.common.components.empty()
                          ? std::vector<double>(kSamples, 0.0)
                          : imuscope::noise::simulated_noise(cell.common, kSamples, random);
  std::vector<std::vector<double>> series;
  std::vector<imuscope::noise::FitResult> fits;
  imuscope::Counts counts;
  for (const Model& own : cell.own) {
    auto x = imuscope::noise::simulated_noise(own, kSamples, random);
    for (std::size_t i = 0; i < kSamples; ++i) x[i] += common[i];
    const auto wv = imuscope::noise::haar_wavelet_variance(x);
    // What users fit to sensors that they do not know.
    const auto fit = imuscope::noise::fit(*wv, *imuscope::noise::parse_model("WN+2*GM+RW"), kRate_hz);
    if (!fit) return counts;
    fits.push_back(*fit);
    series.push_back(std::move(x));
  }
  const std::vector<std::span<const double>> signals(series.begin(), series.end());
  const auto levels = imuscope::noise::cross_variance(signals, {}, fits);
  if (!levels) return counts;
  for (const CrossLevel& level : *levels) {
    if (level.dof >= kFewestSquares) count_level(counts, level, true_level(cell, level));
  }
  count_weights(counts, cell, *levels);
  return counts;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("Coverage of what several sensors have in common, over simulated sensors");
  int series = 1000;
  std::string results_file;
  std::string only;
  app.add_option("--series", series, "Series a cell")->capture_default_str();
  app.add_option("--results", results_file, "Keeps what was counted, and goes on from there");
  app.add_option("--only", only, "One cell");
  CLI11_PARSE(app, argc, argv);
  imuscope::Results results(results_file);
  bool all_met = true;
  constexpr unsigned kFirstSeed = 70'000;
  for (const Cell& cell : cells()) {
    if (!only.empty() && only != cell.name) continue;
    for (int i = results.done(cell.name); i < series; ++i)
      results.keep(cell.name, i + 1, counts_of(cell, kFirstSeed + static_cast<unsigned>(i)));
    all_met = judge(cell.name,
                    {{"pair", 93.0, 97.0},
                     {"common", 93.0, 97.0},
                     {"own", 93.0, 97.0},
                     {"coherence", 93.0, 97.0},
                     {"weights within 3 %", 95.0, 100.0}},
                    results.counts(cell.name)) &&
              all_met;
  }
  return all_met ? 0 : 1;
}
