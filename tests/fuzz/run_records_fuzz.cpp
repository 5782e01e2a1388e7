/// A run folder whose files are valid in form and hostile in content, through every command that reads one:
/// places in its documents and cells of its tables hold what no run writes there.

#include <fstream>
#include <iterator>
#include <map>
#include <sstream>

#include "tests/fuzz/choices.h"
#include "tests/fuzz/command_line.h"
#include "tests/fuzz/folder_in_memory.h"
#include "tests/results/report/synthetic_run.h"

namespace imuscope::fuzz {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kForgeriesMax = 8;

std::span<const std::uint8_t> bytes_of(const std::string& text) {
  return {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()};
}

/// The files of a whole run, by name.
std::map<std::string, std::string> whole_run(const FolderInMemory& folder) {
  test::SyntheticRun run;
  run.duration_s = 3.0;
  run.names = {"mtx1"};
  test::write_synthetic_run(folder.path(), run);
  std::map<std::string, std::string> files;
  for (const auto& entry : fs::directory_iterator(folder.path())) {
    std::ifstream in(entry.path(), std::ios::binary);
    files[entry.path().filename().string()] = {std::istreambuf_iterator<char>(in), {}};
  }
  return files;
}

/// Another text in one cell of a table.
std::string with_forged_cell(const std::string& table, Choices& choices) {
  const std::size_t at = choices.word() % (table.size() + 1);
  const std::size_t begin = table.find_first_of(",\n", at);
  if (begin == std::string::npos) return table;
  const std::size_t end = std::min(table.find_first_of(",\n", begin + 1), table.size());
  const std::string cell = choices.byte() % 2 == 0 ? choices.text() : nlohmann::json(choices.real()).dump();
  return table.substr(0, begin + 1) + cell + table.substr(end);
}

std::string forged(const std::string& name, const std::string& content, Choices& choices) {
  if (!name.ends_with(".json")) return with_forged_cell(content, choices);
  nlohmann::json document = nlohmann::json::parse(content);
  forge(document, choices);
  return document.dump(-1, ' ', false, nlohmann::json::error_handler_t::ignore);
}

}  // namespace
}  // namespace imuscope::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace imuscope::fuzz;
  static const FolderInMemory folder;
  static const std::map<std::string, std::string> whole = whole_run(folder);
  const std::string path = folder.path().string();
  Choices choices({data, size});
  std::map<std::string, std::string> changed;
  for (std::size_t i = 0; i < kForgeriesMax && !choices.at_end(); ++i) {
    const auto file = std::next(whole.begin(), static_cast<std::ptrdiff_t>(choices.below(whole.size())));
    auto& content = changed.try_emplace(file->first, file->second).first->second;
    content = forged(file->first, content, choices);
  }
  for (const auto& [name, content] : changed) folder.put(name, bytes_of(content));
  run_command({"report", path});
  run_command({"tables", path});
  run_command({"tables", path, "--json"});
  run_command({"combine", path, path});
  run_command({"evaluate", path});
  for (const auto& [name, content] : changed) folder.put(name, bytes_of(whole.at(name)));
  return 0;
}
