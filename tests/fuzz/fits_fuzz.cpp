/// Noise models from a JSON file: what `imuscope fit --json` printed or a run's models.json, or what is
/// neither.

#include "fit_file.h"
#include "tests/fuzz/file_in_memory.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace imuscope;
  const fuzz::FileInMemory file(data, size);
  const auto fits = cli::read_fits(file.path());
  if (!fits) {
    fuzz::require(!fits.error().what.empty(), "an error says what is wrong");
    return 0;
  }
  fuzz::require(!fits->empty(), "what holds no model is an error");
  return 0;
}
