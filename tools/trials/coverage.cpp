/// Coverage of the noise engine's intervals and size of its J-test: simulates series of known models, fits
/// them, prints how often the interval holds the truth, and judges that:
///   a parameter whose log-sd at the truth is below 0.3: covered 91 to 98 %, at most 2 % flagged
///   the J-test on the levels with enough coefficients: rejects 3 to 8 % at the 5 % level
/// A robust wavelet variance of quantization noise, which is not Gaussian, is biased: there, every fit has to
/// say so. Exits 1 when one of these does not hold.
///
///   noise_coverage [--robust] [series per truth = 1000] [log2 of the length ... = 14 17]

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "models/noise/fit.h"
#include "models/noise/inference.h"
#include "models/noise/simulated_noise.h"
#include "models/noise/wv_covariance.h"

namespace {

using imuscope::noise::Component;
using imuscope::noise::FitResult;
using imuscope::noise::Model;
using imuscope::noise::ProcessKind;

constexpr double kRateHz = 100.0;

/// What is asked of the intervals and of the test, in per cent.
constexpr double kJudgedBelowLogSd = 0.3;
constexpr double kLeastCovered = 91.0;
constexpr double kMostCovered = 98.0;
constexpr double kMostFlagged = 2.0;
constexpr double kLeastRejected = 3.0;
constexpr double kMostRejected = 8.0;

struct Truth {
  std::string name;
  std::string spec;
  Model model;  ///< components in the order of the fit
};

Component gauss_markov(double beta, double sigma2) {
  return {ProcessKind::kGaussMarkov, sigma2, {beta / kRateHz, 0.0}};
}

std::vector<Truth> truths() {
  const Component wn{ProcessKind::kWhiteNoise, 1.0, {}};
  return {{"WN 1 + GM(1, .5)", "WN+GM", {{wn, gauss_markov(1.0, 0.5)}}},
          {"WN 1 + GM(10.5, .53) + GM(.05, .1)",
           "WN+2*GM",
           {{wn, gauss_markov(10.5, 0.53), gauss_markov(0.05, 0.1)}}},
          {"WN 1 + RW 1e-4", "WN+RW", {{wn, {ProcessKind::kRandomWalk, 1e-4, {}}}}},
          {"QN 1 + WN .09 + RW 1e-5",
           "QN+WN+RW",
           {{{ProcessKind::kQuantization, 1.0, {}},
             {ProcessKind::kWhiteNoise, 0.09, {}},
             {ProcessKind::kRandomWalk, 1e-5, {}}}}}};
}

struct Tally {
  double truth = 0.0;
  double log_sd_at_truth = 0.0;
  int given = 0;
  int covered = 0;
};

struct Settings {
  int series = 1000;
  std::vector<int> lengths;
  bool robust = false;
};

double percent(int part, int whole) { return whole > 0 ? 100.0 * part / whole : std::nan(""); }

/// Sd of the logarithms of the parameters at the truth, for series of n samples.
std::vector<double> log_sd_at_truth(const Truth& truth, std::size_t n, double efficiency) {
  namespace noise = imuscope::noise;
  noise::WaveletVariance wv;
  wv.efficiency = efficiency;
  wv.segments = {{0, n}};
  std::vector<int> levels;
  for (int j = 1; (std::size_t{1} << static_cast<unsigned>(j)) <= n; ++j) {
    levels.push_back(j);
    noise::WvLevel level;
    level.level = j;
    level.tau_samples = std::ldexp(1.0, j);
    level.n_coefficients = n - static_cast<std::size_t>(level.tau_samples) + 1;
    wv.levels.push_back(level);
  }
  const auto places = noise::parameter_places(truth.model);
  const auto jacobian = noise::wv_jacobian(truth.model, levels, places);
  const Eigen::MatrixXd v = noise::wv_covariance(truth.model, wv, levels.size());
  const Eigen::MatrixXd covariance = (jacobian.transpose() * v.llt().solve(jacobian)).inverse();
  std::vector<double> sd;
  for (Eigen::Index i = 0; i < covariance.rows(); ++i) sd.push_back(std::sqrt(covariance(i, i)));
  return sd;
}

double true_value(const Truth& truth, const imuscope::noise::ParameterPlace& place) {
  const Component& c = truth.model.components[place.component];
  return place.shape < 0 ? c.amplitude : c.shape[static_cast<std::size_t>(place.shape)] * kRateHz;
}

struct JTests {
  int n = 0;
  int rejected = 0;
};

bool is_biased_where_robust(const Truth& truth) {
  return std::any_of(truth.model.components.begin(), truth.model.components.end(),
                     [](const Component& c) { return c.kind == ProcessKind::kQuantization; });
}

bool warns_of_bias(const FitResult& fit) {
  return std::any_of(fit.warnings.begin(), fit.warnings.end(), [](const std::string& warning) {
    return warning.find("robust wavelet variance") != std::string::npos;
  });
}

/// Prints one truth's table; true when it keeps to what is asked. `warned`, of fits that are known to be
/// biased: how many say so, which is all that is judged of them.
bool judge(const Truth& truth, int log2_n, int series, const std::vector<std::string>& names,
           const std::vector<Tally>& tallies, JTests j_tests, std::optional<int> warned) {
  const double rejected = percent(j_tests.rejected, j_tests.n);
  bool good = warned ? *warned == series : rejected >= kLeastRejected && rejected <= kMostRejected;
  fmt::print(
      "\n{}, N = 2^{}, {} series: J-test rejects {:.1f} % at 5 %: {}\n", truth.name, log2_n, series, rejected,
      warned
          ? fmt::format("not judged; {} of the fits warn of their bias: {}", *warned, good ? "ok" : "NOT all")
      : good ? "ok"
             : "NOT within 3 to 8");
  fmt::print("{:<12} {:>10} {:>14} {:>10} {:>10}\n", "parameter", "truth", "log-sd there", "flagged %",
             "covered %");
  for (std::size_t i = 0; i < tallies.size(); ++i) {
    const Tally& t = tallies[i];
    const double flagged = percent(series - t.given, series);
    const double covered = percent(t.covered, t.given);
    const bool judged = !warned && t.log_sd_at_truth < kJudgedBelowLogSd;
    const bool holds = covered >= kLeastCovered && covered <= kMostCovered && flagged <= kMostFlagged;
    good = good && (!judged || holds);
    fmt::print("{:<12} {:>10.4g} {:>14.3f} {:>10.1f} {:>10.1f}  {}\n", names[i], t.truth, t.log_sd_at_truth,
               flagged, covered,
               !judged ? "not judged"
               : holds ? "ok"
                       : "NOT within 91 to 98, flagged up to 2");
  }
  (void)std::fflush(stdout);
  return good;
}

bool study(const Truth& truth, int log2_n, const Settings& settings) {
  namespace noise = imuscope::noise;
  const std::size_t n = std::size_t{1} << static_cast<unsigned>(log2_n);
  noise::WvOptions options;
  if (settings.robust) options.robust = noise::RobustOptions{};
  const auto places = noise::parameter_places(truth.model);
  const auto sd = log_sd_at_truth(truth, n, settings.robust ? options.robust->efficiency : 1.0);
  std::vector<Tally> tallies(places.size());
  for (std::size_t i = 0; i < places.size(); ++i) tallies[i] = {true_value(truth, places[i]), sd[i], 0, 0};
  const auto spec = noise::parse_model(truth.spec).value();
  std::mt19937_64 random(20240u + static_cast<unsigned>(log2_n));
  JTests j_tests;
  int warned = 0;
  std::vector<std::string> names(places.size());
  for (int s = 0; s < settings.series; ++s) {
    const auto x = imuscope::noise::simulated_noise(truth.model, n, random);
    const FitResult fit = noise::fit(noise::haar_wavelet_variance(x, options).value(), spec, kRateHz).value();
    if (fit.j_test) {
      ++j_tests.n;
      j_tests.rejected += fit.j_test->p_value < 0.05 ? 1 : 0;
    }
    warned += warns_of_bias(fit) ? 1 : 0;
    for (std::size_t i = 0; i < places.size(); ++i) {
      const auto& p = fit.parameters[i];
      names[i] = p.process + " " + p.name;
      if (!p.ci_low) continue;
      ++tallies[i].given;
      tallies[i].covered += *p.ci_low <= tallies[i].truth && tallies[i].truth <= *p.ci_high ? 1 : 0;
    }
  }
  return judge(truth, log2_n, settings.series, names, tallies, j_tests,
               settings.robust && is_biased_where_robust(truth) ? std::optional(warned) : std::nullopt);
}

/// Nothing where the arguments make no sense.
std::optional<Settings> read(int argc, char** argv) {
  constexpr int kLongest = 24;
  Settings settings;
  int at = 1;
  if (at < argc && std::string(argv[at]) == "--robust") {
    settings.robust = true;
    ++at;
  }
  if (at < argc) settings.series = std::atoi(argv[at++]);
  while (at < argc) settings.lengths.push_back(std::atoi(argv[at++]));
  if (settings.lengths.empty()) settings.lengths = {14, 17};
  if (settings.series < 1) return std::nullopt;
  for (const int log2_n : settings.lengths) {
    if (log2_n < 8 || log2_n > kLongest) return std::nullopt;
  }
  return settings;
}

}  // namespace

int main(int argc, char** argv) {
  const auto settings = read(argc, argv);
  if (!settings) {
    fmt::print(stderr, "usage: noise_coverage [--robust] [series] [log2 of a length, 8 to 24 ...]\n");
    return 2;
  }
  bool good = true;
  for (const int log2_n : settings->lengths) {
    for (const Truth& truth : truths()) good = study(truth, log2_n, *settings) && good;
  }
  fmt::print("\n{}\n",
             good ? "every interval and test keeps to what is asked" : "NOT everything is as asked");
  return good ? 0 : 1;
}
