#include <fmt/format.h>
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

#include "base/json_text.h"
#include "base/units.h"
#include "commands.h"
#include "print.h"
#include "results/tables/json_file.h"

namespace imuscope::cli {
namespace {

using nlohmann::json;

struct TablesCommand {
  std::filesystem::path run;
  std::string truth;
  std::vector<std::string> axes{"gyro_x", "gyro_y", "gyro_z"};
  bool json = false;
};

Result<json> read(const std::filesystem::path& file, const std::string& remedy) {
  auto document = tables::read_json_file(file);
  if (document.is_discarded()) return work_error(file.string() + " is absent or no JSON", remedy);
  return document;
}

std::optional<double> number(const json& object, const char* key) {
  const auto found = object.find(key);
  if (found == object.end() || !found->is_number()) return std::nullopt;
  return found->get<double>();
}

/// True values by S-IMU, axis, regime, process and name.
using Truth = std::map<std::string, double>;
std::string key_of(const std::string& imu, const std::string& axis, const std::string& regime,
                   const json& parameter) {
  return fmt::format("{}/{}/{}/{}/{}", imu, axis, regime, parameter.at("process").get<std::string>(),
                     parameter.at("name").get<std::string>());
}

Result<Truth> read_truth(const std::filesystem::path& file) {
  Truth truth;
  const auto document = read(file, "give the truth.json that imusim record wrote");
  if (!document) return tl::unexpected<Error>(document.error());
  for (const auto& imu : document->at("imus")) {
    for (const auto& model : imu.at("noise")) {
      for (const auto& p : model.at("parameters")) {
        truth[key_of(imu.at("name"), model.at("axis"), model.at("regime"), p)] = p.at("value").get<double>();
      }
    }
  }
  return truth;
}

/// Gyroscopes in deg/s, as in the paper: factor for a parameter in the unit that the files have.
struct Shown {
  double factor = 1.0;
  std::string unit;
};
Shown shown(const std::string& unit) {
  if (unit == "(rad/s)^2") return {kDegPerRad * kDegPerRad, "(deg/s)^2"};
  if (unit == "rad/s") return {kDegPerRad, "deg/s"};
  return {1.0, unit};
}

std::string value_text(std::optional<double> value, double factor) {
  return value ? fmt::format("{:.5g}", *value * factor) : "-";
}

std::string interval_text(const json& p, const std::string& key, double factor) {
  const auto low = number(p, (key + "_ci_low").c_str());
  const auto high = number(p, (key + "_ci_high").c_str());
  return low && high ? fmt::format("[{:.4g}, {:.4g}]", *low * factor, *high * factor) : "not identifiable";
}

/// How many intervals were given, and how many hold the truth.
struct Held {
  int given = 0;
  int of = 0;
  int held = 0;
};

void account(const json& p, const std::string& key, std::optional<double> truth, Held& held) {
  if (!truth) return;
  ++held.of;
  const auto low = number(p, (key + "_ci_low").c_str());
  const auto high = number(p, (key + "_ci_high").c_str());
  if (!low || !high) return;
  ++held.given;
  held.held += *low <= *truth && *truth <= *high ? 1 : 0;
}

std::optional<double> truth_of(const Truth& truth, const json& comparison, const char* side, const json& p) {
  const auto found = truth.find(
      key_of(comparison.at("name"), comparison.at("axis"), comparison.at(side).get<std::string>(), p));
  if (found == truth.end()) return std::nullopt;
  return found->second;
}

std::string p_text(std::optional<double> p) {
  constexpr double kSmallest = 1e-16;
  if (!p) return "-";
  return *p < kSmallest ? "< 1e-16" : fmt::format("{:.2g}", *p);
}

bool wanted(const TablesCommand& options, const json& entry) {
  return std::find(options.axes.begin(), options.axes.end(), entry.at("axis").get<std::string>()) !=
         options.axes.end();
}

const json* find_regression(const json& regressions, const json& like, const char* method, bool projected) {
  for (const auto& r : regressions) {
    if (r.at("name") == like.at("name") && r.at("axis") == like.at("axis") && r.at("method") == method &&
        r.at("projected").get<bool>() == projected)
      return &r;
  }
  return nullptr;
}

void print_table1(const TablesCommand& options, const json& regressions) {
  say("Table I: linear regression of the errors on fifteen measures of the dynamics\n");
  say("{:<8} {:<8} {:>8} {:>9} {:>11} {:>9}   {:>11} {:>9}   {:>11} {:>9}\n", "", "", "n", "R2 (OLS)",
      "F (OLS)", "p (OLS)", "F (GLS)", "p (GLS)", "F projected", "p");
  for (const auto& ols : regressions) {
    if (ols.at("method") != "ols" || ols.at("projected").get<bool>() || !wanted(options, ols)) continue;
    const auto cells = [](const json* r) {
      return r == nullptr
                 ? fmt::format("{:>11} {:>9}", "-", "-")
                 : fmt::format("{:>11.4g} {:>9}", r->at("f").get<double>(), p_text(number(*r, "p_value")));
    };
    say("{:<8} {:<8} {:>8} {:>7.2f} % {}   {}   {}\n", ols.at("name").get<std::string>(),
        ols.at("axis").get<std::string>(), ols.at("n").get<std::int64_t>(),
        100.0 * ols.at("r2").get<double>(), cells(&ols),
        cells(find_regression(regressions, ols, "gls", false)),
        cells(find_regression(regressions, ols, "gls", true)));
  }
}

void print_table2(const TablesCommand& options, const json& comparisons, const Truth& truth) {
  say("\nTable II: noise models per regime (95 % intervals; p corrected by Holm's method over the S-IMU)\n");
  std::map<std::string, Held> held;
  for (const auto& c : comparisons) {
    if (!wanted(options, c)) continue;
    const auto first = c.at("first").get<std::string>();
    const auto second = c.at("second").get<std::string>();
    say("\n{} {}\n{:<4} {:<7} {:<10} | {:>9} {:>9} {:<22} | {:>9} {:>9} {:<22} | {:>8}  {}\n",
        c.at("name").get<std::string>(), c.at("axis").get<std::string>(), "", "", "", "truth", first, "",
        "truth", second, "", "p", "");
    for (const auto& p : c.at("parameters")) {
      const auto [factor, unit] = shown(p.at("unit"));
      const auto true_first = truth_of(truth, c, "first", p);
      const auto true_second = truth_of(truth, c, "second", p);
      say("{:<4} {:<7} {:<10} | {:>9} {:>9} {:<22} | {:>9} {:>9} {:<22} | {:>8}  {}\n",
          p.at("process").get<std::string>(), p.at("name").get<std::string>(), unit,
          value_text(true_first, factor), value_text(number(p, "first"), factor),
          interval_text(p, "first", factor), value_text(true_second, factor),
          value_text(number(p, "second"), factor), interval_text(p, "second", factor),
          p_text(number(p, "p_holm")), p.at("verdict").get<std::string>());
      account(p, "first", true_first, held[first]);
      account(p, "second", true_second, held[second]);
    }
    const json& joint = c.at("joint");
    if (!joint.is_null()) {
      say("jointly: chi2({}) = {:.4g}, p: {} (corrected: {})\n", joint.at("dof").get<int>(),
          joint.at("statistic").get<double>(), p_text(number(joint, "p_value")),
          p_text(number(joint, "p_holm")));
    }
    for (const auto& remark : c.at("remarks")) say("{}\n", remark.get<std::string>());
  }
  say("\n");
  for (const auto& [regime, h] : held) {
    if (h.of == 0) continue;
    say("{}: {} of {} parameters have an interval; {} of those hold the truth\n", regime, h.given, h.of,
        h.held);
  }
}

Result<void> tables(const TablesCommand& options) {
  const std::string remedy = "run imuscope process into this folder first";
  const auto regression = read(options.run / "regression.json", remedy);
  if (!regression) return tl::unexpected<Error>(regression.error());
  const auto comparison = read(options.run / "comparison.json", remedy);
  if (!comparison) return tl::unexpected<Error>(comparison.error());
  Truth truth;
  const auto beside = options.run / "truth.json";
  if (!options.truth.empty() || std::filesystem::exists(beside)) {
    auto found = read_truth(options.truth.empty() ? beside : std::filesystem::path(options.truth));
    if (!found) return tl::unexpected<Error>(found.error());
    truth = std::move(*found);
  }
  if (options.json) {
    json all{{"schema", "imuscope.tables/1"},
             {"regressions", regression->at("regressions")},
             {"comparisons", comparison->at("comparisons")}};
    for (auto& c : all["comparisons"]) {
      for (auto& p : c["parameters"]) {
        for (const char* side : {"first", "second"}) {
          const auto value = truth_of(truth, c, side, p);
          p[std::string(side) + "_truth"] = value ? json(*value) : json(nullptr);
        }
      }
    }
    say("{}\n", json_text(all));
    return {};
  }
  print_table1(options, regression->at("regressions"));
  print_table2(options, comparison->at("comparisons"), truth);
  const auto regimes = read(options.run / "regimes.json", remedy);
  if (!regimes) return tl::unexpected<Error>(regimes.error());
  for (const auto& regime : regimes->at("regimes")) {
    say("{}: {:.1f} s, longest stretch {:.1f} s\n", regime.at("name").get<std::string>(),
        regime.at("total_s").get<double>(), regime.at("longest_s").get<double>());
  }
  for (const auto& remark : regimes->at("remarks")) say("Note: {}\n", remark.get<std::string>());
  return {};
}

}  // namespace

void add_tables(CLI::App& app, Work& chosen) {
  auto* command = app.add_subcommand(
      "tables", "Tables I and II of a finished study, with the truth of a simulation beside the estimate");
  auto options = std::make_shared<TablesCommand>();
  command->add_option("RUN_DIR", options->run, "folder of a finished run")->required()->type_name("DIR");
  command
      ->add_option("--truth", options->truth,
                   "truth.json of the simulation; otherwise that in RUN_DIR, if any")
      ->type_name("FILE");
  command->add_option("--axis", options->axes, "axes to show: gyro_x .. accel_z")->capture_default_str();
  command->add_flag("--json", options->json, "print JSON");
  on_chosen(*command, chosen,
            [options] { return tables::with_documents_of(options->run, [&] { return tables(*options); }); });
}

}  // namespace imuscope::cli
