/// The benchmark programs and the table made of them: that every promised row is there and well-formed. What
/// the rows say of this machine's speed is nobody's business here.

#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <set>

#include "programs.h"
#include "tests/support/shared_data.h"

namespace imuscope::test {
namespace {

using nlohmann::json;

bool is_number_or_null(const json& value) { return value.is_number() || value.is_null(); }

void expect_row(const json& row) {
  SCOPED_TRACE(row.dump());
  const std::set<std::string> keys{"group", "what", "ratio",     "against",  "goal",
                                   "value", "unit", "reference", "memory_mb"};
  std::set<std::string> found;
  for (const auto& [key, value] : row.items()) found.insert(key);
  ASSERT_EQ(found, keys);
  for (const char* key : {"group", "what", "against", "unit"})
    EXPECT_FALSE(row[key].get<std::string>().empty());
  for (const char* key : {"ratio", "reference", "memory_mb"}) EXPECT_TRUE(is_number_or_null(row[key])) << key;
  ASSERT_TRUE(row["value"].is_number());
  if (row["goal"].is_null()) return;
  const auto& goal = row["goal"];
  const auto& held = goal.at("of") == "value" ? row["value"] : row["ratio"];
  ASSERT_TRUE(held.is_number());
  const double number = held.get<double>();
  const double limit = goal.at("value").get<double>();
  EXPECT_EQ(goal.at("met").get<bool>(), goal.at("side") == "at most" ? number <= limit : number >= limit);
}

bool has_row(const json& table, const std::string& group, const std::string& beginning) {
  return std::any_of(table["rows"].begin(), table["rows"].end(), [&](const json& row) {
    return row["group"] == group && row["what"].get<std::string>().starts_with(beginning);
  });
}

TEST(Bench, EveryPromisedRowIsInTheOneTable) {
  const auto folder = scratch_folder();
  struct Program {
    const char* name;
    std::vector<std::string> arguments;
  };
  const std::vector<Program> programs{
      {"decode_speed", {"--repetitions", "1"}},
      {"ring_speed", {"--rounds", "1", "--elements", "1000"}},
      {"imuscope_epoch_cost", {"--repeats", "1", "--seconds", "2"}},
      {"noise_speed", {"--runs", "1", "--quick"}},
      {"replay_speed", {"--minutes", "0.5", "--rounds", "1", "--scratch", (folder / "drives").string()}},
      {"mcap_speed", {"--minutes", "0.1", "--rounds", "1", "--scratch", folder.string()}}};
  std::vector<std::string> compose;
  for (const Program& program : programs) {
    const auto part = folder / (std::string(program.name) + ".json");
    std::vector<std::string> arguments = program.arguments;
    arguments.insert(arguments.end(), {"--json", part.string()});
    const auto log = folder / "log";
    ASSERT_EQ(run_program(program.name, arguments, log), 0) << program.name << ": " << read_text(log);
    compose.push_back(part.string());
  }
  const auto file = folder / "bench.json";
  compose.insert(compose.end(), {"--json", file.string()});
  const auto text = folder / "table.md";
  ASSERT_EQ(run_program("bench_table", compose, text), 0) << read_text(text);

  const json table = read_json(file);
  EXPECT_EQ(table.at("schema"), "imuscope.bench/1");
  for (const json& row : table.at("rows")) expect_row(row);
  for (const char* protocol :
       {"xsens_mt (MTData)", "xsens_mt (MTData2)", "ixblue_stdbin", "greis", "nmea", "ubx", "rtklib_pos"})
    EXPECT_TRUE(has_row(table, "decoding", protocol)) << protocol;
  EXPECT_TRUE(has_row(table, "ring", "round trip"));
  for (const char* states : {"15 ", "33 ", "51 ", "72 ", "129 "})
    EXPECT_TRUE(has_row(table, "epoch", states)) << states;
  for (const char* size : {"1e5", "1e6"}) {
    for (const char* job :
         {"wavelet variance of ", "robust wavelet variance of ", "fit alone, WN+2*GM, ci weights, of ",
          "intervals alone, of ", "fit with intervals, WN+2*GM, optimal, of "})
      EXPECT_TRUE(has_row(table, "noise", std::string(job) + size)) << job << size;
  }
  EXPECT_TRUE(has_row(table, "noise", "streaming, a sample at 16 levels"));
  for (const char* what : {"raw bytes, no refits", "raw bytes, refits every minute", "capture",
                           "whole study with", "whole study, two threads", "report.html"})
    EXPECT_TRUE(has_row(table, "replay", what)) << what;
  for (const char* what : {"out, ", "in, "}) EXPECT_TRUE(has_row(table, "mcap", what)) << what;
  for (const char* what : {"replay, with S-IMUs", "replay, with the drive's length", "streaming, with levels",
                           "epoch, with states"})
    EXPECT_TRUE(has_row(table, "growth", what)) << what;
  // One line a row, below the two of the heading.
  const std::string printed = read_text(text);
  EXPECT_EQ(static_cast<std::size_t>(std::count(printed.begin(), printed.end(), '\n')),
            table["rows"].size() + 4);
}

TEST(Bench, PartThatIsNoneIsToldByName) {
  const auto folder = scratch_folder();
  const auto log = folder / "log";
  const auto part = folder / "part.json";
  const auto table_of_part = [&](const char* content) {
    std::ofstream(part) << content;
    EXPECT_EQ(run_program("bench_table", {part.string()}, log), 1);
    EXPECT_NE(read_text(log).find("part.json"), std::string::npos) << read_text(log);
    return read_text(log);
  };
  EXPECT_NE(table_of_part("{\"schema\": \"other/1\", \"rows\": []}").find("other/1"), std::string::npos);
  EXPECT_NE(table_of_part("{\"schema\": \"imuscope.bench/1\", \"rows\": []}").find("no row"),
            std::string::npos);
  EXPECT_NE(
      table_of_part("{\"schema\": \"imuscope.bench/1\", \"rows\": [{\"group\": \"ring\"}]}").find("what"),
      std::string::npos);
  table_of_part("no json");
  std::filesystem::remove(part);
  EXPECT_EQ(run_program("bench_table", {part.string()}, log), 1);
}

}  // namespace
}  // namespace imuscope::test
