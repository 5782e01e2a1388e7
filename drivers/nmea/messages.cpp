#include "drivers/nmea/messages.h"

#include <algorithm>
#include <bit>
#include <charconv>
#include <cmath>
#include <cstring>

#include "drivers/device/decimal.h"

namespace imuscope::nmea {
namespace {

/// The two characters from `at` on as a number; -1 where they are not two digits.
int two_digits(std::string_view text, std::size_t at) noexcept {
  const auto tens = static_cast<unsigned>(text[at] - '0');
  const auto ones = static_cast<unsigned>(text[at + 1] - '0');
  return tens < 10 && ones < 10 ? static_cast<int>(10 * tens + ones) : -1;
}

std::optional<TimeOfDay> to_time(std::string_view text) noexcept {
  if (text.size() < 6) return std::nullopt;
  const int hour = two_digits(text, 0);
  const int minute = two_digits(text, 2);
  const auto second = read_decimal(text.substr(4));
  if (!second) return std::nullopt;
  const bool possible =
      hour >= 0 && hour < 24 && minute >= 0 && minute < 60 && *second >= 0.0 && *second < 61.0;
  if (!possible) return std::nullopt;
  return TimeOfDay{hour, minute, *second};
}

/// ddmm.mmmm or dddmm.mmmm: the minutes begin two digits before the point.
std::optional<double> to_degrees(std::string_view text, std::string_view hemisphere) noexcept {
  const std::size_t point = std::min(text.find('.'), text.size());
  if (point < 3 || hemisphere.size() != 1) return std::nullopt;
  const auto degrees = read_integer<int>(text.substr(0, point - 2));
  const auto minutes = read_decimal(text.substr(point - 2));
  if (!degrees || !minutes || *degrees < 0 || *minutes < 0.0 || *minutes >= 60.0) return std::nullopt;
  const double value = *degrees + *minutes / 60.0;
  switch (hemisphere[0]) {
    case 'N':
    case 'E':
      return value;
    case 'S':
    case 'W':
      return -value;
    default:
      return std::nullopt;
  }
}

/// Years of two digits: GNSS began in 1980.
constexpr int kFirstTwoDigitYear = 80;

std::optional<Date> to_date(std::string_view text) noexcept {
  if (text.size() != 6) return std::nullopt;
  const int day = two_digits(text, 0);
  const int month = two_digits(text, 2);
  const int year = two_digits(text, 4);
  if (day < 0 || month < 0 || year < 0) return std::nullopt;
  return Date{year < kFirstTwoDigitYear ? 2000 + year : 1900 + year, month, day};
}

constexpr std::size_t kWord = sizeof(std::uint64_t);

/// Eight characters at once, or the last few: bit 8 i + 7 is set where character i is a comma (the exact search for
/// a zero byte, Warren, Hacker's Delight, 6-1).
std::uint64_t commas(const char* text, std::size_t size) noexcept {
  constexpr std::uint64_t kEveryByte = 0x0101010101010101ULL;
  constexpr std::uint64_t kLow = 0x7F * kEveryByte;
  std::uint64_t word = 0;
  std::memcpy(&word, text, size);
  if constexpr (std::endian::native == std::endian::big) word = __builtin_bswap64(word);
  word ^= static_cast<std::uint64_t>(',') * kEveryByte;
  return ~(((word & kLow) + kLow) | word | kLow);
}

void put_digits(detail::ShortText& text, int value, int digits) noexcept {
  for (int power = digits - 1; power >= 0; --power) {
    int scaled = value;
    for (int i = 0; i < power; ++i) scaled /= 10;
    text.chars[text.size++] = static_cast<char>('0' + scaled % 10);
  }
}

}  // namespace

Fields::Fields(std::string_view sentence) noexcept : sentence_(sentence) {
  std::size_t n = 0;  // commas; the address stands before the first one
  const std::size_t end = std::min(sentence.rfind('*'), sentence.size());
  const auto note = [&](std::size_t at, std::uint64_t marks) {
    for (; marks != 0; marks &= marks - 1) {
      begin_[n] = static_cast<std::uint16_t>(at + static_cast<std::size_t>(std::countr_zero(marks)) / 8 + 1);
      n += n <= kMax ? 1 : 0;
    }
  };
  std::size_t at = 0;
  for (; at + kWord <= end; at += kWord) note(at, commas(sentence.data() + at, kWord));
  if (at < end) note(at, commas(sentence.data() + at, end - at));
  begin_[n] = static_cast<std::uint16_t>(end + 1);
  size_ = std::min(n, kMax);
  address_ = sentence.substr(1, begin_[0] - 2U);
  constexpr std::size_t kTalkerAndType = 5;
  if (address_ == "PASHR") {
    type_ = address_;
  } else if (address_ == "PIXSE" && size_ > 0) {
    type_ = {address_.data(), address_.size() + 1 + this->at(0).size()};
  } else if (address_.size() == kTalkerAndType && address_[0] != 'P') {
    type_ = address_.substr(2);
  }
}

std::string_view Fields::at(std::size_t index) const noexcept {
  if (index >= size_) return {};
  return {sentence_.data() + begin_[index], begin_[index + 1] - begin_[index] - 1U};
}
std::optional<double> Fields::number(std::size_t index) const noexcept { return read_decimal(at(index)); }
std::optional<int> Fields::integer(std::size_t index) const noexcept { return read_integer<int>(at(index)); }
std::optional<TimeOfDay> Fields::time(std::size_t index) const noexcept { return to_time(at(index)); }
std::optional<Date> Fields::date(std::size_t index) const noexcept { return to_date(at(index)); }
std::optional<double> Fields::degrees(std::size_t index) const noexcept {
  return to_degrees(at(index), at(index + 1));
}

namespace detail {

ShortText text_of(const TimeOfDay& time) noexcept {
  ShortText text;
  const auto ms = static_cast<int>(std::lround(time.second * 1000.0));
  put_digits(text, time.hour, 2);
  text.chars[text.size++] = ':';
  put_digits(text, time.minute, 2);
  text.chars[text.size++] = ':';
  put_digits(text, ms / 1000, 2);
  text.chars[text.size++] = '.';
  put_digits(text, ms % 1000, 3);
  return text;
}

ShortText text_of(const Date& date) noexcept {
  ShortText text;
  put_digits(text, date.year, 4);
  text.chars[text.size++] = '-';
  put_digits(text, date.month, 2);
  text.chars[text.size++] = '-';
  put_digits(text, date.day, 2);
  return text;
}

ShortText phins_time_text(std::string_view field) noexcept {
  ShortText text;
  // hhmmss.ssssss; more decimals are cut.
  if (!to_time(field)) return text;
  for (std::size_t i = 0; i < field.size() && text.size + 2 < text.chars.size(); ++i) {
    if (i == 2 || i == 4) text.chars[text.size++] = ':';
    text.chars[text.size++] = field[i];
  }
  return text;
}

std::optional<std::uint32_t> hex_word(std::string_view field) noexcept {
  constexpr int kHexadecimal = 16;
  std::uint32_t value = 0;
  const auto [end, error] = std::from_chars(field.data(), field.data() + field.size(), value, kHexadecimal);
  if (error != std::errc{} || end != field.data() + field.size()) return std::nullopt;
  return value;
}

}  // namespace detail
}  // namespace imuscope::nmea
