#pragma once

/// Samples of an IMU as signals of its six axes.

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "base/result.h"
#include "models/certificate/axis_certificate.h"
#include "sample/sample.h"
#include "signal_file.h"
#include "spool.h"

namespace imuscope::cli {

/// "gyro_x" ... "accel_z".
inline constexpr std::array<const char*, 6> kMessageAxes{"gyro_x",  "gyro_y",  "gyro_z",
                                                         "accel_x", "accel_y", "accel_z"};

/// Axes sample by sample in the order of kMessageAxes; times left out are gaps. rad/s and m/s^2.
struct SampleAxes {
  std::array<Signal, kMessageAxes.size()> axes;
  /// In the place of values and mask, of samples that lie on the disk; missing ones are NaN.
  std::array<certificate::FetchSamples, kMessageAxes.size()> fetches;
  std::array<bool, kMessageAxes.size()> is_sent{};  ///< at least one sample has it
  /// One a sample, the last that was sent; null: none.
  std::shared_ptr<const std::vector<float>> temperature_c{};
  /// In its place, of samples that lie on the disk: with those of an axis.
  std::array<certificate::ReadWithTemperature, kMessageAxes.size()> read_with_temperature;
};

/// Takes an IMU's samples, in order, and keeps what the axes need of them.
class AxesSink final : public SampleSink {
 public:
  enum class Keeps : std::uint8_t { kAllInMemory, kLongOnesOnDisk };

  explicit AxesSink(Keeps keeps = Keeps::kAllInMemory, std::size_t rows_together = kRowsTogether)
      : keeps_(keeps), rows_together_(rows_together) {}

  void on_sample(const Sample& sample) noexcept override;

  [[nodiscard]] bool empty() const { return rows_ == 0; }

  /// Errors (kWork): too few samples, times that go back, gaps of more than ten million samples, a disk that
  /// is full; (kUsage) a rate that contradicts the times.
  Result<SampleAxes> axes(std::optional<double> rate_hz) &&;

  /// Samples that lie in memory; 67 MB.
  static constexpr std::size_t kRowsTogether = std::size_t{1} << 20U;

 private:
  /// Six axes, stamps from the first one (since 1970 a double has no microseconds to spare), temperature.
  static constexpr std::size_t kStamps = kMessageAxes.size();
  static constexpr std::size_t kTemperature = kStamps + 1;
  static constexpr std::size_t kColumns = kTemperature + 1;

  [[nodiscard]] Result<void> spill();
  [[nodiscard]] Result<SampleAxes> axes_in_memory(std::optional<double> rate_hz);
  [[nodiscard]] Result<SampleAxes> axes_on_disk(std::optional<double> rate_hz);

  Keeps keeps_;
  std::size_t rows_together_;
  std::optional<HostTime> first_;
  std::size_t rows_ = 0;
  std::array<std::vector<double>, kColumns> columns_;  ///< NaN where a sample lacks it
  std::array<bool, kMessageAxes.size()> is_sent_{};
  std::vector<Spool> spools_;  ///< none, or one a column
  std::optional<Error> failure_;
};

}  // namespace imuscope::cli
