#include "certificate_table.h"

#include <fmt/format.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <optional>
#include <vector>

#include "base/text.h"

namespace imuscope::cli {
namespace {

std::optional<double> number_at(const nlohmann::json& object, const char* key) {
  const auto found = object.find(key);
  return found != object.end() && found->is_number() ? std::optional(found->get<double>()) : std::nullopt;
}

/// Three digits, as an interval of a few percent deserves.
std::string digits(std::optional<double> value) {
  return value ? fmt::format("{:.3g}", *value) : std::string();
}

struct Row {
  std::string axis;
  std::string symbol;
  std::string value;  ///< empty where it is not known
  std::string low;
  std::string high;
  std::string unit;
  bool bound = false;
};

std::vector<Row> rows_of(const nlohmann::json& certificate) {
  std::vector<Row> rows;
  for (const nlohmann::json& axis : certificate.at("axes")) {
    for (const nlohmann::json& term : axis.at("terms")) {
      const std::string known = term.at("known");
      Row row;
      row.axis = axis.at("name");
      row.symbol = term.at("symbol");
      row.unit = term.at("unit");
      if (known != "unknown") row.value = digits(number_at(term, "value"));
      row.bound = known == "bound";
      if (!row.bound) {
        row.low = digits(number_at(term, "ci_low"));
        row.high = digits(number_at(term, "ci_high"));
      }
      rows.push_back(std::move(row));
    }
  }
  return rows;
}

/// Characters that mean something to LaTeX stand for themselves.
std::string latex(const std::string& any) {
  std::string out;
  for (const char c : any) {
    if (c == '\\') {
      out += "\\textbackslash{}";
    } else if (c == '^' || c == '~') {
      out += fmt::format("\\{}{{}}", c);
    } else {
      if (std::string_view("#$%&_{}").find(c) != std::string_view::npos) out += '\\';
      out += c;
    }
  }
  return out;
}

/// A bar would end a cell.
std::string markdown(const std::string& any) {
  std::string out;
  for (const char c : any) {
    if (c == '|') out += '\\';
    out += c;
  }
  return out;
}

std::string interval_words(const Row& row, const char* below, const char* unknown) {
  if (row.value.empty()) return unknown;
  if (row.bound) return below + row.value;
  return row.low.empty() || row.high.empty() ? row.value
                                             : fmt::format("{} [{}, {}]", row.value, row.low, row.high);
}

}  // namespace

std::string certificate_table(const nlohmann::json& certificate, TableFormat format) {
  std::string out;
  switch (format) {
    case TableFormat::kLatex:
      out = "\\begin{tabular}{llrl}\n\\hline\naxis & term & value & unit \\\\\n\\hline\n";
      for (const Row& row : rows_of(certificate)) {
        out += fmt::format("{} & ${}$ & {} & {} \\\\\n", latex(row.axis), row.symbol,
                           interval_words(row, "$<$ ", "--"), latex(row.unit));
      }
      return out + "\\hline\n\\end{tabular}\n";
    case TableFormat::kMarkdown:
      out = "| axis | term | value | unit |\n|---|---|---|---|\n";
      for (const Row& row : rows_of(certificate)) {
        out += fmt::format("| {} | {} | {} | {} |\n", markdown(row.axis), row.symbol,
                           interval_words(row, "below ", "–"), markdown(row.unit));
      }
      return out;
    case TableFormat::kCsv:
      break;
  }
  out = "axis,term,value,ci_low,ci_high,bound,unit\n";
  for (const Row& row : rows_of(certificate)) {
    out += fmt::format("{},{},{},{},{},{},{}\n", row.axis, row.symbol, row.value, row.low, row.high,
                       row.bound ? 1 : 0, row.unit);
  }
  return out;
}

std::string allan_csv(const nlohmann::json& certificate) {
  std::string out = "axis,tau_s,deviation,ci_low,ci_high,model,unit\n";
  const auto cell = [](std::optional<double> value) {
    return value ? fmt::format("{:.9g}", *value) : std::string();
  };
  for (const nlohmann::json& axis : certificate.at("axes")) {
    for (const nlohmann::json& point : axis.at("allan")) {
      out += fmt::format("{},{},{},{},{},{},{}\n", axis.at("name").get<std::string>(),
                         cell(number_at(point, "tau_s")), cell(number_at(point, "deviation")),
                         cell(number_at(point, "ci_low")), cell(number_at(point, "ci_high")),
                         cell(number_at(point, "model")), axis.at("unit").get<std::string>());
    }
  }
  return out;
}

}  // namespace imuscope::cli
