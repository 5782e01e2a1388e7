#pragma once

/// Fitted noise models on their way back to the estimator, and into captures. Soft world; no state.

#include <imuscope/applied_model_t.hpp>

#include "publish/reports.h"
#include "service/config.h"
#include "service/core.h"

namespace imuscope {

/// `current` with what a refit says of it. Per axis and regime, of an identifiable model: WN becomes the
/// white noise, the fastest GM of at most one second the fast process, the slowest GM beyond that the bias
/// process (of the dynamic regime where there is one). A variance more than a hundred times, or less than a
/// hundredth, of the present one is not believed: the filter keeps what it has for that axis.
[[nodiscard]] StudyNoise updated_noise(const StudyNoise& current, const NoiseModelReport& fitted);

/// The capture's record of an applied model. utime and sequence are left to the caller.
[[nodiscard]] applied_model_t applied_model_record(const AppliedNoise& applied, const std::string& device);
/// @param study  index of the S-IMU that the record names
[[nodiscard]] AppliedNoise applied_noise_of(const applied_model_t& record, std::size_t study);

}  // namespace imuscope
