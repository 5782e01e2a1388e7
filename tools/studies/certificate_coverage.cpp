/// How often the intervals of a certificate's terms hold what the simulated sensor has: N, B, K, R and Q of
/// sums of the processes that real sensors show, most of which the selection has to find.

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>

#include "base/units.h"
#include "certificate/axis_certificate.h"
#include "goal_counts.h"
#include "noise/felt_noise.h"
#include "noise/simulated_noise.h"

namespace {

using imuscope::certificate::AxisCertificate;
using imuscope::certificate::Term;
using imuscope::noise::Component;
using imuscope::noise::Model;
using imuscope::noise::ProcessKind;

constexpr double kRate_hz = 100.0;

Component markov(double sigma2, double tau_s) {
  return {ProcessKind::kGaussMarkov, sigma2, {1.0 / (tau_s * kRate_hz), 0.0}};
}

/// A truth of a sensor in deg/s.
struct Cell {
  const char* name;
  Model model;
  std::size_t samples;
};

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

void count_terms(imuscope::Counts& counts, const Cell& cell, const AxisCertificate& certificate) {
  for (const auto& term : certificate.terms) {
    const double truth = true_value(cell.model, term.term);
    if (!std::isfinite(truth) || term.knowledge == imuscope::noise::Knowledge::kUnknown) continue;
    const bool holds = term.ci_low.value_or(0.0) <= truth && truth <= term.ci_high.value_or(term.value);
    count(counts, fmt::format("{}_holds", symbol_of(term.term)), holds);
    if (term.knowledge == imuscope::noise::Knowledge::kFitted)
      count(counts, fmt::format("{}_value_holds", symbol_of(term.term)), holds);
  }
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

void print(const AxisCertificate& certificate, const Model& truth) {
  fmt::print("{}", certificate.fit.spec.name());
  for (const auto& term : certificate.terms) {
    fmt::print("  {} {:.4g} [{:.4g}, {:.4g}] true {:.4g}", symbol_of(term.term), term.value,
               term.ci_low.value_or(0.0), term.ci_high.value_or(0.0), true_value(truth, term.term));
  }
  fmt::print("\n");
}

imuscope::certificate::AxisRecord record_of(const Cell& cell, unsigned seed) {
  std::mt19937_64 random(seed);
  imuscope::certificate::AxisRecord record;
  record.name = "gyro_x";
  record.unit = imuscope::noise::SignalUnit::kDegps;
  record.rate_hz = kRate_hz;
  record.values = imuscope::noise::simulated_noise(cell.model, cell.samples, random);
  return record;
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
  bool show = false;
  app.add_flag("--show", show, "Prints the model and the terms of every series");
  CLI11_PARSE(app, argc, argv);
  imuscope::Results results(results_file);
  bool all_met = true;
  constexpr unsigned kFirstSeed = 40'000;
  for (const Cell& cell : cells()) {
    if (!only.empty() && only != cell.name) continue;
    for (int run = results.done(cell.name); run < series; ++run) {
      imuscope::Counts counts;
      const auto record = record_of(cell, kFirstSeed + static_cast<unsigned>(run));
      if (const auto certificate = characterize_axis(record, {})) {
        count_terms(counts, cell, *certificate);
        if (show) print(*certificate, cell.model);
        count(counts, "record_called_wrong", !certificate->warnings.empty());
      }
      results.keep(cell.name, run + 1, counts);
    }
    std::vector<imuscope::Band> bands{{"record_called_wrong", 0.0, 5.0},
                                      {"no_resonance_named", 99.0, 100.0},
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
