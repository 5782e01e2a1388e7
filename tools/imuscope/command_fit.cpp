#include <fmt/format.h>

#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

#include "commands.h"
#include "noise/json.h"
#include "noise/quantities.h"
#include "noise/select.h"
#include "signal_options.h"

namespace imuscope::cli {
namespace {

struct FitCommand {
  SignalOptions signal;
  std::string model;
  noise::Weighting weighting = noise::Weighting::kOptimal;
  std::string unit;
  bool select = false;
};

std::string interval(const std::optional<double>& low, const std::optional<double>& high) {
  return low && high ? fmt::format("[{:.6g}, {:.6g}]", *low, *high) : "-";
}

void print_fit(const noise::FitResult& fit, noise::SignalUnit unit) {
  fmt::print("model {}   n {}   rate {:g} Hz   weights {}\n\n", fit.spec.name(), fit.n, fit.rate_hz,
             fit.weighting == noise::Weighting::kCi ? "ci" : "optimal");
  fmt::print("{:<7} {:<10} {:>14} {:>14}  {:<30} {}\n", "process", "parameter", "value", "sd",
             "95 % interval", "unit");
  for (const auto& p : fit.parameters) {
    fmt::print("{:<7} {:<10} {:>14.7g} {:>14}  {:<30} {}\n", p.process, p.name, p.value,
               p.sd ? fmt::format("{:.4g}", *p.sd) : "-", interval(p.ci_low, p.ci_high), p.unit);
  }
  fmt::print("\n{:<7} {:<26} {:>14}  {:<30} {}\n", "process", "for filter and data sheet", "value",
             "95 % interval", "unit");
  for (const auto& q : noise::filter_quantities(fit, unit)) {
    fmt::print("{:<7} {:<26} {:>14.7g}  {:<30} {}\n", q.process, q.name, q.value,
               interval(q.ci_low, q.ci_high), q.unit);
  }
  fmt::print("\n{:>5} {:>12} {:>13} {:>13}  {}\n", "level", "tau_s", "wv", "fitted",
             "95 % interval under the model");
  for (const auto& level : fit.wv) {
    fmt::print("{:>5} {:>12.6g} {:>13.6g} {:>13.6g}  [{:.6g}, {:.6g}]\n", level.observed.level,
               level.observed.tau_samples / fit.rate_hz, level.observed.value, level.fitted,
               level.model_ci_low, level.model_ci_high);
  }
  fmt::print("\nobjective {:.8g}", fit.objective);
  if (fit.j_test) {
    fmt::print("   J-test {:.4g} on {} dof, p = {:.3g}", fit.j_test->statistic, fit.j_test->dof,
               fit.j_test->p_value);
  }
  fmt::print("\n{}\n", fit.identifiable ? "identifiable" : "not identifiable");
  for (const auto& warning : fit.warnings) fmt::print("! {}\n", warning);
}

void print_ranking(const std::vector<noise::RankedModel>& ranked) {
  fmt::print("{:<4} {:<20} {:>12} {:>12}  {}\n", "rank", "model", "criterion", "J p-value", "why");
  for (std::size_t i = 0; i < ranked.size(); ++i) {
    const auto& m = ranked[i];
    fmt::print("{:<4} {:<20} {:>12.5g} {:>12}  {}\n", i + 1, m.fit.spec.name(), m.criterion,
               m.fit.j_test ? fmt::format("{:.3g}", m.fit.j_test->p_value) : "-", m.reason);
  }
  fmt::print("\n");
}

nlohmann::json fit_json(const noise::FitResult& fit, const FitCommand& options, noise::SignalUnit unit) {
  auto json = noise::fit_to_json(fit);
  json["unit"] = options.unit;
  json["quantities"] = noise::quantities_to_json(noise::filter_quantities(fit, unit));
  return json;
}

Result<void> select_and_print(const noise::WaveletVariance& wv, const noise::ModelSpec& spec,
                              const FitCommand& options, const noise::FitOptions& fit_options,
                              noise::SignalUnit unit) {
  const auto ranked = noise::rank_models(wv, spec, options.signal.rate_hz, fit_options);
  if (!ranked) return tl::unexpected(ranked.error());
  if (!options.signal.json) {
    print_ranking(*ranked);
    print_fit(ranked->front().fit, unit);
    return {};
  }
  auto json = fit_json(ranked->front().fit, options, unit);
  json["ranking"] = nlohmann::json::array();
  for (const auto& m : *ranked) {
    json["ranking"].push_back(
        {{"model", m.fit.spec.name()},
         {"criterion", m.criterion},
         {"identifiable", m.fit.identifiable},
         {"p_value", m.fit.j_test ? nlohmann::json(m.fit.j_test->p_value) : nlohmann::json()},
         {"reason", m.reason}});
  }
  fmt::print("{}\n", json.dump(2));
  return {};
}

Result<void> run_fit(const FitCommand& options) {
  const auto spec = noise::parse_model(options.model);
  if (!spec) return tl::unexpected(spec.error());
  const auto unit = noise::parse_unit(options.unit);
  if (!unit) return tl::unexpected(unit.error());
  const auto wv = wavelet_variance_of(options.signal);
  if (!wv) return tl::unexpected(wv.error());
  noise::FitOptions fit_options;
  fit_options.weighting = options.weighting;
  fit_options.signal_unit = options.unit;
  if (options.select) return select_and_print(*wv, *spec, options, fit_options, *unit);
  const auto fit = noise::fit(*wv, *spec, options.signal.rate_hz, fit_options);
  if (!fit) return tl::unexpected(fit.error());
  if (options.signal.json) {
    fmt::print("{}\n", fit_json(*fit, options, *unit).dump(2));
  } else {
    print_fit(*fit, *unit);
  }
  return {};
}

}  // namespace

void add_fit(CLI::App& app, Work& chosen) {
  auto* command =
      app.add_subcommand("fit", "Noise model of a signal (generalized method of wavelet moments)");
  auto options = std::make_shared<FitCommand>();
  add_signal_options(*command, options->signal);
  command
      ->add_option("--model,-m", options->model, "Terms of QN, WN, MA1, ARMA11, SIN, GM, RW, DR: 'WN+2*GM'")
      ->required();
  const std::map<std::string, noise::Weighting> weightings{{"optimal", noise::Weighting::kOptimal},
                                                           {"ci", noise::Weighting::kCi}};
  command
      ->add_option("--weights,-w", options->weighting,
                   "optimal: inverse covariance under the model; ci: 1/(interval width)^2 (default: optimal)")
      ->transform(CLI::CheckedTransformer(weightings, CLI::ignore_case));
  command->add_option("--unit,-u", options->unit, "Unit of the signal: rad/s, deg/s, m/s^2 or g");
  command->add_flag("--select", options->select, "Rank the sub-models and report the best");
  on_chosen(*command, chosen, [options] { return run_fit(*options); });
}

}  // namespace imuscope::cli
