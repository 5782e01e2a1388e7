#include <fmt/format.h>

#include <memory>
#include <nlohmann/json.hpp>

#include "base/json_text.h"
#include "commands.h"
#include "print.h"
#include "progress.h"
#include "results/report/report.h"
#include "study/evaluate.h"

namespace imuscope::cli {

namespace {

struct EvaluateCommand {
  EvaluationRunOptions run;
  bool json = false;
};

void print_row(const nlohmann::json& row) {
  const auto number = [&](const char* key) { return row.at(key).get<double>(); };
  const double low = number("nees_low");
  const double high = number("nees_high");
  const auto mark = [&](double nees) { return nees > high ? '+' : nees < low ? '-' : ' '; };
  say("  {:<12} {:>4.0f} {:>5} {:>10.2f} {:>8.2f} {:>6.2f} {:>9.2f}{} {:>9.2f}{} {:>9.2f}{} {:>6.2f} "
      "{:>5.2f} {:>9.2f}\n",
      row.at("model").get<std::string>(), number("duration_s"),
      fmt::format("{}/{}", row.at("n_independent").get<int>(), row.at("n").get<int>()),
      number("horizontal_rms_m"), number("horizontal_sd_m"),
      number("horizontal_rms_m") / number("horizontal_sd_m"), number("nees_position"),
      mark(number("nees_position")), number("nees_velocity"), mark(number("nees_velocity")),
      number("nees_attitude"), mark(number("nees_attitude")), low, high, number("surprise"));
}

void print_table(const nlohmann::json& document) {
  std::string name;
  for (const auto& row : document.at("evaluations")) {
    if (row.at("name") != name) {
      name = row.at("name").get<std::string>();
      say("\n{}: coasting on this sensor alone, against the reference\n", name);
      say("  {:<12} {:>4} {:>5} {:>10} {:>8} {:>6} {:>10} {:>10} {:>10} {:>12} {:>9}\n", "model", "s", "n",
          "horiz. rms", "sd, m", "ratio", "NEES pos.", "vel.", "att.", "95 % of it", "surprise");
    }
    print_row(row);
  }
  for (const auto& absent : document.at("absent")) {
    say("\n{}, {}: {}\n", absent.at("name").get<std::string>(), absent.at("model").get<std::string>(),
        absent.at("why").get<std::string>());
  }
  say("\nn: outages that do not overlap / all. sd: predicted. NEES per degree of freedom: 1 where the model "
      "is right,\n+ above, - below where 95 % of right models lie. surprise: mean -log density of the "
      "position error; the smallest predicts best.\n");
}

Result<void> evaluate(const EvaluateCommand& options) {
  EvaluationRunOptions run = options.run;
  const auto document = [&] {
    ProgressBar bar;
    run.progress = [&](const std::string& step, double share) { bar.show(step, share); };
    return evaluate_run(run);
  }();
  if (!document) return tl::unexpected<Error>(document.error());
  if (auto written = write_report(run.run_dir); !written) return written;
  if (options.json) {
    say("{}\n", json_text(*document));
  } else {
    print_table(*document);
  }
  return {};
}

}  // namespace

void add_evaluate(CLI::App& app, Work& chosen) {
  auto* command = app.add_subcommand(
      "evaluate", "Puts the noise models of a run to the test: each S-IMU coasts through GNSS outages");
  auto options = std::make_shared<EvaluateCommand>();
  command->add_option("RUN_DIR", options->run.run_dir, "folder that `imuscope process` wrote with --out")
      ->required();
  command
      ->add_option("input", options->run.inputs,
                   "the recording, where it is no longer where the run read it: a capture, or NAME=FILE")
      ->type_name("INPUT");
  command->add_option("--config,-c", options->run.configuration, "configuration, in place of the run's own")
      ->type_name("FILE");
  command->add_option("--durations", options->run.outages.durations_s, "lengths of the outages, s, rising")
      ->delimiter(',')
      ->check(CLI::Range(1.0, 3600.0))
      ->capture_default_str();
  command->add_option("--spacing", options->run.outages.spacing_s, "between the starts of outages, s")
      ->check(CLI::Range(0.1, 3600.0))
      ->capture_default_str();
  command
      ->add_option("--settle", options->run.outages.settle_s, "driven with GNSS before the first outage, s")
      ->check(CLI::Range(0.0, 36000.0))
      ->capture_default_str();
  command->add_flag("--json", options->json, "print evaluation.json");
  on_chosen(*command, chosen, [options] { return evaluate(*options); });
}

}  // namespace imuscope::cli
