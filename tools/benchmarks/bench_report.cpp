#include "tools/benchmarks/bench_report.h"

#include <fmt/format.h>
#include <malloc.h>
#include <algorithm>
#include <cmath>
#include <ctime>
#include <fstream>
#include <nlohmann/json.hpp>
#include <stdexcept>

namespace bench {

namespace {

constexpr const char* kAtMost = "at most";
constexpr const char* kAtLeast = "at least";
constexpr const char* kOfRatio = "ratio";
constexpr const char* kOfValue = "value";

nlohmann::json number(double value) {
  return std::isfinite(value) ? nlohmann::json(value) : nlohmann::json(nullptr);
}

nlohmann::json number(const std::optional<double>& value) {
  return value ? number(*value) : nlohmann::json(nullptr);
}

nlohmann::json json_of(const Row& row) {
  nlohmann::json json{{"group", row.group},
                      {"what", row.what},
                      {"ratio", number(row.ratio)},
                      {"against", row.against},
                      {"value", number(row.value)},
                      {"unit", row.unit},
                      {"reference", number(row.reference)},
                      {"memory_mb", number(row.memory_mb)}};
  json["goal"] = nullptr;
  if (row.goal) {
    json["goal"] = {{"side", row.goal->side == Goal::Side::kAtMost ? kAtMost : kAtLeast},
                    {"of", row.goal->of == Goal::Of::kRatio ? kOfRatio : kOfValue},
                    {"value", row.goal->value},
                    {"met", meets_goal(row)}};
  }
  return json;
}

std::optional<double> optional_number(const nlohmann::json& json) {
  return json.is_null() ? std::nullopt : std::optional(json.get<double>());
}

/// One of two words; anything else is an error.
bool is_first(const nlohmann::json& json, const char* first, const char* second) {
  const auto word = json.get<std::string>();
  if (word != first && word != second)
    throw std::runtime_error(fmt::format("'{}' is neither '{}' nor '{}'", word, first, second));
  return word == first;
}

Row row_of(const nlohmann::json& json) {
  Row row;
  row.group = json.at("group").get<std::string>();
  row.what = json.at("what").get<std::string>();
  row.ratio = optional_number(json.at("ratio")).value_or(std::nan(""));
  row.against = json.at("against").get<std::string>();
  row.value = optional_number(json.at("value")).value_or(std::nan(""));
  row.unit = json.at("unit").get<std::string>();
  row.reference = optional_number(json.at("reference"));
  row.memory_mb = optional_number(json.at("memory_mb"));
  const auto& goal = json.at("goal");
  if (goal.is_null()) return row;
  row.goal = Goal{is_first(goal.at("side"), kAtMost, kAtLeast) ? Goal::Side::kAtMost : Goal::Side::kAtLeast,
                  goal.at("value").get<double>(),
                  is_first(goal.at("of"), kOfRatio, kOfValue) ? Goal::Of::kRatio : Goal::Of::kValue};
  return row;
}

std::string text(double value) { return std::isfinite(value) ? fmt::format("{:.3g}", value) : "-"; }

std::string text(const std::optional<double>& value) { return value ? text(*value) : "-"; }

std::string goal_text(const Row& row) {
  if (!row.goal) return "-";
  return fmt::format("{} {:g}{}{}", row.goal->side == Goal::Side::kAtMost ? "<=" : ">=", row.goal->value,
                     row.goal->of == Goal::Of::kValue ? " " + row.unit : "",
                     meets_goal(row) ? "" : ", MISSED");
}

/// Value of `key` in /proc/self/status, MB; NaN where it is not told.
double status_mb(const std::string& key) {
  std::ifstream status("/proc/self/status");
  constexpr double kMbPerKib = 1024.0 * 1e-6;
  for (std::string line; std::getline(status, line);) {
    if (line.rfind(key + ":", 0) == 0) return std::strtod(line.c_str() + key.size() + 1, nullptr) * kMbPerKib;
  }
  return std::nan("");
}

}  // namespace

bool write_rows(const std::filesystem::path& file, const std::vector<Row>& rows) {
  nlohmann::json json{{"schema", kSchema}, {"rows", nlohmann::json::array()}};
  for (const Row& row : rows) json["rows"].push_back(json_of(row));
  std::ofstream out(file);
  out << json.dump(2) << '\n';
  out.flush();
  return out.good();
}

std::vector<Row> read_rows(const std::filesystem::path& file) {
  try {
    const auto json = nlohmann::json::parse(std::ifstream(file));
    if (json.at("schema") != kSchema)
      throw std::runtime_error(fmt::format("the schema is {}, not {}", json.at("schema").dump(), kSchema));
    std::vector<Row> rows;
    for (const auto& row : json.at("rows")) rows.push_back(row_of(row));
    if (rows.empty()) throw std::runtime_error("no row");
    return rows;
  } catch (const std::exception& error) {
    throw std::runtime_error(fmt::format("{}: {}", file.string(), error.what()));
  }
}

int finish(const std::vector<Row>& rows, const std::string& json) {
  print_rows(rows);
  if (json.empty() || write_rows(json, rows)) return 0;
  fmt::print(stderr, "{} cannot be written\n", json);
  return 1;
}

void print_rows(const std::vector<Row>& rows) {
  fmt::print("| group | what | ratio | of what | goal | measured | reference | unit | peak MB |\n");
  fmt::print("|---|---|---|---|---|---|---|---|---|\n");
  for (const Row& row : rows) {
    fmt::print("| {} | {} | {} | {} | {} | {} | {} | {} | {} |\n", row.group, row.what, text(row.ratio),
               row.against, goal_text(row), text(row.value), text(row.reference), row.unit,
               text(row.memory_mb));
  }
}

bool meets_goal(const Row& row) {
  if (!row.goal) return true;
  const double number = row.goal->of == Goal::Of::kRatio ? row.ratio : row.value;
  return row.goal->side == Goal::Side::kAtMost ? number <= row.goal->value : number >= row.goal->value;
}

double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

double growth_exponent(const std::vector<double>& sizes, const std::vector<double>& costs) {
  const auto n = static_cast<double>(sizes.size());
  double sx = 0.0;
  double sy = 0.0;
  double sxx = 0.0;
  double sxy = 0.0;
  for (std::size_t i = 0; i < sizes.size(); ++i) {
    const double x = std::log(sizes[i]);
    const double y = std::log(costs[i]);
    sx += x;
    sy += y;
    sxx += x * x;
    sxy += x * y;
  }
  return (n * sxy - sx * sy) / (n * sxx - sx * sx);
}

Row growth_row(std::string what, const std::vector<double>& sizes, const std::vector<double>& costs,
               double goal) {
  Row row;
  row.group = "growth";
  row.what = std::move(what);
  row.ratio = growth_exponent(sizes, costs);
  row.against = "exponent of the cost";
  row.goal = Goal{Goal::Side::kAtMost, goal};
  row.value = std::exp2(row.ratio);
  row.unit = "x a doubling";
  return row;
}

double peak_memory_mb(const std::function<void()>& job) {
  // What earlier jobs freed would otherwise be used again and not be seen.
  malloc_trim(0);
  {
    constexpr const char* kResetPeak = "5";  // proc(5): clear_refs
    std::ofstream("/proc/self/clear_refs") << kResetPeak;
  }
  const double before = status_mb("VmRSS");
  job();
  const double peak = status_mb("VmHWM") - before;
  return std::isfinite(peak) ? std::max(peak, 0.0) : 0.0;
}

double processor_time_s() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

}  // namespace bench
