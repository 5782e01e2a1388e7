/// A table of regimes that a person wrote, or that is none.

#include <string_view>

#include "estimation/regimes/labels.h"
#include "tests/fuzz/fuzz.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace imuscope;
  const auto labels = parse_labels({reinterpret_cast<const char*>(data), size}, "labels.csv");
  if (!labels) {
    fuzz::require(!labels.error().what.empty(), "an error says what is wrong");
    return 0;
  }
  for (std::size_t i = 0; i < labels->size(); ++i) {
    const Label& label = (*labels)[i];
    fuzz::require(label.begin_s < label.end_s, "a stretch begins before it ends");
    fuzz::require(i == 0 || (*labels)[i - 1].end_s <= label.begin_s,
                  "stretches are in order, none in another");
    fuzz::require(!label.name.empty(), "a stretch has a name");
  }
  labelled_regimes(*labels, HostTime{});
  return 0;
}
