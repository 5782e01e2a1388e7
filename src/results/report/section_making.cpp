#include <fmt/format.h>
#include <algorithm>
#include <iterator>

#include "base/grouped.h"
#include "base/json_text.h"
#include "results/report/people.h"
#include "results/report/sections.h"
#include "results/tables/json_fields.h"

namespace imuscope::report {
namespace {

using tables::field;
using tables::number_at;
using tables::text_at;

constexpr const char* kNoRunFile = "No run.json in this run folder: nothing is known of it.";

Html inputs_list(const nlohmann::json& inputs) {
  Html items;
  for (const auto& input : inputs) {
    items +=
        element("li", text(input.is_string() ? input.get<std::string>() : json_text(input, kJsonOneLine)));
  }
  return items.empty() ? text(kUnknown) : element("ul", items);
}

Html or_unknown(const std::string& words) { return text(words.empty() ? kUnknown : words); }

Html duration_cell(std::optional<double> seconds) {
  return text(seconds ? duration_words(*seconds) : std::string(kUnknown));
}

Html warnings_of(const RunFiles& run) {
  const auto warnings = sentences_of(run, "warnings");
  const auto notes = sentences_of(run, "notes");
  return (warnings.empty() ? paragraph("The run gave no warning.") : list_of(warnings)) +
         (notes.empty() ? Html() : fold("What was left out, and why", list_of(notes)));
}

Html absent_files(const RunFiles& run) {
  if (run.absent.empty()) return {};
  Html items;
  for (const std::string& file : run.absent) items += element("li", text(file));
  return fold("Files that this run folder does not hold", element("ul", items));
}

/// A count of a device and what it is called.
struct Column {
  const char* key;
  const char* heading;
};

/// Whether every device that has this count has none of it: then it need not be shown.
bool is_zero_everywhere(const nlohmann::json& devices, const Column& column) {
  return std::all_of(devices.begin(), devices.end(),
                     [&](const auto& device) { return number_at(device, column.key).value_or(0.0) == 0.0; });
}

/// The counts that are not zero in all devices.
std::vector<Column> columns_of(const nlohmann::json& devices) {
  constexpr Column kColumns[] = {{"rate_hz", "rate, Hz"},
                                 {"samples", "samples"},
                                 {"frames", "frames"},
                                 {"bytes", "bytes"},
                                 {"bytes_skipped", "bytes skipped"},
                                 {"bad_checksums", "wrong checksums"},
                                 {"bad_lengths", "wrong lengths"},
                                 {"bad_contents", "wrong contents"},
                                 {"samples_lost", "samples lost"},
                                 {"gaps", "gaps"},
                                 {"clock_resets", "clock resets"},
                                 {"refused", "refused"},
                                 {"late", "late"}};  // what is not among the headings is zero everywhere
  std::vector<Column> columns;
  std::copy_if(std::begin(kColumns), std::end(kColumns), std::back_inserter(columns),
               [&](const Column& column) { return !is_zero_everywhere(devices, column); });
  return columns;
}

/// What happened, as the run noted it.
Html events_of(const RunFiles& run) {
  Table table({text("time, s"), text("event")});
  for (const auto& event : field(run.run, "events")) {
    const auto time_s = number_at(event, "time_s");
    table.add_row({text(time_s ? fmt::format("{:.1f}", *time_s) : kUnknown), text(text_at(event, "text"))});
  }
  if (table.empty()) return {};
  return element("div", table.html(), "words");
}

Html scaled(std::optional<double> value, double by, int decimals) {
  return text(value ? fmt::format("{:.{}f}", *value * by, decimals) : std::string(kUnknown));
}

/// Of a live run: what lies between an instant that a device measured and its time in the run.
Html time_budget(const nlohmann::json& devices) {
  constexpr double kMs = 1e3;
  constexpr double kUs = 1e6;
  Table table({text("device"), text("stamped by"), text("before the read, us"), text("jitter of reads, us"),
               text("on the wire, ms"), text("adapter up to, ms"), text("until read, ms"), text("jitter, us"),
               text("constant delay t_d, ms"), text("its sd, ms"), text("delay by pulses, ms"),
               text("its sd, ms")});
  for (const auto& device : devices) {
    const auto& budget = field(device, "time_budget");
    if (budget.is_null()) continue;
    table.add_row(
        {text(text_at(device, "name")), text(text_at(budget, "stamped_by")),
         scaled(number_at(budget, "stamp_lead_s"), kUs, 0),
         scaled(number_at(budget, "stamp_lead_sd_s"), kUs, 0), scaled(number_at(budget, "wire_s"), kMs, 3),
         scaled(number_at(budget, "adapter_s"), kMs, 0), scaled(number_at(budget, "latency_s"), kMs, 2),
         scaled(number_at(budget, "clock_sd_s"), kUs, 0), scaled(number_at(budget, "t_d_s"), kMs, 3),
         scaled(number_at(budget, "sd_t_d_s"), kMs, 3), scaled(number_at(budget, "delay_s"), kMs, 3),
         scaled(number_at(budget, "sd_delay_s"), kMs, 3)});
  }
  if (table.empty()) return {};
  return element("h3", text("Time")) + table.html() +
         paragraph(
             "Stamps are dated back by the time on the wire, and late reads have no influence. The constant "
             "delay that is left, of device, adapter and line, is estimated for an S-IMU against the "
             "reference and taken out; of that its sd remains. That of any other device nobody measures, "
             "unless pulses of UTC (PPS) come into the PC and the device tags its data with UTC. Where "
             "kernel or card stamp what arrives, the jitter of reads does not reach the times.");
}

}  // namespace

Html device_table(const RunFiles& run) {
  const auto& devices = field(run.run, "devices");
  const auto columns = columns_of(devices);
  std::vector<Html> headings{text("device"), text("role"), text("protocol")};
  for (const Column& column : columns) headings.push_back(text(column.heading));
  Table table(std::move(headings));
  for (const auto& device : devices) {
    std::vector<Html> row{text(text_at(device, "name")), text(text_at(device, "role")),
                          text(text_at(device, "protocol"))};
    for (const Column& column : columns) row.push_back(count(number_at(device, column.key)));
    table.add_row(std::move(row));
  }
  if (table.empty()) return paragraph("run.json names no device.");
  return table.html() +
         paragraph(
             "Of what is not listed (skipped bytes, wrong checksums, lost, refused and late samples, "
             "restarts of clocks) no device had any.",
             "note");
}

Html health_section(const RunFiles& run) {
  Html section = heading("health", "Health of the devices");
  if (run.run.is_null()) return section + paragraph(kNoRunFile);
  std::vector<std::string> remarks;
  for (const auto& device : field(run.run, "devices")) {
    for (const char* key : {"problem", "clock"}) {
      const std::string words = text_at(device, key);
      if (!words.empty()) remarks.push_back(text_at(device, "name") + ": " + words);
    }
  }
  std::vector<std::string> names;
  for (const auto& device : field(run.run, "devices")) names.push_back(text_at(device, "name"));
  return section + device_table(run) + list_of(grouped_by_name(remarks, names)) +
         time_budget(field(run.run, "devices"));
}

Html making_section(const RunFiles& run) {
  Html section = heading("warnings", "Warnings and events");
  if (run.run.is_null()) {
    section += paragraph(kNoRunFile);
  } else {
    section += warnings_of(run) + fold("Events", events_of(run));
  }
  section += heading("making", "How this was made");
  if (!run.run.is_null()) {
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
    Html all = element("div", table.html(), "words");
    if (const std::string words = text_at(run.run, "configuration_text"); !words.empty())
      all += element("h3", text("The configuration, word by word")) + element("pre", text(words));
    section += fold("Program, configuration, inputs", all);
  }
  return section + absent_files(run);
}

}  // namespace imuscope::report
