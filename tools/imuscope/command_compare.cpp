#include <fmt/format.h>

#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

#include "base/json_text.h"
#include "commands.h"
#include "fit_file.h"
#include "models/noise/compare.h"
#include "print.h"

namespace imuscope::cli {
namespace {

struct CompareCommand {
  std::filesystem::path first;
  std::filesystem::path second;
  bool json = false;
};

Result<noise::FitResult> read_fit(const std::filesystem::path& file) {
  auto fits = read_fits(file);
  if (!fits) return tl::unexpected(fits.error());
  if (fits->size() > 1) {
    return usage_error(fmt::format("{} holds {} models", file.string(), fits->size()),
                       "give files of one fit each");
  }
  return std::move(fits->front().fit);
}

std::string cell(const std::optional<double>& value) { return value ? fmt::format("{:.6g}", *value) : "-"; }

void print_table(const noise::Comparison& comparison) {
  say("{:<7} {:<10} {:>14} {:>14} {:>10} {:>10}  {}\n", "process", "parameter", "first", "second", "ratio",
      "p-value", "unit");
  for (const auto& p : comparison.parameters) {
    say("{:<7} {:<10} {:>14} {:>14} {:>10} {:>10}  {}\n", p.process, p.name, cell(p.first), cell(p.second),
        p.ratio ? fmt::format("{:.4g}", *p.ratio) : "-", p.p_value ? fmt::format("{:.3g}", *p.p_value) : "-",
        p.unit);
  }
  if (comparison.test) {
    const auto& t = *comparison.test;
    constexpr double kLevel = 0.05;
    say("\nall together: {:.4g} on {} dof, p = {:.3g}: {}\n", t.statistic, t.dof, t.p_value,
        t.p_value < kLevel ? "the models differ" : "no difference shown");
  }
  for (const auto& warning : comparison.warnings) say("! {}\n", warning);
}

nlohmann::json to_json(const std::optional<double>& value) {
  return value ? nlohmann::json(*value) : nlohmann::json(nullptr);
}

void print_json(const noise::Comparison& comparison) {
  nlohmann::json json{
      {"parameters", nlohmann::json::array()}, {"test", nullptr}, {"warnings", comparison.warnings}};
  for (const auto& p : comparison.parameters) {
    json["parameters"].push_back({{"process", p.process},
                                  {"name", p.name},
                                  {"unit", p.unit},
                                  {"first", to_json(p.first)},
                                  {"second", to_json(p.second)},
                                  {"ratio", to_json(p.ratio)},
                                  {"p_value", to_json(p.p_value)}});
  }
  if (comparison.test) {
    json["test"] = {{"statistic", comparison.test->statistic},
                    {"dof", comparison.test->dof},
                    {"p_value", comparison.test->p_value}};
  }
  say("{}\n", json_text(json));
}

}  // namespace

void add_compare(CLI::App& app, Work& chosen) {
  auto* command = app.add_subcommand("compare", "Two fits side by side, with the test of their difference");
  auto options = std::make_shared<CompareCommand>();
  command->add_option("A", options->first, "What `imuscope fit --json` printed")->required();
  command->add_option("B", options->second, "The other")->required();
  command->add_flag("--json", options->json, "Print JSON");
  on_chosen(*command, chosen, [options]() -> Result<void> {
    const auto first = read_fit(options->first);
    if (!first) return tl::unexpected(first.error());
    const auto second = read_fit(options->second);
    if (!second) return tl::unexpected(second.error());
    const auto comparison = noise::compare(*first, *second);
    if (options->json) {
      print_json(comparison);
    } else {
      print_table(comparison);
    }
    return {};
  });
}

}  // namespace imuscope::cli
