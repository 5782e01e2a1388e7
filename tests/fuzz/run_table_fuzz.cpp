/// A table of a run folder that anybody wrote.

#include "base/text.h"
#include "results/tables/table_reader.h"
#include "tests/fuzz/file_in_memory.h"

namespace imuscope::fuzz {
namespace {

void read_as(const std::string& file, const tables::TableKind& kind) {
  auto reader = tables::TableReader::open(file, kind);
  if (!reader) {
    require(printable(reader.error().text()) == reader.error().text(),
            "an error is one line that can be printed");
    return;
  }
  require(reader->columns().size() <= tables::kColumnsMax, "there are no more columns than are promised");
  constexpr std::size_t kRows = 7;
  for (;;) {
    const auto block = reader->next(kRows);
    if (!block) {
      require(printable(block.error().text()) == block.error().text(),
              "an error is one line that can be printed");
      return;
    }
    require(block->rows <= kRows, "a block is no larger than was asked for");
    for (const auto& column : block->columns)
      require(column.size() == block->rows, "every column has every row");
    if (block->rows == 0) break;
  }
  for (std::size_t i = 0; i < reader->columns().size(); ++i) {
    require(reader->words(i).size() <= tables::kWordsMax, "there are no more words than are promised");
    for (const auto& word : reader->words(i)) require(one_line(word) == word, "a word can be printed");
  }
}

}  // namespace
}  // namespace imuscope::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace imuscope;
  const fuzz::FileInMemory file(data, size);
  for (const auto& kind : tables::run_tables()) fuzz::read_as(file.path(), kind);
  return 0;
}
