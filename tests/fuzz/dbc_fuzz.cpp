#include <string>

#include "drivers/dbc/parser.h"
#include "tests/fuzz/fuzz.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace imuscope;
  const auto parsed = dbc::parse(std::string_view(reinterpret_cast<const char*>(data), size), "fuzz.dbc");
  if (!parsed) fuzz::require(!parsed.error().what.empty(), "an error says what is wrong");
  return 0;
}
