/// What a new user does wrong, and what the programs say to it: one sentence with what, where and what to do,
/// and an exit code (2: usage or configuration, 1: work that failed). Never a crash, never silence.

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cstdlib>
#include <fstream>
#include <random>
#include <regex>
#include <sstream>
#include <string>
#include <vector>

#include "tests/support/shared_data.h"

namespace imuscope::test {
namespace {

using testing::HasSubstr;

constexpr int kOk = 0;
constexpr int kFailedWork = 1;
constexpr int kUsage = 2;

struct Outcome {
  int exit_code = -1;
  std::string out;
  std::string err;
};

std::string read_file(const std::filesystem::path& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

void write_file(const std::filesystem::path& path, const std::string& bytes) {
  std::ofstream(path, std::ios::binary) << bytes;
}

std::string replaced(const std::string& text, const std::string& what, const std::string& with) {
  return std::regex_replace(text, std::regex(what), with);
}

/// Runs `command` in `folder`; its first word is one of the built programs, before it may stand another's.
Outcome run_in(const std::filesystem::path& folder, const std::string& command,
               const std::string& prefix = "") {
  const std::string program = command.substr(0, command.find(' '));
  const std::string line = "cd '" + folder.string() + "' && " + prefix + " '" +
                           program_path(program).string() + "'" + command.substr(program.size()) +
                           " >stdout.txt 2>stderr.txt </dev/null";
  const int status = std::system(line.c_str());
  return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, read_file(folder / "stdout.txt"),
          read_file(folder / "stderr.txt")};
}

/// Lines of stderr that are not of the log, which begin with a time.
std::vector<std::string> sentences(const std::string& err) {
  static const std::regex log_line("^[0-9]{2}:[0-9]{2}:[0-9]{2}\\.[0-9]{3} .*");
  std::vector<std::string> found;
  std::istringstream lines(err);
  for (std::string line; std::getline(lines, line);) {
    if (!std::regex_match(line, log_line)) found.push_back(line);
  }
  return found;
}

void expect_refusal(const Outcome& outcome, const std::string& program, int exit_code,
                    const std::string& text) {
  EXPECT_EQ(outcome.exit_code, exit_code) << outcome.err;
  EXPECT_THAT(outcome.err, HasSubstr(text));
  const auto said = sentences(outcome.err);
  ASSERT_EQ(said.size(), 1U) << outcome.err;
  EXPECT_EQ(said.front().rfind(program + ": ", 0), 0U) << said.front();
  EXPECT_THAT(said.front(), testing::Not(HasSubstr("unexpected failure")));
}

constexpr const char* kImuHeader =
    "t_s,gyro_x_radps,gyro_y_radps,gyro_z_radps,accel_x_mps2,accel_y_mps2,accel_z_mps2\n";
constexpr const char* kImuRows = "0.00,0,0,0,0,0,-9.8\n0.01,0,0,0,0,0,-9.8\n0.02,0,0,0,0,0,-9.8\n";

constexpr const char* kCsvConfiguration = R"(
[[device]]
name = "ref"
role = "reference"
protocol = "csv_imu"
[[device]]
name = "imu"
role = "study"
protocol = "csv_imu"
)";

/// A minute of simulated driving and everything that can be wrong with files, once for all cases.
class BadInput : public testing::Test {
 protected:
  static void TearDownTestSuite() { std::filesystem::remove_all(folder_); }

  static void SetUpTestSuite() {
    // One folder a process: CTest runs every case in one of its own, several at a time.
    folder_ = program_path("imuscope").parent_path().parent_path() / "bad_input" / std::to_string(getpid());
    std::filesystem::remove_all(folder_);
    std::filesystem::create_directories(folder_ / "folder");
    const std::string demo = replaced(read_file(source_path("config/demo.toml")), "/tmp/imuscope-demo",
                                      (folder_ / "ports").string());
    write_file(folder_ / "demo.toml", demo);
    const auto recorded = run_in(folder_, "imusim record demo.toml --minutes 1 --seed 1 --out rec");
    ASSERT_EQ(recorded.exit_code, 0) << recorded.err;

    write_file(folder_ / "empty", "");
    std::mt19937 random(1);
    std::string bytes(100'000, '\0');
    for (char& byte : bytes) byte = static_cast<char>(random() & 0xFFU);
    write_file(folder_ / "random.bin", bytes);
    // Cut inside a message, with the arrivals of the whole: what a full disk leaves.
    write_file(folder_ / "cut.bin", read_file(folder_ / "rec/mtx1.bin").substr(0, 100'007));
    std::filesystem::copy(folder_ / "rec/mtx1.arrivals.csv", folder_ / "cut.arrivals.csv");
    std::filesystem::copy(folder_ / "rec/mtx1.bin", folder_ / "unstamped.bin");

    write_file(folder_ / "unknown_key.toml", replaced(demo, "states =", "staets ="));
    write_file(folder_ / "unknown_role.toml", replaced(demo, "\"study\"", "\"studdy\""));
    write_file(folder_ / "unknown_truth.toml", replaced(demo, "latency_ms", "latencyms"));
    write_file(folder_ / "not.toml", "this is not TOML\n");
    write_file(folder_ / "no_key.toml", "[@]\n");
    write_file(folder_ / "tcpq.toml", demo + "[lcm]\nurl = \"tcpq://127.0.0.1:7700\"\n");

    write_file(folder_ / "csv.toml", kCsvConfiguration);
    write_file(folder_ / "good.csv", std::string(kImuHeader) + kImuRows);
    write_file(folder_ / "header.csv", kImuHeader);
    write_file(folder_ / "column.csv", replaced(kImuHeader, "gyro_y_radps", "gyro_y_rad") + kImuRows);
    write_file(folder_ / "text.csv",
               std::string(kImuHeader) + replaced(kImuRows, "0.01,0,0,0", "0.01,0,oops,0"));
  }

  static std::filesystem::path folder_;
};

std::filesystem::path BadInput::folder_;  // NOLINT(cppcoreguidelines-avoid-non-const-global-variables)

struct Case {
  std::string arguments;  ///< program first
  int exit_code;
  std::string text;  ///< that must be said
};

TEST_F(BadInput, RecordingsThatCannotBeUsedAreNamedWithARemedy) {
  const std::vector<Case> cases = {
      {"airins=none.bin mtx1=rec/mtx1.bin --config demo.toml", kUsage,
       "none.bin does not exist; check the path"},
      {"airins=folder mtx1=rec/mtx1.bin --config demo.toml", kUsage, "folder is a folder, not a raw dump"},
      {"airins=empty mtx1=rec/mtx1.bin --config demo.toml", kFailedWork, "empty is empty"},
      {"airins=rec/mtx1.bin mtx1=rec/mtx2.bin --config demo.toml", kFailedWork,
       "airins: rec/mtx1.bin: 186128 bytes, and not one ixblue_stdbin sample in them; check that the file is "
       "this device's and the protocol is right; imuscope decode rec/mtx1.bin shows"},
      {"airins=random.bin mtx1=unstamped.bin --config demo.toml", kFailedWork,
       "airins: random.bin: 100000 bytes, and not one ixblue_stdbin sample"},
      {"airins=rec/airins.bin mtx1=unstamped.bin --config demo.toml", kUsage,
       "rec/airins.bin has arrival stamps (airins.arrivals.csv) and unstamped.bin has none; put "
       "unstamped.arrivals.csv beside it"},
      {"airins=unstamped.bin mtx1=rec/mtx1.bin --config demo.toml", kUsage, "has arrival stamps"},
      {"airins=rec/airins.bin mtx9=rec/mtx1.bin --config demo.toml", kUsage,
       "the configuration has no device 'mtx9'; did you mean 'mtx1'?"},
      {"mtx1=rec/mtx1.bin --config demo.toml", kUsage, "add airins=FILE"},
      {"airins=rec/airins.bin --config demo.toml", kUsage, "add mtx1=FILE"},
      {"airins=rec/airins.bin mtx1=rec/mtx1.bin", kUsage, "add --config FILE.toml"},
      {"none.lcm", kUsage, "none.lcm does not exist"},
      {"folder", kUsage, "folder is a folder, not a capture"},
      {"empty", kFailedWork, "empty is empty: nothing was recorded"},
      {"random.bin", kUsage, "random.bin is not a capture (an LCM event log)"},
  };
  for (const std::string command : {"process", "replay"}) {
    for (const Case& one : cases) {
      SCOPED_TRACE(command + " " + one.arguments);
      expect_refusal(run_in(folder_, "imuscope " + command + " " + one.arguments + " --out result"),
                     "imuscope", one.exit_code, one.text);
    }
  }
}

TEST_F(BadInput, CsvMistakesAreNamedWithLineAndColumn) {
  const std::vector<Case> cases = {
      {"column.csv", kUsage,
       "column.csv, line 1: the header has no column 'gyro_y_radps'; did you mean 'gyro_y_rad'?"},
      {"text.csv", kFailedWork, "text.csv, line 3: 'oops' in column 'gyro_y_radps' is not a number; correct"},
      {"header.csv", kFailedWork, "header.csv: has a header but no row; check how it was written"},
      {"empty", kFailedWork, "empty is empty"},
      {"none.csv", kUsage, "none.csv does not exist"},
  };
  for (const Case& one : cases) {
    SCOPED_TRACE(one.arguments);
    expect_refusal(
        run_in(folder_, "imuscope process ref=good.csv imu=" + one.arguments + " -c csv.toml --out result"),
        "imuscope", one.exit_code, one.text);
  }
}

TEST_F(BadInput, ConfigurationsAndArgumentsAreUsageWithARemedy) {
  const std::vector<Case> cases = {
      {"imuscope run none.toml", kUsage, "configuration none.toml does not exist; give the path"},
      {"imuscope run empty", kUsage, "configuration empty is empty; config/ holds examples"},
      {"imuscope run folder", kUsage, "configuration folder is a folder; give the path of a TOML file"},
      {"imuscope run not.toml", kUsage, "not.toml:1: not TOML"},
      {"imuscope run no_key.toml", kUsage, "no_key.toml:1: not TOML"},
      {"imuscope run unknown_key.toml", kUsage,
       "unknown_key.toml:9: unknown key 'estimator.staets'; did you mean 'states'?"},
      {"imuscope run unknown_role.toml", kUsage, "valid: reference, study, gnss"},
      {"imuscope run csv.toml", kUsage, "has no transport, so it cannot be run live; give it transport ="},
      {"imuscope run tcpq.toml --seconds 1 --out tcpq_run", kUsage, "write it as udpm://"},
      {"imuscope run demo.toml --seconds abc", kUsage, "--seconds: Value abc not in range"},
      {"imuscope run", kUsage, "config is required; see imuscope run --help"},
      {"imuscope process rec/mtx1.bin", kUsage, "--out is required; see imuscope process --help"},
      {"imuscope process rec/mtx1.bin --out x --nonsense", kUsage, "--nonsense"},
      {"imuscope nonsense", kUsage, "there is no command 'nonsense'; see imuscope --help"},
      {"imuscope proces a.lcm", kUsage, "there is no command 'proces'; the nearest is 'process'; see"},
      {"imuscope help proces", kUsage,
       "there is no command 'proces'; the nearest is 'process'; imuscope help"},
      {"imuscope completion csh", kUsage, "SHELL: csh not in {bash,zsh,fish}"},
      {"imuscope", kUsage, "see imuscope --help"},
      {"imusim", kUsage, "see imusim --help"},
      {"imusim nonsense", kUsage, "there is no command 'nonsense'; see imusim --help"},
      {"imusim record demo.toml", kUsage, "--out is required; see imusim record --help"},
      {"imusim record demo.toml --minutes x --out sim", kUsage, "--minutes"},
      {"imusim record demo.toml --minutes 0.1 --out empty", kFailedWork, "cannot make the folder empty"},
      {"imusim live demo.toml --start-s 10000", kUsage, "lies behind its end"},
  };
  for (const Case& one : cases) {
    SCOPED_TRACE(one.arguments);
    expect_refusal(run_in(folder_, one.arguments), one.arguments.substr(0, one.arguments.find(' ')),
                   one.exit_code, one.text);
  }
  const std::vector<Case> simulations = {
      {"none.toml", kUsage, "configuration none.toml does not exist; config/ holds examples"},
      {"empty", kUsage, "configuration empty is empty; config/ holds examples"},
      {"folder", kUsage, "configuration folder is a folder; give the path"},
      {"not.toml", kUsage, "not.toml:1: not TOML"},
      {"no_key.toml", kUsage, "no_key.toml:1: not TOML"},
      {"unknown_truth.toml", kUsage, "has no key 'latencyms'; the nearest is 'latency_ms'"},
  };
  for (const std::string command : {"imusim record ", "imusim live "}) {
    for (const Case& one : simulations) {
      SCOPED_TRACE(command + one.arguments);
      expect_refusal(run_in(folder_, command + one.arguments + " --out sim"), "imusim", one.exit_code,
                     one.text);
    }
  }
}

TEST_F(BadInput, ARunFolderWhoseDocumentsAreOfAnotherShapeIsNamed) {
  std::filesystem::create_directories(folder_ / "odd");
  for (const char* name :
       {"run.json", "calibration.json", "models.json", "regression.json", "comparison.json"})
    write_file(folder_ / "odd" / name,
               R"({"schema":7,"inputs":3,"imus":5,"regressions":[{"method":"ols"}]})");
  const std::string text =
      "a JSON file of odd, or the truth.json given with it, is not as this version writes it: ";
  for (const std::string command : {"tables odd", "combine odd odd", "evaluate odd"}) {
    SCOPED_TRACE(command);
    expect_refusal(run_in(folder_, "imuscope " + command), "imuscope", kFailedWork, text);
  }
}

TEST_F(BadInput, ATruncatedStreamIsUsedAndCounted) {
  const auto outcome = run_in(folder_,
                              "imuscope replay airins=rec/airins.bin mtx1=cut.bin gnss=rec/gnss.bin "
                              "--config demo.toml --out cut");
  EXPECT_EQ(outcome.exit_code, kOk) << outcome.err;
  EXPECT_TRUE(sentences(outcome.err).empty()) << outcome.err;
  EXPECT_THAT(outcome.out, testing::ContainsRegex(
                               "mtx1 +[0-9]+ samples in 100007 bytes, [0-9]+ of them in no valid message"));
  EXPECT_THAT(outcome.out, testing::ContainsRegex("gnss +600 samples in 97200 bytes\n"));
}

/// A serial line with nobody at its other end, under `name`.
class SilentLine {
 public:
  explicit SilentLine(const std::filesystem::path& name)
      : end_(posix_openpt(O_RDWR | O_NOCTTY)), name_(name) {
    if (end_ < 0 || grantpt(end_) != 0 || unlockpt(end_) != 0) return;
    std::array<char, 64> terminal{};
    if (ptsname_r(end_, terminal.data(), terminal.size()) != 0) return;
    std::filesystem::create_directories(name.parent_path());
    std::filesystem::create_symlink(terminal.data(), name);
  }
  ~SilentLine() {
    std::error_code absent_is_well;
    std::filesystem::remove(name_, absent_is_well);
    if (end_ >= 0) close(end_);
  }
  SilentLine(const SilentLine&) = delete;
  SilentLine& operator=(const SilentLine&) = delete;

 private:
  int end_;
  std::filesystem::path name_;
};

TEST_F(BadInput, SilentDevicesAndMissingPortsAreNamedEachWithWhatToCheck) {
  const SilentLine airins(folder_ / "ports/airins");
  const SilentLine mtx1(folder_ / "ports/mtx1");
  const auto outcome = run_in(folder_, "imuscope run demo.toml --seconds 5 --out silent");
  expect_refusal(outcome, "imuscope", kFailedWork, "no device ever sent a sample; check power, cables");
  EXPECT_THAT(outcome.err, testing::ContainsRegex("airins: no data from the unit: check cable"));
  EXPECT_THAT(outcome.err, testing::ContainsRegex("mtx1: no answer at .*; check the device's power"));
  EXPECT_THAT(outcome.err, HasSubstr("mtx2: port " + (folder_ / "ports/mtx2").string() +
                                     " does not exist; plug the device in"));
}

TEST_F(BadInput, WithoutAnLcmRouteTheRunSaysTheTwoCommandsAndGoesOn) {
  const std::string own_network = "unshare -n";
  if (std::system((own_network + " true 2>/dev/null").c_str()) != 0)
    GTEST_SKIP() << "a private network namespace needs root";
  const auto outcome = run_in(folder_, "imuscope run demo.toml --seconds 1 --out no_route", own_network);
  EXPECT_THAT(outcome.err,
              HasSubstr("nothing is published over LCM: LCM: no route to the multicast address"));
  EXPECT_THAT(outcome.err, HasSubstr("ip link set lo up multicast on"));
  EXPECT_THAT(outcome.err, HasSubstr("ip route add 224.0.0.0/4 dev lo"));
  EXPECT_THAT(outcome.err, HasSubstr("running 'demo' into no_route"));
  expect_refusal(outcome, "imuscope", kFailedWork, "no device ever sent a sample");
}

}  // namespace
}  // namespace imuscope::test
