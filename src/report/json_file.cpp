#include "report/json_file.h"

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

}  // namespace imuscope::report
