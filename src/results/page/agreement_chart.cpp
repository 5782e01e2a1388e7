#include "results/page/agreement_chart.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace imuscope::page {
namespace {

constexpr double kWidth_px = 560.0;
constexpr double kHeight_px = 230.0;
constexpr double kLeft_px = 40.0;
constexpr double kRight_px = 12.0;
constexpr double kTop_px = 10.0;
constexpr double kFoot_px = 36.0;
/// The ordinate reaches to a factor of this at least, and of this at most.
constexpr double kFactorMin = 1.5;
constexpr double kFactorMax = 10.0;
/// Colours of the page (kit.css, series-0 and on).
constexpr std::size_t kColours = 6;

struct Scale {
  double x_low = 1.0;
  double x_high = 1.0;
  double factor = kFactorMin;

  [[nodiscard]] double x(double at) const {
    return kLeft_px + (kWidth_px - kLeft_px - kRight_px) * std::log(at / x_low) / std::log(x_high / x_low);
  }
  [[nodiscard]] double y(double ratio) const {
    const double height = kHeight_px - kTop_px - kFoot_px;
    const double kept = std::clamp(ratio, 1.0 / factor, factor);
    return kTop_px + 0.5 * height * (1.0 - std::log(kept) / std::log(factor));
  }
};

bool is_drawn(const AgreementPoint& point) {
  return point.at > 0.0 && std::isfinite(point.at) && point.ratio > 0.0 && std::isfinite(point.ratio);
}

Scale scale_of(const std::vector<AgreementSeries>& series) {
  Scale scale{1e300, 0.0, kFactorMin};
  for (const AgreementSeries& one : series) {
    for (const AgreementPoint& point : one.points) {
      if (!is_drawn(point)) continue;
      scale.x_low = std::min(scale.x_low, point.at);
      scale.x_high = std::max(scale.x_high, point.at);
      const double away = std::max(point.ratio, 1.0 / point.ratio);
      scale.factor = std::max(scale.factor, std::min(kFactorMax, 1.1 * away));
    }
  }
  constexpr double kBeside = 1.25;  // the outermost points do not lie on the frame
  scale.x_low /= kBeside;
  scale.x_high *= kBeside;
  return scale;
}

std::string grid_of(const Scale& scale) {
  std::string svg;
  const double bottom = kHeight_px - kFoot_px;
  constexpr double kClose = 1e-9;
  for (double x = std::pow(10.0, std::ceil(std::log10(scale.x_low) - kClose)); x <= scale.x_high; x *= 10.0) {
    svg += fmt::format(
        "<path class=\"grid\" d=\"M{0:.1f} {1}V{2}\"/><text class=\"quiet\" text-anchor=\"middle\" "
        "x=\"{0:.1f}\" y=\"{3}\">{4:g}</text>",
        scale.x(x), kTop_px, bottom, bottom + 14.0, x);
  }
  for (const double ratio : {0.1, 0.2, 0.5, 0.7, 1.0, 1.4, 2.0, 5.0, 10.0}) {
    if (ratio > scale.factor * (1.0 + kClose) || ratio < (1.0 - kClose) / scale.factor) continue;
    svg += fmt::format(
        "<path class=\"{0}\" d=\"M{1} {2:.1f}H{3}\"/><text class=\"quiet\" text-anchor=\"end\" x=\"{4}\" "
        "y=\"{5:.1f}\">{6:g}</text>",
        ratio == 1.0 ? "right" : "grid", kLeft_px, scale.y(ratio), kWidth_px - kRight_px, kLeft_px - 5.0,
        scale.y(ratio) + 4.0, ratio);
  }
  return svg;
}

std::string drawn(const Scale& scale, const AgreementSeries& series, std::size_t colour) {
  std::string whiskers;
  std::string dots;
  for (const AgreementPoint& point : series.points) {
    if (!is_drawn(point)) continue;
    const double x = scale.x(point.at);
    whiskers += fmt::format("M{:.1f} {:.1f}V{:.1f}", x, scale.y(point.low > 0.0 ? point.low : 0.0),
                            scale.y(point.high));
    // A line of no length with round ends is a dot, in one path with all others.
    dots += fmt::format("M{:.1f} {:.1f}h0", x, scale.y(point.ratio));
  }
  return fmt::format(
      "<path class=\"whiskers series-{0}\" d=\"{1}\"/><path class=\"dots series-{0}\" d=\"{2}\"/>", colour,
      whiskers, dots);
}

}  // namespace

Html agreement_chart(const std::vector<AgreementSeries>& series, const std::string& x_words) {
  const Scale scale = scale_of(series);
  if (!(scale.x_high > scale.x_low)) return {};
  std::string svg = grid_of(scale);
  Html legend;
  for (std::size_t i = 0; i < series.size(); ++i) {
    svg += drawn(scale, series[i], i % kColours);
    legend += element("span", text(series[i].name), fmt::format("key series-{}", i % kColours)) + text(" ");
  }
  svg += fmt::format("<text class=\"quiet\" text-anchor=\"end\" x=\"{}\" y=\"{}\">{}</text>",
                     kWidth_px - kRight_px, kHeight_px - 6.0, text(x_words).str());
  return element("div", legend, "keys") +
         inline_svg("chart", kWidth_px, kHeight_px, "measured error over predicted", svg);
}

}  // namespace imuscope::page
