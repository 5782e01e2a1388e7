/// How often the intervals of a certificate's terms hold what the simulated sensor has: N, B, K, R and Q of
/// sums of the processes that real sensors show, most of which the selection has to find; beneath the lines of an
/// engine whose speed wanders; of records with holes; and of sensors that no model of ours describes: white noise
/// through a low-pass of third order, rounded before a mean, beside a slow swing as of the temperature, or
/// growing and fading.

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include "all_threads.h"
#include "base/units.h"
#include "goal_counts.h"
#include "models/certificate/axis_certificate.h"
#include "models/noise/felt_noise.h"
#include "models/noise/simulated_noise.h"

namespace {

using imuscope::Counts;
using imuscope::certificate::AxisCertificate;
using imuscope::certificate::Term;
using imuscope::noise::Component;
using imuscope::noise::Model;
using imuscope::noise::ProcessKind;

constexpr double kRate_hz = 100.0;

Component markov(double sigma2, double tau_s) {
  return {ProcessKind::kGaussMarkov, sigma2, {1.0 / (tau_s * kRate_hz), 0.0}};
}

using Series = std::vector<double>;

/// Makes a record of so many samples.
using Maker = std::function<Series(std::mt19937_64&, std::size_t)>;

/// A truth of a sensor in deg/s.
struct Cell {
  const char* name;
  Model model;  ///< of what is made by `beyond`: the one with its N, B and K at scales of a second and more
  std::size_t samples;
  Maker beyond{};
  bool has_bias_instability = true;  ///< false: the model's is not the sensor's
  std::vector<double> lines_hz{};
  bool is_wrong = false;  ///< and is to be called so
};

constexpr double kWhite = 0.2;      ///< sd a sample, deg/s
constexpr double kWalkStep = 1e-4;  ///< deg/s

Series white_noise(std::mt19937_64& random, std::size_t n) {
  std::normal_distribution<double> normal;
  Series x(n);
  for (double& v : x) v = kWhite * normal(random);
  return x;
}

void add_walk(Series& x, std::mt19937_64& random) {
  std::normal_distribution<double> normal;
  double walk = 0.0;
  for (double& v : x) v += walk += kWalkStep * normal(random);
}

/// Autoregression of third order, of unit gain at zero frequency: a real pole and a pair, as of a low-pass
/// filter at a tenth of the rate.
Series low_passed(const Series& x) {
  constexpr double kPole = 0.53;
  constexpr double kRadius = 0.73;
  constexpr double kAngle = 0.53;
  const double b = 2.0 * kRadius * std::cos(kAngle);
  const double c = -kRadius * kRadius;
  const double a1 = kPole + b;
  const double a2 = c - kPole * b;
  const double a3 = -kPole * c;
  Series y(x.size(), 0.0);
  for (std::size_t i = 3; i < x.size(); ++i)
    y[i] = a1 * y[i - 1] + a2 * y[i - 2] + a3 * y[i - 3] + (1.0 - a1 - a2 - a3) * x[i];
  return y;
}

/// Rounded to steps as large as the noise, then means of four that overlap.
Series rounded_then_averaged(Series x) {
  for (double& v : x) v = kWhite * std::round(v / kWhite);
  constexpr std::size_t kMean = 4;
  Series y(x.size() - kMean + 1);
  for (std::size_t i = 0; i < y.size(); ++i) y[i] = 0.25 * (x[i] + x[i + 1] + x[i + 2] + x[i + 3]);
  return y;
}

constexpr std::array kLines_hz{0.565, 1.69};

/// Adds a line and its third harmonic, of a speed that wanders by a thousandth.
void add_lines(std::mt19937_64& random, Series& x) {
  constexpr double kWander = 1e-3;
  constexpr double kWander_s = 20.0;
  constexpr std::array kAmplitudes{0.3 * kWhite, 0.1 * kWhite};
  std::normal_distribution<double> normal;
  const double fade = std::exp(-1.0 / (kWander_s * kRate_hz));
  double wander = normal(random);
  double turns = std::uniform_real_distribution<double>()(random);
  for (double& v : x) {
    wander = fade * wander + std::sqrt(1.0 - fade * fade) * normal(random);
    turns += kLines_hz[0] * (1.0 + kWander * wander) / kRate_hz;
    const double angle = 2.0 * std::numbers::pi * turns;
    v += kAmplitudes[0] * std::sin(angle) + kAmplitudes[1] * std::sin(3.0 * angle);
  }
}

/// Takes out so many stretches of a second to a minute each, anywhere.
void take_holes(std::mt19937_64& random, int holes, Series& x) {
  constexpr double kLongest_s = 60.0;
  std::uniform_int_distribution<std::size_t> place(0, x.size() - 1);
  std::uniform_real_distribution<double> log_length(0.0, std::log(kLongest_s));
  for (int i = 0; i < holes; ++i) {
    const std::size_t begin = place(random);
    const auto length = static_cast<std::size_t>(kRate_hz * std::exp(log_length(random)));
    const std::size_t end = std::min(begin + length, x.size());
    std::fill(x.begin() + static_cast<std::ptrdiff_t>(begin), x.begin() + static_cast<std::ptrdiff_t>(end),
              std::nan(""));
  }
}

std::vector<Cell> cells_with_more_than_noise() {
  constexpr std::size_t kLong = std::size_t{1} << 18U;
  const Model noise{{{ProcessKind::kWhiteNoise, kWhite * kWhite, {}},
                     {ProcessKind::kRandomWalk, kWalkStep * kWalkStep, {}}}};
  return {{"lines",
           noise,
           kLong,
           [noise](std::mt19937_64& random, std::size_t n) {
             Series x = imuscope::noise::simulated_noise(noise, n, random);
             add_lines(random, x);
             return x;
           },
           true,
           {kLines_hz.begin(), kLines_hz.end()}},
          {"thirty holes",
           noise,
           kLong,
           [noise](std::mt19937_64& random, std::size_t n) {
             constexpr int kHoles = 30;
             Series x = imuscope::noise::simulated_noise(noise, n, random);
             take_holes(random, kHoles, x);
             return x;
           },
           true,
           {},
           true}};
}

std::vector<Cell> cells_beyond_models() {
  constexpr std::size_t kLong = std::size_t{1} << 18U;
  const Component walk{ProcessKind::kRandomWalk, kWalkStep * kWalkStep, {}};
  const Component white{ProcessKind::kWhiteNoise, kWhite * kWhite, {}};
  const Component rounded{ProcessKind::kWhiteNoise, kWhite * kWhite * (1.0 + 1.0 / 12.0), {}};
  const auto turn = [](std::size_t i, double turns) {
    return 2.0 * std::numbers::pi * turns * static_cast<double>(i) / static_cast<double>(kLong);
  };
  return {{"low-pass of third order",
           {{white, walk}},
           kLong,
           [](std::mt19937_64& random, std::size_t n) {
             Series x = white_noise(random, n);
             add_walk(x, random);
             return low_passed(x);
           }},
          {"rounded, then averaged",
           {{rounded, walk}},
           kLong,
           [](std::mt19937_64& random, std::size_t n) {
             Series x = white_noise(random, n);
             add_walk(x, random);
             return rounded_then_averaged(std::move(x));
           }},
          {"slow swing",
           {{white}},
           kLong,
           [turn](std::mt19937_64& random, std::size_t n) {
             Series x = white_noise(random, n);
             for (std::size_t i = 0; i < n; ++i) x[i] += 0.05 * kWhite * std::sin(turn(i, 3.0));
             return x;
           },
           false,
           {},
           true},
          {"growing and fading by a tenth",
           {{white}},
           kLong,
           [turn](std::mt19937_64& random, std::size_t n) {
             Series x = white_noise(random, n);
             // Of the mean square of 1 + sin / 10.
             const double level = 1.0 / std::sqrt(1.0 + 0.005);
             for (std::size_t i = 0; i < n; ++i) x[i] *= level * (1.0 + 0.1 * std::sin(turn(i, 5.0)));
             return x;
           },
           false,
           {},
           true}};
}

std::vector<Cell> cells() {
  const Component white{ProcessKind::kWhiteNoise, 0.04, {}};
  const Component walk{ProcessKind::kRandomWalk, 1e-9, {}};
  const Component flicker{ProcessKind::kFlicker, 1e-5, {}};
  const Component quantization{ProcessKind::kQuantization, 0.02, {}};
  const Component resonance{ProcessKind::kResonance, 0.01, {0.08, 1.25}};
  const Component ramp{ProcessKind::kRamp, 1e-14, {}};
  constexpr std::size_t kShort = std::size_t{1} << 17U;
  constexpr std::size_t kLong = std::size_t{1} << 18U;
  return {{"WN", {{white}}, kShort},
          {"WN+RW", {{white, walk}}, kLong},
          {"WN+FN", {{white, flicker}}, kLong},
          {"QN+WN", {{quantization, white}}, kShort},
          {"WN+GM", {{white, markov(4e-5, 20.0)}}, kLong},
          {"WN+GM+RW", {{white, markov(4e-5, 5.0), walk}}, kLong},
          {"fastGM+RW", {{markov(0.05, 0.02), walk}}, kLong},
          {"WN+RES+FN", {{white, resonance, flicker}}, kLong},
          {"WN+DR", {{white, ramp}}, kLong},
          {"QN+WN+GM+FN+RW", {{quantization, white, markov(4e-5, 2.0), flicker, walk}}, kLong}};
}

/// What the terms are in truth, in the unit of the certificate; NaN where the truth has none.
double true_value(const Model& model, Term term) {
  const double root_hour = std::sqrt(imuscope::kSecondsPerHour);
  const auto amplitude = [&](ProcessKind kind) {
    for (const Component& c : model.components) {
      if (c.kind == kind) return c.amplitude;
    }
    return std::nan("");
  };
  switch (term) {
    case Term::kRandomWalk: {
      imuscope::noise::FitResult truth;
      truth.model = model;
      truth.rate_hz = kRate_hz;
      return root_hour * std::sqrt(felt_white_density(truth, {}).value);
    }
    case Term::kBiasInstability: {
      double lowest = std::numeric_limits<double>::infinity();
      for (double n = 1.0; n < 1e6; n *= 1.02) lowest = std::min(lowest, model_allan_deviation(model, n));
      return imuscope::kSecondsPerHour * lowest / 0.664;
    }
    case Term::kRateRandomWalk:
      return imuscope::kSecondsPerHour * root_hour *
             std::sqrt(amplitude(ProcessKind::kRandomWalk) * kRate_hz);
    case Term::kRamp:
      return std::pow(imuscope::kSecondsPerHour, 2) * std::sqrt(amplitude(ProcessKind::kRamp)) * kRate_hz;
    case Term::kQuantization:
      return imuscope::kSecondsPerHour * std::sqrt(amplitude(ProcessKind::kQuantization)) / kRate_hz;
  }
  return std::nan("");
}

void count_terms(Counts& counts, const Cell& cell, const AxisCertificate& certificate) {
  for (const auto& term : certificate.terms) {
    const double truth = true_value(cell.model, term.term);
    if (term.term == Term::kBiasInstability && !cell.has_bias_instability) continue;
    if (!std::isfinite(truth) || term.knowledge == imuscope::noise::Knowledge::kUnknown) continue;
    const bool holds = term.ci_low.value_or(0.0) <= truth && truth <= term.ci_high.value_or(term.value);
    count(counts, fmt::format("{}_holds", symbol_of(term.term)), holds);
    if (term.knowledge == imuscope::noise::Knowledge::kFitted)
      count(counts, fmt::format("{}_value_holds", symbol_of(term.term)), holds);
  }
  for (const double frequency_hz : cell.lines_hz) {
    constexpr double kBeside = 0.01;
    const bool named = std::ranges::any_of(certificate.lines, [&](const auto& line) {
      return std::abs(line.frequency_hz / frequency_hz - 1.0) < kBeside;
    });
    count(counts, "line_named", named);
  }
  if (cell.lines_hz.empty()) count(counts, "no_line_named", certificate.lines.empty());
  const bool has_resonance =
      std::any_of(cell.model.components.begin(), cell.model.components.end(),
                  [](const Component& c) { return c.kind == ProcessKind::kResonance; });
  if (!has_resonance) {
    count(counts, "no_resonance_named", certificate.resonances.empty());
    return;
  }
  constexpr double kTrue_hz = 1.25 * kRate_hz / (2.0 * std::numbers::pi);
  const bool named = !certificate.resonances.empty() &&
                     std::abs(certificate.resonances.front().frequency_hz - kTrue_hz) < 1.0;
  count(counts, "resonance_named", named);
}

/// A line in one go: threads print side by side.
void print(const AxisCertificate& certificate, const Model& truth) {
  std::string line = certificate.fit.spec.name();
  for (const auto& term : certificate.terms) {
    line += fmt::format("  {} {:.4g} [{:.4g}, {:.4g}] true {:.4g}", symbol_of(term.term), term.value,
                        term.ci_low.value_or(0.0), term.ci_high.value_or(0.0), true_value(truth, term.term));
  }
  fmt::print("{}\n", line);
}

imuscope::certificate::AxisRecord record_of(const Cell& cell, unsigned seed) {
  std::mt19937_64 random(seed);
  imuscope::certificate::AxisRecord record;
  record.name = "gyro_x";
  record.unit = imuscope::noise::SignalUnit::kDegps;
  record.rate_hz = kRate_hz;
  record.values = cell.beyond ? cell.beyond(random, cell.samples)
                              : imuscope::noise::simulated_noise(cell.model, cell.samples, random);
  return record;
}

Counts counts_of(const Cell& cell, unsigned seed, bool show) {
  Counts counts;
  const auto certificate = characterize_axis(record_of(cell, seed), {});
  if (!certificate) return counts;
  count_terms(counts, cell, *certificate);
  if (show) print(*certificate, cell.model);
  count(counts, cell.is_wrong ? "record_called_wrong_as_it_is" : "record_called_wrong",
        !certificate->warnings.empty());
  return counts;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("Coverage of the terms of a certificate over simulated sensors");
  int series = 1000;
  std::string results_file;
  std::string only;
  app.add_option("--series", series, "Series a cell")->capture_default_str();
  app.add_option("--results", results_file, "Keeps what was counted, and goes on from there");
  app.add_option("--only", only, "One cell");
  std::size_t threads = 2;
  app.add_option("--threads", threads, "Of which each makes series")
      ->capture_default_str()
      ->check(CLI::PositiveNumber);
  bool show = false;
  app.add_flag("--show", show, "Prints the model and the terms of every series");
  CLI11_PARSE(app, argc, argv);
  imuscope::Results results(results_file);
  bool all_met = true;
  constexpr unsigned kFirstSeed = 40'000;
  constexpr int kTogether = 32;  // between two times that results are kept
  std::vector<Cell> all = cells();
  for (auto more : {cells_with_more_than_noise(), cells_beyond_models()})
    all.insert(all.end(), more.begin(), more.end());
  for (const Cell& cell : all) {
    if (!only.empty() && only != cell.name) continue;
    for (int run = results.done(cell.name); run < series; run += kTogether) {
      std::vector<Counts> counts(static_cast<std::size_t>(std::min(kTogether, series - run)));
      imuscope::on_all_threads(counts.size(), threads, [&](std::size_t i) {
        counts[i] = counts_of(cell, kFirstSeed + static_cast<unsigned>(run) + static_cast<unsigned>(i), show);
      });
      for (std::size_t i = 0; i < counts.size(); ++i)
        results.keep(cell.name, run + 1 + static_cast<int>(i), counts[i]);
    }
    std::vector<imuscope::Band> bands{{"record_called_wrong", 0.0, 5.0},
                                      {"no_resonance_named", 99.0, 100.0},
                                      {"no_line_named", 99.0, 100.0},
                                      {"line_named", 99.0, 100.0},
                                      {"resonance_named", 99.0, 100.0}};
    // A bound holds more often than it has to.
    for (const char* symbol : {"N", "B", "K", "R", "Q"}) {
      bands.push_back({fmt::format("{}_holds", symbol), 93.0, 100.0});
      bands.push_back({fmt::format("{}_value_holds", symbol), 93.0, 97.0});
    }
    all_met = judge(cell.name, bands, results.counts(cell.name)) && all_met;
  }
  return all_met ? 0 : 1;
}
