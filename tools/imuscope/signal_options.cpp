#include "signal_options.h"

#include <fmt/format.h>

#include <cmath>

namespace imuscope::cli {
namespace {

Result<noise::WaveletVariance> wavelet_variance_of(const std::filesystem::path& file,
                                                   const SignalOptions& options) {
  const auto signal = read_signal(file, options.choice);
  if (!signal) return tl::unexpected(signal.error());
  noise::WvOptions wv_options;
  wv_options.levels = options.levels;
  wv_options.mask = signal->mask;
  wv_options.nan_is_gap = options.nan_is_gap;
  if (options.robust) wv_options.robust = noise::RobustOptions{options.efficiency, std::nullopt};
  auto wv = noise::haar_wavelet_variance(signal->values, wv_options);
  if (!wv) {
    Error error = wv.error();
    error.what = fmt::format("{}: {}", file.string(), error.what);
    if (!options.nan_is_gap && error.remedy.find("gap") != std::string::npos)
      error.remedy += " (--nan-is-gap)";
    return tl::unexpected(error);
  }
  return wv;
}

}  // namespace

void add_signal_options(CLI::App& command, SignalOptions& options, bool several) {
  const char* what =
      several ? "Signal: CSV, or raw little-endian float64 (.f64); several are replicates of one sensor"
              : "Signal: CSV, or raw little-endian float64 (.f64)";
  auto* file = command.add_option("FILE", options.files, what)->required();
  if (!several) file->expected(1);
  command.add_option("--column,-c", options.choice.column, "Column of a CSV: its name, or its number from 1");
  command.add_option("--where", options.choice.where,
                     "COLUMN=VALUE of a CSV: rows with another value count as gaps, as in regime=static");
  command.add_option("--counter", options.choice.counter,
                     "Column of a CSV that counts the samples: numbers left out count as gaps");
  command.add_option("--rate,-r", options.rate_hz, "Samples per second")->required();
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

Result<std::vector<noise::WaveletVariance>> wavelet_variances_of(const SignalOptions& options) {
  if (!(options.rate_hz > 0.0) || !std::isfinite(options.rate_hz)) {
    return usage_error(fmt::format("--rate {} is impossible", options.rate_hz),
                       "give the samples per second");
  }
  if (const auto unit = noise::parse_unit(options.unit); !unit) return tl::unexpected(unit.error());
  std::vector<noise::WaveletVariance> out;
  for (const auto& file : options.files) {
    auto wv = wavelet_variance_of(file, options);
    if (!wv) return tl::unexpected(wv.error());
    out.push_back(std::move(*wv));
  }
  return out;
}

}  // namespace imuscope::cli
