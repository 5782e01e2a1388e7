#include "firmware_sim/imusim/fault_log.h"

#include <nlohmann/json.hpp>

#include "firmware_sim/imusim/fault_script.h"
#include "firmware_sim/imusim/truth_files.h"

namespace imusim {

Outcome<void> write_fault_log(const Configuration& configuration, const std::filesystem::path& folder) {
  nlohmann::json faults = nlohmann::json::array();
  for (const Fault& fault : configuration.faults) {
    const FaultTally& tally = *fault.tally;
    faults.push_back({{"device", fault.device},
                      {"kind", name_of(fault.kind)},
                      {"begin_s", fault.begin_s},
                      {"end_s", fault.end_s},
                      {"messages", tally.messages},
                      {"hit", tally.hit},
                      {"bytes_hit", tally.bytes_hit},
                      {"silent_s", tally.silent_s}});
  }
  const nlohmann::json log{{"schema", "imuscope.fault_log/1"}, {"faults", std::move(faults)}};
  return write_file(folder / "fault_log.json", log.dump(1) + "\n");
}

}  // namespace imusim
