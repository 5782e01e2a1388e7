#pragma once

/// Mistakes as people make them, planted into drives, and what the look at the data is to say of each.

#include <functional>
#include <string>
#include <vector>

#include "check/finding.h"
#include "configuration/config.h"
#include "sample/sample.h"

namespace imuscope::test {

/// A drive in memory: samples by device, and the configuration that goes with them.
struct DriveInMemory {
  std::string toml;
  Configuration configuration;
  std::vector<std::vector<Sample>> samples;
  std::vector<bool> has_own_clock;
};

/// Devices of such a drive.
inline constexpr std::size_t kReference = 0;
inline constexpr std::size_t kStudy = 1;
inline constexpr std::size_t kGnss = 2;

struct Mistake {
  std::string name;
  std::function<void(DriveInMemory&)> plant;
  std::size_t device = 0;  ///< that the finding must name
  std::string check;       ///< and what kind it must be
  std::string key;         ///< of the line that mends it; empty where no line can
  std::string value;       ///< of that line; empty: any
};

/// Every kind of mistake that the checks know, most of them twice.
std::vector<Mistake> planted_mistakes();

std::vector<check::Finding> look_at(const DriveInMemory& drive);

/// Of the first three findings, whether one is what the mistake calls for.
bool is_named(const Mistake& mistake, const DriveInMemory& drive,
              const std::vector<check::Finding>& findings);

}  // namespace imuscope::test
