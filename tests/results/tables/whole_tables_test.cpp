// Tables and documents of a run: all columns, and every kind of cell, row and damage.
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <cmath>
#include <fstream>

#include "base/text.h"
#include "results/tables/columns.h"
#include "results/tables/csv_reader.h"
#include "results/tables/json_fields.h"
#include "results/tables/json_file.h"
#include "results/tables/table_reader.h"
#include "tests/support/recorded_answer.h"
#include "tests/support/shared_data.h"

namespace imuscope::tables {
namespace {

TEST(WholeTables, ColumnsAreAsTheyWere) {
  std::string text;
  for (const TableKind& table : run_tables()) {
    text += fmt::format("{} {} {}\n", table.stem, table.is_per_device, table.description);
    for (const Column& column : table.columns)
      text += fmt::format("  {} | {} | {} | {}\n", column.name, column.unit, column.description,
                          static_cast<int>(column.kind));
  }
  for (const char* name :
       {"a_radps3", "a_radps2", "a_radps",   "a_mps3", "a_mps2", "a_mps",        "a_degC", "a_deg_per_h",
        "a_deg",    "a_rad",    "a_percent", "a_ppm",  "a_hz",   "a_km",         "a_mm",   "a_mb",
        "a_ms",     "a_us",     "a_ns",      "a_m",    "a_s",    "rotation_b_s", "a_x"})
    text += fmt::format("{} {}\n", name, unit_in_name(name));
  test::expect_recorded("tables/columns.txt", text);
}

class Files : public testing::Test {
 protected:
  [[nodiscard]] std::filesystem::path with(const std::string& content) const {
    const auto file = folder_ / "errors_a.csv";
    std::ofstream(file, std::ios::binary) << content;
    return file;
  }
  /// An error without the folder.
  [[nodiscard]] std::string told(const Error& error) const {
    std::string text = error.text();
    const std::string path = folder_.string();
    if (const auto at = text.find(path); at != std::string::npos) text.replace(at, path.size(), "HERE");
    return text;
  }
  std::filesystem::path folder_ = test::scratch_folder();
};

using WholeTableReader = Files;

std::string written(const Block& block) {
  std::string text;
  for (std::size_t row = 0; row < block.rows; ++row) {
    for (const auto& column : block.columns)
      text += std::isnan(column[row]) ? " -" : fmt::format(" {:.9g}", column[row]);
    text += '\n';
  }
  return text;
}

TEST_F(WholeTableReader, ReadsEveryKindOfRowAndTellsEveryKindOfDamage) {
  std::string text;
  const auto tell = [&](const std::string& title, const std::string& content) {
    text += title + ": ";
    auto reader = TableReader::open(with(content), run_table("errors"));
    if (!reader) {
      text += told(reader.error()) + '\n';
      return;
    }
    for (const Column& column : reader->columns())
      text += fmt::format(" {}[{}]{}", column.name, column.unit, static_cast<int>(column.kind));
    text += '\n';
    for (int block = 0; block < 4; ++block) {
      const auto rows = reader->next(2);
      if (!rows) {
        text += " " + told(rows.error()) + '\n';
        break;
      }
      text += fmt::format(" {} rows, {} columns, cut off {}\n", rows->rows, rows->columns.size(),
                          reader->was_cut_off()) +
              written(*rows);
    }
    for (std::size_t i = 0; i < reader->columns().size(); ++i)
      for (const std::string& one : reader->words(i)) text += fmt::format(" {}:{}\n", i, one);
  };
  tell("usual", "time_s,regime,counter\r\n1.5,static,2\r\n-2e3,,\r\n,dynamic,7\n3,static,-1\n4,a\x01,1\n");
  tell("unknown columns", "a\x02,time_s\n1,2\n");
  tell("empty", "");
  tell("an empty header", "\ntime_s\n");
  tell("a header with a carriage return alone", "\r\n1\n");
  tell("no name", "time_s,,utc_s\n");
  tell("twice", "time_s,utc_s,time_s\n");
  tell("a header that does not end", "time_s,utc_s");
  tell("fewer cells", "time_s,utc_s\n1,2\n1\n");
  tell("more cells", "time_s,utc_s\n1,2\n1,2,3\n");
  tell("an empty row", "time_s\n\n\r\n1\n");
  tell("no number", "time_s,utc_s\n1,0x10\n");
  tell("a number and more", "time_s,utc_s\n1,2 \n");
  tell("a long text for a number", "time_s,utc_s\n1," + std::string(60, 'x') + "\n");
  tell("cut off", "time_s\n1\n2\n3");
  tell("whole", "time_s\n1\n2\n3\n");
  test::expect_recorded("tables/rows.txt", text);
}

TEST_F(WholeTableReader, HasLimits) {
  const auto columns = [](std::size_t n) {
    std::string header = "c0";
    for (std::size_t i = 1; i < n; ++i) header += fmt::format(",c{}", i);
    return header + '\n';
  };
  EXPECT_TRUE(TableReader::open(with(columns(kColumnsMax)), run_table("errors")));
  EXPECT_FALSE(TableReader::open(with(columns(kColumnsMax + 1)), run_table("errors")));
  EXPECT_TRUE(TableReader::open(with(std::string(kRowMax, 'a') + '\n'), run_table("errors")));
  EXPECT_FALSE(TableReader::open(with(std::string(kRowMax + 1, 'a') + '\n'), run_table("errors")));
  EXPECT_FALSE(TableReader::open(folder_, run_table("errors")));
  const auto rows_of = [&](const std::string& content) {
    auto reader = TableReader::open(with(content), run_table("errors"));
    const auto block = reader->next(5000);
    return block ? static_cast<int>(block->rows) : -1;
  };
  EXPECT_EQ(rows_of("regime\n" + std::string(kRowMax, 'a') + '\n'), 1);
  EXPECT_EQ(rows_of("regime\n" + std::string(kRowMax + 1, 'a') + '\n'), -1);
  std::string words = "regime\n";
  for (std::size_t i = 0; i < kWordsMax; ++i) words += fmt::format("w{}\n", i);
  EXPECT_EQ(rows_of(words + "w5\n"), static_cast<int>(kWordsMax) + 1);
  EXPECT_EQ(rows_of(words + "one more\n"), -1);
}

using WholeCsvReader = Files;

TEST_F(WholeCsvReader, GivesTheWantedCellsOfEveryRow) {
  std::string text;
  const auto tell = [&](const std::string& title, const std::string& content,
                        const std::vector<std::string>& wanted) {
    text += title + '\n';
    auto reader = CsvReader::open(with(content), wanted);
    if (!reader) {
      text += " " + told(reader.error()) + '\n';
      return;
    }
    while (reader->next()) {
      text += fmt::format(" at {}:", reader->place());
      for (std::size_t i = 0; i < wanted.size(); ++i)
        text += fmt::format(" '{}' {}", reader->cell(i),
                            std::isnan(reader->number(i)) ? "-" : fmt::format("{:.9g}", reader->number(i)));
      text += '\n';
    }
    text += fmt::format(" ends at {}\n", reader->place());
  };
  tell("usual", "a,b,c\n1,2,3\n4,,6\n7,x,9e1\n", {"c", "a", "b"});
  tell("carriage returns", "a,b\r\n1,2\r\n3,4\r\n", {"b"});
  tell("fewer and more cells", "a,b,c\n1,2\n1,2,3,4\n,,\n\n5,6,7\n", {"a", "c"});
  tell("cut off", "a,b\n1,2\n3,4", {"a", "b"});
  tell("cut off behind the first", "a,b\n1,2\n3", {"a", "b"});
  tell("no column", "a,b\n1,2\n", {"a", "d"});
  tell("a column twice", "a,a\n1,2\n", {"a"});
  tell("empty", "", {"a"});
  tell("numbers", "a\n1.5e-3\n-7\n+7\n 7\n7 \n0x1\nnan\ninf\n1e999\n", {"a"});
  tell("a row of the longest", "a\n" + std::string(65536, '0') + "\n2\n", {});
  tell("a longer row", "a\n1\n" + std::string(65537, '0') + "\n2\n", {});
  test::expect_recorded("tables/csv.txt", text);
  EXPECT_FALSE(CsvReader::open(folder_ / "absent", {"a"}));
}

TEST_F(WholeCsvReader, GoesToTheRowThatItIsSentTo) {
  auto reader = CsvReader::open(with("a,b\n1,2\n33,4\n5,6\n"), {"b"});
  std::vector<std::uint64_t> places;
  while (reader->next()) places.push_back(reader->place());
  EXPECT_EQ(places, (std::vector<std::uint64_t>{4, 8, 13}));
  reader->go_to(places[1]);
  EXPECT_EQ(reader->place(), 8U);
  ASSERT_TRUE(reader->next());
  EXPECT_EQ(reader->number(0), 4.0);
  EXPECT_EQ(reader->place(), 8U);
  ASSERT_TRUE(reader->next());
  EXPECT_EQ(reader->place(), 13U);
  EXPECT_FALSE(reader->next());
}

using WholeJson = Files;

TEST_F(WholeJson, PassesTheGate) {
  const std::string text =
      "{\"a\\nb\": \"c\\u0001d\", \"list\": [\"e\\tf\", 1, true, null, {\"g\": \"h\\ni\"}],"
      "\"configuration_text\": \"one\\n\\u001b[2Jtwo\\n\\nthree\\n\", \"inner\": {\"configuration_text\": 5}}";
  EXPECT_EQ(
      read_json_file(with(text)).dump(),
      R"({"a?b":"c?d","configuration_text":"one\n?[2Jtwo\n\nthree\n","inner":{"configuration_text":5},"list":["e?f",1,true,null,{"g":"h?i"}]})");
  EXPECT_EQ(read_json_file(with("{\"configuration_text\": \"no end\"}")).dump(),
            R"({"configuration_text":"no end"})");
  EXPECT_EQ(read_json_file(with("{\"configuration_text\": \"\"}")).dump(), R"({"configuration_text":""})");
  EXPECT_EQ(read_json_file(with("[\"" + std::string(kLineMax + 5, 'x') + "\"]"))[0].get<std::string>().size(),
            kLineMax);
  EXPECT_TRUE(read_json_file(with("{\"a\": ")).is_discarded());
  EXPECT_TRUE(read_json_file(folder_ / "absent").is_discarded());
}

TEST_F(WholeJson, HasADepth) {
  const auto nested = [&](std::size_t depth, char open, char close, const std::string& inner = "") {
    const std::string key = open == '{' ? "\"a\": " : "";
    std::string text;
    for (std::size_t i = 0; i < depth; ++i)
      text += i + 1 < depth ? std::string(1, open) + key : std::string(1, open);
    return text + inner + std::string(depth, close);
  };
  EXPECT_FALSE(read_json_file(with(nested(kJsonDepthMax, '[', ']'))).is_discarded());
  EXPECT_TRUE(read_json_file(with(nested(kJsonDepthMax + 1, '[', ']'))).is_discarded());
  EXPECT_FALSE(read_json_file(with(nested(kJsonDepthMax, '{', '}'))).is_discarded());
  EXPECT_TRUE(read_json_file(with(nested(kJsonDepthMax + 1, '{', '}'))).is_discarded());
  // Brackets of texts do not count, those that are closed neither.
  EXPECT_FALSE(read_json_file(with(nested(kJsonDepthMax, '[', ']', "\"[[\\\"[{\\\\\""))).is_discarded());
  EXPECT_TRUE(read_json_file(with(nested(kJsonDepthMax, '[', ']', "\"\\\\\",[]"))).is_discarded());
  std::string many = "[[]";
  for (int i = 0; i < 100; ++i) many += ",[],{}";
  EXPECT_FALSE(read_json_file(with(many + "]")).is_discarded());
  EXPECT_TRUE(read_json_file(with("]]" + nested(kJsonDepthMax + 1, '[', ']'))).is_discarded());
}

TEST_F(WholeJson, FieldsAreAskedForAndNeverAssumed) {
  const auto document = nlohmann::json::parse(
      R"({"n": 1.5, "i": 7, "t": "x", "b": true, "z": null, "three": [1, 2, 3], "words": [1, "2", 3],
      "list": [{"name": "a"}, 5, {"name": 7}, {"name": "b", "v": 1}]})");
  EXPECT_EQ(field(document, "n"), 1.5);
  EXPECT_TRUE(field(document, "absent").is_null());
  EXPECT_TRUE(field(document["three"], "n").is_null());
  EXPECT_EQ(number_at(document, "n"), 1.5);
  EXPECT_EQ(number_at(document, "i"), 7.0);
  for (const char* key : {"t", "b", "z", "absent", "three"}) EXPECT_FALSE(number_at(document, key)) << key;
  EXPECT_EQ(text_at(document, "t") + text_at(document, "n") + text_at(document, "b") + text_at(document, "z"),
            "x1.5true");
  EXPECT_EQ(numbers_at<3>(document, "three")->at(2), 3.0);
  EXPECT_FALSE(numbers_at<2>(document, "three"));
  EXPECT_FALSE(numbers_at<3>(document, "words"));
  EXPECT_FALSE(numbers_at<3>(document, "n"));
  EXPECT_EQ(named(document["list"], "b")["v"], 1);
  EXPECT_EQ(named(document["list"], "7")["name"], 7);
  EXPECT_TRUE(named(document["list"], "c").is_null());
  EXPECT_TRUE(named(document, "a").is_null());
}

TEST_F(WholeJson, WhatIsMissingIsToldInWords) {
  const auto done = with_documents_of("runs/a", []() -> Result<void> {
    (void)nlohmann::json::object().at("imus");
    return {};
  });
  ASSERT_FALSE(done);
  EXPECT_EQ(done.error().kind, ErrorKind::kWork);
  EXPECT_EQ(
      done.error().text(),
      "a JSON file of runs/a, or the truth.json given with it, is not as this version writes it: key 'imus' not "
      "found; make the run again");
  EXPECT_TRUE(with_documents_of("runs/a", []() -> Result<void> { return {}; }));
}

}  // namespace
}  // namespace imuscope::tables
