#include "drivers/nmea/messages.h"

#include <algorithm>
#include <charconv>
#include <cmath>

#include "drivers/device/decimal.h"

namespace imuscope::nmea {
namespace {

std::optional<TimeOfDay> to_time(std::string_view text) noexcept {
  if (text.size() < 6) return std::nullopt;
  const auto hour = read_integer<int>(text.substr(0, 2));
  const auto minute = read_integer<int>(text.substr(2, 2));
  const auto second = read_decimal(text.substr(4));
  if (!hour || !minute || !second) return std::nullopt;
  const bool possible =
      *hour >= 0 && *hour < 24 && *minute >= 0 && *minute < 60 && *second >= 0.0 && *second < 61.0;
  if (!possible) return std::nullopt;
  return TimeOfDay{*hour, *minute, *second};
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
  const auto day = read_integer<int>(text.substr(0, 2));
  const auto month = read_integer<int>(text.substr(2, 2));
  const auto year = read_integer<int>(text.substr(4, 2));
  if (!day || !month || !year) return std::nullopt;
  return Date{*year < kFirstTwoDigitYear ? 2000 + *year : 1900 + *year, *month, *day};
}

void put_digits(detail::ShortText& text, int value, int digits) noexcept {
  for (int power = digits - 1; power >= 0; --power) {
    int scaled = value;
    for (int i = 0; i < power; ++i) scaled /= 10;
    text.chars[text.size++] = static_cast<char>('0' + scaled % 10);
  }
}

}  // namespace

Fields::Fields(std::string_view sentence) noexcept {
  const char* at = sentence.data() + 1;
  const char* end = sentence.data() + sentence.size();
  const char* begin = at;
  bool in_address = true;
  const auto close = [&] {
    const std::string_view cell(begin, static_cast<std::size_t>(at - begin));
    if (in_address) {
      address_ = cell;
    } else if (size_ < kMax) {
      fields_[size_++] = cell;
    }
    in_address = false;
  };
  for (; at < end && *at != '*'; ++at) {
    if (*at != ',') continue;
    close();
    begin = at + 1;
  }
  close();
  constexpr std::size_t kTalkerAndType = 5;
  if (address_ == "PASHR") {
    type_ = address_;
  } else if (address_ == "PIXSE" && size_ > 0) {
    type_ = {address_.data(), address_.size() + 1 + fields_[0].size()};
  } else if (address_.size() == kTalkerAndType && address_[0] != 'P') {
    type_ = address_.substr(2);
  }
}

std::string_view Fields::at(std::size_t index) const noexcept {
  return index < size_ ? fields_[index] : std::string_view{};
}
std::optional<double> Fields::number(std::size_t index) const noexcept { return read_decimal(at(index)); }
std::optional<int> Fields::integer(std::size_t index) const noexcept { return read_integer<int>(at(index)); }

std::optional<TimeOfDay> time_of(const Fields& f) noexcept { return to_time(f.at(0)); }

Gga parse_gga(const Fields& f) noexcept {
  return {to_time(f.at(0)),
          to_degrees(f.at(1), f.at(2)),
          to_degrees(f.at(3), f.at(4)),
          f.integer(5),
          f.integer(6),
          f.number(7),
          f.number(8),
          f.number(10),
          f.number(12),
          f.at(13)};
}

Rmc parse_rmc(const Fields& f) noexcept {
  return {to_time(f.at(0)),
          f.at(1) == "A",
          to_degrees(f.at(2), f.at(3)),
          to_degrees(f.at(4), f.at(5)),
          f.number(6),
          f.number(7),
          to_date(f.at(8)),
          f.at(11)};
}

Vtg parse_vtg(const Fields& f) noexcept { return {f.number(0), f.number(4), f.number(6)}; }

Gst parse_gst(const Fields& f) noexcept {
  return {to_time(f.at(0)), f.number(1), f.number(2), f.number(3),
          f.number(4),      f.number(5), f.number(6), f.number(7)};
}

Zda parse_zda(const Fields& f) noexcept {
  Zda zda{to_time(f.at(0)), std::nullopt, f.integer(4), f.integer(5)};
  const auto day = f.integer(1), month = f.integer(2), year = f.integer(3);
  if (day && month && year) zda.date = Date{*year, *month, *day};
  return zda;
}

Hdt parse_hdt(const Fields& f) noexcept { return {f.number(0)}; }

Pashr parse_pashr(const Fields& f) noexcept {
  return {to_time(f.at(0)), f.number(1), f.number(3), f.number(4),  f.number(5),
          f.number(6),      f.number(7), f.number(8), f.integer(9), f.integer(10)};
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
