#include "results/hdf5/run_export.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <set>

#include "base/json_text.h"
#include "base/output_folder.h"
#include "base/text.h"
#include "results/hdf5/h5_file.h"
#include "results/hdf5/json_tree.h"
#include "results/tables/json_file.h"
#include "results/tables/table_reader.h"

namespace imuscope::hdf5 {
namespace {

/// Rows that are in memory at a time.
constexpr std::size_t kBlockRows = 65'536;
/// Files of a run are some dozens.
constexpr std::size_t kFilesMax = 4096;

struct RunFileNames {
  std::set<std::string> tables;
  std::set<std::string> documents;
  std::set<std::string> left_out;
};

Result<RunFileNames> files_of(const std::filesystem::path& folder) {
  std::error_code failed;
  if (!std::filesystem::is_directory(folder, failed)) {
    return usage_error(fmt::format("{} is no folder", folder.string()), "give the folder of a run");
  }
  RunFileNames names;
  std::size_t n = 0;
  for (std::filesystem::directory_iterator at(folder, failed), end; !failed && at != end;
       at.increment(failed)) {
    if (++n > kFilesMax)
      return usage_error(fmt::format("{} holds more than {} files", folder.string(), kFilesMax),
                         "give the folder of a run");
    const std::string name = at->path().filename().string();
    if (name.starts_with('.') || !is_utf8(name)) continue;
    if (tables::table_file(name)) {
      names.tables.insert(name);
    } else if (name.ends_with(".json")) {
      names.documents.insert(name);
    } else {
      names.left_out.insert(name);
    }
  }
  if (failed)
    return work_error(fmt::format("{} cannot be read: {}", folder.string(), failed.message()),
                      "check its permissions");
  if (names.tables.empty() && names.documents.empty())
    return usage_error(fmt::format("{} holds nothing of a run", folder.string()), "give the folder of a run");
  return names;
}

std::string stem_of(const std::string& name) { return std::filesystem::path(name).stem().string(); }

/// Where the columns of one table go while it is read.
class TableWriter {
 public:
  static Result<TableWriter> create(const Handle& group, const std::vector<tables::Column>& columns) {
    TableWriter writer(group, columns);
    for (std::size_t i = 0; i < columns.size(); ++i) {
      writer.places_.push_back(writer.growing_.size());
      if (columns[i].kind == tables::CellKind::kText) continue;
      auto growing = GrowingColumn::create(group, columns[i].name);
      if (!growing) return tl::unexpected<Error>(growing.error());
      if (auto described = writer.describe(growing->data_set(), columns[i]); !described)
        return tl::unexpected<Error>(described.error());
      writer.growing_.push_back(std::move(*growing));
    }
    writer.codes_.resize(columns.size());
    return writer;
  }

  Result<void> append(const tables::Block& block) {
    for (std::size_t i = 0; i < columns_.size(); ++i) {
      if (columns_[i].kind == tables::CellKind::kText) {
        for (const double code : block.columns[i]) codes_[i].push_back(static_cast<std::int16_t>(code));
      } else if (auto appended = growing_[places_[i]].append(block.columns[i]); !appended) {
        return appended;
      }
    }
    return {};
  }

  /// Columns of text, whose longest word is known now.
  Result<void> finish(const tables::TableReader& reader) {
    for (std::size_t i = 0; i < columns_.size(); ++i) {
      if (columns_[i].kind != tables::CellKind::kText) continue;
      const auto written = write_words(group_, columns_[i].name, codes_[i], reader.words(i));
      if (!written) return tl::unexpected<Error>(written.error());
      if (auto described = describe(*written, columns_[i]); !described) return described;
    }
    return {};
  }

 private:
  TableWriter(const Handle& group, const std::vector<tables::Column>& columns)
      : group_(group), columns_(columns) {}

  static Result<void> describe(const Handle& data_set, const tables::Column& column) {
    if (auto set = set_attribute(data_set, "unit", column.unit); !set) return set;
    return set_attribute(data_set, "description", column.description);
  }

  const Handle& group_;
  const std::vector<tables::Column>& columns_;
  std::vector<std::size_t> places_;  ///< in growing_, of the columns of numbers
  std::vector<GrowingColumn> growing_;
  std::vector<std::vector<std::int16_t>> codes_;
};

Result<void> write_table(const Handle& tables_group, const std::filesystem::path& folder,
                         const std::string& name) {
  const auto file = tables::table_file(name);
  auto reader = tables::TableReader::open(folder / name, *file->kind);
  if (!reader) return tl::unexpected<Error>(reader.error());
  const auto group = create_group(tables_group, stem_of(name));
  if (!group) return tl::unexpected<Error>(group.error());
  if (auto set = set_attribute(*group, "description", file->kind->description); !set) return set;
  auto writer = TableWriter::create(*group, reader->columns());
  if (!writer) return tl::unexpected<Error>(writer.error());
  for (;;) {
    const auto block = reader->next(kBlockRows);
    if (!block) return tl::unexpected<Error>(block.error());
    if (block->rows == 0) break;
    if (auto appended = writer->append(*block); !appended) return appended;
  }
  return writer->finish(*reader);
}

/// @return whether the document could be read
Result<bool> write_document(const Handle& documents, const Handle& results,
                            const std::filesystem::path& file) {
  const auto document = tables::read_json_file(file);
  if (document.is_discarded()) return false;
  const std::string stem = file.stem().string();
  if (const auto written = write_text(documents, stem, json_text(document)); !written)
    return tl::unexpected<Error>(written.error());
  const auto taken_apart = write_json_tree(results, stem, document);
  if (!taken_apart) return tl::unexpected<Error>(taken_apart.error());
  return true;
}

std::string joined(const std::set<std::string>& names) {
  std::string text;
  for (const std::string& name : names) text += (text.empty() ? "" : "\n") + name;
  return text;
}

Result<void> write_all(const Handle& file, const std::filesystem::path& folder, RunFileNames names,
                       std::string_view version) {
  for (const auto& [key, value] : {std::pair<const char*, std::string_view>{"format", "imuscope run"},
                                   {"imuscope_version", version},
                                   {"text_encoding", "UTF-8"}}) {
    if (auto set = set_attribute(file, key, value); !set) return set;
  }
  const auto tables_group = create_group(file, "tables");
  const auto results = create_group(file, "results");
  const auto documents = create_group(file, "documents");
  for (const auto* group : {&tables_group, &results, &documents}) {
    if (!*group) return tl::unexpected<Error>(group->error());
  }
  for (const std::string& name : names.tables) {
    if (auto written = write_table(*tables_group, folder, name); !written) return written;
  }
  for (const std::string& name : names.documents) {
    const auto readable = write_document(*documents, *results, folder / name);
    if (!readable) return tl::unexpected<Error>(readable.error());
    if (!*readable) names.left_out.insert(name);
  }
  return set_attribute(file, "left_out", joined(names.left_out));
}

}  // namespace

Result<void> export_run(const std::filesystem::path& run_folder, const std::filesystem::path& file,
                        std::string_view version) {
  const std::string name = file.filename().string();
  if (name.empty() || name == "." || name == "..")
    return usage_error(fmt::format("{} is no name of a file", file.string()), "give the file to write");
  auto names = files_of(run_folder);
  if (!names) return tl::unexpected<Error>(names.error());
  const auto parent = file.has_parent_path() ? file.parent_path() : std::filesystem::path(".");
  std::error_code elsewhere;
  if (std::filesystem::equivalent(parent, run_folder, elsewhere)) names->left_out.erase(name);
  const auto folder = OutputFolder::open(parent);
  if (!folder) return tl::unexpected<Error>(folder.error());
  const auto scratch = folder->scratch_folder();
  if (!scratch) return tl::unexpected<Error>(scratch.error());
  auto done = [&]() -> Result<void> {
    // The library opens a path: that of the descriptor leads to the new file and nowhere else.
    const Descriptor fresh = scratch->create_new(name);
    if (!fresh.is_open())
      return work_error(fmt::format("{} cannot be written", file.string()), "check the disk");
    auto h5 = create_file(fmt::format("/proc/self/fd/{}", fresh.get()));
    if (!h5) return tl::unexpected<Error>(h5.error());
    if (auto written = write_all(*h5, run_folder, *names, version); !written) return written;
    if (!h5->close())
      return work_error(fmt::format("{} is not whole", file.string()), "look at the free space of the disk");
    return folder->take(*scratch, name);
  }();
  scratch->remove(name);
  folder->remove(scratch->path().filename().string());
  return done;
}

}  // namespace imuscope::hdf5
