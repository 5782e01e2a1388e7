#include "axis_columns.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <fstream>

#include "base/line_reader.h"
#include "base/text.h"
#include "signal_file.h"
#include "time_column.h"

namespace imuscope::cli {
namespace {

using Tokens = std::vector<std::string>;

/// Words of a name in lower case: what is no letter or digit parts them, and a capital after a small letter.
Tokens tokens_of(std::string_view name) {
  Tokens tokens;
  std::string word;
  const auto end_word = [&] {
    if (!word.empty()) tokens.push_back(std::move(word));
    word.clear();
  };
  char before = ' ';
  for (const char c : name) {
    const auto u = static_cast<unsigned char>(c);
    if (std::isalnum(u) == 0) {
      end_word();
    } else {
      if (std::isupper(u) != 0 && std::islower(static_cast<unsigned char>(before)) != 0) end_word();
      word += static_cast<char>(std::tolower(u));
    }
    before = c;
  }
  end_word();
  return tokens;
}

constexpr std::array<std::string_view, 8> kGyroWords{"gyro",  "gyr",  "gyroscope", "angular",
                                                     "omega", "rate", "angrate",   "gyros"};
constexpr std::array<std::string_view, 8> kAccelWords{
    "accel", "acc", "accelerometer", "acceleration", "accelerometers", "linear", "specific", "force"};

template <std::size_t N>
bool is_one_of(std::string_view word, const std::array<std::string_view, N>& words) {
  return std::find(words.begin(), words.end(), word) != words.end();
}

bool is_axis_letter(std::string_view word) { return word == "x" || word == "y" || word == "z"; }

/// "x" of "gyrox", "wx", "ax", where what is before it names a triad; the triad goes to `gyro`.
char fused_axis(std::string_view word, std::optional<bool>& gyro) {
  if (word.size() < 2 || !is_axis_letter(word.substr(word.size() - 1))) return 0;
  const std::string_view stem = word.substr(0, word.size() - 1);
  if (is_one_of(stem, kGyroWords) || stem == "w" || stem == "g")
    gyro = true;
  else if (is_one_of(stem, kAccelWords) || stem == "a" || stem == "f")
    gyro = false;
  else
    return 0;
  return word.back();
}

struct Unit {
  noise::SignalUnit unit = noise::SignalUnit::kNone;
  double factor = 1.0;
};

/// The unit at the end of a name, by the words after the axis.
Unit unit_of(const Tokens& tokens, std::size_t behind, bool gyro) {
  std::string rest;
  for (std::size_t i = behind; i < tokens.size(); ++i) rest += tokens[i];
  using noise::SignalUnit;
  if (gyro) {
    if (rest == "radps" || rest == "rads" || rest == "radpersec") return {SignalUnit::kRadps, 1.0};
    if (rest == "degps" || rest == "degs" || rest == "dps" || rest == "degpersec")
      return {SignalUnit::kDegps, 1.0};
    return {};
  }
  if (rest == "mps2" || rest == "ms2" || rest == "mss" || rest == "mpss") return {SignalUnit::kMps2, 1.0};
  if (rest == "g" || rest == "gs") return {SignalUnit::kG, 1.0};
  constexpr double kThousandth = 1e-3;
  if (rest == "mg") return {SignalUnit::kG, kThousandth};
  return {};
}

}  // namespace

std::optional<AxisColumn> axis_of_name(std::string_view name) {
  const Tokens tokens = tokens_of(name);
  std::optional<bool> gyro;
  char axis = 0;
  std::size_t behind = 0;
  for (std::size_t i = 0; i < tokens.size(); ++i) {
    if (axis == 0 && is_one_of(tokens[i], kGyroWords)) gyro = true;
    if (axis == 0 && is_one_of(tokens[i], kAccelWords)) gyro = false;
    if (axis == 0 && gyro && is_axis_letter(tokens[i])) {
      axis = tokens[i].front();
      behind = i + 1;
    }
    if (axis == 0 && !gyro) {
      if (const char fused = fused_axis(tokens[i], gyro)) {
        axis = fused;
        behind = i + 1;
      }
    }
  }
  if (!gyro || axis == 0) return std::nullopt;
  const Unit unit = unit_of(tokens, behind, *gyro);
  return AxisColumn{fmt::format("{}_{}", *gyro ? "gyro" : "accel", axis), std::string(name), unit.unit,
                    unit.factor};
}

bool is_temperature_name(std::string_view name) {
  const Tokens tokens = tokens_of(name);
  return !tokens.empty() && (tokens.front() == "temp" || tokens.front() == "temperature" ||
                             tokens.back() == "temp" || tokens.back() == "temperature");
}

Result<std::vector<std::string>> header_of(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  if (!std::filesystem::exists(file)) return work_error(fmt::format("{} does not exist", file.string()));
  if (!in) return work_error(fmt::format("{} cannot be opened", file.string()));
  constexpr std::size_t kLongest = std::size_t{1} << 16U;
  std::string line;
  while (read_line(in, line, kLongest)) {
    const auto names = cells_of(line);
    if (names.empty()) continue;
    const bool has_names =
        std::any_of(names.begin(), names.end(), [](const auto& cell) { return !parse_stamp(cell); });
    return has_names ? names : std::vector<std::string>{};
  }
  return work_error(fmt::format("{} is empty", file.string()));
}

}  // namespace imuscope::cli
