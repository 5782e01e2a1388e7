#pragma once

/// Fields of the sentences that are read. Sentences are told by the last three letters of their address, as
/// the talker may change during a drive (GP, GN, ...). Every field may be empty.

#include <array>
#include <cstdint>
#include <optional>
#include <string_view>

namespace imuscope::nmea {

/// hhmmss.sss; seconds may be 60 in a leap second.
struct TimeOfDay {
  int hour;
  int minute;
  double second;
  [[nodiscard]] double seconds() const noexcept { return 3600.0 * hour + 60.0 * minute + second; }
};
/// Year in full, month and day from 1, as sent: not checked against the calendar.
struct Date {
  int year;
  int month;
  int day;
};

/// A sentence cut at its commas. Refers to the sentence's text.
class Fields {
 public:
  /// @param sentence  from '$' to the checksum
  explicit Fields(std::string_view sentence) noexcept;

  /// "GNGGA"
  [[nodiscard]] std::string_view address() const noexcept { return address_; }
  /// "GGA", "RMC", ... ; of proprietary ones "PASHR", and "PIXSE,ATITUD" and the like; empty for other
  /// addresses.
  [[nodiscard]] std::string_view type() const noexcept { return type_; }
  /// Field after the address, from 0; empty after the last one.
  [[nodiscard]] std::string_view at(std::size_t index) const noexcept;
  [[nodiscard]] std::optional<double> number(std::size_t index) const noexcept;
  [[nodiscard]] std::optional<int> integer(std::size_t index) const noexcept;
  /// hhmmss.sss
  [[nodiscard]] std::optional<TimeOfDay> time(std::size_t index) const noexcept;
  /// ddmmyy
  [[nodiscard]] std::optional<Date> date(std::size_t index) const noexcept;
  /// ddmm.mmmm or dddmm.mmmm, and the hemisphere in the field after it.
  [[nodiscard]] std::optional<double> degrees(std::size_t index) const noexcept;

 private:
  static constexpr std::size_t kMax = 40;
  std::string_view sentence_;
  std::string_view address_;
  std::string_view type_;
  /// Field i is from begin_[i] to the comma before begin_[i + 1]; the last place takes what is too much.
  std::array<std::uint16_t, kMax + 2> begin_;
  std::size_t size_ = 0;
};

/// The sentences, as views: a field is read when it is asked for. They refer to the Fields.
struct Gga {
  const Fields& fields;
  [[nodiscard]] std::optional<TimeOfDay> time() const noexcept { return fields.time(0); }
  [[nodiscard]] std::optional<double> lat_deg() const noexcept { return fields.degrees(1); }
  [[nodiscard]] std::optional<double> lon_deg() const noexcept { return fields.degrees(3); }
  [[nodiscard]] std::optional<int> quality() const noexcept { return fields.integer(5); }
  [[nodiscard]] std::optional<int> nsat() const noexcept { return fields.integer(6); }
  [[nodiscard]] std::optional<double> hdop() const noexcept { return fields.number(7); }
  [[nodiscard]] std::optional<double> alt_msl_m() const noexcept { return fields.number(8); }
  [[nodiscard]] std::optional<double> geoid_sep_m() const noexcept { return fields.number(10); }
  [[nodiscard]] std::optional<double> age_s() const noexcept { return fields.number(12); }
  [[nodiscard]] std::string_view station() const noexcept { return fields.at(13); }
};
/// RMC: recommended minimum of position, course, speed and date; without a height. Where valid() is false the
/// receiver warns of its own solution.
struct Rmc {
  const Fields& fields;
  [[nodiscard]] std::optional<TimeOfDay> time() const noexcept { return fields.time(0); }
  [[nodiscard]] bool valid() const noexcept { return fields.at(1) == "A"; }
  [[nodiscard]] std::optional<double> lat_deg() const noexcept { return fields.degrees(2); }
  [[nodiscard]] std::optional<double> lon_deg() const noexcept { return fields.degrees(4); }
  [[nodiscard]] std::optional<double> sog_kn() const noexcept { return fields.number(6); }
  [[nodiscard]] std::optional<double> cog_deg() const noexcept { return fields.number(7); }
  [[nodiscard]] std::optional<Date> date() const noexcept { return fields.date(8); }
  [[nodiscard]] std::string_view mode() const noexcept { return fields.at(11); }
};
/// VTG: course over ground, clockwise from true north, and speed; has no time of its own.
struct Vtg {
  const Fields& fields;
  [[nodiscard]] std::optional<double> cog_deg() const noexcept { return fields.number(0); }
  [[nodiscard]] std::optional<double> sog_kn() const noexcept { return fields.number(4); }
  [[nodiscard]] std::optional<double> sog_kmh() const noexcept { return fields.number(6); }
};
/// GST: standard deviations of the position of the epoch.
struct Gst {
  const Fields& fields;
  [[nodiscard]] std::optional<TimeOfDay> time() const noexcept { return fields.time(0); }
  [[nodiscard]] std::optional<double> rms() const noexcept { return fields.number(1); }
  [[nodiscard]] std::optional<double> semi_major_m() const noexcept { return fields.number(2); }
  [[nodiscard]] std::optional<double> semi_minor_m() const noexcept { return fields.number(3); }
  [[nodiscard]] std::optional<double> orient_deg() const noexcept { return fields.number(4); }
  [[nodiscard]] std::optional<double> std_lat_m() const noexcept { return fields.number(5); }
  [[nodiscard]] std::optional<double> std_lon_m() const noexcept { return fields.number(6); }
  [[nodiscard]] std::optional<double> std_alt_m() const noexcept { return fields.number(7); }
};
/// ZDA: UTC time and date, and the local zone.
struct Zda {
  const Fields& fields;
  [[nodiscard]] std::optional<TimeOfDay> time() const noexcept { return fields.time(0); }
  [[nodiscard]] std::optional<Date> date() const noexcept {
    const auto day = fields.integer(1), month = fields.integer(2), year = fields.integer(3);
    return day && month && year ? std::optional(Date{*year, *month, *day}) : std::nullopt;
  }
  [[nodiscard]] std::optional<int> tz_h() const noexcept { return fields.integer(4); }
  [[nodiscard]] std::optional<int> tz_min() const noexcept { return fields.integer(5); }
};
/// HDT: heading, clockwise from true north.
struct Hdt {
  const Fields& fields;
  [[nodiscard]] std::optional<double> heading_deg() const noexcept { return fields.number(0); }
};
/// Signs of roll and pitch are by maker.
struct Pashr {
  const Fields& fields;
  [[nodiscard]] std::optional<TimeOfDay> time() const noexcept { return fields.time(0); }
  [[nodiscard]] std::optional<double> heading_deg() const noexcept { return fields.number(1); }
  [[nodiscard]] std::optional<double> roll_deg() const noexcept { return fields.number(3); }
  [[nodiscard]] std::optional<double> pitch_deg() const noexcept { return fields.number(4); }
  [[nodiscard]] std::optional<double> heave_m() const noexcept { return fields.number(5); }
  [[nodiscard]] std::optional<double> roll_std() const noexcept { return fields.number(6); }
  [[nodiscard]] std::optional<double> pitch_std() const noexcept { return fields.number(7); }
  [[nodiscard]] std::optional<double> heading_std() const noexcept { return fields.number(8); }
  [[nodiscard]] std::optional<int> gps_quality() const noexcept { return fields.integer(9); }
  [[nodiscard]] std::optional<int> ins_quality() const noexcept { return fields.integer(10); }
};

inline constexpr double kMpsPerKnot = 1852.0 / 3600.0;

/// One named field of a sentence, for those who list messages. Absent fields are not visited.
struct NamedValue {
  enum class Kind : std::uint8_t { kReal, kInteger, kBool, kText };
  std::string_view name;
  Kind kind = Kind::kReal;
  double number = 0.0;    ///< of all but kText
  std::string_view text;  ///< of kText; valid during the visit
};

namespace detail {
/// Text of a time or a date without the heap.
struct ShortText {
  std::array<char, 24> chars{};
  std::size_t size = 0;
  [[nodiscard]] std::string_view view() const noexcept { return {chars.data(), size}; }
};
/// "12:34:56.100"
[[nodiscard]] ShortText text_of(const TimeOfDay& time) noexcept;
/// "2026-03-14"
[[nodiscard]] ShortText text_of(const Date& date) noexcept;
}  // namespace detail

namespace detail {

/// Names of the numbers of one $PIXSE sentence (the "PHINS STANDARD" output of older Ixsea units). The order
/// in STDSPD differs between sources, so its numbers are not named here.
struct PhinsLayout {
  std::string_view type;
  std::array<std::string_view, 3> names;
};
inline constexpr std::array<PhinsLayout, 6> kPhinsLayouts{{
    {"PIXSE,ATITUD", {"roll_deg", "pitch_deg", ""}},
    {"PIXSE,POSITI", {"lat_deg", "lon_deg", "alt_m"}},
    {"PIXSE,SPEED_", {"east_ms", "north_ms", "up_ms"}},
    {"PIXSE,HEAVE_", {"surge_m", "sway_m", "heave_m"}},
    {"PIXSE,STDHRP", {"heading_std", "roll_std", "pitch_std"}},
    {"PIXSE,STDPOS", {"lat_std_m", "lon_std_m", "alt_std_m"}},
}};
/// Sentences of two or one words of hexadecimal digits.
inline constexpr std::array<std::string_view, 3> kPhinsWordSentences{"PIXSE,ALGSTS", "PIXSE,STATUS",
                                                                     "PIXSE,HT_STS"};
/// "12:34:56.100000" of "123456.100000"; empty for what is no time.
[[nodiscard]] ShortText phins_time_text(std::string_view field) noexcept;
[[nodiscard]] std::optional<std::uint32_t> hex_word(std::string_view field) noexcept;

/// Fields of a $PIXSE sentence begin after its kind.
template <typename Visit>
void for_each_phins_field(const Fields& fields, Visit&& visit) {
  using Kind = NamedValue::Kind;
  const std::string_view type = fields.type();
  for (const PhinsLayout& layout : kPhinsLayouts) {
    if (layout.type != type) continue;
    for (std::size_t i = 0; i < layout.names.size(); ++i) {
      const auto value = fields.number(1 + i);
      if (value && !layout.names[i].empty()) visit(NamedValue{layout.names[i], Kind::kReal, *value, {}});
    }
  }
  if (type == "PIXSE,TIME__") {
    const ShortText text = phins_time_text(fields.at(1));
    if (text.size > 0) visit(NamedValue{"hms", Kind::kText, 0.0, text.view()});
  }
  for (const std::string_view word_sentence : kPhinsWordSentences) {
    if (word_sentence != type) continue;
    const auto lsb = hex_word(fields.at(1));
    const auto msb = hex_word(fields.at(2));
    if (lsb) visit(NamedValue{"lsb", Kind::kInteger, static_cast<double>(*lsb), {}});
    if (msb) visit(NamedValue{"msb", Kind::kInteger, static_cast<double>(*msb), {}});
  }
}

}  // namespace detail

/// Calls visit(const NamedValue&) for each field of a sentence that is read; nothing for others.
template <typename Visit>
void for_each_field(const Fields& fields, Visit&& visit) {
  using Kind = NamedValue::Kind;
  const auto real = [&](std::string_view name, const std::optional<double>& value) {
    if (value) visit(NamedValue{name, Kind::kReal, *value, {}});
  };
  const auto integer = [&](std::string_view name, const std::optional<int>& value) {
    if (value) visit(NamedValue{name, Kind::kInteger, static_cast<double>(*value), {}});
  };
  const auto text = [&](std::string_view name, std::string_view value) {
    if (!value.empty()) visit(NamedValue{name, Kind::kText, 0.0, value});
  };
  const auto stamp = [&](std::string_view name, const auto& value) {
    if (value) text(name, detail::text_of(*value).view());
  };
  const std::string_view type = fields.type();
  if (type == "GGA") {
    const Gga gga = Gga{fields};
    stamp("hms", gga.time()), real("lat_deg", gga.lat_deg()), real("lon_deg", gga.lon_deg());
    integer("quality", gga.quality()), integer("nsat", gga.nsat()), real("hdop", gga.hdop());
    real("alt_msl_m", gga.alt_msl_m()), real("geoid_sep_m", gga.geoid_sep_m());
    if (gga.alt_msl_m() && gga.geoid_sep_m()) real("h_ellipsoid_m", *gga.alt_msl_m() + *gga.geoid_sep_m());
    real("age_s", gga.age_s()), text("station", gga.station());
  } else if (type == "RMC") {
    const Rmc rmc = Rmc{fields};
    stamp("hms", rmc.time()), visit(NamedValue{"valid", Kind::kBool, rmc.valid() ? 1.0 : 0.0, {}});
    real("lat_deg", rmc.lat_deg()), real("lon_deg", rmc.lon_deg()), real("sog_kn", rmc.sog_kn());
    if (rmc.sog_kn()) real("sog_ms", *rmc.sog_kn() * kMpsPerKnot);
    real("cog_deg", rmc.cog_deg()), stamp("date", rmc.date()), text("mode", rmc.mode());
  } else if (type == "VTG") {
    const Vtg vtg = Vtg{fields};
    real("cog_deg", vtg.cog_deg()), real("sog_kn", vtg.sog_kn()), real("sog_kmh", vtg.sog_kmh());
  } else if (type == "GST") {
    const Gst gst = Gst{fields};
    stamp("hms", gst.time()), real("rms", gst.rms()), real("semi_major_m", gst.semi_major_m());
    real("semi_minor_m", gst.semi_minor_m()), real("orient_deg", gst.orient_deg());
    real("std_lat_m", gst.std_lat_m()), real("std_lon_m", gst.std_lon_m()),
        real("std_alt_m", gst.std_alt_m());
  } else if (type == "ZDA") {
    const Zda zda = Zda{fields};
    stamp("hms", zda.time()), stamp("date", zda.date()), integer("tz_h", zda.tz_h());
    integer("tz_min", zda.tz_min());
  } else if (type == "HDT") {
    real("heading_deg", Hdt{fields}.heading_deg());
  } else if (type == "PASHR") {
    const Pashr p = Pashr{fields};
    stamp("hms", p.time()), real("heading_deg", p.heading_deg()), real("roll_deg", p.roll_deg());
    real("pitch_deg", p.pitch_deg()), real("heave_m", p.heave_m()), real("roll_std", p.roll_std());
    real("pitch_std", p.pitch_std()), real("heading_std", p.heading_std());
    integer("gps_quality", p.gps_quality()), integer("ins_quality", p.ins_quality());
  } else if (type.starts_with("PIXSE,")) {
    detail::for_each_phins_field(fields, visit);
  }
}

}  // namespace imuscope::nmea
