#pragma once

/// Decimal numbers out of text, for protocols that are text. Exact: the nearest double, as the standard
/// library gives it, which is asked only for what is no plain decimal of a few digits.

#include <array>
#include <charconv>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string_view>

namespace imuscope {

namespace detail {
inline constexpr auto kPowersOfTen = std::to_array<double>(
    {1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15, 1e16, 1e17, 1e18});
}  // namespace detail

/// The whole text as a number; nothing where it is none, or not finite. A leading '+' is allowed.
[[nodiscard]] inline std::optional<double> read_decimal(std::string_view text) noexcept {
  // Whole numbers below 2^53 and powers of ten up to 10^22 are doubles without rounding, so that their
  // quotient is rounded once (Clinger 1990).
  constexpr std::uint64_t kExactBelow = std::uint64_t{1} << 53U;
  constexpr std::size_t kDigitsMax = 18;
  if (!text.empty() && text.front() == '+') text.remove_prefix(1);
  const bool negative = !text.empty() && text.front() == '-';
  std::uint64_t digits = 0;
  std::size_t n_digits = 0;
  std::size_t n_decimals = 0;
  bool point = false;
  bool plain = text.size() <= kDigitsMax;
  for (std::size_t i = negative ? 1 : 0; i < text.size() && plain; ++i) {
    const auto digit = static_cast<unsigned>(text[i] - '0');
    if (digit < 10) {
      digits = 10 * digits + digit;
      ++n_digits;
      n_decimals += point ? 1 : 0;
    } else {
      plain = text[i] == '.' && !point;
      point = true;
    }
  }
  if (plain && n_digits > 0 && digits < kExactBelow) {
    const double value = static_cast<double>(digits) / detail::kPowersOfTen[n_decimals];
    return negative ? -value : value;
  }
  double value = 0.0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{} || end != text.data() + text.size() || !std::isfinite(value)) return std::nullopt;
  return value;
}

/// The whole text as an integer; nothing where it is none. A leading '+' is allowed.
template <typename T>
[[nodiscard]] std::optional<T> read_integer(std::string_view text) noexcept {
  constexpr std::size_t kDigitsThatFit = 9;  // into 32 bits
  if (!text.empty() && text.front() == '+') text.remove_prefix(1);
  bool plain = !text.empty() && text.size() <= kDigitsThatFit;
  std::uint32_t digits = 0;
  for (std::size_t i = 0; i < text.size() && plain; ++i) {
    const auto digit = static_cast<unsigned>(text[i] - '0');
    plain = digit < 10;
    digits = 10 * digits + digit;
  }
  if constexpr (sizeof(T) >= sizeof digits) {
    if (plain) return static_cast<T>(digits);
  }
  T value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{} || end != text.data() + text.size()) return std::nullopt;
  return value;
}

}  // namespace imuscope
