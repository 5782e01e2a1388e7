#pragma once

/// CSV recordings as devices: an IMU or a GNSS receiver whose samples are rows. README.md in this folder
/// explains it to users.
///
/// The time column is the device's own time. The clock map brings it to the host's scale: kFixed for files
/// (a clock in common with other files has their origin; an own clock gets one from whoever aligns the
/// files). Times must not go back. Core: no allocation after construction.

#include <array>
#include <cstdint>
#include <optional>
#include <string>

#include "drivers/csv/row_reader.h"
#include "drivers/device/device.h"
#include "sample/clock_map.h"

namespace imuscope::csv {

enum class AngularRateUnit : std::uint8_t { kRadps, kDegps };
enum class AccelerationUnit : std::uint8_t { kMps2, kG };

/// How an IMU's CSV file is to be read: names of its columns, their units, and how the file's axes
/// turn into the device's.
struct ImuConfig {
  DeviceIndex device = 0;
  std::string time_column = "t_s";
  double time_unit_s = 1.0;    ///< seconds per unit of the time column
  double time_offset_s = 0.0;  ///< to be added to the times
  /// A minus before a name turns its sign, of gyros and accelerometers alike.
  std::array<std::string, 3> gyro_columns{"gyro_x_radps", "gyro_y_radps", "gyro_z_radps"};
  AngularRateUnit gyro_unit = AngularRateUnit::kRadps;
  std::array<std::string, 3> accel_columns{"accel_x_mps2", "accel_y_mps2", "accel_z_mps2"};
  AccelerationUnit accel_unit = AccelerationUnit::kMps2;
  /// Sample counter, +1 per sample taken; 16- and 32-bit wraps are unwrapped. Empty: the row number counts,
  /// and gaps are seen in the time column.
  std::string counter_column;
  /// Row-major rotation of the file's axes to the device's (b, or s).
  std::array<double, 9> axes{1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0};
  /// Nominal time between rows, to tell gaps; zero: the median of the first rows.
  Duration period{};
  ClockMapConfig clock = ClockMapConfig::fixed({}, 1.0);
};

/// What the numbers of a solution column mean.
enum class SolutionCode : std::uint8_t {
  kRtklib,  ///< 1 fixed, 2 float, 3 and 4 differential, 5 and 6 single
  kNmea,    ///< 0 none, 1 single, 2 and 3 differential, 4 fixed, 5 float
};

/// How the CSV file of a GNSS solution is to be read: names of its columns, latitude and longitude in degrees
/// (WGS-84).
struct GnssConfig {
  DeviceIndex device = 0;
  std::string time_column = "t_s";
  double time_unit_s = 1.0;
  double time_offset_s = 0.0;
  std::string latitude_column = "lat_deg";
  std::string longitude_column = "lon_deg";
  std::string height_column = "height_m";          ///< above the WGS-84 ellipsoid
  std::array<std::string, 3> velocity_columns;     ///< north, east, down m/s; all empty: none
  std::array<std::string, 3> position_sd_columns;  ///< north, east, down m; all empty: none
  std::array<std::string, 3> velocity_sd_columns;  ///< north, east, down m/s; all empty: none
  std::string solution_column;                     ///< empty: none
  SolutionCode solution_code = SolutionCode::kRtklib;
  /// Fixed: the standard deviations of the file, or the configured ones, hold as they are.
  GnssSolution solution_without_column = GnssSolution::kFixed;
  Duration period{};
  ClockMapConfig clock = ClockMapConfig::fixed({}, 1.0);
};

/// Nominal period of rows: as configured, or the median of the first intervals.
class RowPeriod {
 public:
  explicit RowPeriod(Duration configured) noexcept : period_(configured) {}
  /// Rows missing before a row that comes `step` after the one above; 0 while the period is not known.
  std::uint64_t missing(Duration step) noexcept;

 private:
  static constexpr std::size_t kLearn = 15;
  Duration period_;
  std::array<Duration, kLearn> steps_{};
  std::size_t n_steps_ = 0;
};

/// What both devices share: lines to rows, time, counts.
class RowDecoder : public DeviceDecoder {
 public:
  void push(std::span<const std::uint8_t> bytes, Arrival arrival, SampleSink& sink) noexcept final;
  void finish(HostTime arrival, SampleSink& sink) noexcept final;
  [[nodiscard]] const DecoderCounters& counters() const noexcept final { return counters_; }
  [[nodiscard]] double clock_drift_ppm() const noexcept final { return clock_.drift_ppm(); }
  [[nodiscard]] double clock_sd_s() const noexcept final { return clock_.scatter_s(); }

  /// The first mistake of the stream; rows with mistakes give no sample and are counted as bad_contents.
  [[nodiscard]] const RowError& error() const noexcept { return reader_.error(); }
  [[nodiscard]] const RowReader& reader() const noexcept { return reader_; }

 protected:
  /// Column 0 is the time.
  RowDecoder(std::vector<Column> columns, double time_unit_s, double time_offset_s, Duration period,
             const ClockMapConfig& clock, DeviceIndex device);

  /// Fills the sample of a row; false where the row cannot be used (and report() has said why).
  virtual bool fill(std::span<const double> values, std::uint64_t missing_before,
                    Sample& sample) noexcept = 0;

  void report(RowError::Kind kind, std::size_t column, double value) noexcept;
  DecoderCounters counters_;

 private:
  void drain(HostTime arrival, SampleSink& sink, bool at_end) noexcept;
  [[nodiscard]] bool take_row(HostTime arrival, SampleSink& sink) noexcept;

  RowReader reader_;
  ClockMap clock_;
  RowPeriod period_;
  double time_unit_s_;
  double time_offset_s_;
  DeviceIndex device_;
  std::uint64_t sequence_ = 0;
  std::optional<std::int64_t> last_time_ns_;
};

/// Rows of an IMU's file to kImu samples, in SI units and the device's axes.
class ImuDecoder final : public RowDecoder {
 public:
  explicit ImuDecoder(const ImuConfig& config);

 private:
  bool fill(std::span<const double> values, std::uint64_t missing_before, Sample& sample) noexcept override;
  [[nodiscard]] bool take_counter(double value, ImuData& imu) noexcept;

  std::array<double, 9> axes_;
  Vector3 gyro_units_radps_;  ///< by column, with its sign
  Vector3 accel_units_mps2_;
  bool has_counter_;
  std::int64_t row_ = 0;
  std::optional<std::int64_t> last_counter_;  ///< unwrapped
  std::int64_t unwrapped_by_ = 0;
};

/// Rows of a GNSS solution to kGnss samples. A row whose solution code says "none" gives a sample without a
/// valid position.
class GnssDecoder final : public RowDecoder {
 public:
  explicit GnssDecoder(const GnssConfig& config);

 private:
  bool fill(std::span<const double> values, std::uint64_t missing_before, Sample& sample) noexcept override;

  // Index of the first of three columns, 0 where there are none.
  std::size_t velocity_at_ = 0;
  std::size_t position_sd_at_ = 0;
  std::size_t velocity_sd_at_ = 0;
  std::size_t solution_at_ = 0;
  SolutionCode solution_code_;
  GnssSolution solution_without_column_;
};

}  // namespace imuscope::csv
