#include <fmt/format.h>
#include <fmt/ranges.h>
#include <algorithm>
#include <cmath>
#include <map>

#include "report/people.h"
#include "report/verdict.h"

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

/// White noise of one kind of sensor in one regime, over all S-IMUs and axes, as the sd of a sample.
struct WhiteNoise {
  std::size_t n = 0;
  std::size_t known = 0;
  double lowest = 0.0;
  double highest = 0.0;
  double half_width = 0.0;  ///< widest, relative
  std::string unit;

  void add(const Fit& fit) {
    ++n;
    const FitParameter* white = find_parameter(fit, "WN", "sigma2");
    if (white == nullptr || !is_known(*white) || !(*white->value > 0.0)) return;
    const double sd = std::sqrt(*white->value);
    lowest = known == 0 ? sd : std::min(lowest, sd);
    highest = known == 0 ? sd : std::max(highest, sd);
    // Half the interval of the sd's logarithm, which is a quarter of that of the variance.
    half_width = std::max(half_width, 0.25 * std::log(*white->ci_high / *white->ci_low));
    unit = fit.unit;
    ++known;
  }

  [[nodiscard]] std::string words(const char* sensors) const {
    if (known == 0) return fmt::format("{}: of none of {}", sensors, n);
    const std::string range = fmt::format("{:.3g}", lowest) == fmt::format("{:.3g}", highest)
                                  ? fmt::format("{:.3g}", lowest)
                                  : fmt::format("{:.3g} to {:.3g}", lowest, highest);
    return fmt::format("{} {} {} a sample, ± {:.2g} % or better{}", sensors, range, unit, 100.0 * half_width,
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
  std::vector<std::string> regimes;
  std::map<std::string, std::vector<double>> needed_s;
  std::map<std::string, double> has_s;
  for (const Fit& fit : fits) {
    double slowest = 0.0;
    for (const FitParameter& parameter : fit.parameters) {
      if (parameter.name != "beta" || parameter.ci_low || !parameter.value || !(*parameter.value > 0.0))
        continue;
      slowest = std::max(slowest, 1.0 / *parameter.value);
    }
    const double record_s = seconds_of(fit);
    if (!(kCorrelationTimes * slowest > record_s)) continue;
    if (needed_s.find(fit.regime) == needed_s.end()) regimes.push_back(fit.regime);
    needed_s[fit.regime].push_back(kCorrelationTimes * slowest);
    has_s[fit.regime] = std::max(has_s[fit.regime], record_s);
  }
  std::vector<std::string> sentences;
  for (const std::string& regime : regimes) {
    auto& all = needed_s[regime];
    const auto middle = all.begin() + static_cast<std::ptrdiff_t>(all.size() / 2);
    std::nth_element(all.begin(), middle, all.end());
    sentences.push_back(fmt::format(
        "For rate and variance of the slow process, {}: {:.0f} of its correlation times, which is about {} "
        "as "
        "fitted (median of {} models; a process as slow as the record is long is itself known by its order "
        "of "
        "magnitude alone). This run has {}. What a filter needs for shorter times is in the model as it is.",
        regime.empty() ? "all" : regime, kCorrelationTimes, duration_words(*middle), all.size(),
        duration_words(has_s[regime])));
  }
  return sentences;
}

}  // namespace imuscope::report
