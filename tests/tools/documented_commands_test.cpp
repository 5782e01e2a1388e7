/// Every command that a document shows exists as it is shown: its name, and each of its options.

#include <gtest/gtest.h>

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <fstream>
#include <map>
#include <sstream>
#include <string>
#include <vector>

#include "programs.h"
#include "tests/support/shared_data.h"

namespace imuscope::test {
namespace {

/// A command line as a document shows it.
struct Shown {
  std::string where;  ///< file and line
  std::vector<std::string> words;
};

/// The words of one command: up to a comment, a pipe, a redirection or the end of a list.
std::vector<std::string> words_of(const std::string& text) {
  std::istringstream in(text);
  std::vector<std::string> words;
  for (std::string word; in >> word;) {
    if (word.front() == '#' || word == "|" || word == ">" || word == "&" || word == "&&") break;
    words.push_back(word);
  }
  return words;
}

bool is_command(const std::string& word) {
  const std::string name = std::filesystem::path(word).filename().string();
  return word.starts_with("tools/") || name == "imuscope" || name == "imusim";
}

void take(const std::string& where, const std::string& text, std::vector<Shown>& shown) {
  auto words = words_of(text);
  if (words.size() < 2 || !is_command(words[0])) return;
  shown.push_back({where, std::move(words)});
}

/// What stands in code blocks, and between single backticks in the text.
std::vector<Shown> commands_in(const std::filesystem::path& document) {
  std::vector<Shown> shown;
  std::ifstream in(document);
  bool in_block = false;
  int number = 0;
  for (std::string line; std::getline(in, line);) {
    const std::string where = document.filename().string() + ":" + std::to_string(++number);
    if (line.starts_with("```")) {
      in_block = !in_block;
    } else if (in_block) {
      take(where, line, shown);
    } else {
      for (std::size_t from = line.find('`'); from != std::string::npos;) {
        const std::size_t to = line.find('`', from + 1);
        if (to == std::string::npos) break;
        take(where, line.substr(from + 1, to - from - 1), shown);
        from = line.find('`', to + 1);
      }
    }
  }
  return shown;
}

std::vector<Shown> documented_commands() {
  std::vector<std::filesystem::path> documents{source_path("README.md"),
                                               source_path("ARCHITECTURE.md"),
                                               source_path("drivers/README.md"),
                                               source_path("drivers/csv/README.md"),
                                               source_path("drivers/can_odometry/README.md"),
                                               source_path("drivers/rtklib_pos/README.md"),
                                               source_path("cmake/debian/README.md.in"),
                                               source_path("tests/golden/README.md")};
  for (const auto& entry : std::filesystem::directory_iterator(source_path("docs"))) {
    if (entry.path().extension() == ".md") documents.push_back(entry.path());
  }
  std::vector<Shown> shown;
  for (const auto& document : documents) {
    const auto more = commands_in(document);
    shown.insert(shown.end(), more.begin(), more.end());
  }
  return shown;
}

/// What a program says of itself, or of one of its commands; of a script, its text.
class Manual {
 public:
  const std::string& of(const Shown& command) {
    const std::string& program = command.words[0];
    const bool script = program.starts_with("tools/");
    const std::string name = script ? program : std::filesystem::path(program).filename().string();
    // "capture" and "fleet" have commands of their own.
    const bool nested =
        !script && command.words.size() > 2 && (command.words[1] == "capture" || command.words[1] == "fleet");
    const std::string key =
        script ? name : name + " " + command.words[1] + (nested ? " " + command.words[2] : std::string());
    const auto known = texts_.find(key);
    if (known != texts_.end()) return known->second;
    if (script) return texts_[key] = read_text(source_path(name));
    const auto log = folder_ / "help.txt";
    const bool option = command.words[1].starts_with("-");
    std::vector<std::string> ask{"--help"};
    if (nested) ask.insert(ask.begin(), command.words[2]);
    if (!option) ask.insert(ask.begin(), command.words[1]);
    std::string text = run_program(name, ask, log) == 0 ? read_text(log) : std::string();
    // Of a command that it does not know the program explains itself instead.
    const std::string usage = text.substr(std::min(text.size(), text.find("Usage: ")));
    if (!option && usage.substr(0, usage.find('\n')).find(key + " ") == std::string::npos) text.clear();
    return texts_[key] = text;
  }

 private:
  std::filesystem::path folder_ = scratch_folder();
  std::map<std::string, std::string> texts_;
};

/// Whether a text names an option as a word of its own.
bool names(const std::string& text, const std::string& option) {
  for (std::size_t at = text.find(option); at != std::string::npos; at = text.find(option, at + 1)) {
    const char next = at + option.size() < text.size() ? text[at + option.size()] : ' ';
    if (std::isalnum(static_cast<unsigned char>(next)) == 0 && next != '-') return true;
  }
  return false;
}

TEST(DocumentedCommands, ExistWithEveryOptionTheyAreShownWith) {
  const auto shown = documented_commands();
  ASSERT_GT(shown.size(), 60U);
  Manual manual;
  for (const Shown& command : shown) {
    const std::string& text = manual.of(command);
    ASSERT_FALSE(text.empty()) << command.where << " shows " << command.words[0] << " " << command.words[1]
                               << ", which does not exist";
    for (std::size_t i = 1; i < command.words.size(); ++i) {
      std::string option = command.words[i].substr(0, command.words[i].find('='));
      if (!option.starts_with("-") || option == "-" || option == "--") continue;
      EXPECT_TRUE(names(text, option)) << command.where << " shows " << command.words[0] << " "
                                       << command.words[1] << " with " << option << ", which it has not";
    }
  }
}

}  // namespace
}  // namespace imuscope::test
