/// How often exported noise parameters hold: over simulated sensors, whether what `imuscope export` would
/// write holds the truth's own numbers (felt_noise.h of the true model) in its intervals, whether the
/// conservative ones lie above them, and whether white noise is within 2 % of it.

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cmath>
#include <functional>
#include <random>
#include <string>
#include <vector>

#include "models/noise/export.h"
#include "models/noise/felt_noise.h"
#include "models/noise/fit.h"
#include "models/noise/simulated_noise.h"
#include "models/noise/wavelet_variance.h"
#include "own_sd.h"

namespace {

using namespace imuscope::noise;

constexpr double kRateHz = 100.0;

struct Truth {
  const char* spec;
  Model model;
};

std::vector<Truth> truths() {
  const Component white{ProcessKind::kWhiteNoise, 1.0, {}};
  const auto walk = [](double step2) { return Component{ProcessKind::kRandomWalk, step2, {}}; };
  const auto markov = [](double variance, double tau_s) {
    return Component{ProcessKind::kGaussMarkov, variance, {1.0 / (tau_s * kRateHz), 0.0}};
  };
  return {{"WN", {{white}}},
          {"WN+RW", {{white, walk(1e-6)}}},
          {"WN+GM", {{white, markov(0.02, 5.0)}}},
          {"WN+GM", {{white, markov(0.01, 30.0)}}},
          {"WN+2*GM", {{white, markov(0.5, 0.05), markov(0.02, 10.0)}}},
          {"WN+GM+RW", {{white, markov(0.01, 5.0), walk(1e-8)}}},
          {"QN+WN+RW", {{{ProcessKind::kQuantization, 1.0, {}}, white, walk(1e-6)}}}};
}

double slowest_variance(const Model& model) {
  double variance = 0.0;
  for (const Component& c : model.components) {
    if (c.kind == ProcessKind::kGaussMarkov) variance = c.amplitude;  // in order of falling rate
  }
  return variance;
}

/// Counts of one number over the series of a truth.
struct Count {
  int fitted = 0;
  int bound = 0;
  int held = 0;  ///< of the fitted, the truth inside the interval
  int near =
      0;  ///< of the fitted, root within 2 % of the truth's, or the truth inside an interval that is wider
  int below = 0;  ///< of all, the conservative value below the truth
  int wide = 0;   ///< of the fitted, the conservative root more than twice the fitted one: refused

  void add(const Felt& felt, double truth) {
    if (felt.knowledge == Knowledge::kFitted) {
      ++fitted;
      held += felt.lower <= truth && truth <= felt.upper ? 1 : 0;
      const bool is_inside = felt.lower <= truth && truth <= felt.upper;
      near += is_inside || std::abs(std::sqrt(felt.value / truth) - 1.0) <= 0.02 ? 1 : 0;
      wide += std::sqrt(felt.upper / felt.value) > kConservativeMost ? 1 : 0;
    } else {
      ++bound;
    }
    below += felt.upper < truth ? 1 : 0;
  }
};

/// The share lies above `least`, or below it by chance.
bool is_at_least(int part, int whole, double least) {
  if (whole == 0) return true;
  return part >= whole * least - imuscope::kOwnSd * std::sqrt(whole * least * (1.0 - least));
}

/// Goals: intervals hold 91 % at least, conservative values lie below the truth in 5 % at most.
/// A fitted number that its conservative one exceeds by more than kConservativeMost is refused as such.
bool meets_goals(const Count& c, int n) {
  return is_at_least(c.held, c.fitted, 0.91) && is_at_least(n - c.below, n, 0.95);
}

/// What is white is fitted in every series, and 95 % lie within 2 % of the truth or of what the record tells.
bool meets_goals_of_white(const Count& c, int n) { return c.fitted == n && is_at_least(c.near, n, 0.95); }

void print(const char* what, const Count& c, int n) {
  const auto percent = [](int part, int whole) { return whole > 0 ? 100.0 * part / whole : 0.0; };
  fmt::print(
      "  {:<20} fitted {:5}  inside {:5.1f} %  within 2 % {:5.1f} %  bound {:5}  conservative below {:4.1f} "
      "%  beyond twice {:5}\n",
      what, c.fitted, percent(c.held, c.fitted), percent(c.near, c.fitted), c.bound, percent(c.below, n),
      c.wide);
}

}  // namespace

int main(int argc, char** argv) {
  int runs = 200;
  int log2_samples = 17;
  CLI::App app("How often exported noise parameters hold");
  app.add_option("--runs", runs, "Series a truth")->capture_default_str();
  app.add_option("--log2-samples", log2_samples, "Length of a series, at 100 Hz")->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  const FilterBand walk_band{kFastTau_s, 100.0};
  const FilterBand bias_band{kFastTau_s, 1000.0};
  bool all_met = true;
  for (const Truth& truth : truths()) {
    FitResult true_fit;
    true_fit.rate_hz = kRateHz;
    true_fit.spec = parse_model(truth.spec).value();
    true_fit.model = truth.model;
    const double true_white = felt_white_density(true_fit, walk_band).value;
    const double true_walk = felt_walk_density(true_fit, walk_band).value;
    Count white;
    Count walk;
    Count bias;
    int refused = 0;
    std::mt19937_64 random(1);
    for (int run = 0; run < runs; ++run) {
      const auto wv = haar_wavelet_variance(imuscope::noise::simulated_noise(
                                                truth.model, std::size_t{1} << log2_samples, random))
                          .value();
      FitOptions options;
      options.intervals = Intervals::kInverted;
      const auto fitted = fit(wv, true_fit.spec, kRateHz, options).value();
      white.add(felt_white_density(fitted, walk_band), true_white);
      walk.add(felt_walk_density(fitted, walk_band), true_walk);
      const FeltWithBias with_bias = felt_with_bias(fitted, bias_band);
      // The truth's own process, or what stands in its place at the same correlation time.
      FeltBias true_bias = felt_with_bias(true_fit, bias_band, with_bias.bias.tau_s).bias;
      if (with_bias.bias.as_fitted) true_bias.variance.value = slowest_variance(truth.model);
      bias.add(with_bias.bias.variance, true_bias.variance.value);
      refused += export_models({{"x", SignalUnit::kRadps, fitted}}, ExportFormat::kKalibr) ? 0 : 1;
    }
    fmt::print("{}, {} series of 2^{}, {} refused\n", truth.spec, runs, log2_samples, refused);
    print("white density", white, runs);
    print("random walk", walk, runs);
    print("bias variance", bias, runs);
    for (const Count& count : {white, walk, bias}) all_met = all_met && meets_goals(count, runs);
    all_met = all_met && meets_goals_of_white(white, runs);
  }
  fmt::print("{}\n", all_met ? "goals met" : "a goal is missed");
  return all_met ? 0 : 1;
}
