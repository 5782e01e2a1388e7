#pragma once

/// What page.js draws, collected as JSON while the sections are written.

#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "results/report/binned_signals.h"
#include "results/report/fits.h"
#include "results/report/page_parts.h"
#include "results/report/run_files.h"

namespace imuscope::report {

/// One figure: a caption, one or more curves over a common horizontal axis.
struct Figure {
  std::string id;
  std::string group;  ///< figures of one group zoom together; may be empty
  std::string y_label;
  std::optional<Stretch> window;  ///< heights shown at first; the whole range otherwise
  std::vector<Stretch> shaded;    ///< times shown on a darker ground
  std::optional<double> truth;    ///< drawn as a dashed line
};

/// Each function adds one figure to the sheet and returns the HTML of its place on the page.
class FigureSheet {
 public:
  /// Mean of signal `signal` over time, as a line in a band from its smallest to its largest value.
  Html range_figure(const Figure& figure, const BinnedSignals& signals, std::size_t signal, int colour,
                    const Html& caption);
  /// Last value of `signal` in each stretch, as a line in a band of +- the last value of `sd_signal`, times
  /// `unit`.
  Html estimate_figure(const Figure& figure, const BinnedSignals& signals, std::size_t signal,
                       std::size_t sd_signal, double unit, int colour, const Html& caption);
  /// Wavelet variances of the fits with their intervals, and the fitted lines; both axes logarithmic.
  Html wavelet_figure(const std::string& id, const std::vector<const Fit*>& fits, const Html& caption);
  /// A column of numbers that several figures may show; returns its place in the sheet.
  std::size_t add_column(const std::vector<double>& values);
  /// One point for each pair of values of two columns that are both known.
  Html scatter_figure(const std::string& id, const std::string& x_label, const std::string& y_label,
                      std::size_t x_column, std::size_t y_column, int colour, const Html& caption);
  /// The way driven, in metres, coloured by speed.
  Html map_figure(const std::string& id, const BinnedSignals& navigation, const Html& caption);

  /// The sheet: {"columns": [[...], ...], "figures": [{...}, ...]}.
  [[nodiscard]] std::string json() const {
    return "{\"columns\":[" + columns_ + "],\"figures\":[" + figures_ + "]}";
  }

 private:
  void add(const std::string& figure);
  std::string figures_;
  std::string columns_;
  std::size_t n_columns_ = 0;
};

/// Height window that shows signal +- 2 sd after the first fifth of the time, when an estimate has settled.
std::optional<Stretch> settled_window(const BinnedSignals& signals, std::size_t signal, std::size_t sd_signal,
                                      double unit, std::optional<double> truth);

}  // namespace imuscope::report
