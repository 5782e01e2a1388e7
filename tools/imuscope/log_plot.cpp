#include "log_plot.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace imuscope::cli {
namespace {

constexpr std::size_t kColumns = 66;
constexpr std::size_t kRows = 19;
constexpr std::size_t kLabel = 9;
/// Intervals reach beyond the picture where they are wider than this share of it.
constexpr double kMargin = 1.3;

/// The picture's extent, in logarithms.
struct Extent {
  double x_low;
  double x_high;
  double y_low;
  double y_high;

  [[nodiscard]] double column(double x) const {
    return (std::log10(x) - x_low) / (x_high - x_low) * static_cast<double>(kColumns - 1);
  }
  [[nodiscard]] double row(double y) const {
    return (y_high - std::log10(y)) / (y_high - y_low) * static_cast<double>(kRows - 1);
  }
};

bool is_drawn(const PlottedPoint& point) {
  return point.x > 0.0 && point.y > 0.0 && std::isfinite(point.x) && std::isfinite(point.y);
}

Extent extent_of(const std::vector<PlottedPoint>& points) {
  Extent extent{1e300, -1e300, 1e300, -1e300};
  for (const PlottedPoint& point : points) {
    extent.x_low = std::min(extent.x_low, std::log10(point.x));
    extent.x_high = std::max(extent.x_high, std::log10(point.x));
    for (const double y : {point.y, point.model}) {
      if (!(y > 0.0)) continue;
      extent.y_low = std::min(extent.y_low, std::log10(y / kMargin));
      extent.y_high = std::max(extent.y_high, std::log10(y * kMargin));
    }
  }
  if (!(extent.x_high > extent.x_low)) extent.x_high = extent.x_low + 1.0;
  return extent;
}

class Canvas {
 public:
  void put(double column, double row, char mark, bool over) {
    const auto c = std::lround(column);
    const auto r = std::lround(row);
    if (c < 0 || r < 0 || c >= static_cast<long>(kColumns) || r >= static_cast<long>(kRows)) return;
    char& cell = rows_[static_cast<std::size_t>(r)][static_cast<std::size_t>(c)];
    if (cell == ' ' || over) cell = mark;
  }
  [[nodiscard]] const std::string& row(std::size_t i) const { return rows_[i]; }

 private:
  std::vector<std::string> rows_ = std::vector<std::string>(kRows, std::string(kColumns, ' '));
};

void draw_model(const std::vector<PlottedPoint>& points, const Extent& extent, Canvas& canvas) {
  for (std::size_t i = 1; i < points.size(); ++i) {
    const PlottedPoint& from = points[i - 1];
    const PlottedPoint& to = points[i];
    if (!(from.model > 0.0) || !(to.model > 0.0)) continue;
    const double begin = extent.column(from.x);
    const double end = extent.column(to.x);
    for (double c = std::ceil(begin); c <= end && end > begin; c += 1.0) {
      const double share = (c - begin) / (end - begin);
      canvas.put(c, (1.0 - share) * extent.row(from.model) + share * extent.row(to.model), '.', false);
    }
  }
}

void draw_points(const std::vector<PlottedPoint>& points, const Extent& extent, Canvas& canvas) {
  for (const PlottedPoint& point : points) {
    const double column = extent.column(point.x);
    if (point.low > 0.0 && point.high > 0.0) {
      const double first = std::max(0.0, extent.row(point.high));
      const double last = std::min(static_cast<double>(kRows - 1), extent.row(point.low));
      for (double row = first; row <= last; row += 1.0) canvas.put(column, row, '|', true);
    }
  }
  for (const PlottedPoint& point : points) canvas.put(extent.column(point.x), extent.row(point.y), 'o', true);
}

/// A row's label where a power of ten lies in it.
std::string label_of(std::size_t row, const Extent& extent) {
  const double height = (extent.y_high - extent.y_low) / static_cast<double>(kRows - 1);
  const double here = extent.y_high - height * static_cast<double>(row);
  const double decade = std::round(here);
  return std::abs(here - decade) <= 0.5 * height ? fmt::format("{:.0e}", std::pow(10.0, decade))
                                                 : std::string();
}

std::string x_labels(const Extent& extent) {
  std::string line(kColumns + 4, ' ');
  for (double decade = std::ceil(extent.x_low); decade <= extent.x_high; decade += 1.0) {
    const std::string label = fmt::format("{:g}", std::pow(10.0, decade));
    const auto at = static_cast<std::size_t>(std::lround(extent.column(std::pow(10.0, decade))));
    if (at + label.size() < line.size()) line.replace(at, label.size(), label);
  }
  return line;
}

}  // namespace

std::vector<std::string> log_plot(const std::vector<PlottedPoint>& all, const std::string& x_words,
                                  const std::string& y_words) {
  std::vector<PlottedPoint> points;
  std::copy_if(all.begin(), all.end(), std::back_inserter(points), is_drawn);
  if (points.size() < 2) return {};
  const Extent extent = extent_of(points);
  Canvas canvas;
  draw_model(points, extent, canvas);
  draw_points(points, extent, canvas);
  std::vector<std::string> lines{y_words};
  for (std::size_t row = 0; row < kRows; ++row)
    lines.push_back(fmt::format("{:>{}} |{}", label_of(row, extent), kLabel, canvas.row(row)));
  lines.push_back(fmt::format("{:>{}} +{}", "", kLabel, std::string(kColumns, '-')));
  lines.push_back(fmt::format("{:>{}}  {}", "", kLabel, x_labels(extent)));
  lines.push_back(fmt::format("{:>{}}  {:>{}}", "", kLabel, x_words, kColumns));
  for (std::string& line : lines) line.erase(line.find_last_not_of(' ') + 1);
  return lines;
}

}  // namespace imuscope::cli
