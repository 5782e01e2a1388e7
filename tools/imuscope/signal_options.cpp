#include "signal_options.h"

#include <fmt/format.h>

#include <cmath>

#include "signal_file.h"

namespace imuscope::cli {

void add_signal_options(CLI::App& command, SignalOptions& options) {
  command.add_option("FILE", options.file, "Signal: CSV, or raw little-endian float64 (.f64)")->required();
  command.add_option("--column,-c", options.column, "Column of a CSV: its name, or its number from 1");
  command.add_option("--rate,-r", options.rate_hz, "Samples per second")->required();
  command.add_option("--levels,-l", options.levels, "Number of levels (default: all that the length allows)");
  command.add_flag("--robust", options.robust, "Resist outliers (Tukey biweight)");
  command.add_option("--efficiency", options.efficiency, "Efficiency of the robust estimate on clean data")
      ->check(CLI::Range(0.2, 0.99))
      ->capture_default_str();
  command.add_flag("--nan-is-gap", options.nan_is_gap,
                   "Let NaN and infinity count as gaps instead of refusing them");
  command.add_flag("--json", options.json, "Print JSON");
}

Result<noise::WaveletVariance> wavelet_variance_of(const SignalOptions& options) {
  if (!(options.rate_hz > 0.0) || !std::isfinite(options.rate_hz)) {
    return usage_error(fmt::format("--rate {} is impossible", options.rate_hz),
                       "give the samples per second");
  }
  const auto signal = read_signal(options.file, options.column);
  if (!signal) return tl::unexpected(signal.error());
  noise::WvOptions wv_options;
  wv_options.levels = options.levels;
  wv_options.nan_is_gap = options.nan_is_gap;
  if (options.robust) wv_options.robust = noise::RobustOptions{options.efficiency, std::nullopt};
  auto wv = noise::haar_wavelet_variance(*signal, wv_options);
  if (!wv) {
    Error error = wv.error();
    error.what = fmt::format("{}: {}", options.file.string(), error.what);
    if (!options.nan_is_gap && error.remedy.find("gap") != std::string::npos)
      error.remedy += " (--nan-is-gap)";
    return tl::unexpected(error);
  }
  return wv;
}

}  // namespace imuscope::cli
