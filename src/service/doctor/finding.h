#pragma once

/// What a check found out about this PC.

#include <cstdint>
#include <string>

namespace imuscope::doctor {

enum class Verdict : std::uint8_t {
  kGood,
  kWarning,  ///< the service runs, less well than it could
  kBad,      ///< the service misses deadlines, devices or data
};

struct Finding {
  std::string check;  ///< what was looked at, in two or three words
  Verdict verdict = Verdict::kGood;
  std::string what;  ///< one sentence
  std::string fix;   ///< commands or lines to write, exactly; empty when all is well
};

}  // namespace imuscope::doctor
