#include "results/report/figures.h"

#include <fmt/format.h>
#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "base/json_text.h"

namespace imuscope::report {
namespace {

/// Significant digits that are more than a figure can show, also when zoomed.
constexpr int kDigitsOfSignal = 4;
constexpr int kDigitsOfEstimate = 7;
constexpr int kDigitsOfSd = 3;

std::string quoted(const std::string& any) { return json_text(any, kJsonOneLine); }

std::string short_number(double value, int digits) {
  return std::isfinite(value) ? fmt::format("{:.{}g}", value, digits) : std::string("null");
}

/// "[1,2,null]" of value(i) for i < n.
template <typename Value>
std::string array_of(std::size_t n, int digits, Value value) {
  std::string array = "[";
  for (std::size_t i = 0; i < n; ++i) {
    if (i > 0) array += ',';
    array += short_number(value(i), digits);
  }
  return array + "]";
}

std::string head_of(const Figure& figure, const char* kind) {
  std::string head = fmt::format("\"id\":{},\"kind\":\"{}\",\"group\":{},\"y_label\":{}", quoted(figure.id),
                                 kind, quoted(figure.group), quoted(figure.y_label));
  if (figure.window) {
    head += fmt::format(",\"window\":[{},{}]", short_number(figure.window->begin_s, kDigitsOfEstimate),
                        short_number(figure.window->end_s, kDigitsOfEstimate));
  }
  if (figure.truth) head += fmt::format(",\"truth\":{}", short_number(*figure.truth, kDigitsOfEstimate));
  head += ",\"shaded\":[";
  for (std::size_t i = 0; i < figure.shaded.size(); ++i) {
    head +=
        fmt::format("{}[{:.1f},{:.1f}]", i > 0 ? "," : "", figure.shaded[i].begin_s, figure.shaded[i].end_s);
  }
  return head + "]";
}

/// Middle of the first stretch and the step to the next.
std::string times_of(const BinnedSignals& signals) {
  return signals.size() == 0 ? "[0,1]" : fmt::format("[{:.3f},{:.6g}]", signals.time_s(0), signals.width_s());
}

std::string components_of(const Fit& fit) {
  std::string list = "[";
  for (const FitComponent& component : fit.components) {
    // A fit whose levels are not all shown has no place for them.
    if (component.values.size() != fit.levels.size()) continue;
    list += fmt::format("{}{{\"name\":{},\"values\":{}}}", list.size() > 1 ? "," : "", quoted(component.name),
                        array_of(component.values.size(), kDigitsOfSignal,
                                 [&](std::size_t i) { return component.values[i]; }));
  }
  return list + "]";
}

std::string wavelet_series(const Fit& fit) {
  const auto values = [&](auto member) {
    return array_of(fit.levels.size(), kDigitsOfSignal,
                    [&](std::size_t i) { return or_nan(member(fit.levels[i])); });
  };
  return fmt::format(
      "{{\"name\":{},\"tau\":{},\"mid\":{},\"low\":{},\"high\":{},\"fitted\":{},"
      "\"components\":{}}}",
      quoted(fit.regime.empty() ? "all" : fit.regime),
      array_of(fit.levels.size(), kDigitsOfEstimate, [&](std::size_t i) { return fit.levels[i].tau_s; }),
      values([](const FitLevel& level) { return level.value; }),
      values([](const FitLevel& level) { return level.ci_low; }),
      values([](const FitLevel& level) { return level.ci_high; }),
      values([](const FitLevel& level) { return level.fitted; }), components_of(fit));
}

}  // namespace

void FigureSheet::add(const std::string& figure) {
  if (!figures_.empty()) figures_ += ",\n";
  figures_ += "{" + figure + "}";
}

Html FigureSheet::range_figure(const Figure& figure, const BinnedSignals& signals, std::size_t signal,
                               int colour, const Html& caption) {
  const auto values = [&](auto member) {
    return array_of(signals.size(), kDigitsOfSignal, [&](std::size_t i) {
      const auto& bin = signals.bin(signal, i);
      return bin.n == 0 ? std::numeric_limits<double>::quiet_NaN() : member(bin);
    });
  };
  add(head_of(figure, "time") + fmt::format(",\"colour\":{},\"times\":{},\"mid\":{},\"low\":{},\"high\":{}",
                                            colour, times_of(signals),
                                            values([](const auto& bin) { return bin.mean(); }),
                                            values([](const auto& bin) { return bin.smallest; }),
                                            values([](const auto& bin) { return bin.largest; })));
  return figure_place(figure.id, caption);
}

Html FigureSheet::estimate_figure(const Figure& figure, const BinnedSignals& signals, std::size_t signal,
                                  std::size_t sd_signal, double unit, int colour, const Html& caption) {
  const auto values = [&](std::size_t of, int digits) {
    return array_of(signals.size(), digits, [&](std::size_t i) { return unit * signals.bin(of, i).last; });
  };
  add(head_of(figure, "time") + fmt::format(",\"colour\":{},\"times\":{},\"mid\":{},\"sd\":{}", colour,
                                            times_of(signals), values(signal, kDigitsOfEstimate),
                                            values(sd_signal, kDigitsOfSd)));
  return figure_place(figure.id, caption);
}

Html FigureSheet::wavelet_figure(const std::string& id, const std::vector<const Fit*>& fits,
                                 const Html& caption) {
  Figure figure;
  figure.id = id;
  figure.y_label = fits.empty() ? "" : "(" + fits.front()->unit + ")²";
  std::string series;
  for (const Fit* fit : fits) series += (series.empty() ? "" : ",") + wavelet_series(*fit);
  add(head_of(figure, "wavelet") + ",\"series\":[" + series + "]");
  return figure_place(id, caption);
}

std::size_t FigureSheet::add_column(const std::vector<double>& values) {
  if (!columns_.empty()) columns_ += ",\n";
  columns_ += array_of(values.size(), kDigitsOfSignal, [&](std::size_t i) { return values[i]; });
  return n_columns_++;
}

Html FigureSheet::scatter_figure(const std::string& id, const std::string& x_label,
                                 const std::string& y_label, std::size_t x_column, std::size_t y_column,
                                 int colour, const Html& caption) {
  Figure figure;
  figure.id = id;
  figure.y_label = y_label;
  add(head_of(figure, "scatter") + fmt::format(",\"colour\":{},\"x_label\":{},\"x\":{},\"y\":{}", colour,
                                               quoted(x_label), x_column, y_column));
  return figure_place(id, caption);
}

Html FigureSheet::map_figure(const std::string& id, const BinnedSignals& navigation, const Html& caption) {
  Figure figure;
  figure.id = id;
  const auto values = [&](std::size_t signal) {
    return array_of(navigation.size(), kDigitsOfEstimate,
                    [&](std::size_t i) { return navigation.bin(signal, i).last; });
  };
  add(head_of(figure, "map") + fmt::format(",\"times\":{},\"north\":{},\"east\":{},\"speed\":{}",
                                           times_of(navigation), values(kNorth_m), values(kEast_m),
                                           values(kSpeed_mps)));
  return figure_place(id, caption, "map");
}

std::optional<Stretch> settled_window(const BinnedSignals& signals, std::size_t signal, std::size_t sd_signal,
                                      double unit, std::optional<double> truth) {
  constexpr std::size_t kUnsettledFifth = 5;
  constexpr double kSdShown = 2.0;
  constexpr double kMargin = 0.05;
  double low = std::numeric_limits<double>::infinity();
  double high = -low;
  for (std::size_t i = signals.size() / kUnsettledFifth; i < signals.size(); ++i) {
    const double value = unit * signals.bin(signal, i).last;
    const double sd = unit * signals.bin(sd_signal, i).last;
    if (!std::isfinite(value) || !std::isfinite(sd)) continue;
    low = std::min(low, value - kSdShown * sd);
    high = std::max(high, value + kSdShown * sd);
  }
  if (truth) {
    low = std::min(low, *truth);
    high = std::max(high, *truth);
  }
  if (!(high > low) || !std::isfinite(high - low)) return {};
  const double margin = kMargin * (high - low);
  return Stretch{low - margin, high + margin};
}

}  // namespace imuscope::report
