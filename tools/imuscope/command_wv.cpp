#include <fmt/format.h>

#include <cmath>
#include <memory>
#include <nlohmann/json.hpp>

#include "commands.h"
#include "noise/json.h"
#include "signal_options.h"

namespace imuscope::cli {
namespace {

void print_table(const noise::WaveletVariance& wv, double rate_hz) {
  const bool robust = wv.efficiency < 1.0;
  fmt::print("{:>5} {:>12} {:>12} {:>13} {:>13} {:>13} {:>13} {:>12}{}\n", "level", "tau_s", "allan_tau_s",
             "wv", "ci_low", "ci_high", "allan_dev", "coefficients", robust ? "   rejected" : "");
  for (const noise::WvLevel& level : wv.levels) {
    const double tau_s = level.tau_samples / rate_hz;
    fmt::print("{:>5} {:>12.6g} {:>12.6g} {:>13.6g} {:>13.6g} {:>13.6g} {:>13.6g} {:>12}", level.level, tau_s,
               0.5 * tau_s, level.value, level.ci_low, level.ci_high, std::sqrt(2.0 * level.value),
               level.n_coefficients);
    if (robust) fmt::print(" {:>9.3f}%", 100.0 * level.rejected_share);
    fmt::print("\n");
  }
}

}  // namespace

void add_wv(CLI::App& app, Work& chosen) {
  auto* command =
      app.add_subcommand("wv", "Wavelet variance of a signal (half the Allan variance at half of tau)");
  auto options = std::make_shared<SignalOptions>();
  add_signal_options(*command, *options);
  on_chosen(*command, chosen, [options]() -> Result<void> {
    const auto wv = wavelet_variance_of(*options);
    if (!wv) return tl::unexpected(wv.error());
    if (options->json) {
      fmt::print("{}\n", noise::wv_to_json(*wv, options->rate_hz).dump(2));
    } else {
      print_table(*wv, options->rate_hz);
    }
    return {};
  });
}

}  // namespace imuscope::cli
