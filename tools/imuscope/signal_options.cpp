#include "signal_options.h"

#include <fmt/format.h>

#include <cmath>

#include "mcap_signal.h"
#include "noise/fit.h"
#include "noise/tails.h"

namespace imuscope::cli {
namespace {

Result<noise::WaveletVariance> wavelet_variance_of(const std::filesystem::path& file, const Signal& signal,
                                                   const SignalOptions& options) {
  noise::WvOptions wv_options;
  wv_options.levels = options.levels;
  wv_options.mask = signal.mask;
  wv_options.nan_is_gap = options.nan_is_gap;
  if (options.robust) wv_options.robust = noise::RobustOptions{options.efficiency, std::nullopt};
  auto wv = noise::haar_wavelet_variance(signal.values, wv_options);
  if (!wv) {
    Error error = wv.error();
    error.what = fmt::format("{}: {}", file.string(), error.what);
    if (!options.nan_is_gap && error.remedy.find("gap") != std::string::npos)
      error.remedy += " (--nan-is-gap)";
    return tl::unexpected(error);
  }
  return wv;
}

/// The sinusoids of a signal, after they were taken out of it where that is asked for.
std::vector<noise::Line> lines_of(Signal& signal, double rate_hz, Lines lines) {
  std::vector<std::uint8_t> mask = signal.mask;
  if (mask.empty()) mask.assign(signal.values.size(), 1);
  for (std::size_t i = 0; i < mask.size(); ++i) {
    if (!std::isfinite(signal.values[i])) mask[i] = 0;
  }
  noise::LineOptions line_options;
  line_options.rate_hz = rate_hz;
  auto found = noise::find_lines(signal.values, mask, line_options);
  if (lines == Lines::kTakenOut) noise::remove_lines(signal.values, mask, found, rate_hz);
  return found;
}

std::string line_warning(const noise::Line& line, const std::string& unit, Lines lines) {
  return noise::in_words(line, unit) + (lines == Lines::kTakenOut
                                            ? ": taken out before the fit (--keep-lines leaves it in)"
                                            : ": it raises the levels around half its period; `fit` takes it "
                                              "out");
}

/// A sentence where a signal holds spikes that its wavelet variance does not resist.
std::optional<std::string> spikes_in(const Signal& signal, const noise::WaveletVariance& wv, double rate_hz,
                                     const SignalOptions& options) {
  if (options.robust) return std::nullopt;
  const auto model = noise::fit(wv, noise::parse_model("QN+WN+2*GM").value(), rate_hz);
  if (!model) return std::nullopt;
  noise::WvOptions wv_options;
  wv_options.mask = signal.mask;
  wv_options.nan_is_gap = options.nan_is_gap;
  return noise::spike_warning(noise::test_tails(signal.values, wv_options, model->model), rate_hz);
}

}  // namespace

void add_signal_options(CLI::App& command, SignalOptions& options, bool several) {
  const char* what = several ? "Signal: CSV, MCAP with messages of ROS, or raw little-endian float64 (.f64); "
                               "several are replicates of one sensor"
                             : "Signal: CSV, MCAP with messages of ROS, or raw little-endian float64 (.f64)";
  auto* file = command.add_option("FILE", options.files, what)->required();
  if (!several) file->expected(1);
  command.add_option("--column,-c", options.choice.column,
                     "Column of a CSV: its name, or its number from 1; of an MCAP file gyro_x to accel_z");
  command.add_option("--topic", options.choice.topic, "Topic of an MCAP file, where it holds several IMUs");
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

Result<ReadSignals> wavelet_variances_of(const SignalOptions& options, Lines lines) {
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
    // First, as it refuses what is no signal.
    auto wv = wavelet_variance_of(file, *signal, options);
    if (!wv) return tl::unexpected(wv.error());
    out.lines.push_back(lines_of(*signal, out.rate_hz, lines));
    for (const auto& line : out.lines.back()) warn(line_warning(line, options.unit, lines));
    if (lines == Lines::kTakenOut && !out.lines.back().empty())
      wv = wavelet_variance_of(file, *signal, options);
    if (!wv) return tl::unexpected(wv.error());
    if (const auto spikes = spikes_in(*signal, *wv, out.rate_hz, options)) warn(*spikes);
    out.wvs.push_back(std::move(*wv));
  }
  return out;
}

}  // namespace imuscope::cli
