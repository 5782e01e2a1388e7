#pragma once

/// The options that every command on a signal file has.

#include <CLI/CLI.hpp>
#include <filesystem>
#include <string>
#include <vector>

#include "base/result.h"
#include "models/noise/quantities.h"
#include "models/noise/signal.h"
#include "models/noise/wavelet_variance.h"
#include "signal_file.h"

namespace imuscope::cli {

struct SignalOptions {
  std::vector<std::filesystem::path> files;  ///< one, or several of one sensor
  SignalChoice choice;
  std::string unit;
  int levels = 0;
  bool robust = false;
  double efficiency = 0.6;
  bool nan_is_gap = false;
  bool json = false;
};

/// Registers FILE, --column, --where, --counter, --time, --rate, --unit, --levels, --robust, --efficiency,
/// --nan-is-gap and --json. `several`: FILE may be given more than once.
void add_signal_options(CLI::App& command, SignalOptions& options, bool several);

/// What the files hold; of several all at one rate.
struct ReadSignals {
  std::vector<noise::WaveletVariance> wvs;
  std::vector<std::vector<noise::Line>> lines;  ///< one entry a file, strongest first
  std::vector<std::string> warnings;            ///< sentences for people: lines, spikes
  double rate_hz = 0.0;
};

/// Reads the files and makes their wavelet variances. Errors: those of the reader and of the wavelet
/// variance, and an impossible rate or unit, none at all, or files of different ones (kUsage).
Result<ReadSignals> wavelet_variances_of(const SignalOptions& options, noise::Lines lines);

}  // namespace imuscope::cli
