#include "signal_options.h"

#include <fmt/format.h>

#include <cmath>

#include "message_signal.h"
#include "models/noise/quantities.h"

namespace imuscope::cli {
namespace {

Result<noise::SignalLook> look_at(const std::filesystem::path& file, const Signal& signal, double rate_hz,
                                  const SignalOptions& options, noise::Lines lines) {
  noise::WvOptions wv_options;
  wv_options.levels = options.levels;
  wv_options.mask = signal.mask;
  wv_options.nan_is_gap = options.nan_is_gap;
  if (options.robust) wv_options.robust = noise::RobustOptions{options.efficiency, std::nullopt};
  auto look = noise::look_at_signal(signal.values, wv_options, rate_hz, lines);
  if (!look) {
    Error error = look.error();
    error.what = fmt::format("{}: {}", file.string(), error.what);
    if (!options.nan_is_gap && error.remedy.find("gap") != std::string::npos)
      error.remedy += " (--nan-is-gap)";
    return tl::unexpected(error);
  }
  return look;
}

std::string line_warning(const noise::Line& line, const std::string& unit, noise::Lines lines) {
  return noise::in_words(line, unit) + (lines == noise::Lines::kTakenOut
                                            ? ": taken out before the fit (--keep-lines leaves it in)"
                                            : ": it raises the levels around half its period; "
                                              "`fit` takes it out");
}

}  // namespace

void add_signal_options(CLI::App& command, SignalOptions& options, bool several) {
  const char* what = several ? "Signal: CSV, a file of topics (MCAP, ROS bag, PX4 ULog, ArduPilot .bin), or "
                               "raw little-endian float64 (.f64); several are replicates of one sensor"
                             : "Signal: CSV, a file of topics (MCAP, ROS bag, PX4 ULog, ArduPilot .bin), or "
                               "raw little-endian float64 (.f64)";
  auto* file = command.add_option("FILE", options.files, what)->required();
  if (!several) file->expected(1);
  command.add_option("--column,-c", options.choice.column,
                     "Column of a CSV: its name, or its number from 1; of a topic gyro_x to accel_z");
  command.add_option("--topic", options.choice.topic,
                     "Topic of an MCAP file, bag or flight log that holds several IMUs");
  command.add_option("--where", options.choice.where,
                     "COLUMN=VALUE of a CSV: rows with another value count as gaps, as in regime=static");
  command.add_option("--counter", options.choice.counter,
                     "Column of a CSV that counts the samples: numbers left out count as gaps");
  command.add_option(
      "--time", options.choice.time,
      "Column of a CSV with time stamps: seconds, ISO 8601, or WEEK,SECONDS of GPS; times left "
      "out count as gaps. A column named time_s or the like is taken by itself; none: no times");
  command.add_option("--rate,-r", options.choice.rate_hz,
                     "Samples per second (default: what the time stamps say, where there are any)");
  command.add_option("--unit,-u", options.unit, "Unit of the signal: rad/s, deg/s, m/s^2 or g");
  command.add_option("--levels,-l", options.levels, "Number of levels (default: all that the length allows)");
  command.add_flag("--robust", options.robust, "Resist outliers (Tukey biweight)");
  command.add_option("--efficiency", options.efficiency, "Efficiency of the robust estimate on clean data")
      ->check(CLI::Range(0.2, 0.99))
      ->capture_default_str();
  command.add_flag("--nan-is-gap", options.nan_is_gap,
                   "Let NaN and infinity count as gaps instead of refusing them");
  command.add_flag("--json", options.json, "Print JSON");
}

Result<ReadSignals> wavelet_variances_of(const SignalOptions& options, noise::Lines lines) {
  const auto& asked_hz = options.choice.rate_hz;
  if (asked_hz && (!(*asked_hz > 0.0) || !std::isfinite(*asked_hz))) {
    return usage_error(fmt::format("--rate {} is impossible", *asked_hz), "give the samples per second");
  }
  if (const auto unit = noise::parse_unit(options.unit); !unit) return tl::unexpected(unit.error());
  ReadSignals out;
  for (const auto& file : options.files) {
    auto signal = read_any_signal(file, options.choice, out.warnings);
    if (!signal) return tl::unexpected(signal.error());
    if (!signal->rate_hz) {
      return usage_error(fmt::format("{} has no time stamps that would tell its rate", file.string()),
                         "give the samples per second, --rate");
    }
    constexpr double kSameRate = 0.005;
    if (!out.wvs.empty() && std::abs(*signal->rate_hz / out.rate_hz - 1.0) > kSameRate) {
      return usage_error(
          fmt::format("{} has {:g} samples per second and {} has {:g}", options.files.front().string(),
                      out.rate_hz, file.string(), *signal->rate_hz),
          "replicates have one rate");
    }
    if (out.wvs.empty()) out.rate_hz = *signal->rate_hz;
    const auto warn = [&](const std::string& what) {
      out.warnings.push_back(options.files.size() > 1 ? fmt::format("{}: {}", file.string(), what) : what);
    };
    auto look = look_at(file, *signal, out.rate_hz, options, lines);
    if (!look) return tl::unexpected(look.error());
    for (const auto& line : look->lines) warn(line_warning(line, options.unit, lines));
    if (look->spikes) warn(*look->spikes);
    out.lines.push_back(std::move(look->lines));
    out.wvs.push_back(std::move(look->wv));
  }
  return out;
}

}  // namespace imuscope::cli
