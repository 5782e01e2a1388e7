#include "results/report/certificate_page.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>

#include "base/grouped.h"
#include "base/output_folder.h"
#include "base/text.h"
#include "base/units.h"
#include "results/report/certificate_figures.h"
#include "results/report/fits.h"
#include "results/report/page_parts.h"
#include "results/report/people.h"
#include "results/tables/json_fields.h"
#include "results/tables/json_file.h"

namespace imuscope {
namespace report {
namespace {

using tables::field;
using tables::number_at;
using tables::numbers_at;
using tables::text_at;

using nlohmann::json;

Html figure(const std::filesystem::path& svg, const std::string& words) {
  std::ifstream in(svg, std::ios::binary);
  std::ostringstream content;
  content << in.rdbuf();
  return element("figure", svg_image(content.str(), words) + element("figcaption", text(words)));
}

/// "0.302 [0.299, 0.305]", "below 1.2", "–".
Html term_cell(const json& term) {
  const std::string known = text_at(term, "known");
  const auto value = number_at(term, "value");
  if (known == "unknown" || !value) return text(kUnknown);
  if (known == "bound") return text("below ") + number(*value, 2);
  return with_interval(*value, number_at(term, "ci_low"), number_at(term, "ci_high"));
}

/// The first axis' terms name the rows; gyroscopes and accelerometers have tables of their own.
Html terms_table(const json& certificate, bool gyro) {
  std::vector<const json*> axes;
  for (const auto& axis : field(certificate, "axes")) {
    if (is_gyro_axis(axis) == gyro) axes.push_back(&axis);
  }
  if (axes.empty()) return {};
  std::vector<Html> headings{text(gyro ? "gyroscope" : "accelerometer")};
  for (const json* axis : axes) headings.push_back(text(text_at(*axis, "name")));
  headings.push_back(text("unit"));
  Table table(std::move(headings));
  const json& first = field(*axes.front(), "terms");
  for (std::size_t i = 0; i < first.size(); ++i) {
    std::vector<Html> row{text(text_at(first[i], "name") + " (" + text_at(first[i], "symbol") + ")")};
    for (const json* axis : axes) {
      const json& terms = field(*axis, "terms");
      row.push_back(i < terms.size() ? term_cell(terms[i]) : text(kUnknown));
    }
    row.push_back(text(text_at(first[i], "unit")));
    table.add_row(std::move(row));
  }
  return table.html();
}

/// Records beside each other: the population's mean, what they differ by, the bound for a new unit.
Html units_section(const json& certificate) {
  const json& units = field(certificate, "units");
  if (!units.is_array() || units.empty()) return {};
  Table table({text("axis"), text("term"), text("records"), text("mean of all"), text("differ by, %"),
               text("95 % are below"), text("unit"), text("stands out")});
  for (const auto& row : units) {
    std::size_t n = 0;
    std::string outliers;
    const json& values = field(row, "values");
    const json& p = field(row, "p_holm");
    for (std::size_t i = 0; i < values.size(); ++i) {
      n += values[i].is_number() ? 1 : 0;
      constexpr double kSignificant = 0.05;
      if (i < p.size() && p[i].is_number() && p[i].get<double>() < kSignificant)
        outliers += (outliers.empty() ? "" : ", ") + std::to_string(i + 1);
    }
    const auto ci = numbers_at<2>(row, "mean_ci");
    const auto mean = number_at(row, "mean");
    const auto spread = number_at(row, "spread_log");
    table.add_row({text(text_at(row, "axis")), text(text_at(row, "symbol")), text(std::to_string(n)),
                   mean && ci ? with_interval(*mean, (*ci)[0], (*ci)[1]) : text(kUnknown),
                   spread ? number(100.0 * *spread, 2) : text(kUnknown),
                   number(number_at(row, "tolerance_upper_95_95"), 3), text(text_at(row, "unit")),
                   text(outliers.empty() ? kUnknown : "record " + outliers)});
  }
  return element("h2", text("All records")) + table.html();
}

/// What the maker states beside what the record shows.
Html data_sheet_section(const json& certificate) {
  const json& comparison = field(certificate, "comparison");
  if (!comparison.is_object()) return {};
  Table table({text("axis"), text("term"), text("record"), text("data sheet"), text("unit"),
               text("record is"), text("where it is stated")});
  for (const auto& row : field(comparison, "rows")) {
    table.add_row(
        {text(text_at(row, "axis")), text(text_at(row, "symbol")), term_cell(row),
         number(number_at(row, "stated"), 3) + text(text_at(row, "kind") == "maximum" ? " at most" : ""),
         text(text_at(row, "unit")), text(text_at(row, "verdict")),
         text(fmt::format("{}, {}, page {}", text_at(row, "document"), text_at(row, "revision"),
                          text_at(row, "page")))});
  }
  const Html heading = element("h2", text("Beside the data sheet of " + text_at(comparison, "part")));
  return heading + (table.empty() ? paragraph("It states nothing of these axes.") : table.html());
}

/// Which axes move together, at the scale where it is plainest.
Html correlation_section(const json& certificate) {
  const json& pairs = field(certificate, "correlation");
  if (!pairs.is_array() || pairs.empty()) return {};
  Table table({text("axes"), text("correlation"), text("at, s"), text("p, corrected")});
  std::size_t without = 0;
  for (const auto& pair : pairs) {
    const auto value = number_at(pair, "coherence");
    const auto p = number_at(pair, "p_holm");
    const json& names = field(pair, "signals");
    const bool has_names = names.size() == 2 && names[0].is_string() && names[1].is_string();
    const json& shows = field(pair, "shows");
    if (!value || !p || !has_names || !shows.is_boolean() || !shows.get<bool>()) {
      ++without;
      continue;
    }
    table.add_row(
        {text(axis_words(names[0].get<std::string>()) + ", " + axis_words(names[1].get<std::string>())),
         with_interval(*value, number_at(pair, "ci_low"), number_at(pair, "ci_high")),
         number(number_at(pair, "tau_s"), 3), number(*p, 2)});
  }
  Html out = element("h2", text("What axes have in common"));
  if (const auto means_s = number_at(certificate, "correlation_of_means_s")) {
    out += paragraph(fmt::format(
        "Looked for in means of {:.3g} s, as the record is long; faster ones would not show.", *means_s));
  }
  if (!table.empty()) out += table.html();
  const std::string rest =
      table.empty()
          ? "No two axes correlate by more than a tenth at the scale where it is plainest."
          : fmt::format("The other {} pairs correlate by less than a tenth, or not at all.", without);
  if (without > 0) out += paragraph(rest);
  return out;
}

/// Sentences of all axes; one that several axes share stands once, with their names.
std::vector<std::string> grouped_at(const json& certificate, const char* key) {
  std::vector<Named> sentences;
  for (const auto& axis : field(certificate, "axes")) {
    for (const auto& sentence : field(axis, key)) {
      if (sentence.is_string()) sentences.push_back({text_at(axis, "name"), sentence.get<std::string>()});
    }
  }
  return grouped(sentences);
}

Html heading_of(const json& certificate) {
  std::string words = duration_words(number_at(certificate, "duration_s").value_or(0.0)) +
                      fmt::format(" at {:.6g} Hz", number_at(certificate, "rate_hz").value_or(0.0));
  const std::string selection = text_at(certificate, "selection");
  if (!selection.empty()) words += ", " + selection;
  std::string files;
  for (const auto& file : field(certificate, "files")) {
    if (file.is_string()) files += (files.empty() ? "" : ", ") + file.get<std::string>();
  }
  return element("header", element("h1", text(text_at(certificate, "sensor"))) +
                               paragraph("IMU noise certificate: " + words) +
                               paragraph("From " + files, "quiet"));
}

Html summary(const json& certificate, const CertificateFigures& figures) {
  Html out;
  const auto warnings = grouped_at(certificate, "warnings");
  out += list_of(warnings, "answer partly");
  out += terms_table(certificate, true) + terms_table(certificate, false);
  out += paragraph(fmt::format("Intervals at {:.0f} % confidence, if the model or one as good is right. "
                               "\"Below\" is the most that this record allows. "
                               "Symbols as in IEEE Std 952 and 1293.",
                               100.0 * number_at(certificate, "confidence").value_or(0.0)),
                   "quiet");
  Html overview;
  for (const auto& [file, words] : figures.overview) overview += figure(file, words);
  out += element("div", overview, "panels wide");
  out += data_sheet_section(certificate);
  out += correlation_section(certificate);
  out += units_section(certificate);
  const auto limits = grouped_at(certificate, "limits");
  if (!limits.empty()) out += element("h2", text("What limits the numbers")) + list_of(limits, "limits");
  return out;
}

Html found_in_spectrum(const json& axis) {
  std::vector<std::string> sentences;
  for (const char* key : {"lines", "resonances"}) {
    for (const auto& found : field(axis, key)) sentences.push_back(text_at(found, "words"));
  }
  if (const auto end = number_at(axis, "low_pass_hz")) {
    sentences.push_back(
        fmt::format("the density falls to half of its plateau at {:.3g} Hz: the end of the bandwidth", *end));
  }
  if (sentences.empty()) return {};
  for (auto& sentence : sentences) sentence.front() = static_cast<char>(std::toupper(sentence.front()));
  return list_of(sentences, "plain");
}

Html temperature_words(const json& axis) {
  const json& t = field(axis, "temperature");
  if (!t.is_object()) return {};
  const std::string unit = text_at(axis, "unit");
  std::string words =
      fmt::format("Between {:.1f} and {:.1f} °C the bias changes by {:.3g} ± {:.2g} {} per °C (p = {:.2g}).",
                  number_at(t, "lowest_c").value_or(0.0), number_at(t, "highest_c").value_or(0.0),
                  number_at(t, "bias_per_c").value_or(0.0), number_at(t, "bias_per_c_sd").value_or(0.0), unit,
                  number_at(t, "bias_p_value").value_or(1.0));
  if (const auto noise = number_at(t, "noise_variance_per_c")) {
    words += fmt::format(" The variance of the fast noise changes by {:.2g} ± {:.1g} % per °C.",
                         100.0 * *noise, 100.0 * number_at(t, "noise_variance_per_c_sd").value_or(0.0));
  }
  return paragraph(words);
}

Html axis_section(const json& axis, const std::filesystem::path& drawn) {
  Html out = element("h2", text(axis_words(text_at(axis, "name"))));
  const json& fit = field(axis, "fit");
  std::string words = fmt::format("{} samples", number_at(axis, "n_samples").value_or(0.0));
  if (const double missing = number_at(axis, "n_missing").value_or(0.0); missing > 0.0)
    words += fmt::format(", {} missing", missing);
  words += fmt::format("; mean {:.6g}, sd {:.4g} {}", number_at(axis, "mean").value_or(0.0),
                       number_at(axis, "sd").value_or(0.0), text_at(axis, "unit"));
  if (const auto step = number_at(axis, "resolution")) words += fmt::format(", resolution {:.4g}", *step);
  words += ". Model " + text_at(fit, "model");
  if (const double miss = number_at(axis, "largest_miss").value_or(0.0); miss > 0.0)
    words += fmt::format(", which stays within {:.2g} % of the interval of every scale", 100.0 * miss);
  out += paragraph(words + ".");
  out += figure(
      drawn,
      "Allan deviation, wavelet variance with the model and its processes, and power spectral density.");
  out += found_in_spectrum(axis) + temperature_words(axis);
  Table table({text("process"), text("parameter"), text("value"), text("unit")});
  for (const auto& p : field(fit, "parameters")) {
    const auto value = number_at(p, "value");
    table.add_row(
        {text(text_at(p, "process")), text(text_at(p, "name")),
         value ? with_interval(*value, number_at(p, "ci_low"), number_at(p, "ci_high")) : text(kUnknown),
         text(text_at(p, "unit"))});
  }
  if (!table.empty()) out += table.html();
  return out;
}

std::string page_of(const json& certificate, const CertificateFigures& figures) {
  Html body = heading_of(certificate) + element("section", summary(certificate, figures));
  std::size_t i = 0;
  for (const auto& axis : field(certificate, "axes")) {
    if (i < figures.of_axes.size()) body += element("section", axis_section(axis, figures.of_axes[i]));
    ++i;
  }
  body += paragraph(fmt::format("Made by imuscope {} at {}.", text_at(certificate, "version"),
                                text_at(certificate, "made_utc")),
                    "quiet");
  return page_without_script(text_at(certificate, "sensor"), body);
}

}  // namespace
}  // namespace report

Result<std::vector<std::filesystem::path>> write_certificate_page(const std::filesystem::path& folder,
                                                                  const nlohmann::json& certificate) {
  using Files = std::vector<std::filesystem::path>;
  return tables::with_documents_of(folder, [&]() -> Result<Files> {
    const auto out = OutputFolder::open(folder);
    if (!out) return tl::unexpected<Error>(out.error());
    const auto figures = report::draw_certificate(*out, certificate);
    if (!figures) return tl::unexpected<Error>(figures.error());
    if (auto written = out->write_whole("certificate.html", report::page_of(certificate, *figures)); !written)
      return tl::unexpected<Error>(written.error());
    Files files{folder / "certificate.html"};
    files.insert(files.end(), figures->of_axes.begin(), figures->of_axes.end());
    return files;
  });
}

}  // namespace imuscope
