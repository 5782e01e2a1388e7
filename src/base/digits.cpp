#include "base/digits.h"

#include <array>
#include <charconv>
#include <cmath>

namespace imuscope {

namespace {

std::string with_digits(double value, int digits) {
  std::array<char, 32> text{};
  const auto end =
      std::to_chars(text.data(), text.data() + text.size(), value, std::chars_format::general, digits);
  return {text.data(), end.ptr};
}

}  // namespace

std::string digits_beside(double value, double wanted) {
  constexpr double kWhole = 99.5;  // from here on two digits would need a power of ten
  constexpr int kDigitsMost = 4;
  constexpr int kDigitsOfWhole = 9;
  if (value >= kWhole) return with_digits(std::round(value), kDigitsOfWhole);
  std::string text;
  for (int digits = 2; digits <= kDigitsMost; ++digits) {
    text = with_digits(value, digits);
    if (text != with_digits(wanted, digits)) break;
  }
  return text;
}

}  // namespace imuscope
