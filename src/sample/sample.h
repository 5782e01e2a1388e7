#pragma once

/// What a device said, in SI and in its own declared axes, stamped. A sample is the unit that crosses from an
/// I/O thread to the estimator, so it is trivially copyable and holds no Eigen type.
///
/// Axes: for the R-IMU, b = forward-right-down after the configured axes rotation; for an S-IMU, s = the
/// sensor's own axes after the configured rotation (identity by default).

#include <array>
#include <cstdint>
#include <type_traits>

#include "base/time.h"

namespace imuscope {

/// Index of a device in the order of the configuration.
using DeviceIndex = std::uint8_t;

using Vector3 = std::array<double, 3>;

enum class SampleKind : std::uint8_t { kImu, kGnss, kAttitude, kOdometry, kPulse, kSteering };

/// Bits of ImuData::flags.
enum ImuFlag : std::uint32_t {
  kGyroValid = 1U << 0U,
  kAccelValid = 1U << 1U,
  /// Axis at the end of its range in this sample (x, y, z).
  kGyroClipX = 1U << 2U,
  kGyroClipY = 1U << 3U,
  kGyroClipZ = 1U << 4U,
  kAccelClipX = 1U << 5U,
  kAccelClipY = 1U << 6U,
  kAccelClipZ = 1U << 7U,
  /// The device's counter says that samples are missing between this one and the one before.
  kGapBefore = 1U << 8U,
  /// Rate and force are means over the sample interval (increments / dt), centred half an interval earlier.
  kIsIncrement = 1U << 9U,
  /// angular_acceleration_radps2 is given by the device.
  kHasAngularAcceleration = 1U << 10U,
  /// temperature_degC was part of the message; devices send it with every sample, or now and then.
  kHasTemperature = 1U << 11U,
};

/// One IMU sample. Times of validity are in Sample.
struct ImuData {
  Vector3 omega_radps;                  ///< angular rate relative to inertial, resolved in the device's axes
  Vector3 f_mps2;                       ///< specific force (-g at rest, i.e. upwards), same axes
  Vector3 angular_acceleration_radps2;  ///< only with kHasAngularAcceleration
  std::int64_t counter;                 ///< the device's sample counter, unwrapped; +1 per sample taken
  std::uint32_t flags;                  ///< ImuFlag bits
  float temperature_degC;               ///< of the sensor; only with kHasTemperature
};

enum class GnssSolution : std::uint8_t { kNone, kSingle, kDifferential, kFloat, kFixed };

/// Bits of GnssData::flags.
enum GnssFlag : std::uint32_t {
  kPositionValid = 1U << 0U,
  kVelocityValid = 1U << 1U,
  /// The receiver gave standard deviations; otherwise the configured ones are to be used.
  kHasPositionSd = 1U << 2U,
  kHasVelocitySd = 1U << 3U,
};

/// One GNSS solution, at the antenna.
struct GnssData {
  double latitude_rad;
  double longitude_rad;
  double height_m;          ///< above the WGS-84 ellipsoid
  Vector3 v_n_mps;          ///< velocity relative to the Earth, north-east-down
  Vector3 sd_position_m;    ///< north, east, down
  Vector3 sd_velocity_mps;  ///< north, east, down
  GnssSolution solution;
  std::uint32_t flags;  ///< GnssFlag bits
};

/// Bits of AttitudeData::flags.
enum AttitudeFlag : std::uint32_t {
  kRollPitchValid = 1U << 0U,
  /// Not set while the unit aligns: its heading is meaningless then.
  kHeadingValid = 1U << 1U,
  kHasAttitudeSd = 1U << 2U,
};

/// The R-IMU's own attitude solution, of its forward-right-down axes relative to NED.
struct AttitudeData {
  double roll_rad;
  double pitch_rad;
  double heading_rad;   ///< clockwise from true north, [0, 2 pi)
  Vector3 sd_rpy_rad;   ///< roll, pitch, heading
  std::uint32_t flags;  ///< AttitudeFlag bits
};

/// Bits of OdometryData::flags.
enum OdometryFlag : std::uint32_t {
  /// The wheels do not tell forward from backward: speed_mps is a magnitude.
  kSpeedHasNoSign = 1U << 0U,
};

/// Speed of the vehicle over ground as its wheels show it.
struct OdometryData {
  double speed_mps;     ///< forward, mean of the wheels that were chosen
  std::uint32_t flags;  ///< OdometryFlag bits
};

/// A pulse that marks a whole second of UTC; Sample.time is when the kernel stamped it.
struct PulseData {
  std::int64_t wall_ns;  ///< CLOCK_REALTIME of the same instant
};

/// How the PC steers the clock that stamps everything: from Sample.time on along a line.
struct SteeringData {
  std::int64_t unsteered_ns;  ///< the quartz left alone (CLOCK_MONOTONIC_RAW) at that instant
  double rate;                ///< its seconds in one of the host's clock, minus 1
};

struct Sample {
  SampleKind kind;
  DeviceIndex device;
  bool has_utc;            ///< utc is meaningful
  std::uint64_t sequence;  ///< counts the samples of this device, from 0
  HostTime arrival;        ///< of the read that completed the sample's frame
  HostTime time;           ///< time of validity, on the host's time scale as the device's clock map gives it
  UtcTime utc;             ///< time of validity as tagged by the device
  union {
    ImuData imu;
    GnssData gnss;
    AttitudeData attitude;
    OdometryData odometry;
    PulseData pulse;
    SteeringData steering;
  };
};

static_assert(std::is_trivially_copyable_v<Sample>);

/// Where a decoder puts what it decoded. Implementations on the real-time side push into a ring.
class SampleSink {
 public:
  virtual ~SampleSink() = default;
  /// Called in stream order. Must not block, allocate or throw on a real-time thread.
  virtual void on_sample(const Sample& sample) noexcept = 0;
};

}  // namespace imuscope
