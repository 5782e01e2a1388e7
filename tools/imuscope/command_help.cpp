#include <fmt/format.h>
#include <memory>
#include <string>

#include "base/nearest_word.h"
#include "commands.h"
#include "print.h"

namespace imuscope::cli {

std::string no_such_command(const CLI::App& app, const std::string& word) {
  for (const std::string& other : commands_of_another_package()) {
    if (word == other)
      return fmt::format(
          "'{}' is a command of the package imuscope, and this is imuscope-live; run it on a PC with "
          "that one",
          word);
  }
  std::vector<std::string> names;
  for (const CLI::App* command : app.get_subcommands({})) names.push_back(command->get_name());
  const std::string nearest = nearest_word(word, names);
  return fmt::format("there is no command '{}'{}", word,
                     nearest.empty() ? "" : fmt::format("; the nearest is '{}'", nearest));
}

void add_help(CLI::App& app, Work& chosen) {
  auto* command = app.add_subcommand("help", "Print the help of a command");
  auto name = std::make_shared<std::string>();
  command->add_option("COMMAND", *name, "without it, the commands are listed");
  on_chosen(*command, chosen, [name, &app]() -> Result<void> {
    if (name->empty()) {
      say("{}", app.get_formatter()->make_help(&app, app.get_name(), CLI::AppFormatMode::Normal));
      return {};
    }
    for (const CLI::App* asked : app.get_subcommands({})) {
      if (asked->get_name() != *name) continue;
      say("{}", asked->help(app.get_name()));
      return {};
    }
    return usage_error(no_such_command(app, *name), "imuscope help lists them");
  });
}

}  // namespace imuscope::cli
