#pragma once

#include "service/pipeline/estimator_setup.h"
#include "tests/support/two_devices.h"

namespace imuscope::test {

/// kTwoDevices as the estimator takes them.
inline EstimatorConfig one_study() {
  return estimator_config(*parse_configuration(kTwoDevices, "test.toml"));
}

}  // namespace imuscope::test
