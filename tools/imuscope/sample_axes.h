#pragma once

/// Samples of an IMU as signals of its six axes.

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "base/result.h"
#include "sample/sample.h"
#include "signal_file.h"

namespace imuscope::cli {

/// "gyro_x" ... "accel_z".
inline constexpr std::array<const char*, 6> kMessageAxes{"gyro_x",  "gyro_y",  "gyro_z",
                                                         "accel_x", "accel_y", "accel_z"};

/// Axes sample by sample in the order of kMessageAxes; times left out are gaps. rad/s and m/s^2.
struct SampleAxes {
  std::array<Signal, kMessageAxes.size()> axes;
  std::vector<float> temperature_c;  ///< one a sample, the last that was sent; empty where none was
};

/// Takes an IMU's samples, in order, and keeps what the axes need of them.
class AxesSink final : public SampleSink {
 public:
  void on_sample(const Sample& sample) noexcept override;

  [[nodiscard]] bool empty() const { return stamps_s_.empty(); }

  /// Errors (kWork): too few samples, times that go back, gaps of more than ten million samples; (kUsage) a
  /// rate that contradicts the times.
  Result<SampleAxes> axes(std::optional<double> rate_hz) &&;

 private:
  std::optional<HostTime> first_;
  std::vector<double> stamps_s_;  ///< from the first: since 1970 a double has no microseconds to spare
  std::array<std::vector<double>, kMessageAxes.size()> values_;
  std::vector<std::uint32_t> flags_;
  std::vector<float> temperature_c_;
};

}  // namespace imuscope::cli
