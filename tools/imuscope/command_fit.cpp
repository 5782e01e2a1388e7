#include <fmt/format.h>

#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

#include "base/json_text.h"
#include "commands.h"
#include "fit_output.h"
#include "log_plot.h"
#include "models/noise/conservative.h"
#include "models/noise/json.h"
#include "models/noise/nested_fit.h"
#include "print.h"
#include "signal_options.h"

namespace imuscope::cli {
namespace {

struct FitCommand {
  SignalOptions signal;
  std::string model;
  noise::Weighting weighting = noise::Weighting::kOptimal;
  double confidence = 0.95;
  bool quick_intervals = false;
  bool select = false;
  bool conservative = false;
  bool keep_lines = false;
  bool plot = false;
};

/// What one call of the command works on.
struct Task {
  const FitCommand& options;
  noise::SignalUnit unit;
  noise::FitOptions fit_options;
  std::vector<noise::WaveletVariance> wvs;
  std::vector<std::vector<noise::Line>> lines;  ///< that were taken out of each
  std::vector<std::string> warnings;            ///< of the signals
  double rate_hz;
};

/// The wavelet variance as points with what the model allows it, and the model between them.
void print_plot(const noise::FitResult& fit, const std::string& unit) {
  std::vector<PlottedPoint> points;
  for (const auto& level : fit.wv) {
    points.push_back({level.observed.tau_samples / fit.rate_hz, level.observed.value, level.observed.ci_low,
                      level.observed.ci_high, level.fitted});
  }
  say("\n");
  for (const auto& line :
       log_plot(points, "tau, s",
                unit.empty() ? "wavelet variance" : fmt::format("wavelet variance, ({})^2", unit)))
    say("{}\n", line);
}

/// The fit that the command is about, after the ranking that led to it and what else belongs to it.
void report(const Task& task, noise::FitResult fit, const nlohmann::json& extra) {
  fit.warnings.insert(fit.warnings.begin(), task.warnings.begin(), task.warnings.end());
  std::optional<noise::FitResult> bound;
  if (task.options.conservative) {
    bound = noise::over_bounding(fit);
    if (const double increase = noise::largest_increase(fit, *bound); increase > noise::kMostIncrease) {
      bound.reset();
      fit.warnings.push_back(
          fmt::format("no over-bounding model: an amplitude would have to be {:.3g} times the fitted one, "
                      "as the model misses levels by factors; give it the terms that they show",
                      increase));
    }
  }
  if (task.options.signal.json) {
    auto json = noise::fit_to_json(fit, task.unit);
    json.update(extra);
    if (task.wvs.size() == 1 && !task.lines.front().empty())
      json["sinusoids"] = noise::sinusoids_to_json(task.lines.front(), fit, task.options.signal.unit);
    if (task.options.conservative)
      json["conservative"] = bound ? conservative_json(*bound, task.unit) : nlohmann::json(nullptr);
    say("{}\n", json_text(json));
    return;
  }
  print_fit(fit, task.unit);
  if (bound) print_conservative(*bound, task.unit);
  if (task.options.plot) print_plot(fit, task.options.signal.unit);
}

Result<void> fit_one(const Task& task, const noise::ModelSpec& spec) {
  const auto& wv = task.wvs.front();
  const double rate_hz = task.rate_hz;
  if (!task.options.select) {
    const auto fit = noise::fit(wv, spec, rate_hz, task.fit_options);
    if (!fit) return tl::unexpected(fit.error());
    report(task, *fit, nlohmann::json::object());
    return {};
  }
  noise::FitOptions quick = task.fit_options;
  quick.intervals = noise::Intervals::kQuick;
  const auto ranked = noise::rank_models(wv, spec, rate_hz, quick);
  if (!ranked) return tl::unexpected(ranked.error());
  if (!task.options.signal.json) print_ranking(*ranked);
  const auto& test = ranked->front().fit.j_test;
  if (test && test->p_value < noise::kRejectedOutright) {
    say_aside(
        "warning: the data reject every one of these models; `imuscope characterize` also looks for "
        "resonances and flicker noise, or name them: --model WN+RES+GM+FN+RW\n");
  }
  noise::FitOptions again = task.fit_options;
  again.warm_start = &ranked->front().fit;
  const auto best = noise::fit(wv, ranked->front().fit.spec, rate_hz, again);
  if (!best) return tl::unexpected(best.error());
  report(task, *best, {{"ranking", noise::ranking_to_json(*ranked)}});
  return {};
}

Result<void> fit_replicates(const Task& task, noise::ModelSpec spec) {
  const double rate_hz = task.rate_hz;
  auto extra = nlohmann::json::object();
  if (task.options.select) {
    noise::FitOptions quick = task.fit_options;
    quick.intervals = noise::Intervals::kQuick;
    const auto ranked = noise::cross_validate(task.wvs, spec, rate_hz, quick);
    if (!ranked) return tl::unexpected(ranked.error());
    if (!task.options.signal.json) print_ranking(*ranked);
    extra["ranking"] = ranking_json(*ranked);
    spec = ranked->front().pooled.spec;
  }
  const auto joint = noise::fit_jointly(task.wvs, spec, rate_hz, task.fit_options);
  if (!joint) return tl::unexpected(joint.error());
  extra.update(replicates_json(*joint, task.unit));
  report(task, joint->pooled, extra);
  if (!task.options.signal.json) print_replicates(*joint);
  return {};
}

Result<void> run_fit(const FitCommand& options) {
  const auto spec = noise::parse_model(options.model);
  if (!spec) return tl::unexpected(spec.error());
  // A model that has sinusoids finds them itself.
  const bool keeps = options.keep_lines || spec->count(noise::ProcessKind::kSinusoid) > 0;
  auto read = wavelet_variances_of(options.signal, keeps ? noise::Lines::kStay : noise::Lines::kTakenOut);
  if (!read) return tl::unexpected(read.error());
  Task task{options,
            noise::parse_unit(options.signal.unit).value(),
            {},
            std::move(read->wvs),
            keeps ? std::vector<std::vector<noise::Line>>(read->lines.size()) : std::move(read->lines),
            std::move(read->warnings),
            read->rate_hz};
  task.fit_options.weighting = options.weighting;
  task.fit_options.confidence = options.confidence;
  if (!options.quick_intervals) task.fit_options.intervals = noise::Intervals::kInverted;
  task.fit_options.signal_unit = options.signal.unit;
  return task.wvs.size() == 1 ? fit_one(task, *spec) : fit_replicates(task, *spec);
}

}  // namespace

void add_fit(CLI::App& app, Work& chosen) {
  auto* command =
      app.add_subcommand("fit", "Noise model of a signal (generalized method of wavelet moments)");
  auto options = std::make_shared<FitCommand>();
  add_signal_options(*command, options->signal, true);
  command
      ->add_option("--model,-m", options->model, "Terms of QN, WN, MA1, ARMA11, SIN, GM, RW, DR: 'WN+2*GM'")
      ->required();
  const std::map<std::string, noise::Weighting> weightings{{"optimal", noise::Weighting::kOptimal},
                                                           {"ci", noise::Weighting::kCi}};
  command
      ->add_option("--weights,-w", options->weighting,
                   "optimal: inverse covariance under the model; ci: 1/(interval width)^2 (default: optimal)")
      ->transform(CLI::CheckedTransformer(weightings, CLI::ignore_case));
  command
      ->add_option("--confidence", options->confidence,
                   "Of every interval, as a share: 0.99 for 99 % (default: 0.95)")
      ->check(CLI::Range(0.51, 0.9999));
  command->add_flag(
      "--quick-intervals", options->quick_intervals,
      "Intervals from the estimate's own covariance, none for slow processes, as the live refits have them");
  command->add_flag("--keep-lines", options->keep_lines,
                    "Leave sinusoids (an engine, a fan) in the signal instead of "
                    "taking them out before the fit");
  command->add_flag("--plot", options->plot, "Draw wavelet variance and model, too, in the terminal");
  command->add_flag("--select", options->select,
                    "Rank the sub-models and report the best; of three or more files by cross-validation");
  command->add_flag(
      "--conservative", options->conservative,
      "Also give amplitudes that over-bound the noise, for a filter that must not be optimistic");
  on_chosen(*command, chosen, [options] { return run_fit(*options); });
}

}  // namespace imuscope::cli
