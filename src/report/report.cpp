#include "report/report.h"

#include <fmt/format.h>
#include <openssl/evp.h>
#include <array>

#include "base/output_folder.h"
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

/// The script as a Content-Security-Policy names it: no other is run, whatever got into the page.
std::string hash_of(std::string_view script) {
  std::array<unsigned char, EVP_MAX_MD_SIZE> digest{};
  unsigned int size = 0;
  EVP_Digest(script.data(), script.size(), digest.data(), &size, EVP_sha256(), nullptr);
  std::array<unsigned char, 2 * EVP_MAX_MD_SIZE> base64{};
  const int length = EVP_EncodeBlock(base64.data(), digest.data(), static_cast<int>(size));
  return fmt::format("'sha256-{}'", std::string_view(reinterpret_cast<const char*>(base64.data()),
                                                     static_cast<std::size_t>(length)));
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
  const std::string hashes = hash_of(plotting_script()) + " " + hash_of(page_script());
  return filled(page_template(), {{"script_hashes", hashes},
                                  {"plotting_notice", plotting_notice()},
                                  {"plotting_style", plotting_style()},
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
