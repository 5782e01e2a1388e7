/// A table of numbers from anywhere, as `imuscope wv` and `fit` read it: plainly, with a regime, with a
/// counter, with times.

#include "signal_file.h"
#include "tests/fuzz/file_in_memory.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace imuscope;
  const fuzz::FileInMemory file(data, size);
  const cli::SignalChoice choices[] = {{},
                                       {"1", "", ""},
                                       {"1", "3=static", ""},
                                       {"1", "", "2"},
                                       {"1", "", "", "2"},
                                       {"1", "", "", "2,3"},
                                       {"1", "", "3", "2", 100.0}};
  for (const auto& choice : choices) {
    const auto signal = cli::read_signal(file.path(), choice);
    if (!signal) {
      fuzz::require(!signal.error().what.empty(), "an error says what is wrong");
      continue;
    }
    fuzz::require(!signal->values.empty(), "a signal has values");
    fuzz::require(signal->mask.empty() || signal->mask.size() == signal->values.size(),
                  "every value has its mask");
  }
  return 0;
}
