#include "report/report.h"

#include <fmt/format.h>
#include <fstream>

#include "report/assets.h"
#include "report/figures.h"
#include "report/fits.h"
#include "report/html.h"
#include "report/json_fields.h"
#include "report/people.h"
#include "report/run_files.h"
#include "report/sections.h"
#include "report/verdict.h"

namespace imuscope {
namespace report {
namespace {

Html page_heading(const RunFiles& run) {
  std::string words = fmt::format("{} S-IMU{}", run.studies.size(), run.studies.size() == 1 ? "" : "s");
  if (const auto duration_s = number_at(run.run, "duration_s")) words += ", " + duration_words(*duration_s);
  const std::string start = text_at(run.run, "t0_utc");
  if (!start.empty()) words += ", from " + start;
  return element("header", element("h1", text("imuscope report")) + paragraph(words));
}

/// The template with each {{name}} replaced once, in one pass: what is put in is not searched again.
std::string filled(std::string_view page_text,
                   const std::vector<std::pair<std::string_view, std::string_view>>& values) {
  std::string page;
  while (!page_text.empty()) {
    const std::size_t begin = page_text.find("{{");
    page += page_text.substr(0, begin);
    if (begin == std::string_view::npos) break;
    const std::size_t end = page_text.find("}}", begin);
    const std::string_view name = page_text.substr(begin + 2, end - begin - 2);
    for (const auto& [key, value] : values) {
      if (key == name) page += value;
    }
    page_text.remove_prefix(end + 2);
  }
  return page;
}

std::string make_page(const RunFiles& run) {
  const auto fits = read_fits(run.models);
  FigureSheet figures;
  Html body = page_heading(run);
  body += element("section", summary_section(run, fits));
  body += element("section", drive_section(run, figures));
  body += element("section", calibration_section(run, figures));
  body += element("section", errors_section(run, figures));
  body += element("section", dynamics_section(run, figures));
  body += element("section", models_section(run, fits, figures));
  body += element("section", dependence_section(run, figures));
  body += element("section", outages_section(run));
  body += element("section", health_section(run));
  body += element("section", making_section(run));
  body += element("section", take_away_section(run, fits));
  const std::string data = json_for_script(figures.json());
  return filled(page_template(), {{"plotting_notice", plotting_notice()},
                                  {"plotting_style", plotting_style()},
                                  {"page_style", page_style()},
                                  {"body", body.str()},
                                  {"figures", data},
                                  {"plotting_script", plotting_script()},
                                  {"page_script", page_script()}});
}

/// Writes beside the file and renames, so that a report is whole or not there.
Result<void> write_page(const std::filesystem::path& file, const std::string& page) {
  const std::filesystem::path unfinished = file.string() + ".unfinished";
  std::ofstream out(unfinished, std::ios::binary | std::ios::trunc);
  out << page;
  out.close();
  std::error_code code;
  if (out) std::filesystem::rename(unfinished, file, code);
  if (!out || code) {
    return work_error(file.string() + " could not be written",
                      "check the folder's permissions and the disk's free space");
  }
  return {};
}

}  // namespace
}  // namespace report

Result<void> write_report(const std::filesystem::path& run_dir) {
  const auto run = report::read_run_files(run_dir);
  if (!run) return tl::unexpected<Error>(run.error());
  return report::write_page(run_dir / "report.html", report::make_page(*run));
}

}  // namespace imuscope
