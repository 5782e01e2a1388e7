/// The times and sizes of the reads beside a dump of a device's bytes.

#include "capture/raw_dump.h"
#include "tests/fuzz/folder_in_memory.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace imuscope;
  static const fuzz::FolderInMemory folder;
  constexpr std::size_t kDump = 4096;
  static const std::vector<std::uint8_t> bytes(kDump, 0x55);
  folder.put("x.bin", bytes);
  folder.put("x.arrivals.csv", {data, size});
  auto dump = RawDump::open(folder.path() / "x.bin");
  if (!dump) {
    fuzz::require(!dump.error().what.empty(), "an error says what is wrong");
    return 0;
  }
  fuzz::require(dump->has_arrivals(), "a file of arrivals is not passed over");
  std::size_t given = 0;
  std::optional<HostTime> last;
  while (const auto read = dump->next()) {
    fuzz::require(read->arrival.has_value() && !(last && *read->arrival < *last), "arrivals never go back");
    last = read->arrival;
    given += read->bytes.size();
    fuzz::require(!read->bytes.empty() && given <= kDump, "no byte is given out twice");
  }
  return 0;
}
