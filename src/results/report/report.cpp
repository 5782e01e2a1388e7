#include "results/report/report.h"

#include <fmt/format.h>
#include <filesystem>
#include <utility>

#include "base/output_folder.h"
#include "results/page/assets.h"
#include "results/page/template.h"
#include "results/report/assets.h"
#include "results/report/figures.h"
#include "results/report/fits.h"
#include "results/report/page_parts.h"
#include "results/report/people.h"
#include "results/report/run_files.h"
#include "results/report/sections.h"
#include "results/report/verdict.h"
#include "results/tables/json_fields.h"

namespace imuscope {
namespace report {
namespace {

using tables::number_at;
using tables::text_at;

Html page_heading(const RunFiles& run) {
  const std::string vehicle = text_at(run.run, "name");
  std::string words = fmt::format("{} S-IMU{}", run.studies.size(), run.studies.size() == 1 ? "" : "s");
  if (const auto duration_s = number_at(run.run, "duration_s")) words += ", " + duration_words(*duration_s);
  // "2026-03-14T09:30:00.002000Z": to the second.
  constexpr std::size_t kDate = 10;
  constexpr std::size_t kToTheSecond = 19;
  if (const std::string start = text_at(run.run, "t0_utc"); start.size() > kToTheSecond)
    words += fmt::format(", from {} {} UTC", start.substr(0, kDate),
                         start.substr(kDate + 1, kToTheSecond - kDate - 1));
  const std::string folder = std::filesystem::absolute(run.folder).lexically_normal().filename().string();
  return element("header",
                 element("h1", text(vehicle.empty() ? "imuscope report" : vehicle)) +
                     paragraph("imuscope report: " + words + (folder.empty() ? "" : ", folder " + folder)));
}

/// The sections that the contents lead to, in the order of the page.
constexpr std::pair<const char*, const char*> kContents[] = {
    {"in-short", "In short"},  {"drive", "Drive"},
    {"mounting", "Mounting"},  {"figure-1", "Figure 1"},
    {"errors", "Figure 2"},    {"motion", "Figure 3"},
    {"table-1", "Table I"},    {"noise", "Figure 4"},
    {"table-2", "Table II"},   {"dependence", "Noise and motion"},
    {"outages", "Outages"},    {"health", "Devices"},
    {"warnings", "Warnings"},  {"making", "Making"},
    {"take-away", "Take away"}};

/// They follow the reader down the page.
Html contents_of(const Html& body) {
  Html links;
  for (const auto& [id, words] : kContents) {
    if (body.str().find(fmt::format("<h2 id=\"{}\"", id)) == std::string::npos) continue;
    links += link_to_heading(id, words);
  }
  return Html::markup("<nav class=\"contents\" aria-label=\"contents\">") + links + Html::markup("</nav>");
}

std::string make_page(const RunFiles& run) {
  const auto fits = read_fits(run.models);
  FigureSheet figures;
  Html sections = element("section", summary_section(run, fits));
  sections += element("section", drive_section(run, figures));
  sections += element("section", calibration_section(run, figures));
  sections += element("section", errors_section(run, figures));
  sections += element("section", dynamics_section(run, figures));
  sections += element("section", models_section(run, fits, figures));
  sections += element("section", dependence_section(run, figures));
  sections += element("section", outages_section(run));
  sections += element("section", health_section(run));
  sections += element("section", making_section(run));
  sections += element("section", take_away_section(run, fits));
  const Html body = page_heading(run) + contents_of(sections) + sections;
  const std::string data = json_for_script(figures.json());
  const std::string hashes = page::hash_source(plotting_script()) + " " + page::hash_source(page_script());
  return page::filled(page_template(), {{"script_hashes", hashes},
                                        {"plotting_notice", plotting_notice()},
                                        {"plotting_style", plotting_style()},
                                        {"kit_style", page::kit_style()},
                                        {"document_style", page::document_style()},
                                        {"page_style", page_style()},
                                        {"body", body.str()},
                                        {"figures", data},
                                        {"plotting_script", plotting_script()},
                                        {"page_script", page_script()}});
}

}  // namespace
}  // namespace report

Result<void> write_report(const std::filesystem::path& run_dir) {
  const auto run = report::read_run_files(run_dir);
  if (!run) return tl::unexpected<Error>(run.error());
  const auto folder = OutputFolder::open(run_dir);
  if (!folder) return tl::unexpected<Error>(folder.error());
  return folder->write_whole("report.html", report::make_page(*run));
}

}  // namespace imuscope
