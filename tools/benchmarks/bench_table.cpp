/// Makes one table and one JSON of what the benchmark programs wrote with --json; tools/bench runs them.

#include <fmt/format.h>
#include <CLI/CLI.hpp>
#include <exception>
#include <set>

#include "tools/benchmarks/bench_report.h"

int main(int argc, char** argv) {
  CLI::App app{"One table of several benchmark programs' rows"};
  std::vector<std::string> parts;
  std::string json;
  app.add_option("part", parts, "what a benchmark program wrote with --json")->required()->type_name("FILE");
  app.add_option("--json", json, "write all rows here")->type_name("FILE");
  CLI11_PARSE(app, argc, argv);
  try {
    std::vector<bench::Row> all;
    std::set<std::string> names;
    for (const std::string& part : parts) {
      for (bench::Row& row : bench::read_rows(part)) {
        if (!names.insert(row.group + '\n' + row.what).second)
          throw std::runtime_error(fmt::format("{}: '{}' of '{}' is there twice", part, row.what, row.group));
        all.push_back(std::move(row));
      }
    }
    const int status = bench::finish(all, json);
    const auto missed =
        std::count_if(all.begin(), all.end(), [](const auto& row) { return !meets_goal(row); });
    const auto goals =
        std::count_if(all.begin(), all.end(), [](const auto& row) { return row.goal.has_value(); });
    fmt::print("\n{} rows; {} of {} goals met\n", all.size(), goals - missed, goals);
    return status;
  } catch (const std::exception& error) {
    fmt::print(stderr, "bench_table: {}\n", error.what());
    return 1;
  }
}
