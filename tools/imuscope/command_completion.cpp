#include <fmt/format.h>
#include <algorithm>
#include <memory>
#include <string>
#include <vector>

#include "commands.h"
#include "print.h"

namespace imuscope::cli {

namespace {

/// One command as a shell completes it.
struct Command {
  std::string name;
  std::string what;
  std::vector<std::string> options;
};

std::vector<std::string> options_of(const CLI::App& app) {
  std::vector<std::string> names;
  for (const CLI::Option* option : app.get_options())
    for (const std::string& name : option->get_lnames()) names.push_back("--" + name);
  std::sort(names.begin(), names.end());
  return names;
}

std::vector<Command> commands_of(const CLI::App& app) {
  std::vector<Command> commands;
  for (const CLI::App* command : app.get_subcommands({}))
    commands.push_back({command->get_name(), command->get_description(), options_of(*command)});
  return commands;
}

std::string joined(const std::vector<std::string>& words) {
  std::string line;
  for (const std::string& word : words) line += (line.empty() ? "" : " ") + word;
  return line;
}

/// In single quotes, as all three shells read them.
std::string in_quotes(const std::string& text) {
  std::string out = "'";
  for (const char c : text) {
    if (c == '\'') {
      out += "'\\''";
    } else {
      out += c;
    }
  }
  return out + "'";
}

std::string bash(const std::vector<Command>& commands) {
  std::string names;
  std::string cases;
  for (const Command& command : commands) {
    names += (names.empty() ? "" : " ") + command.name;
    cases += fmt::format("    {}) options={} ;;\n", command.name, in_quotes(joined(command.options)));
  }
  return fmt::format(R"(# Completion of imuscope for bash; `imuscope completion bash` prints it.
_imuscope() {{
  local word=${{COMP_WORDS[COMP_CWORD]}} options=''
  if [ "$COMP_CWORD" -eq 1 ]; then
    COMPREPLY=($(compgen -W {} -- "$word"))
    return
  fi
  case ${{COMP_WORDS[1]}} in
{}  esac
  case $word in
    -*) COMPREPLY=($(compgen -W "$options" -- "$word")) ;;
    *=*) COMPREPLY=($(compgen -f -- "${{word#*=}}")) ;;
    *) COMPREPLY=($(compgen -f -- "$word")) ;;
  esac
}}
complete -o filenames -F _imuscope imuscope
)",
                     in_quotes(names), cases);
}

std::string zsh(const std::vector<Command>& commands) {
  std::string names;
  std::string cases;
  for (const Command& command : commands) {
    names += fmt::format("    {}\n", in_quotes(command.name + ":" + command.what));
    cases += fmt::format("    {}) compadd -- {} ;;\n", command.name, joined(command.options));
  }
  return fmt::format(R"(#compdef imuscope
# Completion of imuscope for zsh; `imuscope completion zsh` prints it.
_imuscope() {{
  local -a commands
  commands=(
{}  )
  if (( CURRENT == 2 )); then
    _describe command commands
    return
  fi
  if [[ ${{words[CURRENT]}} != -* ]]; then
    _files
    return
  fi
  case ${{words[2]}} in
{}  esac
}}
_imuscope "$@"
)",
                     names, cases);
}

std::string fish(const std::vector<Command>& commands) {
  std::string lines = "# Completion of imuscope for fish; `imuscope completion fish` prints it.\n";
  for (const Command& command : commands) {
    lines += fmt::format("complete -c imuscope -n __fish_use_subcommand -a {} -d {}\n", command.name,
                         in_quotes(command.what));
    for (const std::string& option : command.options) {
      lines += fmt::format("complete -c imuscope -n '__fish_seen_subcommand_from {}' -l {}\n", command.name,
                           option.substr(2));
    }
  }
  return lines;
}

}  // namespace

void add_completion(CLI::App& app, Work& chosen) {
  auto* command = app.add_subcommand("completion", "Print what lets a shell complete commands and options");
  auto shell = std::make_shared<std::string>();
  command->add_option("SHELL", *shell, "bash, zsh or fish")
      ->required()
      ->check(CLI::IsMember({"bash", "zsh", "fish"}));
  on_chosen(*command, chosen, [shell, &app]() -> Result<void> {
    const auto commands = commands_of(app);
    say("{}", *shell == "bash" ? bash(commands) : *shell == "zsh" ? zsh(commands) : fish(commands));
    return {};
  });
}

}  // namespace imuscope::cli
