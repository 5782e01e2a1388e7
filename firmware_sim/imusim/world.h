#pragma once

/// The simulated world of a configuration: one motion, and every device with its errors, its clock and its
/// line. Truth comes from here too, as nothing else knows it.

#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "firmware_sim/devices/device.h"
#include "firmware_sim/devices/xsens_encoder.h"
#include "firmware_sim/imu/imu_model.h"
#include "firmware_sim/imusim/configuration.h"
#include "firmware_sim/io/can_line.h"
#include "firmware_sim/io/pulse_line.h"
#include "firmware_sim/io/serial_line.h"
#include "firmware_sim/motion/motion.h"

namespace imusim {

/// The host's monotonic clock at the scenario's beginning: a PC that has been up for a while.
inline constexpr std::int64_t kHostBegin_ns = 1'000'000'000'000;

/// One sample of an S-IMU as it was made.
struct TrueSample {
  double t_s;
  std::int64_t counter;  ///< not wrapped
  ImuReading reading;
  Regime regime;
};
using OnTrueSample = std::function<void(const TrueSample&)>;

/// What is true of one S-IMU.
struct SImuTruth {
  std::string name;
  Mounting mounting;
  ImuErrors errors;
  double latency_s = 0.0;       ///< from the sampling instant to the first bit on the line
  double clock_skew_ppm = 0.0;  ///< positive: samples more often than its nominal rate
  double first_sample_s = 0.0;  ///< instant of the sample with first_counter
  double period_s = 0.0;        ///< between two samples, its clock's skew included
  std::uint16_t first_counter = 0;
  XsensModel model = XsensModel::kMtx;
  MtiOutput can_output = MtiOutput::kIncrements;
  bool sends_temperature = false;
};

/// What is true of the R-IMU.
struct ReferenceTruth {
  std::string name;
  ImuErrors errors;
  double first_sample_s = 0.0;  ///< instant of a sample
  double period_s = 0.0;        ///< to the next one, its clock's skew included
};

/// A device, or all those behind one Xbus Master under the name of the first.
struct WorldDevice {
  PlayedDevice played;
  std::unique_ptr<Device> device;
};

/// What one MTx behind an Xbus Master measures.
using XbusSampler = std::function<xsens::MtSample(double t_s, std::int64_t counter)>;

/// An Xbus Master's line, while its devices are being found.
struct XbusLine {
  PlayedDevice owner;
  SImuTruth clock;  ///< the head's, which all share
  std::map<int, XbusSampler> by_bus_id;
};

class World {
 public:
  /// Devices as they are when a recording begins: set up and measuring from time 0 (kStreaming), or just
  /// powered on at `begin_s` (kPoweredOn).
  enum class Beginning { kStreaming, kPoweredOn };

  World(const Configuration& configuration, Beginning beginning, double begin_s = 0.0);

  [[nodiscard]] const Configuration& configuration() const { return configuration_; }
  [[nodiscard]] const Motion& motion() const { return *motion_; }
  [[nodiscard]] std::vector<WorldDevice>& devices() { return devices_; }
  [[nodiscard]] const std::vector<SImuTruth>& studies() const { return studies_; }
  [[nodiscard]] const ReferenceTruth& reference() const { return reference_; }

  /// Latency of the R-IMU, from the sampling instant to the first bit on the line.
  [[nodiscard]] double reference_latency_s() const { return configuration_.reference.latency_s; }
  /// Instant of the R-IMU's first sample at or after the beginning: what time_s counts from.
  [[nodiscard]] double first_reference_sample_s() const { return first_reference_sample_s_; }

  /// The clock of the PC that reads the devices.
  [[nodiscard]] const PcClock& pc_clock() const { return configuration_.line.clock; }

  /// The line of a device to the host.
  [[nodiscard]] SerialLine line_of(const PlayedDevice& played) const;

  /// The way of a device on a CAN bus to the host.
  [[nodiscard]] CanLine can_line_of(const PlayedDevice& played) const;

  /// The way of a pulse into the PC: of a recording, or live, where the PC is a real one.
  [[nodiscard]] PulseLine pulse_line_of(const PlayedDevice& played) const;
  [[nodiscard]] PulseLine live_pulse_line_of(const PlayedDevice& played, std::int64_t host_begin_ns) const;

  /// Has every sample of an S-IMU shown as it is made, in the thread that runs the device.
  void observe(const std::string& name, OnTrueSample on_sample);

 private:
  void add(const PlayedDevice& played, std::unique_ptr<Device> device);
  void add_study(const PlayedDevice& played, const SImuSimulation& study, Beginning beginning,
                 double begin_s);
  void add_reference(const PlayedDevice& played, Beginning beginning, double begin_s);
  void add_gnss(const PlayedDevice& played, double begin_s);
  void add_pulses(const PlayedDevice& played, double begin_s);
  void add_wheels(const PlayedDevice& played, double begin_s);
  void join_bus(const PlayedDevice& played, XbusSampler sampler, const SImuTruth& clock);
  void add_buses(Beginning beginning, double begin_s);
  void add_imu(const PlayedDevice& played, const std::shared_ptr<ImuModel>& imu, const SImuTruth& clock,
               Beginning beginning, double begin_s);

  Configuration configuration_;
  std::shared_ptr<const Motion> motion_;
  std::vector<WorldDevice> devices_;
  std::vector<XbusLine> buses_;
  std::vector<SImuTruth> studies_;
  ReferenceTruth reference_;
  std::vector<std::pair<std::string, std::shared_ptr<OnTrueSample>>> observers_;
  double first_reference_sample_s_ = 0.0;
};

/// Refuses a fault script that leaves out blocks which a device does not have.
Outcome<void> check_faults(World& world);

/// The instant on the R-IMU's time scale that an S-IMU's sample shows is its stamp plus this, where both
/// stamps are the host times of the first bit of a message: z_S(t) = h(R at t + t_d). For a motion that is
/// slow beside the low-passes of both gyro triads.
inline double true_time_offset_s(const World& world, const SImuTruth& study) {
  return world.reference_latency_s() + slow_delay_s(world.reference().errors.gyro) - study.latency_s -
         slow_delay_s(study.errors.gyro);
}

/// The same of the accelerometers, less that of the gyros.
inline double true_accel_time_offset_s(const World& world, const SImuTruth& study) {
  const ImuErrors& reference = world.reference().errors;
  return slow_delay_s(reference.accel) - slow_delay_s(reference.gyro) -
         (slow_delay_s(study.errors.accel) - slow_delay_s(study.errors.gyro));
}

}  // namespace imusim
