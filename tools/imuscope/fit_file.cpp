#include "fit_file.h"

#include <fmt/format.h>

#include <fstream>
#include <nlohmann/json.hpp>

#include "models/noise/json.h"
#include "results/tables/json_file.h"

namespace imuscope::cli {
namespace {

std::string text_of(const nlohmann::json& object, const char* key, const std::string& otherwise) {
  const auto at = object.find(key);
  return at != object.end() && at->is_string() ? at->get<std::string>() : otherwise;
}

Result<StoredFit> stored_fit(const nlohmann::json& entry, const std::filesystem::path& file) {
  auto fit = noise::fit_from_json(entry);
  if (!fit) return tl::unexpected(fit.error());
  const auto unit = noise::parse_unit(text_of(entry, "unit", ""));
  if (!unit) return tl::unexpected(unit.error());
  return StoredFit{text_of(entry, "name", ""),
                   text_of(entry, "axis", file.stem().string()),
                   text_of(entry, "regime", ""),
                   *unit,
                   std::move(*fit),
                   noise::fitted_to_words(entry)};
}

/// The axes of a certificate as entries of a run's models.
nlohmann::json entries_of_certificate(const nlohmann::json& certificate) {
  auto entries = nlohmann::json::array();
  const auto axes = certificate.find("axes");
  if (axes == certificate.end() || !axes->is_array()) return entries;
  for (const auto& axis : *axes) {
    if (!axis.is_object() || !axis.contains("fit")) continue;
    auto entry = axis.at("fit");
    if (!entry.is_object()) continue;
    entry["axis"] = text_of(axis, "name", "");
    entry["unit"] = text_of(axis, "unit", "");
    entry["name"] = text_of(certificate, "sensor", "");
    entries.push_back(std::move(entry));
  }
  return entries;
}

}  // namespace

Result<std::vector<StoredFit>> read_fits(const std::filesystem::path& file) {
  std::ifstream in(file);
  if (!std::filesystem::is_regular_file(file) || !in) {
    return work_error(fmt::format("{} is not a file that can be read", file.string()),
                      "give what `imuscope fit --json` printed or a run's models.json");
  }
  const auto json = tables::read_json_file(file);
  if (json.is_discarded()) return work_error(fmt::format("{} is not JSON", file.string()));
  const bool is_certificate =
      json.is_object() && json.value("schema", "").starts_with("imuscope.certificate/");
  const bool is_run = json.is_object() && json.contains("models") && json.at("models").is_array();
  const auto entries = is_certificate ? entries_of_certificate(json)
                       : is_run       ? json.at("models")
                                      : nlohmann::json::array({json});
  std::vector<StoredFit> fits;
  for (const auto& entry : entries) {
    auto fit = stored_fit(entry, file);
    if (!fit) {
      Error error = fit.error();
      error.what = fmt::format("{}: {}", file.string(), error.what);
      return tl::unexpected(error);
    }
    fits.push_back(std::move(*fit));
  }
  if (fits.empty()) return work_error(fmt::format("{} holds no model", file.string()));
  return fits;
}

}  // namespace imuscope::cli
