#include "models/certificate/data_sheet.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <optional>
#include <string_view>

#include "base/json_text.h"
#include "base/units.h"

namespace imuscope::certificate {
namespace {

using nlohmann::json;

constexpr const char* kSchema = "imuscope.data_sheets/1";

/// A unit that a data sheet may use, and its factor to the certificate's unit of that term.
struct StatedUnit {
  Term term;
  bool gyro;
  std::string_view name;
  double factor;
};

/// sqrt(h) over sqrt(s).
constexpr double kRootHour = 60.0;
constexpr double kMilli = 1e-3;
constexpr double kArcsecPerDeg = 3600.0;

const std::array<StatedUnit, 21>& stated_units() {
  using enum Term;
  static const std::array<StatedUnit, 21> kUnits{{
      {kRandomWalk, true, "deg/sqrt(h)", 1.0},
      {kRandomWalk, true, "deg/s/sqrt(Hz)", kRootHour},
      {kRandomWalk, true, "mdeg/s/sqrt(Hz)", kMilli * kRootHour},
      {kRandomWalk, true, "rad/s/sqrt(Hz)", kRootHour / kRadPerDeg},
      {kRandomWalk, false, "m/s/sqrt(h)", 1.0},
      {kRandomWalk, false, "m/s^2/sqrt(Hz)", kRootHour},
      {kRandomWalk, false, "ug/sqrt(Hz)", kMps2PerMicroG * kRootHour},
      {kRandomWalk, false, "mg/sqrt(Hz)", kMilli * kMps2PerG * kRootHour},
      {kBiasInstability, true, "deg/h", 1.0},
      {kBiasInstability, true, "deg/s", kSecondsPerHour},
      {kBiasInstability, true, "rad/s", kSecondsPerHour / kRadPerDeg},
      {kBiasInstability, false, "ug", 1.0},
      {kBiasInstability, false, "mg", 1e3},
      {kBiasInstability, false, "m/s^2", 1.0 / kMps2PerMicroG},
      {kRateRandomWalk, true, "deg/h/sqrt(h)", 1.0},
      {kRateRandomWalk, false, "ug/sqrt(h)", 1.0},
      {kRamp, true, "deg/h/h", 1.0},
      {kRamp, false, "ug/h", 1.0},
      {kQuantization, true, "arcsec", 1.0},
      {kQuantization, true, "deg", kArcsecPerDeg},
      {kQuantization, false, "m/s", 1.0},
  }};
  return kUnits;
}

constexpr std::array kTerms{Term::kRandomWalk, Term::kBiasInstability, Term::kRateRandomWalk, Term::kRamp,
                            Term::kQuantization};

std::string text_of(const json& value, const char* key) {
  const auto at = value.find(key);
  if (at == value.end()) return {};
  if (at->is_string()) return at->get<std::string>();
  return at->is_number() ? json_text(*at) : std::string();
}

bool is_axes(const std::string& axes) {
  constexpr std::array<std::string_view, 8> kNames{"gyro",   "accel",   "gyro_x",  "gyro_y",
                                                   "gyro_z", "accel_x", "accel_y", "accel_z"};
  return std::ranges::find(kNames, axes) != kNames.end();
}

/// @param where  of the value, for errors
Result<StatedValue> read_value(const json& value, const std::string& where) {
  const auto wrong = [&](const std::string& what, const std::string& remedy) {
    return work_error(fmt::format("{} {}", where, what), remedy);
  };
  if (!value.is_object())
    return wrong("is no object", "write {\"axes\", \"term\", \"value\", \"unit\", ...}");
  StatedValue out;
  out.axes = text_of(value, "axes");
  if (!is_axes(out.axes)) return wrong("has no axes", "give gyro, accel, or one axis such as accel_z");
  const std::string symbol = text_of(value, "term");
  const auto* const term = std::ranges::find_if(kTerms, [&](Term t) { return symbol == symbol_of(t); });
  if (term == kTerms.end()) return wrong("has no term", "give N, B, K, R or Q");
  out.term = *term;
  for (const auto& [key, text] : {std::pair{"document", &out.document}, std::pair{"revision", &out.revision},
                                  std::pair{"page", &out.page}}) {
    *text = text_of(value, key);
    if (text->empty())
      return wrong(fmt::format("has no {}", key),
                   "a value counts only with the document, its revision and the page that it stands on");
  }
  const std::string kind = text_of(value, "kind");
  if (!kind.empty() && kind != "typical" && kind != "maximum")
    return wrong(fmt::format("is of kind '{}'", kind), "give typical or maximum");
  out.is_maximum = kind == "maximum";
  const bool gyro = out.axes.starts_with("gyro");
  const std::string unit = text_of(value, "unit");
  std::vector<std::string_view> units;
  std::optional<double> factor;
  for (const StatedUnit& known : stated_units()) {
    if (known.term != out.term || known.gyro != gyro) continue;
    units.push_back(known.name);
    if (known.name == unit) factor = known.factor;
  }
  if (!factor)
    return wrong(unit.empty() ? "has no unit" : fmt::format("is in '{}'", unit),
                 fmt::format("give one of {}", fmt::join(units, ", ")));
  const auto number = value.find("value");
  if (number == value.end() || !number->is_number() || !(number->get<double>() > 0.0))
    return wrong("has no positive value", "give the number that stands on the page");
  out.value = *factor * number->get<double>();
  return out;
}

const TermValue* measured_term(const AxisCertificate& axis, Term term) {
  const auto at = std::ranges::find_if(axis.terms, [&](const TermValue& t) { return t.term == term; });
  return at == axis.terms.end() ? nullptr : &*at;
}

Verdict verdict_on(const TermValue& measured, double stated) {
  if (!std::isfinite(measured.value) || measured.knowledge == noise::Knowledge::kUnknown)
    return Verdict::kNotTold;
  if (measured.knowledge == noise::Knowledge::kBound)
    return measured.value <= stated ? Verdict::kBetter : Verdict::kNotTold;
  if (measured.ci_high && *measured.ci_high < stated) return Verdict::kBetter;
  if (measured.ci_low && *measured.ci_low > stated) return Verdict::kWorse;
  return Verdict::kAgrees;
}

}  // namespace

Result<DataSheet> read_data_sheet(const json& document, const std::string& part, const std::string& file) {
  if (!document.is_object() || text_of(document, "schema") != kSchema || !document.contains("parts") ||
      !document["parts"].is_array()) {
    return work_error(fmt::format("{} is no file of data sheets", file),
                      fmt::format("write {{\"schema\": \"{}\", \"parts\": [...]}}", kSchema));
  }
  std::vector<std::string> names;
  const json* found = nullptr;
  for (const json& entry : document["parts"]) {
    if (!entry.is_object() || text_of(entry, "part").empty())
      return work_error(fmt::format("{}: part {} has no name", file, names.size() + 1));
    names.push_back(text_of(entry, "part"));
    if (names.back() == part || (part.empty() && found == nullptr)) found = &entry;
  }
  if (found == nullptr || (part.empty() && names.size() > 1)) {
    return usage_error(part.empty() ? fmt::format("{} holds {} parts", file, names.size())
                                    : fmt::format("{} holds no part {}", file, part),
                       fmt::format("give --part; there is {}", fmt::join(names, ", ")));
  }
  DataSheet sheet{text_of(*found, "part"), {}};
  const auto values = found->find("values");
  if (values == found->end() || !values->is_array() || values->empty())
    return work_error(fmt::format("{}: {} has no values", file, sheet.part));
  for (const json& value : *values) {
    auto read =
        read_value(value, fmt::format("{}: value {} of {}", file, sheet.values.size() + 1, sheet.part));
    if (!read) return tl::unexpected<Error>(read.error());
    sheet.values.push_back(std::move(*read));
  }
  return sheet;
}

const char* name_of(Verdict verdict) noexcept {
  constexpr const char* kNames[] = {"better", "agrees", "worse", "not told"};
  return kNames[static_cast<std::size_t>(verdict)];
}

std::vector<StatedBeside> beside(const DataSheet& sheet, const std::vector<AxisCertificate>& axes) {
  std::vector<StatedBeside> rows;
  for (const AxisCertificate& axis : axes) {
    for (const Term term : kTerms) {
      const StatedValue* stated = nullptr;
      for (const StatedValue& value : sheet.values) {
        const bool is_own = value.axes == axis.name;
        const bool is_of_triad = axis.name.starts_with(value.axes + "_");
        if (value.term == term && (is_own || (is_of_triad && stated == nullptr))) stated = &value;
      }
      const TermValue* measured = measured_term(axis, term);
      if (stated == nullptr || measured == nullptr) continue;
      rows.push_back({axis.name, *measured, *stated, measured->value / stated->value,
                      verdict_on(*measured, stated->value)});
    }
  }
  return rows;
}

json to_json(const DataSheet& sheet, const std::vector<StatedBeside>& rows) {
  const auto number = [](double value) { return std::isfinite(value) ? json(value) : json(nullptr); };
  json out{{"part", sheet.part}, {"rows", json::array()}};
  for (const StatedBeside& row : rows) {
    out["rows"].push_back({{"axis", row.axis},
                           {"symbol", symbol_of(row.measured.term)},
                           {"name", name_of(row.measured.term, row.axis.starts_with("gyro"))},
                           {"unit", row.measured.unit},
                           {"stated", row.stated.value},
                           {"kind", row.stated.is_maximum ? "maximum" : "typical"},
                           {"value", number(row.measured.value)},
                           {"ci_low", row.measured.ci_low ? number(*row.measured.ci_low) : json(nullptr)},
                           {"ci_high", row.measured.ci_high ? number(*row.measured.ci_high) : json(nullptr)},
                           {"known", knowledge_name(row.measured.knowledge)},
                           {"ratio", number(row.ratio)},
                           {"verdict", name_of(row.verdict)},
                           {"document", row.stated.document},
                           {"revision", row.stated.revision},
                           {"page", row.stated.page}});
  }
  return out;
}

}  // namespace imuscope::certificate
