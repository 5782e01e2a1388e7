#pragma once

/// A status in the text format of Prometheus (version 0.0.4). docs/metrics.md has every name.

#include <imuscope/status_t.hpp>
#include <span>
#include <string>

namespace imuscope {

/// One family of metrics, as docs/metrics.md lists it.
struct MetricFamily {
  const char* name;
  const char* type;    ///< gauge, counter
  const char* labels;  ///< with commas between them
  const char* help;
};

/// Every family, in the order in which they are written.
[[nodiscard]] std::span<const MetricFamily> metric_families();

/// Pure function. Base units: seconds, bytes, ratios. What is not known is NaN.
/// @param age_s  of the status
[[nodiscard]] std::string metrics_text(const status_t& status, double age_s);

/// What Content-Type says of it.
inline constexpr const char* kMetricsContentType = "text/plain; version=0.0.4; charset=utf-8";

}  // namespace imuscope
