#include "tests/support/shared_data.h"

#include <string>

namespace imuscope::test {

std::filesystem::path shared_path(std::string_view relative) {
  return std::filesystem::path(IMUSCOPE_SHARED_DIR) / relative;
}

std::filesystem::path source_path(std::string_view relative) {
  return std::filesystem::path(IMUSCOPE_SOURCE_DIR) / relative;
}

std::filesystem::path program_path(std::string_view name) {
  return std::filesystem::path(IMUSCOPE_BINARY_DIR) / "bin" / name;
}

std::filesystem::path scratch_folder() {
  const auto* info = testing::UnitTest::GetInstance()->current_test_info();
  std::string name = std::string(info->test_suite_name()) + "." + info->name();
  for (char& c : name) {
    if (c == '/') c = '_';
  }
  const auto folder = std::filesystem::path(IMUSCOPE_BINARY_DIR) / "scratch" / name;
  std::filesystem::remove_all(folder);
  std::filesystem::create_directories(folder);
  return folder;
}

}  // namespace imuscope::test
