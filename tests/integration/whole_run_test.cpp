/// Two whole runs through bytes and the command line, held as they once were: whatever a run writes, every file of it and
/// what it says. What is right about these numbers, other tests prove; this one notices that something moved.

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <map>
#include <regex>
#include <sstream>
#include <string>
#include <vector>

#include "programs.h"
#include "tests/support/recorded_answer.h"
#include "tests/support/shared_data.h"

namespace imuscope::test {
namespace {

/// What the solvers' last steps leave open between two builds of the same source.
constexpr double kShareOfSum = 1e-4;
constexpr std::size_t kWordsMost =
    12;  ///< of different ones that stand in a place; of more, how many there are

/// Of a list of numbers, which is too long to stand in a file: how many, and sums that every one of them moves.
class Sums {
 public:
  void add(double value) {
    ++n_;
    sum_of_sizes_ += std::abs(value);
    sum_ += value;
    // So that an order that is turned round is seen.
    in_order_ += value * (1.0 + 0.5 * std::sin(static_cast<double>(n_)));
    last_ = value;
  }

  /// Means, of which those that may cancel are told to a ten-thousandth of the numbers' size.
  [[nodiscard]] std::string text() const {
    const double n = static_cast<double>(n_);
    const double size = sum_of_sizes_ / n;
    if (!(size > 0.0)) return fmt::format("n {} all 0", n_);
    return fmt::format("n {} size {:.6g} mean {:.4f} in order {:.4f} last {:.4f}", n_, size, sum_ / n / size,
                       in_order_ / n / size, last_ / size);
  }

 private:
  std::size_t n_ = 0;
  double sum_of_sizes_ = 0.0;
  double sum_ = 0.0;
  double in_order_ = 0.0;
  double last_ = 0.0;
};

/// The leaves of a JSON, those of a list's members together.
struct Leaves {
  std::map<std::string, Sums> numbers;
  std::map<std::string, std::map<std::string, int>> words;
};

void gather(const nlohmann::json& value, const std::string& path, Leaves& leaves) {
  if (value.is_object()) {
    for (const auto& [key, member] : value.items()) gather(member, path + "." + key, leaves);
  } else if (value.is_array()) {
    for (const auto& member : value) gather(member, path + "[]", leaves);
  } else if (value.is_number()) {
    leaves.numbers[path].add(value.get<double>());
  } else {
    ++leaves.words[path][value.is_string() ? value.get<std::string>() : value.dump()];
  }
}

std::string digest_of_json(const std::filesystem::path& file) {
  Leaves leaves;
  gather(read_json(file), "", leaves);
  std::string text;
  for (const auto& [path, sums] : leaves.numbers) text += fmt::format("{} {}\n", path, sums.text());
  for (const auto& [path, words] : leaves.words) {
    if (path == ".build" || path == ".version" || path.starts_with(".configuration") ||
        path.starts_with(".inputs"))
      continue;
    if (words.size() > kWordsMost) {
      std::size_t letters = 0;
      for (const auto& [word, times] : words) letters += word.size();
      text += fmt::format("{} {} words of {} letters\n", path, words.size(), letters);
      continue;
    }
    for (const auto& [word, times] : words) text += fmt::format("{} {}x {}\n", path, times, word);
  }
  return text;
}

std::string digest_of_csv(const std::filesystem::path& file) {
  std::ifstream in(file);
  std::string line;
  std::getline(in, line);
  std::vector<std::pair<std::string, Sums>> columns;
  std::istringstream header(line);
  for (std::string name; std::getline(header, name, ',');) columns.emplace_back(name, Sums{});
  std::vector<int> empty(columns.size(), 0);
  while (std::getline(in, line)) {
    std::istringstream fields(line);
    std::string field;
    for (std::size_t c = 0; c < columns.size() && std::getline(fields, field, ','); ++c) {
      if (field.empty())
        ++empty[c];
      else
        columns[c].second.add(std::strtod(field.c_str(), nullptr));
    }
  }
  std::string text;
  for (std::size_t c = 0; c < columns.size(); ++c)
    text += fmt::format("{} {} empty {}\n", columns[c].first, columns[c].second.text(), empty[c]);
  return text;
}

/// Every table and document that a run wrote, in the order of their names.
std::string digest_of(const std::filesystem::path& run) {
  std::vector<std::filesystem::path> files;
  for (const auto& entry : std::filesystem::directory_iterator(run)) files.push_back(entry.path());
  std::sort(files.begin(), files.end());
  std::string text;
  for (const auto& file : files) {
    text += fmt::format("== {}\n", file.filename().string());
    if (file.extension() == ".json") text += digest_of_json(file);
    if (file.extension() == ".csv") text += digest_of_csv(file);
  }
  return text;
}

/// What a program said, without the places of this machine.
std::string said(const std::filesystem::path& log, const std::filesystem::path& folder) {
  return std::regex_replace(read_text(log), std::regex(folder.string()), "FOLDER");
}

TEST(WholeRun, AReplayOfTheGoldenCaptureWritesWhatItWrote) {
  const auto folder = scratch_folder();
  const auto capture = folder / "capture.lcm";
  const std::string unpack =
      "gzip -dc " + source_path("tests/golden/capture.lcm.gz").string() + " > " + capture.string();
  ASSERT_EQ(std::system(unpack.c_str()), 0);
  ASSERT_EQ(run_program("imuscope", {"replay", capture.string(), "--out", (folder / "run").string()},
                        folder / "replay.log"),
            0);
  expect_recorded("integration/golden_replay.txt",
                  said(folder / "replay.log", folder) + digest_of(folder / "run"), kShareOfSum, 1e-4);
}

TEST(WholeRun, AStudyOfADriveWithWheelsOnTheCanBusWritesWhatItWrote) {
  const auto folder = scratch_folder();
  ASSERT_EQ(run_program("imusim",
                        {"record", source_path("config/can_vehicle.toml").string(), "--minutes", "2",
                         "--seed", "11", "--out", (folder / "recording").string()},
                        folder / "record.log"),
            0);
  ASSERT_EQ(run_program(
                "imuscope",
                {"process", (folder / "recording/capture.lcm").string(), "--out", (folder / "run").string()},
                folder / "process.log"),
            0);
  expect_recorded("integration/can_study.txt",
                  said(folder / "process.log", folder) + digest_of(folder / "run"), kShareOfSum, 1e-4);
}

}  // namespace
}  // namespace imuscope::test
