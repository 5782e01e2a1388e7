#pragma once

/// The options that every command on a signal file has.

#include <CLI/CLI.hpp>
#include <filesystem>
#include <string>

#include "base/result.h"
#include "noise/wavelet_variance.h"

namespace imuscope::cli {

struct SignalOptions {
  std::filesystem::path file;
  std::string column;
  double rate_hz = 0.0;
  int levels = 0;
  bool robust = false;
  double efficiency = 0.6;
  bool nan_is_gap = false;
  bool json = false;
};

/// Registers FILE, --column, --rate, --levels, --robust, --efficiency, --nan-is-gap and --json.
void add_signal_options(CLI::App& command, SignalOptions& options);

/// Reads the file and makes its wavelet variance.
Result<noise::WaveletVariance> wavelet_variance_of(const SignalOptions& options);

}  // namespace imuscope::cli
