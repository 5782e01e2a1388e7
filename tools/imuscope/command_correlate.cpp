#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "base/json_text.h"
#include "base/units.h"
#include "commands.h"
#include "joint_run.h"
#include "models/certificate/joint_axes.h"
#include "models/certificate/json.h"
#include "models/noise/holm.h"
#include "models/noise/signal.h"
#include "print.h"
#include "progress.h"
#include "record_files.h"

namespace imuscope::cli {
namespace {

constexpr std::array<const char*, kErrorAxes> kErrorAxisNames{"gyro_x",  "gyro_y",  "gyro_z",
                                                              "accel_x", "accel_y", "accel_z"};

struct CorrelateCommand {
  std::filesystem::path path;
  std::vector<std::string> names;
  std::string regime = "static";
  RecordChoice log;
  certificate::JointOptions how;
  bool json = false;
};

/// Root of a variance for people: of gyros in deg/s. Below zero there is none.
std::string shown_root(double variance, double factor) {
  return variance > 0.0 ? fmt::format("{:.3g}", factor * std::sqrt(variance)) : "0";
}

/// A scale that is worth fewer squares tells nothing of parts.
constexpr double kFewestSquares = 5.0;

std::string shown(const noise::Estimate& estimate, double squares, double factor) {
  if (squares < kFewestSquares) return "-";
  return fmt::format("{} [{}, {}]", shown_root(estimate.value, factor), shown_root(estimate.ci_low, factor),
                     shown_root(estimate.ci_high, factor));
}

void print_pairs(const certificate::JointAxes& joint, const std::vector<std::string>& names) {
  for (const auto& pair : joint.pairs) {
    const bool significant = pair.p_holm < noise::kSignificance;
    say("  {} and {}: {}\n", names[pair.first], names[pair.second],
        significant ? fmt::format("coherence {:.2f} [{:.2f}, {:.2f}] at {:.3g} s (p = {:.2g}, corrected)",
                                  pair.coherence.value, pair.coherence.ci_low, pair.coherence.ci_high,
                                  pair.tau_s, pair.p_holm)
                    : fmt::format("nothing in common that shows (p = {:.2g}, corrected)", pair.p_holm));
  }
}

void print_run_axis(const certificate::JointAxes& joint, const std::vector<std::string>& names,
                    const std::string& axis) {
  const bool gyro = axis.starts_with("gyro");
  const double factor = gyro ? 1.0 / kRadPerDeg : 1.0;
  say("{}, {}, about b: {} samples\n", axis, gyro ? "deg/s" : "m/s^2", joint.samples);
  say("  {:>9} {:>26}", "tau_s", "common to all");
  for (const auto& name : names) say(" {:>26}", name + " alone");
  say(" {:>10}\n", "mean");
  for (const auto& scale : joint.scales) {
    say("  {:>9.4g} {:>26}", scale.tau_s, shown(scale.common, scale.squares, factor));
    for (const auto& own : scale.own) say(" {:>26}", shown(own, scale.squares, factor));
    say(" {:>10}\n", shown_root(scale.mean_variance, factor));
  }
  say("  quietest mean from {:.3g} to {:.3g} s:", joint.from_s, joint.to_s);
  for (std::size_t i = 0; i < names.size(); ++i) say(" {} {:.3f}", names[i], joint.weights[i]);
  say("; {:.0f} % of the best S-IMU alone ({:.0f} % on halves that it was not chosen on)\n",
      100.0 * joint.ratio, 100.0 * joint.held_out);
  print_pairs(joint, names);
}

nlohmann::json number(double value) {
  return std::isfinite(value) ? nlohmann::json(value) : nlohmann::json(nullptr);
}

nlohmann::json estimate_json(const noise::Estimate& estimate) {
  return {{"value", number(estimate.value)},
          {"ci_low", number(estimate.ci_low)},
          {"ci_high", number(estimate.ci_high)}};
}

nlohmann::json json_of(const certificate::JointAxes& joint, const std::vector<std::string>& names,
                       bool common) {
  nlohmann::json out{{"signals", names}, {"rate_hz", joint.rate_hz}, {"samples", joint.samples}};
  out["scales"] = nlohmann::json::array();
  for (const auto& scale : joint.scales) {
    nlohmann::json row{
        {"tau_s", scale.tau_s}, {"squares", number(scale.squares)}, {"variance", scale.variance}};
    if (common) {
      row["common"] = estimate_json(scale.common);
      row["own"] = nlohmann::json::array();
      for (const auto& own : scale.own) row["own"].push_back(estimate_json(own));
      row["mean_variance"] = number(scale.mean_variance);
    }
    out["scales"].push_back(std::move(row));
  }
  out["pairs"] = certificate::pairs_json(joint, names);
  if (common) {
    out["mean"] = {{"weights", joint.weights},
                   {"from_s", joint.from_s},
                   {"to_s", joint.to_s},
                   {"ratio", number(joint.ratio)},
                   {"held_out", number(joint.held_out)}};
  }
  return out;
}

/// What has the quietest mean published live. Nothing where an axis has no weights.
void print_virtual_imu(const std::vector<std::string>& names,
                       const std::array<std::vector<double>, kErrorAxes>& weights) {
  if (names.size() < 2 ||
      std::any_of(weights.begin(), weights.end(), [](const auto& of_axis) { return of_axis.empty(); }))
    return;
  say("\nTo have this mean published live as IMUSCOPE_VIRTUAL, add to the configuration:\n\n[virtual_imu]\n"
      "imus = [\"{}\"]\n",
      fmt::join(names, "\", \""));
  for (std::size_t axis = 0; axis < kErrorAxes; ++axis)
    say("{} = [{:.4f}]\n", kErrorAxisNames[axis], fmt::join(weights[axis], ", "));
}

Result<void> correlate_run(const CorrelateCommand& options) {
  ProgressBar bar;
  bar.show("reading");
  const auto run = read_joint_run(options.path, options.names, options.regime);
  bar.clear();
  if (!run) return tl::unexpected(run.error());
  nlohmann::json document{
      {"schema", "imuscope.correlation/1"}, {"regime", options.regime}, {"axes", nlohmann::json::object()}};
  std::array<std::vector<double>, kErrorAxes> weights;
  for (std::size_t axis = 0; axis < kErrorAxes; ++axis) {
    bar.show("axes", static_cast<double>(axis) / static_cast<double>(kErrorAxes));
    std::vector<certificate::JointSignal> signals;
    for (std::size_t i = 0; i < run->names.size(); ++i)
      signals.push_back({run->names[i], run->values[axis][i]});
    certificate::JointOptions how = options.how;
    how.rate_hz = run->rate_hz;
    const auto joint = joint_axes(signals, how);
    bar.clear();
    if (!joint) return tl::unexpected(joint.error());
    weights[axis].assign(joint->weights.begin(), joint->weights.end());
    document["axes"][kErrorAxisNames[axis]] = json_of(*joint, run->names, true);
    if (options.json) continue;
    if (axis > 0) say("\n");
    print_run_axis(*joint, run->names, kErrorAxisNames[axis]);
  }
  if (options.json)
    say("{}\n", json_text(document));
  else
    print_virtual_imu(run->names, weights);
  return {};
}

Result<void> correlate_log(const CorrelateCommand& options) {
  RecordChoice log = options.log;
  if (!options.names.empty()) log.imu = options.names.front();
  auto records = read_records({options.path}, log);
  if (!records) return tl::unexpected(records.error());
  if (records->size() > 1) {
    return usage_error(
        fmt::format("{} holds {} IMUs, and their axes are not those of one sensor", options.path.string(),
                    records->size()),
        "choose one with --name; what several on one vehicle have in common is told by the folder "
        "of its study (imuscope process)");
  }
  auto& axes = records->front().axes;
  std::vector<certificate::JointSignal> signals;
  std::vector<std::string> names;
  for (auto& axis : axes) {
    if (axis.fetch) {
      auto samples = axis.fetch();
      if (!samples) return tl::unexpected(samples.error());
      axis.values = std::move(*samples);
    }
    for (std::size_t t = 0; t < axis.mask.size(); ++t) {
      if (axis.mask[t] == 0) axis.values[t] = std::nan("");
    }
    signals.push_back({axis.name, axis.values});
    names.push_back(axis.name);
  }
  certificate::JointOptions how = options.how;
  how.rate_hz = axes.front().rate_hz;
  how.share_a_reference = false;
  const auto joint = joint_axes(signals, how);
  if (!joint) return tl::unexpected(joint.error());
  if (options.json) {
    auto document = json_of(*joint, names, false);
    document["schema"] = "imuscope.correlation/1";
    say("{}\n", json_text(document));
    return {};
  }
  say("{}: {} samples at {:.6g} Hz\n", records->front().name, joint->samples, joint->rate_hz);
  print_pairs(*joint, names);
  return {};
}

}  // namespace

void add_correlate(CLI::App& app, Work& chosen) {
  auto* command = app.add_subcommand(
      "correlate",
      "What S-IMUs of a run have in common, what is each one's own, and the weights of their quietest mean; "
      "of a log, what its axes have in common");
  auto options = std::make_shared<CorrelateCommand>();
  command
      ->add_option(
          "PATH", options->path,
          "The folder of a study; or the log or capture of a sensor at rest as characterize reads it")
      ->required();
  command->add_option("--name,-n", options->names,
                      "S-IMUs of the run to take (default: all); the IMU of a capture");
  command->add_option("--regime", options->regime, "Of a run: static, dynamic, another regime's name, or all")
      ->capture_default_str();
  command->add_option("--from", options->how.from_s,
                      "Shortest time scale, seconds, at which the mean shall be quiet");
  command->add_option("--to", options->how.to_s, "Longest one (default: as far as the record tells weights)");
  command->add_option("--rate,-r", options->log.signal.rate_hz,
                      "Of a log: samples per second (default: by the time stamps)");
  command->add_option("--gyro-unit", options->log.gyro_unit,
                      "Of a log, where its names do not say: rad/s or deg/s");
  command->add_option("--accel-unit", options->log.accel_unit,
                      "Of a log, where its names do not say: m/s^2 or g");
  command->add_option("--confidence", options->how.confidence, "Of every interval (default: 0.95)")
      ->check(CLI::Range(0.51, 0.9999));
  command->add_flag("--json", options->json, "Print JSON");
  on_chosen(*command, chosen, [options] {
    return std::filesystem::is_directory(options->path) ? correlate_run(*options) : correlate_log(*options);
  });
}

}  // namespace imuscope::cli
