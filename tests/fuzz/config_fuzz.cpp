/// A configuration from a careless hand, or from a capture of unknown origin.

#include <string>

#include "configuration/config.h"
#include "tests/fuzz/fuzz.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace imuscope;
  const std::string text(reinterpret_cast<const char*>(data), size);
  const auto configuration = parse_configuration(text, "fuzz.toml");
  if (!configuration) fuzz::require(!configuration.error().what.empty(), "an error says what is wrong");
  return 0;
}
