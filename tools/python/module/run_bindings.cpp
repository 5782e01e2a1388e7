#include <nlohmann/json.hpp>

#include "base/json_text.h"
#include "conversions.h"
#include "results/tables/json_file.h"
#include "results/tables/table_reader.h"

namespace imuscope::python {
namespace {

namespace py = pybind11;

/// Rows that are read at a time.
constexpr std::size_t kBlockRows = 65'536;

/// A whole table, column by column.
struct Table {
  std::vector<tables::Column> columns;
  std::vector<std::vector<std::string>> words;
  std::vector<std::vector<double>> values;
};

Table read_all(const std::filesystem::path& file) {
  const auto known = tables::table_file(file.filename().string());
  if (!known)
    throw Failure(
        {ErrorKind::kUsage, file.string() + " is no table of a run", "give one of navigation.csv, ..."});
  auto reader = take(tables::TableReader::open(file, *known->kind));
  Table table{reader.columns(), {}, {}};
  table.values.resize(table.columns.size());
  for (;;) {
    const auto block = take(reader.next(kBlockRows));
    if (block.rows == 0) break;
    for (std::size_t i = 0; i < table.values.size(); ++i)
      table.values[i].insert(table.values[i].end(), block.columns[i].begin(), block.columns[i].end());
  }
  for (std::size_t i = 0; i < table.columns.size(); ++i) table.words.push_back(reader.words(i));
  return table;
}

/// [(name, unit, description, numbers, words)]: of a column of text the numbers are places in the words.
py::list read_table(const std::string& file) {
  Table table;
  {
    const py::gil_scoped_release unlocked;
    table = read_all(file);
  }
  py::list out;
  for (std::size_t i = 0; i < table.columns.size(); ++i) {
    const auto& column = table.columns[i];
    py::object words = py::none();
    if (column.kind == tables::CellKind::kText) words = py::cast(table.words[i]);
    out.append(py::make_tuple(column.name, column.unit, column.description,
                              array_of(std::move(table.values[i])), words));
  }
  return out;
}

std::string read_document(const std::string& file) {
  const py::gil_scoped_release unlocked;
  const auto document = tables::read_json_file(file);
  if (document.is_discarded())
    throw Failure({ErrorKind::kWork, file + " cannot be read, or is no JSON document that a run would write",
                   "make the run again"});
  return json_text(document, kJsonOneLine);
}

}  // namespace

void bind_runs(py::module_& module) {
  module.def("read_table", &read_table);
  module.def("read_document", &read_document);
  module.def("unit_in_name", &tables::unit_in_name);
  module.def("is_table", [](const std::string& name) { return tables::table_file(name).has_value(); });
}

}  // namespace imuscope::python
