#pragma once

#include "service/pipeline/estimator_setup.h"

namespace imuscope::test {

/// A reference (device 0) and an S-IMU (device 1), with nothing else said of them.
inline EstimatorConfig one_study() {
  return estimator_config(*parse_configuration(R"(
[[device]]
name = "r"
role = "reference"
protocol = "csv_imu"
[[device]]
name = "s"
role = "study"
protocol = "csv_imu"
)",
                                               "test.toml"));
}

}  // namespace imuscope::test
