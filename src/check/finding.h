#pragma once

/// What a look at the data themselves, before anything is estimated from them, finds to be wrong.

#include <string>
#include <vector>

namespace imuscope::check {

/// What a finding does to the results.
enum class Harm {
  kWrong,   ///< they are wrong, or there are none
  kLimits,  ///< they are worse than the sensors allow
  kNote,    ///< something that this recording cannot show
};

/// A line of the configuration that would mend a finding.
struct ConfigLine {
  std::string device;  ///< name of the [[device]]
  std::string key;     ///< in its table, such as "axes" or "csv.gyro_unit"
  std::string value;   ///< as TOML writes it
};

struct Finding {
  Harm harm = Harm::kNote;
  std::string check;  ///< its name for programs, such as "gravity norm"
  std::string device;
  std::string what;  ///< in words
  double value = 0.0;
  double expected = 0.0;
  std::string unit;               ///< of both
  std::string remedy;             ///< what to do
  std::vector<ConfigLine> mends;  ///< empty where no line of the configuration can
};

/// "dot: its forces at rest are those of g (1.00 m/s2, expected 9.81); write accel_unit = ..."
[[nodiscard]] std::string sentence(const Finding& finding);

[[nodiscard]] constexpr const char* key_of(Harm harm) noexcept {
  switch (harm) {
    case Harm::kWrong:
      return "wrong";
    case Harm::kLimits:
      return "limits";
    case Harm::kNote:
      break;
  }
  return "note";
}

}  // namespace imuscope::check
