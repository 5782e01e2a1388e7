#include <fmt/format.h>
#include <algorithm>

#include "report/json_fields.h"
#include "report/people.h"
#include "report/sections.h"

namespace imuscope::report {
namespace {

constexpr const char* kNoRunFile = "No run.json in this run folder: nothing is known of it.";

Html inputs_list(const nlohmann::json& inputs) {
  Html items;
  for (const auto& input : inputs) {
    items += element(
        "li", text(input.is_string() ? input.get<std::string>()
                                     : input.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace)));
  }
  return items.empty() ? text(kUnknown) : element("ul", items);
}

Html or_unknown(const std::string& words) { return text(words.empty() ? kUnknown : words); }

Html duration_cell(std::optional<double> seconds) {
  return text(seconds ? duration_words(*seconds) : std::string(kUnknown));
}

Html warnings_of(const RunFiles& run) {
  Html items;
  for (const auto& warning : field(run.run, "warnings")) {
    if (warning.is_string()) items += element("li", text(warning.get<std::string>()));
  }
  return items.empty() ? paragraph("The run gave no warning.") : element("ul", items);
}

Html absent_files(const RunFiles& run) {
  if (run.absent.empty()) return {};
  Html items;
  for (const std::string& file : run.absent) items += element("li", text(file));
  return element("h3", text("Files that this run folder does not hold")) + element("ul", items);
}

}  // namespace

Html health_section(const RunFiles& run) {
  Html section = element("h2", text("Health of the devices"));
  if (run.run.is_null()) return section + paragraph(kNoRunFile);
  Table table({text("device"), text("role"), text("protocol"), text("samples"), text("rate, Hz"),
               text("frames"), text("bytes"), text("bytes skipped"), text("wrong checksums"),
               text("samples lost"), text("gaps"), text("late")});
  for (const auto& device : field(run.run, "devices")) {
    std::vector<Html> row{text(text_at(device, "name")), text(text_at(device, "role")),
                          text(text_at(device, "protocol")), count(number_at(device, "samples")),
                          number(number_at(device, "rate_hz"))};
    for (const char* key :
         {"frames", "bytes", "bytes_skipped", "bad_checksums", "samples_lost", "gaps", "late"}) {
      row.push_back(count(number_at(device, key)));
    }
    table.add_row(std::move(row));
  }
  return section + (table.empty() ? paragraph("run.json names no device.") : table.html());
}

Html making_section(const RunFiles& run) {
  Html section = element("h2", text("How this was made"));
  if (run.run.is_null()) {
    section += paragraph(kNoRunFile);
  } else {
    Table table({text("what"), text("value")});
    const auto& regimes = field(run.run, "regimes");
    table.add_row({text("imuscope"), or_unknown(text_at(run.run, "version"))});
    table.add_row({text("build"), or_unknown(text_at(run.run, "build"))});
    table.add_row({text("configuration"), or_unknown(text_at(run.run, "configuration"))});
    table.add_row(
        {text("its SHA-256"), element("code", or_unknown(text_at(run.run, "configuration_sha256")))});
    table.add_row({text("inputs"), inputs_list(field(run.run, "inputs"))});
    table.add_row({text("start (UTC)"), or_unknown(text_at(run.run, "t0_utc"))});
    table.add_row({text("duration"), duration_cell(number_at(run.run, "duration_s"))});
    table.add_row({text("at rest"), duration_cell(number_at(regimes, "static_s"))});
    table.add_row({text("in motion"), duration_cell(number_at(regimes, "dynamic_s"))});
    section += element("div", table.html(), "words") + element("h3", text("Warnings")) + warnings_of(run);
  }
  return section + absent_files(run);
}

}  // namespace imuscope::report
