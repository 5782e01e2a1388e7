#include "fleet/page_pictures.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "base/units.h"

namespace imuscope::fleet {
namespace {

using page::Html;

constexpr double kMapWidth = 1160.0;
constexpr double kMapHeight = 420.0;
constexpr double kMapMargin = 18.0;
constexpr double kEarth_m = 6371008.8;  ///< mean radius; a map of a page needs no more
/// A fleet in one yard is not drawn larger than this.
constexpr double kSmallestMap_m = 200.0;
/// Points of all tracks together; a page is to stay small.
constexpr std::size_t kPointsMax = 60000;

constexpr double kChartWidth = 560.0;
constexpr double kRowHeight = 44.0;
constexpr double kChartLeft = 64.0;
constexpr double kChartRight = 12.0;
constexpr double kChartTop = 8.0;
constexpr double kScaleHeight = 34.0;
constexpr int kBins = 40;
/// So many units are dots; more are bars.
constexpr std::size_t kDotsMax = 60;
constexpr double kDot = 4.0;

/// 1, 2 or 5 times a power of ten, not above `value`.
double round_below(double value) {
  const double power = std::pow(10.0, std::floor(std::log10(value)));
  for (const double step : {5.0, 2.0})
    if (step * power <= value) return step * power;
  return power;
}

std::string short_number(double value) { return fmt::format("{:.3g}", value); }

struct Frame {
  double lat0 = 0.0, lon0 = 0.0, cos_lat = 1.0, metres_per_px = 1.0;
  [[nodiscard]] double x(double lon) const {
    return kMapWidth / 2 + (lon - lon0) * kRadPerDeg * kEarth_m * cos_lat / metres_per_px;
  }
  [[nodiscard]] double y(double lat) const {
    return kMapHeight / 2 - (lat - lat0) * kRadPerDeg * kEarth_m / metres_per_px;
  }
};

Frame frame_of(const std::vector<MapTrack>& tracks) {
  double south = INFINITY, north = -INFINITY, west = INFINITY, east = -INFINITY;
  for (const auto& track : tracks) {
    for (const auto& [lat, lon] : track.lat_lon_deg) {
      south = std::min(south, lat);
      north = std::max(north, lat);
      west = std::min(west, lon);
      east = std::max(east, lon);
    }
  }
  Frame frame;
  frame.lat0 = 0.5 * (south + north);
  frame.lon0 = 0.5 * (west + east);
  frame.cos_lat = std::max(std::cos(frame.lat0 * kRadPerDeg), 1e-3);
  const double height_m = std::max((north - south) * kRadPerDeg * kEarth_m, kSmallestMap_m);
  const double width_m = std::max((east - west) * kRadPerDeg * kEarth_m * frame.cos_lat, kSmallestMap_m);
  frame.metres_per_px =
      std::max(height_m / (kMapHeight - 2 * kMapMargin), width_m / (kMapWidth - 2 * kMapMargin));
  return frame;
}

/// All tracks of one colour as one path; a drive that stays within a few pixels is a dot.
std::string path_of(const std::vector<const MapTrack*>& tracks, const Frame& frame, std::size_t step) {
  std::string path;
  for (const MapTrack* track : tracks) {
    const auto& points = track->lat_lon_deg;
    double last_x = INFINITY;
    double last_y = INFINITY;
    for (std::size_t i = 0; i < points.size(); ++i) {
      if (i % step != 0 && i + 1 != points.size()) continue;
      const double x = frame.x(points[i].second);
      const double y = frame.y(points[i].first);
      if (i > 0 && std::hypot(x - last_x, y - last_y) < 1.0) continue;
      path += fmt::format("{}{:.0f} {:.0f}", i == 0 ? "M" : "L", x, y);
      last_x = x;
      last_y = y;
    }
    path += "h0";
  }
  return path;
}

/// The scale of a distribution, linear or of logarithms.
struct Scale {
  double low = 0.0, high = 1.0;
  bool is_log = false;
  [[nodiscard]] double x(double value) const {
    const double at = is_log ? std::log(value) : value;
    return kChartLeft + (at - low) / (high - low) * (kChartWidth - kChartLeft - kChartRight);
  }
  [[nodiscard]] bool shows(double value) const {
    const double at = is_log ? std::log(value) : value;
    return std::isfinite(at) && at >= low && at <= high;
  }
};

Scale scale_of(const std::vector<AxisValues>& axes, bool is_log, std::optional<double> data_sheet) {
  Scale scale;
  scale.is_log = is_log;
  scale.low = INFINITY;
  scale.high = -INFINITY;
  const auto take = [&](double value) {
    const double at = is_log ? std::log(value) : value;
    if (!std::isfinite(at)) return;
    scale.low = std::min(scale.low, at);
    scale.high = std::max(scale.high, at);
  };
  for (const auto& axis : axes) {
    for (const double value : axis.values) take(value);
    if (axis.tolerance_low) take(*axis.tolerance_low);
    if (axis.tolerance_high) take(*axis.tolerance_high);
  }
  if (data_sheet) take(*data_sheet);
  const double room = std::max(0.06 * (scale.high - scale.low), is_log ? 0.02 : 1e-9);
  scale.low -= room;
  scale.high += room;
  return scale;
}

/// Values that are marked: round ones, of logarithms to two digits.
std::vector<double> marks_on(const Scale& scale) {
  constexpr int kMarks = 5;
  std::vector<double> marks;
  if (scale.is_log) {
    for (int i = 0; i < kMarks; ++i) {
      const double value = std::exp(scale.low + (scale.high - scale.low) * (i + 0.5) / kMarks);
      const double digit = round_below(value) / 20.0;
      marks.push_back(std::round(value / digit) * digit);
    }
    return marks;
  }
  const double step = round_below((scale.high - scale.low) / (kMarks - 1));
  for (double at = std::ceil(scale.low / step) * step; at <= scale.high; at += step) marks.push_back(at);
  return marks;
}

std::string marks_of(const Scale& scale, double bottom) {
  std::string out;
  for (const double value : marks_on(scale)) {
    constexpr double kNothing = 1e-12;
    const double shown = std::abs(value) < kNothing ? 0.0 : value;
    out += fmt::format(R"(<text class="quiet" x="{:.1f}" y="{:.1f}" text-anchor="middle">{}</text>)",
                       scale.x(value), bottom + 14.0, page::text(short_number(shown)).str());
  }
  return out;
}

std::string row_of_axis(const AxisValues& axis, const Scale& scale, double top) {
  const double bottom = top + kRowHeight - 8.0;
  std::string out =
      fmt::format(R"(<text x="4" y="{:.1f}">{}</text>)", bottom - 6.0, page::text(axis.axis).str());
  if (axis.tolerance_low && axis.tolerance_high) {
    const double x0 = std::clamp(scale.x(*axis.tolerance_low), kChartLeft, kChartWidth - kChartRight);
    const double x1 = std::clamp(scale.x(*axis.tolerance_high), kChartLeft, kChartWidth - kChartRight);
    out += fmt::format(R"(<rect class="band" x="{:.1f}" y="{:.1f}" width="{:.1f}" height="{:.1f}"/>)", x0,
                       top, x1 - x0, kRowHeight - 8.0);
  }
  out += fmt::format(R"(<path class="base" d="M{:.0f} {:.1f}H{:.0f}"/>)", kChartLeft, bottom,
                     kChartWidth - kChartRight);
  if (axis.values.size() <= kDotsMax) {
    std::array<int, kBins + 1> piled{};
    for (std::size_t i = 0; i < axis.values.size(); ++i) {
      if (!scale.shows(axis.values[i])) continue;
      const double x = scale.x(axis.values[i]);
      auto& pile = piled[static_cast<std::size_t>((x - kChartLeft) /
                                                  (kChartWidth - kChartLeft - kChartRight) * kBins)];
      const double y = std::max(bottom - kDot - 5.0 * pile, top + kDot);
      ++pile;
      out += fmt::format(R"(<circle class="{}" cx="{:.1f}" cy="{:.1f}" r="{:.1f}"/>)",
                         axis.stands_out[i] ? "out" : "unit", x, y, kDot);
    }
    return out;
  }
  std::array<int, kBins> all{};
  for (const double value : axis.values) {
    if (!scale.shows(value)) continue;
    const auto bin = static_cast<std::size_t>((scale.x(value) - kChartLeft) /
                                              (kChartWidth - kChartLeft - kChartRight) * kBins);
    ++all[std::min<std::size_t>(bin, kBins - 1)];
  }
  const int most = std::max(1, *std::max_element(all.begin(), all.end()));
  constexpr double kBar = (kChartWidth - kChartLeft - kChartRight) / kBins;
  for (std::size_t i = 0; i < all.size(); ++i) {
    if (all[i] == 0) continue;
    const double height = (kRowHeight - 12.0) * all[i] / most;
    out += fmt::format(R"(<rect class="bar" x="{:.1f}" y="{:.1f}" width="{:.1f}" height="{:.1f}"/>)",
                       kChartLeft + kBar * static_cast<double>(i), bottom - height, kBar - 1.0, height);
  }
  for (std::size_t i = 0; i < axis.values.size(); ++i) {
    if (axis.stands_out[i] && scale.shows(axis.values[i]))
      out += fmt::format(R"(<circle class="out" cx="{:.1f}" cy="{:.1f}" r="{:.1f}"/>)",
                         scale.x(axis.values[i]), bottom - kDot, kDot);
  }
  return out;
}

}  // namespace

Html map_of(const std::vector<MapTrack>& tracks) {
  std::size_t points = 0;
  for (const auto& track : tracks) points += track.lat_lon_deg.size();
  if (points == 0) return {};
  const Frame frame = frame_of(tracks);
  const std::size_t step = 1 + points / kPointsMax;
  std::string inner;
  for (const char* colour : {"fine", "limits", "wrong"}) {
    std::vector<const MapTrack*> of_colour;
    for (const auto& track : tracks) {
      const std::string mine = track.worst == "wrong" || track.worst == "limits" ? track.worst : "fine";
      if (mine == colour && !track.lat_lon_deg.empty()) of_colour.push_back(&track);
    }
    if (!of_colour.empty())
      inner += fmt::format(R"(<path class="track {}" d="{}"/>)", colour, path_of(of_colour, frame, step));
  }
  const double bar_m = round_below(0.2 * kMapWidth * frame.metres_per_px);
  constexpr double kKilometre = 1000.0;
  const std::string length =
      bar_m >= kKilometre ? fmt::format("{:.6g} km", bar_m / kKilometre) : fmt::format("{:.6g} m", bar_m);
  inner +=
      fmt::format(R"(<path class="bar" d="M{:.0f} {:.0f}h{:.1f}"/><text x="{:.0f}" y="{:.0f}">{}</text>)",
                  kMapMargin, kMapHeight - kMapMargin, bar_m / frame.metres_per_px, kMapMargin,
                  kMapHeight - kMapMargin - 6.0, length);
  return page::inline_svg("map", kMapWidth, kMapHeight, "Where the drives went, north up", inner);
}

Html distribution_of(const std::string& words, bool is_log, const std::vector<AxisValues>& axes,
                     std::optional<double> data_sheet) {
  const Scale scale = scale_of(axes, is_log, data_sheet);
  if (!(scale.high > scale.low)) return {};
  std::string inner;
  double top = kChartTop;
  for (const auto& axis : axes) {
    inner += row_of_axis(axis, scale, top);
    top += kRowHeight;
  }
  if (data_sheet && scale.shows(*data_sheet)) {
    const double x = scale.x(*data_sheet);
    const bool left = x < 0.5 * kChartWidth;
    inner += fmt::format(
        R"(<path class="sheet" d="M{:.1f} {:.1f}V{:.1f}"/><text class="quiet" x="{:.1f}" y="{:.1f}" text-anchor="{}">data sheet</text>)",
        x, kChartTop - 4.0, top + 20.0, left ? x + 3.0 : x - 3.0, top + 24.0, left ? "start" : "end");
  }
  inner += marks_of(scale, top - 4.0);
  return page::inline_svg("distribution", kChartWidth, top + kScaleHeight, words, inner);
}

}  // namespace imuscope::fleet
