#include "results/report/people.h"

#include <fmt/format.h>
#include <algorithm>
#include <cmath>

namespace imuscope::report {
namespace {

/// Beyond these a power of ten reads better.
constexpr double kPlainMin = 5e-4;
constexpr double kPlainMax = 1e6;
constexpr int kDigitsOfSd = 2;
constexpr int kDecimalsMax = 12;

int exponent_of(double value) { return static_cast<int>(std::floor(std::log10(std::abs(value)))); }

/// Decimals that show two significant digits of `width`.
int decimals_for(double width) { return std::clamp(kDigitsOfSd - 1 - exponent_of(width), 0, kDecimalsMax); }

bool usable(std::optional<double> width) { return width && std::isfinite(*width) && *width > 0.0; }

/// A minus sign as typographers have it, and no "-0.00".
std::string fixed(double value, int decimals) {
  std::string digits = fmt::format("{:.{}f}", std::abs(value), decimals);
  const bool zero = digits.find_first_not_of("0.") == std::string::npos;
  return value < 0.0 && !zero ? "−" + digits : digits;
}

/// Power of ten to take out of a group of numbers whose largest is `magnitude`; 0: none.
int common_exponent(double magnitude) {
  if (magnitude == 0.0 || (magnitude >= kPlainMin && magnitude < kPlainMax)) return 0;
  return exponent_of(magnitude);
}

Html times_power(int exponent) {
  if (exponent == 0) return {};
  return text(" × 10") +
         element("sup", text(fmt::format("{}{}", exponent < 0 ? "−" : "", std::abs(exponent))));
}

}  // namespace

Html number(double value, int digits) {
  if (!std::isfinite(value)) return text(kUnknown);
  if (value == 0.0) return text("0");
  const int exponent = common_exponent(std::abs(value));
  const double mantissa = value / std::pow(10.0, exponent);
  const int decimals = std::clamp(digits - 1 - exponent_of(mantissa), 0, kDecimalsMax);
  return text(fixed(mantissa, decimals)) + times_power(exponent);
}

Html number(std::optional<double> value, int digits) {
  return value ? number(*value, digits) : text(kUnknown);
}

Html with_sd(double value, std::optional<double> sd) {
  if (!usable(sd) || !std::isfinite(value)) return number(value);
  const int exponent = common_exponent(std::max(std::abs(value), *sd));
  const double scale = std::pow(10.0, exponent);
  const int decimals = decimals_for(*sd / scale);
  const std::string both = fixed(value / scale, decimals) + " ± " + fixed(*sd / scale, decimals);
  return exponent == 0 ? text(both) : text("(" + both + ")") + times_power(exponent);
}

Html with_interval(double value, std::optional<double> low, std::optional<double> high) {
  if (low.has_value() != high.has_value() && std::isfinite(value) && std::isfinite(high ? *high : *low))
    return number(value) + Html::markup(" <span class=\"interval\">") + text(high ? "below " : "above ") +
           number(high ? *high : *low) + Html::markup("</span>");
  if (!low || !high || !usable(*high - *low) || !std::isfinite(value)) return number(value);
  const double magnitude = std::max(std::abs(value), std::abs(*high));
  const int exponent = common_exponent(magnitude);
  const double scale = std::pow(10.0, exponent);
  const double half_width = 0.5 * (*high - *low) / scale;
  // A very one-sided interval: its lower end must not round to nothing.
  const double finest = std::min(half_width, *low > 0.0 ? *low / scale : half_width);
  const int decimals = decimals_for(finest);
  return text(fixed(value / scale, decimals)) + Html::markup(" <span class=\"interval\">[") +
         text(fixed(*low / scale, decimals) + ", " + fixed(*high / scale, decimals)) +
         Html::markup("]</span>") + times_power(exponent);
}

Html p_words(std::optional<double> p) {
  if (!p) return text(kUnknown);
  return *p < kSmallestP ? text("< 10⁻⁶") : number(p, 2);
}

std::string duration_words(double seconds) {
  if (!std::isfinite(seconds) || seconds < 0.0) return kUnknown;
  const auto whole = static_cast<long long>(std::llround(seconds));
  constexpr long long kMinute = 60;
  constexpr long long kHour = 3600;
  if (whole >= kHour) return fmt::format("{} h {} min", whole / kHour, whole % kHour / kMinute);
  if (whole >= kMinute) return fmt::format("{} min {} s", whole / kMinute, whole % kMinute);
  return fmt::format("{} s", whole);
}

Html count(std::optional<double> value) {
  if (!value || !std::isfinite(*value)) return text(kUnknown);
  std::string digits = fmt::format("{:.0f}", *value);
  for (auto place = static_cast<std::ptrdiff_t>(digits.size()) - 3; place > 0; place -= 3) {
    digits.insert(static_cast<std::size_t>(place), "\u202f");
  }
  return text(digits);
}

std::string in_sd(double error, std::optional<double> sd) {
  return usable(sd) ? fmt::format("{:.1f} sd", std::abs(error) / *sd) : std::string(kUnknown);
}

}  // namespace imuscope::report
