/// What all pages share: one palette, in which words and lines can be read.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <regex>
#include <string>

#include "results/page/assets.h"

namespace imuscope::page {
namespace {

/// Relative luminance of #rrggbb (WCAG 2.1).
double luminance(const std::string& colour) {
  double sum = 0.0;
  constexpr double kWeights[] = {0.2126, 0.7152, 0.0722};
  for (std::size_t i = 0; i < 3; ++i) {
    const double c = std::stoi(colour.substr(1 + 2 * i, 2), nullptr, 16) / 255.0;
    sum += kWeights[i] * (c <= 0.03928 ? c / 12.92 : std::pow((c + 0.055) / 1.055, 2.4));
  }
  return sum;
}

double contrast(const std::string& a, const std::string& b) {
  const double bright = std::max(luminance(a), luminance(b));
  const double dark = std::min(luminance(a), luminance(b));
  return (bright + 0.05) / (dark + 0.05);
}

/// The value of a colour in the first block of the style that begins with `selector`.
std::string colour(const std::string& selector, const std::string& name) {
  const std::string style(kit_style());
  const std::size_t block = style.find(selector);
  const std::size_t at = style.find("--" + name + ": #", block);
  return style.substr(at + name.size() + 4, 7);
}

class Palette : public testing::TestWithParam<const char*> {};

// 4.5 for words (WCAG 2.1, 1.4.3), 3 for lines (1.4.11); the axes are the same by day and by night.
TEST_P(Palette, WordsAndLinesCanBeRead) {
  const std::string selector = GetParam();
  const std::string ground = colour(selector, "ground");
  for (const char* words : {"text", "quiet", "yes", "partly", "no"})
    EXPECT_GE(contrast(colour(selector, words), ground), 4.5) << words;
  for (const char* line : {"x", "y", "z", "series-3", "series-4", "series-5"})
    EXPECT_GE(contrast(colour(":root {", line), ground), 3.0) << line;
}

INSTANTIATE_TEST_SUITE_P(DayAndNight, Palette,
                         testing::Values(":root {", ":root:not([data-colours=\"day\"])",
                                         ":root[data-colours=\"night\"]"));

// A colour is written in one place: no page has a palette of its own.
TEST(Kit, DocumentsTakeTheirColoursFromTheKit) {
  const std::string style(document_style());
  const std::regex colour("#[0-9a-fA-F]{3,6}\\b");
  std::string found;
  for (std::sregex_iterator i(style.begin(), style.end(), colour); i != std::sregex_iterator(); ++i) {
    if (i->str() != "#fff") found += i->str() + " ";  // the paper of pictures that are drawn for it
  }
  EXPECT_EQ(found, "");
}

}  // namespace
}  // namespace imuscope::page
