#include "results/report/wavelet_plots.h"

#include <fmt/format.h>
#include <algorithm>
#include <limits>

namespace imuscope::report {

GnuplotScript wavelet_block(const GnuplotScript& name, const Fit& fit) {
  auto block = GnuplotScript::of("${} << EOD\n", name);
  for (std::size_t i = 0; i < fit.levels.size(); ++i) {
    const FitLevel& level = fit.levels[i];
    block.add("{} {} {} {} {}", GnuplotNumber{level.tau_s}, GnuplotNumber{or_nan(level.value)},
              GnuplotNumber{or_nan(level.ci_low)}, GnuplotNumber{or_nan(level.ci_high)},
              GnuplotNumber{or_nan(level.fitted)});
    for (const FitComponent& component : fit.components) {
      if (component.values.size() == fit.levels.size()) block.add(" {}", GnuplotNumber{component.values[i]});
    }
    block.add("\n");
  }
  return block.add("EOD\n");
}

GnuplotScript wavelet_plots(const GnuplotScript& block, const Fit& fit, const GnuplotWord& colour) {
  constexpr std::size_t kFirstComponent = 6;
  auto plots = GnuplotScript::of(
      "${0} using 1:2:3:4 with yerrorbars pointtype 7 pointsize 0.4 linecolor rgb '{1}' title {2} "
      "noenhanced, ${0} using 1:5 with lines linewidth 1.5 linecolor rgb '{1}' notitle",
      block, colour, GnuplotText(fit.regime.empty() ? "all" : fit.regime));
  for (std::size_t i = 0; i < fit.components.size(); ++i) {
    if (fit.components[i].values.size() != fit.levels.size()) continue;
    plots.add(", ${} using 1:{} with lines dashtype 2 linewidth 0.8 linecolor rgb '{}' notitle", block,
              kFirstComponent + i, colour);
  }
  return plots;
}

GnuplotScript wavelet_range(const std::vector<const Fit*>& fits) {
  double low = std::numeric_limits<double>::infinity();
  double high = 0.0;
  for (const Fit* fit : fits) {
    for (const FitLevel& level : fit->levels) {
      for (const auto& value : {level.value, level.fitted}) {
        if (!value || !(*value > 0.0)) continue;
        low = std::min(low, *value);
        high = std::max(high, *value);
      }
    }
  }
  return high > 0.0
             ? GnuplotScript::of("set yrange [{}:{}]\n", GnuplotNumber{0.5 * low}, GnuplotNumber{2.0 * high})
             : GnuplotScript::of("set yrange [*:*]\n");
}

}  // namespace imuscope::report
