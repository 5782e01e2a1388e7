#include "results/page/mounting_drawing.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string_view>

#include "base/units.h"

namespace imuscope::page {
namespace {

constexpr double kSide_px = 220.0;
constexpr double kMargin_px = 46.0;  ///< leaves room for arrows and names
constexpr double kArrow_px = 26.0;
constexpr double kReference_px = 12.0;
/// Below this a set of S-IMUs all at the reference is drawn as if it were so wide.
constexpr double kSmallestHalfWidth_m = 0.02;
/// An arrow shorter than this points at the onlooker or away: it is drawn as a dot.
constexpr double kDot_px = 4.0;

/// What one looks at: page right and page down, each along an axis of b.
struct View {
  const char* words;
  std::size_t right;
  double right_sign;
  std::size_t down;
  double down_sign;
  const char* right_words;
  const char* up_words;
};

constexpr std::array<View, 3> kViews{{{"from above", 1, 1.0, 0, -1.0, "right", "forward"},
                                      {"from the right", 0, 1.0, 2, 1.0, "forward", "up"},
                                      {"from behind", 1, 1.0, 2, 1.0, "right", "up"}}};

struct Point {
  double x = 0.0;
  double y = 0.0;
};

Point seen(const View& view, const std::array<double, 3>& v_b) {
  return {view.right_sign * v_b[view.right], view.down_sign * v_b[view.down]};
}

/// Metres a pixel so that the reference and all S-IMUs are inside every view; the reference is in the middle.
double metres_per_pixel(const std::vector<DrawnImu>& imus) {
  double half_width_m = kSmallestHalfWidth_m;
  for (const DrawnImu& imu : imus) {
    for (const double component_m : imu.r_bs_b_m)
      half_width_m = std::max(half_width_m, std::abs(component_m));
  }
  return half_width_m / (0.5 * kSide_px - kMargin_px);
}

/// The largest of 1, 2, 5 times a power of ten that is no longer than `most_m`.
double round_length_m(double most_m) {
  const double power = std::pow(10.0, std::floor(std::log10(most_m)));
  for (const double digit : {5.0, 2.0}) {
    if (digit * power <= most_m) return digit * power;
  }
  return power;
}

std::string line(Point from, Point to, std::string_view css_class) {
  return fmt::format("<path class=\"{}\" d=\"M{:.1f} {:.1f}L{:.1f} {:.1f}\"/>", css_class, from.x, from.y,
                     to.x, to.y);
}

std::string words_at(Point at, std::string_view words, std::string_view anchor, std::string_view css_class) {
  return fmt::format("<text class=\"{}\" text-anchor=\"{}\" x=\"{:.1f}\" y=\"{:.1f}\">{}</text>", css_class,
                     anchor, at.x, at.y, text(words).str());
}

/// Axes of a sensor as arrows, each with its letter.
std::string axes_of(const View& view, const DrawnImu& imu, Point at) {
  constexpr std::string_view kNames = "xyz";
  constexpr double kLetterBeyond = 1.32;
  std::string svg;
  for (std::size_t axis = 0; axis < kNames.size(); ++axis) {
    const Point p = seen(view, {imu.C_b_s[3 * axis], imu.C_b_s[3 * axis + 1], imu.C_b_s[3 * axis + 2]});
    const Point tip{at.x + kArrow_px * p.x, at.y + kArrow_px * p.y};
    const std::string css_class = fmt::format("axis-{}", kNames[axis]);
    if (kArrow_px * std::hypot(p.x, p.y) < kDot_px) continue;
    svg += line(at, tip, css_class);
    constexpr double kLetterDrop_px = 3.5;  // from the middle of a letter to its foot
    svg += words_at(
        {at.x + kLetterBeyond * kArrow_px * p.x, at.y + kLetterBeyond * kArrow_px * p.y + kLetterDrop_px},
        kNames.substr(axis, 1), "middle", css_class);
  }
  return svg;
}

std::string compass_of(const View& view) {
  constexpr double kCorner_px = 14.0;
  constexpr double kLength_px = 20.0;
  const Point corner{kCorner_px, kSide_px - kCorner_px};
  const Point right{corner.x + kLength_px, corner.y};
  const Point up{corner.x, corner.y - kLength_px};
  return line(corner, right, "compass") + line(corner, up, "compass") +
         words_at({right.x + 4.0, right.y + 4.0}, view.right_words, "start", "quiet") +
         words_at({up.x - 4.0, up.y - 5.0}, view.up_words, "start", "quiet");
}

std::string scale_bar(double metres_a_pixel) {
  const double length_m = round_length_m(0.35 * kSide_px * metres_a_pixel);
  const double width_px = length_m / metres_a_pixel;
  const Point end{kSide_px - 10.0, kSide_px - 12.0};
  return line({end.x - width_px, end.y}, end, "bar") +
         words_at(
             {end.x, end.y - 5.0},
             length_m < 1.0 ? fmt::format("{:g} mm", kMmPerM * length_m) : fmt::format("{:g} m", length_m),
             "end", "quiet");
}

/// Where nothing else may be written: middle and half the size.
struct Box {
  Point middle;
  Point half;
};

bool overlap(const Box& a, const Box& b) {
  return std::abs(a.middle.x - b.middle.x) < a.half.x + b.half.x &&
         std::abs(a.middle.y - b.middle.y) < a.half.y + b.half.y;
}

/// Finds for each name the first place about its sensor that is free.
class Names {
 public:
  void keep_free(Point at, double half_px) { taken_.push_back({at, {half_px, half_px}}); }

  std::string place(Point at, const std::string& name) {
    constexpr double kLetter_px = 6.2;
    constexpr double kHalfHeight_px = 6.0;
    constexpr double kBaseline_px = 4.0;  // from the middle of a line to its foot
    const Point half{0.5 * kLetter_px * static_cast<double>(std::max<std::size_t>(name.size(), 1)),
                     kHalfHeight_px};
    Box box{{at.x, at.y + 14.0}, half};
    for (const double away : {14.0, 26.0, 42.0}) {
      const double beside = half.x + away - 4.0;
      for (const Point& shift :
           {Point{0.0, away}, Point{0.0, -away}, Point{beside, 0.0}, Point{-beside, 0.0}, Point{beside, away},
            Point{-beside, away}, Point{beside, -away}, Point{-beside, -away}}) {
        const Box tried{{at.x + shift.x, at.y + shift.y}, half};
        if (is_free(tried)) {
          taken_.push_back(tried);
          return words_at({tried.middle.x, tried.middle.y + kBaseline_px}, name, "middle", "name");
        }
      }
    }
    taken_.push_back(box);
    return words_at({box.middle.x, box.middle.y + kBaseline_px}, name, "middle", "name");
  }

 private:
  [[nodiscard]] bool is_free(const Box& box) const {
    if (box.middle.x < box.half.x || box.middle.x > kSide_px - box.half.x) return false;
    if (box.middle.y < box.half.y || box.middle.y > kSide_px - box.half.y) return false;
    return std::none_of(taken_.begin(), taken_.end(), [&](const Box& other) { return overlap(box, other); });
  }
  std::vector<Box> taken_;
};

/// Arrows and their letters, from the sensor to beyond the tips.
void keep_arrows_free(Names& names, const View& view, const DrawnImu& imu, Point at) {
  constexpr double kHalf_px = 6.0;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const Point p = seen(view, {imu.C_b_s[3 * axis], imu.C_b_s[3 * axis + 1], imu.C_b_s[3 * axis + 2]});
    if (kArrow_px * std::hypot(p.x, p.y) < kDot_px) continue;
    for (const double along : {0.0, 0.45, 0.9, 1.32})
      names.keep_free({at.x + along * kArrow_px * p.x, at.y + along * kArrow_px * p.y}, kHalf_px);
  }
}

Html drawn(const View& view, const std::vector<DrawnImu>& imus, double metres_a_pixel) {
  const Point middle{0.5 * kSide_px, 0.5 * kSide_px};
  constexpr double kHalf = 0.5 * kReference_px;
  const auto place_of = [&](const DrawnImu& imu) {
    const Point offset = seen(view, imu.r_bs_b_m);
    return Point{middle.x + offset.x / metres_a_pixel, middle.y + offset.y / metres_a_pixel};
  };
  Names names;
  names.keep_free(middle, kHalf);
  constexpr double kCompass_px = 22.0;
  names.keep_free({kCompass_px, kSide_px - kCompass_px}, kCompass_px);
  names.keep_free({kSide_px - kCompass_px, kSide_px - kCompass_px / 2.0}, kCompass_px);
  for (const DrawnImu& imu : imus) keep_arrows_free(names, view, imu, place_of(imu));
  std::string svg =
      fmt::format("<rect class=\"reference\" x=\"{:.1f}\" y=\"{:.1f}\" width=\"{}\" height=\"{}\"/>",
                  middle.x - kHalf, middle.y - kHalf, kReference_px, kReference_px);
  for (const DrawnImu& imu : imus) {
    const Point at = place_of(imu);
    svg += line(middle, at, "arm") + axes_of(view, imu, at);
    svg += fmt::format("<circle class=\"imu\" cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"3.5\"/>", at.x, at.y);
    svg += names.place(at, imu.name);
  }
  return inline_svg("drawing", kSide_px, kSide_px, std::string("mounting ") + view.words,
                    svg + compass_of(view) + scale_bar(metres_a_pixel));
}

}  // namespace

Html mounting_drawing(const std::vector<DrawnImu>& imus) {
  if (imus.empty()) return {};
  const double metres_a_pixel = metres_per_pixel(imus);
  Html views;
  for (const View& view : kViews) {
    views += element("figure", drawn(view, imus, metres_a_pixel) + element("figcaption", text(view.words)));
  }
  return element("div", views, "views");
}

}  // namespace imuscope::page
