#pragma once

/// A plot for a terminal, where nothing else is at hand: both axes logarithmic.

#include <string>
#include <vector>

namespace imuscope::cli {

/// A value with its interval, and what a model says there; 0 where there is none.
struct PlottedPoint {
  double x = 0.0;
  double y = 0.0;
  double low = 0.0;
  double high = 0.0;
  double model = 0.0;
};

/// Lines of text, at most 78 characters each: points as o, intervals as |, the model as dots between them.
/// Points that are not above zero are left out; nothing where fewer than two are left.
/// @param x_words, y_words  what the axes are, with their units
std::vector<std::string> log_plot(const std::vector<PlottedPoint>& points, const std::string& x_words,
                                  const std::string& y_words);

}  // namespace imuscope::cli
