#include "report/json_file.h"

#include <fmt/format.h>
#include <fstream>
#include <system_error>

#include "base/text.h"

namespace imuscope::report {

nlohmann::json read_json_file(const std::filesystem::path& file) {
  std::error_code error;
  const auto size = std::filesystem::file_size(file, error);
  if (error || size > kTextFileMax) return nlohmann::json(nlohmann::json::value_t::discarded);
  std::ifstream in(file);
  return nlohmann::json::parse(in, nullptr, /*allow_exceptions=*/false);
}

Error malformed(const std::filesystem::path& run_folder, const nlohmann::json::exception& why) {
  // Before the words stands "[json.exception.out_of_range.403] ".
  std::string words = why.what();
  if (const auto end = words.find("] "); end != std::string::npos) words.erase(0, end + 2);
  return {
      ErrorKind::kWork,
      fmt::format("a JSON file of {}, or the truth.json given with it, is not as this version writes it: {}",
                  run_folder.string(), words),
      "make the run again"};
}

}  // namespace imuscope::report
