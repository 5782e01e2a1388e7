/// The manual page names every command, and the log speaks the journal's language where the journal listens.

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <fstream>
#include <regex>
#include <set>
#include <sstream>

#include "programs.h"
#include "tests/support/shared_data.h"

namespace imuscope::test {
namespace {

using testing::HasSubstr;
using testing::Not;

/// The commands that `imuscope --help` lists: two spaces, a word, at least two spaces.
std::set<std::string> commands_of_the_program(const std::string& program = "imuscope") {
  const auto log = scratch_folder() / "help.txt";
  EXPECT_EQ(run_program(program, {"--help"}, log), 0);
  const std::string text = read_text(log);
  std::istringstream lines(text.substr(text.find("Subcommands:")));
  std::set<std::string> commands;
  std::smatch match;
  for (std::string line; std::getline(lines, line);) {
    if (std::regex_search(line, match, std::regex("^  ([a-z]+)  "))) commands.insert(match[1]);
  }
  return commands;
}

std::set<std::string> commands_of_the_manual() {
  std::istringstream lines(read_text(source_path("config/imuscope.1")));
  std::set<std::string> commands;
  std::smatch match;
  for (std::string line; std::getline(lines, line);) {
    if (std::regex_search(line, match, std::regex("^\\.It Cm ([a-z]+)"))) commands.insert(match[1]);
  }
  return commands;
}

TEST(ManualPage, NamesEveryCommandAndNoOther) {
  const auto commands = commands_of_the_program();
  EXPECT_GT(commands.size(), 10U);
  EXPECT_EQ(commands_of_the_manual(), commands);
}

TEST(LiveProgram, HasWhatAVehicleNeedsAndNamesThePackageOfAllElse) {
  const auto live = commands_of_the_program("imuscope_live");
  for (const char* needed :
       {"run", "top", "doctor", "replay", "status", "capture", "keep", "probe", "config"})
    EXPECT_TRUE(live.contains(needed)) << needed;
  const auto log = scratch_folder() / "said.txt";
  std::set<std::string> all = live;
  for (const std::string& command : commands_of_the_program()) {
    if (live.contains(command)) continue;
    all.insert(command);
    EXPECT_EQ(run_program("imuscope_live", {command}, log), 2) << command;
    EXPECT_THAT(read_text(log), HasSubstr("is a command of the package imuscope")) << command;
  }
  EXPECT_EQ(all, commands_of_the_program()) << "it has no command that the other has not";
  EXPECT_LT(live.size(), all.size());
}

TEST(Help, OfACommandIsWhatTheCommandItselfPrints) {
  const auto folder = scratch_folder();
  ASSERT_EQ(run_program("imuscope", {"help", "process"}, folder / "help.txt"), 0);
  ASSERT_EQ(run_program("imuscope", {"process", "--help"}, folder / "option.txt"), 0);
  EXPECT_EQ(read_text(folder / "help.txt"), read_text(folder / "option.txt"));
  ASSERT_EQ(run_program("imuscope", {"help"}, folder / "all.txt"), 0);
  EXPECT_THAT(read_text(folder / "all.txt"), HasSubstr("Subcommands:"));
}

/// What bash offers for a line, its last word being completed.
std::string completed(const std::filesystem::path& script, const std::string& words, int word) {
  const auto log = script.parent_path() / "completed.txt";
  const std::string command = "bash -c 'source " + script.string() + "; COMP_WORDS=(" + words +
                              "); COMP_CWORD=" + std::to_string(word) +
                              "; _imuscope; echo \"${COMPREPLY[@]}\"' >" + log.string();
  EXPECT_EQ(std::system(command.c_str()), 0);
  return read_text(log);
}

TEST(Completion, OfBashKnowsEveryCommandItsOptionsAndFiles) {
  const auto commands = commands_of_the_program();
  const auto folder = scratch_folder();
  const auto script = folder / "imuscope.bash";
  ASSERT_EQ(run_program("imuscope", {"completion", "bash"}, script), 0);
  for (const std::string& command : commands)
    EXPECT_EQ(completed(script, "imuscope " + command, 1).find(command), 0U) << command;
  EXPECT_EQ(completed(script, "imuscope proc", 1), "process\n");
  EXPECT_EQ(completed(script, "imuscope process --fi", 2), "--fix\n");
  EXPECT_EQ(completed(script, "imuscope process mtx1=" + (folder / "imuscope.b").string(), 2),
            script.string() + "\n");
}

TEST(Completion, OfTheOtherShellsNamesEveryCommand) {
  const auto commands = commands_of_the_program();
  const auto folder = scratch_folder();
  for (const char* shell : {"zsh", "fish"}) {
    ASSERT_EQ(run_program("imuscope", {"completion", shell}, folder / shell), 0);
    const std::string text = read_text(folder / shell);
    for (const std::string& command : commands) EXPECT_THAT(text, HasSubstr(command)) << shell;
    if (std::system(("command -v " + std::string(shell) + " >/dev/null").c_str()) != 0) continue;
    EXPECT_EQ(std::system((std::string(shell) + " -n " + (folder / shell).string()).c_str()), 0) << shell;
  }
}

TEST(ManualPage, IsMarkedUpWithoutAMistake) {
  if (std::system("command -v mandoc >/dev/null") != 0)
    GTEST_SKIP() << "mandoc is missing: apt-get install mandoc";
  const auto log = scratch_folder() / "mandoc.txt";
  const std::string command =
      "mandoc -T lint -W error " + source_path("config/imuscope.1").string() + " >" + log.string();
  EXPECT_EQ(std::system(command.c_str()), 0) << read_text(log);
}

/// A run whose devices are not there: it logs information, warnings and errors, and fails.
std::string log_of_a_run(const std::filesystem::path& log, const std::string& journal_stream) {
  const auto folder = log.parent_path();
  const auto configuration = folder / "absent.toml";
  std::ofstream(configuration) << std::regex_replace(read_text(source_path("config/demo.toml")),
                                                     std::regex("/tmp/imuscope-demo"),
                                                     (folder / "absent").string());
  setenv("JOURNAL_STREAM", journal_stream.c_str(), 1);
  EXPECT_EQ(run_program(
                "imuscope",
                {"run", configuration.string(), "--seconds", "0.3", "--out", (folder / "run").string()}, log),
            1);
  unsetenv("JOURNAL_STREAM");
  return read_text(log);
}

/// Device and inode of a file as systemd writes them.
std::string stream_of(const std::filesystem::path& file) {
  std::ofstream(file) << "";
  struct stat status {};
  EXPECT_EQ(stat(file.c_str(), &status), 0);
  return std::to_string(status.st_dev) + ":" + std::to_string(status.st_ino);
}

TEST(JournalLog, EveryLineCarriesItsPriorityAndNoTime) {
  const auto log = scratch_folder() / "journal.log";
  const std::string text = log_of_a_run(log, stream_of(log));
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);)
    EXPECT_TRUE(std::regex_search(line, std::regex("^<[3467]>[^0-9]"))) << line;
  EXPECT_THAT(text, HasSubstr("<6>running 'demo'"));
  EXPECT_THAT(text, HasSubstr("<3>airins: port "));
  EXPECT_THAT(text, HasSubstr("<3>imuscope: no device ever sent a sample"));
}

TEST(JournalLog, APipeThatOnlyInheritedTheVariableGetsTheLogForPeople) {
  const auto log = scratch_folder() / "people.log";
  const std::string text = log_of_a_run(log, "1:1");
  EXPECT_THAT(text, Not(HasSubstr("<6>")));
  EXPECT_THAT(text, testing::ContainsRegex("[0-9]:[0-9][0-9]\\.[0-9]+ info running 'demo'"));
}

}  // namespace
}  // namespace imuscope::test
