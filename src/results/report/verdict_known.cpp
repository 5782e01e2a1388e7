#include <fmt/format.h>
#include <fmt/ranges.h>
#include <algorithm>
#include <cmath>
#include <map>

#include "results/report/people.h"
#include "results/report/verdict.h"

namespace imuscope::report {
namespace {

/// Rate and variance of a Gauss-Markov process can be told apart from so many of its correlation times on (as
/// the noise engine has it).
constexpr double kCorrelationTimes = 20.0;

bool is_gyro(const Fit& fit) { return fit.axis.rfind("gyro", 0) == 0; }

const FitParameter* find_parameter(const Fit& fit, const std::string& process, const std::string& name) {
  const auto found = std::find_if(
      fit.parameters.begin(), fit.parameters.end(),
      [&](const FitParameter& parameter) { return parameter.process == process && parameter.name == name; });
  return found == fit.parameters.end() ? nullptr : &*found;
}

bool is_known(const FitParameter& parameter) {
  return parameter.value && parameter.ci_low && parameter.ci_high && *parameter.ci_low > 0.0;
}

/// How far a value may be off, from half the interval of its logarithm.
std::string width_words(double half_width) {
  // A percentage says less than a factor where up and down are no longer alike.
  constexpr double kFactorFrom = 0.4;
  return half_width < kFactorFrom ? fmt::format("± {:.2g} %", 100.0 * half_width)
                                  : fmt::format("within a factor of {:.2g}", std::exp(half_width));
}

/// White noise of one kind of sensor in one regime, over all S-IMUs and axes, as the sd of a sample.
struct WhiteNoise {
  std::size_t n = 0;
  std::size_t known = 0;
  double lowest = 0.0;
  double highest = 0.0;
  std::vector<double> half_widths;  ///< relative
  std::string unit;

  void add(const Fit& fit) {
    ++n;
    const FitParameter* white = find_parameter(fit, "WN", "sigma2");
    if (white == nullptr || !is_known(*white) || !(*white->value > 0.0)) return;
    const double sd = std::sqrt(*white->value);
    lowest = known == 0 ? sd : std::min(lowest, sd);
    highest = known == 0 ? sd : std::max(highest, sd);
    // Half the interval of the sd's logarithm, which is a quarter of that of the variance.
    half_widths.push_back(0.25 * std::log(*white->ci_high / *white->ci_low));
    unit = fit.unit;
    ++known;
  }

  [[nodiscard]] std::string words(const char* sensors) const {
    if (known == 0) return fmt::format("{}: of none of {} axes", sensors, n);
    std::vector<double> sorted = half_widths;
    std::sort(sorted.begin(), sorted.end());
    std::string width = width_words(sorted[sorted.size() / 2]);
    constexpr double kUneven = 2.0;
    if (sorted.back() > kUneven * sorted[sorted.size() / 2])
      width += fmt::format(" in the middle, {} at worst", width_words(sorted.back()));
    const std::string range = fmt::format("{:.3g}", lowest) == fmt::format("{:.3g}", highest)
                                  ? fmt::format("{:.3g}", lowest)
                                  : fmt::format("{:.3g} to {:.3g}", lowest, highest);
    return fmt::format("{} {} {} a sample, {}{}", sensors, range, unit, width,
                       known == n ? "" : fmt::format(" ({} of {} axes)", known, n));
  }
};

/// "White noise, static: gyroscopes 0.71 deg/s a sample ...; accelerometers ..."
void say_white_noise(const std::vector<Fit>& fits, std::vector<std::string>& sentences) {
  std::vector<std::string> regimes;
  std::map<std::string, std::array<WhiteNoise, 2>> by_regime;
  for (const Fit& fit : fits) {
    if (find_parameter(fit, "WN", "sigma2") == nullptr) continue;
    if (by_regime.find(fit.regime) == by_regime.end()) regimes.push_back(fit.regime);
    by_regime[fit.regime][is_gyro(fit) ? 0 : 1].add(fit);
  }
  for (const std::string& regime : regimes) {
    std::vector<std::string> parts;
    if (by_regime[regime][0].n > 0) parts.push_back(by_regime[regime][0].words("gyroscopes"));
    if (by_regime[regime][1].n > 0) parts.push_back(by_regime[regime][1].words("accelerometers"));
    sentences.push_back(fmt::format("Known of the white noise, {}: {}.", regime.empty() ? "all" : regime,
                                    fmt::join(parts, "; ")));
  }
}

/// "The fast Gauss-Markov process (GM1) is known in 9 of 36 models, ..."
void say_gauss_markov(const std::vector<Fit>& fits, std::vector<std::string>& sentences) {
  struct Count {
    std::size_t n = 0;
    std::size_t known = 0;
  };
  std::map<std::string, Count> counts;
  for (const Fit& fit : fits) {
    for (const FitParameter& parameter : fit.parameters) {
      if (parameter.process.rfind("GM", 0) != 0 || parameter.name != "sigma2") continue;
      const FitParameter* rate = find_parameter(fit, parameter.process, "beta");
      Count& count = counts[parameter.process];
      ++count.n;
      if (is_known(parameter) && rate != nullptr && is_known(*rate)) ++count.known;
    }
  }
  std::vector<std::string> parts;
  for (const auto& [process, count] : counts)
    parts.push_back(fmt::format("{} in {} of {} models", process, count.known, count.n));
  if (!parts.empty())
    sentences.push_back(
        fmt::format("Gauss-Markov processes, the fastest first, known with rate and variance: {}.",
                    fmt::join(parts, ", ")));
}

double seconds_of(const Fit& fit) {
  if (fit.levels.empty() || !fit.n) return 0.0;
  return *fit.n * fit.levels.front().tau_s / 2.0;
}

}  // namespace

std::vector<std::string> what_is_known(const std::vector<Fit>& fits) {
  std::vector<std::string> sentences;
  say_white_noise(fits, sentences);
  say_gauss_markov(fits, sentences);
  return sentences;
}

std::vector<std::string> records_needed(const std::vector<Fit>& fits) {
  struct Regime {
    double record_s = 0.0;
    std::vector<double> seen_s;  ///< correlation times that the record lasts once at least
    std::size_t unseen = 0;      ///< models whose slow process is slower than that
  };
  std::vector<std::string> names;
  std::map<std::string, Regime> regimes;
  for (const Fit& fit : fits) {
    double slowest_s = 0.0;
    for (const FitParameter& parameter : fit.parameters) {
      if (parameter.name != "beta" || parameter.ci_low || !parameter.value || !(*parameter.value > 0.0))
        continue;
      slowest_s = std::max(slowest_s, 1.0 / *parameter.value);
    }
    const double record_s = seconds_of(fit);
    if (!(kCorrelationTimes * slowest_s > record_s)) continue;
    if (regimes.find(fit.regime) == regimes.end()) names.push_back(fit.regime);
    Regime& regime = regimes[fit.regime];
    regime.record_s = std::max(regime.record_s, record_s);
    if (slowest_s <= record_s) {
      regime.seen_s.push_back(slowest_s);
    } else {
      ++regime.unseen;
    }
  }
  std::vector<std::string> sentences;
  for (const std::string& name : names) {
    Regime& regime = regimes[name];
    std::vector<std::string> parts;
    if (!regime.seen_s.empty()) {
      const auto middle = regime.seen_s.begin() + static_cast<std::ptrdiff_t>(regime.seen_s.size() / 2);
      std::nth_element(regime.seen_s.begin(), middle, regime.seen_s.end());
      parts.push_back(fmt::format("about {} as fitted in {} models (median)",
                                  duration_words(std::round(kCorrelationTimes * *middle)),
                                  regime.seen_s.size()));
    }
    if (regime.unseen > 0) {
      parts.push_back(
          fmt::format("more than {} in {} models, whose slow process is slower than this record is long",
                      duration_words(std::round(kCorrelationTimes * regime.record_s)), regime.unseen));
    }
    sentences.push_back(
        fmt::format("Record longer ({}) where rate and variance of the slow process are wanted: it takes "
                    "{:.0f} of its correlation times, {}. This run has {}. For times shorter than this "
                    "record the models hold as they are.",
                    name.empty() ? "all" : name, kCorrelationTimes, fmt::join(parts, "; "),
                    duration_words(regime.record_s)));
  }
  return sentences;
}

}  // namespace imuscope::report
