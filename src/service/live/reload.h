#pragma once

/// What a changed configuration file can change in a running service.

#include <string>
#include <vector>

#include "base/result.h"
#include "configuration/config.h"
#include "models/noise/model.h"

namespace imuscope {

/// The part of a configuration that can change while the service runs.
struct Tunables {
  LcmOptions lcm;
  NoiseOptions noise;
  noise::ModelSpec model;
};

struct Reload {
  Tunables tunables;
  /// Tables of the file that differ, too, but only take effect at the next start: "device", "estimator", ...
  std::vector<std::string> at_next_start;
};

/// Reads the file of `running` again. Errors: those of load_configuration() and of the noise model; the
/// running configuration then stays as it is.
[[nodiscard]] Result<Reload> reload_configuration(const Configuration& running);

}  // namespace imuscope
