#pragma once

/// The estimator over a list of samples: compiled as it is deployed, and together with everything that it
/// rests on at -O0 and at -O3 into a library of its own.

#include <cstddef>
#include <vector>

#include "estimation/calibration/estimator.h"

namespace imuscope::test {

/// Takes the estimates of one tick; what is pointed at is valid for the call alone.
using KeepOutputs = void (*)(void* context, const NavigationOutput& navigation, const SImuOutput* studies,
                             std::size_t n_studies);

}  // namespace imuscope::test

// A name of its own for every build, so that none can be taken for another.
extern "C" {
/// @param samples  by arrival, not empty
/// @param keep     called ten times a second
using EstimatorRun = void(const imuscope::EstimatorConfig& config,
                          const std::vector<imuscope::Sample>& samples, imuscope::test::KeepOutputs keep,
                          void* context);
EstimatorRun estimator_run_release;
EstimatorRun estimator_run_O0;
EstimatorRun estimator_run_O3;
}
