#pragma once

/// The error process of one S-IMU as the noise engine wants it: one value per counter step and axis, with a
/// mask that says where there is a value and in which regime. Gaps stay gaps.

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "estimation/error_process/error_row.h"

namespace imuscope {

/// gyro_x, gyro_y, gyro_z, accel_x, accel_y, accel_z.
inline constexpr std::size_t kAxisCount = 6;
std::string axis_name(std::size_t axis);
/// "rad/s" or "m/s^2".
std::string axis_unit(std::size_t axis);

/// Regimes that a run can have.
inline constexpr std::size_t kMaxRegimes = 64;

class NoiseSeries {
 public:
  /// Rows in the order of their counter. A row whose counter does not increase is left out.
  void add(const ErrorRow& row) { add(row, static_cast<std::size_t>(row.regime)); }
  /// The same with a regime that is not the row's own.
  /// @param regime  below kMaxRegimes; absent: the row belongs to none
  void add(const ErrorRow& row, std::optional<std::size_t> regime);

  [[nodiscard]] std::size_t size() const { return regimes_.size(); }
  /// Time of validity of sample `index`; of the one before where it is missing.
  [[nodiscard]] HostTime time(std::size_t index) const { return times_[index]; }
  [[nodiscard]] const std::vector<double>& values(std::size_t axis) const { return values_[axis]; }
  /// 1 where the axis has a value.
  [[nodiscard]] std::vector<std::uint8_t> mask(std::size_t axis) const;
  /// 1 where the axis has a value and the vehicle was in `regime`.
  [[nodiscard]] std::vector<std::uint8_t> mask(std::size_t axis, std::size_t regime) const;
  [[nodiscard]] std::vector<std::uint8_t> mask(std::size_t axis, Regime regime) const {
    return mask(axis, static_cast<std::size_t>(regime));
  }
  /// Samples that the counter says are missing.
  [[nodiscard]] std::size_t missing() const { return missing_; }

 private:
  static constexpr std::uint8_t kNoRegime = 255;

  bool started_ = false;
  std::int64_t next_counter_ = 0;
  std::size_t missing_ = 0;
  std::vector<HostTime> times_;
  std::array<std::vector<double>, kAxisCount> values_;
  std::vector<std::uint8_t> valid_;    ///< a bit for each triad
  std::vector<std::uint8_t> regimes_;  ///< kNoRegime where there is none, or no sample
};

}  // namespace imuscope
