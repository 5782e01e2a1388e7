#pragma once

/// The error process of one S-IMU as the noise engine wants it: one value per counter step and axis, with a
/// mask that says where there is a value and in which regime. Gaps stay gaps.

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "error_process/error_row.h"

namespace imuscope {

/// gyro_x, gyro_y, gyro_z, accel_x, accel_y, accel_z.
inline constexpr std::size_t kAxisCount = 6;
std::string axis_name(std::size_t axis);
/// "rad/s" or "m/s^2".
std::string axis_unit(std::size_t axis);

class NoiseSeries {
 public:
  /// Rows in the order of their counter. A row whose counter does not increase is left out.
  void add(const ErrorRow& row);

  [[nodiscard]] std::size_t size() const { return regimes_.size(); }
  [[nodiscard]] const std::vector<double>& values(std::size_t axis) const { return values_[axis]; }
  /// 1 where the axis has a value.
  [[nodiscard]] std::vector<std::uint8_t> mask(std::size_t axis) const;
  /// 1 where the axis has a value and the vehicle was in `regime`.
  [[nodiscard]] std::vector<std::uint8_t> mask(std::size_t axis, Regime regime) const;
  [[nodiscard]] std::size_t count(Regime regime) const;
  /// Samples that the counter says are missing.
  [[nodiscard]] std::size_t missing() const { return missing_; }

 private:
  enum class Cell : std::uint8_t { kMissing, kStatic, kDynamic };

  bool started_ = false;
  std::int64_t next_counter_ = 0;
  std::size_t missing_ = 0;
  std::array<std::vector<double>, kAxisCount> values_;
  std::array<std::vector<std::uint8_t>, kAxisCount> valid_;
  std::vector<Cell> regimes_;
};

}  // namespace imuscope
