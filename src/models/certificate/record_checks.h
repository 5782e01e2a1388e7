#pragma once

/// What is wrong with one axis of a log that should be of a sensor at rest.

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace imuscope::certificate {

struct AxisRecord;
struct AxisCertificate;

/// Step of the grid on which the values lie; absent where they lie on none that is coarser than a thousandth
/// of their spread.
std::optional<double> resolution_of(std::span<const double> x, std::span<const std::uint8_t> mask);

/// Sentences: the sensor was moved, values at the end of the range, runs of one value, samples missing, a
/// resolution that is coarser than the noise.
/// @param x       the samples of the record
/// @param so_far  with n_samples, n_missing, mean, sd, resolution
std::vector<std::string> record_warnings(const AxisRecord& record, std::span<const double> x,
                                         std::span<const std::uint8_t> mask, const AxisCertificate& so_far);

}  // namespace imuscope::certificate
