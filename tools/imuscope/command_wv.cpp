#include <fmt/format.h>

#include <cmath>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>

#include "base/json_text.h"
#include "commands.h"
#include "log_plot.h"
#include "models/noise/json.h"
#include "print.h"
#include "signal_options.h"

namespace imuscope::cli {
namespace {

void print_table(const noise::WaveletVariance& wv, double rate_hz, const std::string& unit) {
  const bool robust = wv.efficiency < 1.0;
  if (!unit.empty()) say("wv in ({0})^2, allan_dev in {0}\n", unit);
  if (wv.n_valid < wv.n_samples) {
    say("{} of {} samples used, in {} runs\n", wv.n_valid, wv.n_samples, wv.segments.size());
  }
  say("{:>5} {:>12} {:>12} {:>13} {:>13} {:>13} {:>13} {:>12}{}\n", "level", "tau_s", "allan_tau_s", "wv",
      "ci_low", "ci_high", "allan_dev", "coefficients", robust ? "   rejected" : "");
  for (const noise::WvLevel& level : wv.levels) {
    const double tau_s = level.tau_samples / rate_hz;
    say("{:>5} {:>12.6g} {:>12.6g} {:>13.6g} {:>13.6g} {:>13.6g} {:>13.6g} {:>12}", level.level, tau_s,
        0.5 * tau_s, level.value, level.ci_low, level.ci_high, std::sqrt(2.0 * level.value),
        level.n_coefficients);
    if (robust) say(" {:>9.3f}%", 100.0 * level.rejected_share);
    say("\n");
  }
}

void print_plot(const noise::WaveletVariance& wv, double rate_hz, const std::string& unit) {
  std::vector<PlottedPoint> points;
  for (const noise::WvLevel& level : wv.levels)
    points.push_back({level.tau_samples / rate_hz, level.value, level.ci_low, level.ci_high, 0.0});
  say("\n");
  for (const auto& line :
       log_plot(points, "tau, s",
                unit.empty() ? "wavelet variance" : fmt::format("wavelet variance, ({})^2", unit)))
    say("{}\n", line);
}

}  // namespace

void add_wv(CLI::App& app, Work& chosen) {
  auto* command =
      app.add_subcommand("wv", "Wavelet variance of a signal (half the Allan variance at half of tau)");
  auto options = std::make_shared<SignalOptions>();
  add_signal_options(*command, *options, false);
  auto plot = std::make_shared<bool>(false);
  command->add_flag("--plot", *plot, "Draw it, too, in the terminal");
  on_chosen(*command, chosen, [options, plot]() -> Result<void> {
    const auto wvs = wavelet_variances_of(*options, noise::Lines::kStay);
    if (!wvs) return tl::unexpected(wvs.error());
    const auto& wv = wvs->wvs.front();
    if (options->json) {
      auto json = noise::wv_to_json(wv, wvs->rate_hz);
      json["unit"] = options->unit;
      json["warnings"] = wvs->warnings;
      say("{}\n", json_text(json));
    } else {
      print_table(wv, wvs->rate_hz, options->unit);
      if (*plot) print_plot(wv, wvs->rate_hz, options->unit);
      for (const auto& warning : wvs->warnings) say("warning: {}\n", warning);
    }
    return {};
  });
}

}  // namespace imuscope::cli
