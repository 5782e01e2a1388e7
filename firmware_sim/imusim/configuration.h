#pragma once

/// The configuration as the simulator sees it: what plays the far end of each [[device]], and the truth in
/// the table [simulation], which imuscope itself does not look at. Everything is SI and radians here.
///
/// Keys of [simulation], all optional:
///   world ("ideal", the default; "harsh": all that imu/imperfections.h draws), duration_s,
///   initial_standstill_s, seed, scenario ("drive", "static"), start_utc, start_latitude_deg,
///   start_longitude_deg, start_height_m, gyro_noise ("by_regime", "static", "dynamic"), regime_switch
///   ("continuous", "independent")
/// [simulation.reference]: class (1 to 5: imu/sensor_classes.h; the keys after it override it),
/// gyro_white_deg_per_sqrt_h, accel_white_ug_per_sqrt_hz, gyro_bias_sd_deg_per_h,
///   accel_bias_sd_mps2, attitude_sd_deg (roll, pitch, heading), latency_ms, alignment_s
/// [simulation.gnss]: position_sd_m, velocity_sd_mps (north, east, down), latency_ms, epoch_error_ms
/// [simulation.wheels]: scale_error_percent, slow_sd_mps, white_sd_mps, step_kmph, dead_band_mps, latency_ms
/// [simulation.can]: bit_rate, bus_load_percent (by others), stamp_jitter_us
/// [simulation.line]: reads ("usb_frames", "ftdi", "messages"), read_jitter_us, host_skew_ppm (of the PC's
///   clock; 0 in the ideal world, drawn in the harsh one), suspend_at_s, suspend_for_s (the PC sleeps: its
///   monotonic clock stands still, and what the devices send is lost)
/// [[simulation.imu]], one for each S-IMU, found by `name`: model ("mtx", "mti"), rotation_vector_b_s_deg,
///   lever_arm_b_m, can_output ("increments", "high_rate", "high_rate_swapped": 061 is the rate of turn),
///   latency_ms, clock_skew_ppm, first_counter, accel_white_mps2, gyro_bias_sd_deg_per_s,
///   accel_bias_sd_mps2, gyro_scale_sd_percent, accel_scale_sd_percent, and instead of what is drawn from
///   those: gyro_bias_deg_per_s, accel_bias_mps2, gyro_scale_percent, accel_scale_percent; and
///   gyro_misalignment_deg, accel_misalignment_deg, g_sensitivity_deg_per_s_per_g (three rows of three),
///   gyro_range_deg_per_s, accel_range_mps2, gyro_step_deg_per_s, accel_step_mps2, gyro_low_pass_hz,
///   accel_low_pass_hz; begin_temperature_degC (where it is given, an MTx on a line of its own sends its
///   temperature with its data), end_temperature_degC, warm_up_s (time constant between the two),
///   gyro_white_log_per_degC and gyro_white_log_per_deg_per_s (change of the logarithm of the gyros'
///   white-noise variance)
/// A mounting that is not given is drawn: 2 deg and 0.3 m, one sigma per axis.

#include <Eigen/Core>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "firmware_sim/devices/can_encoder.h"
#include "firmware_sim/devices/utc.h"
#include "firmware_sim/faults/fault.h"
#include "firmware_sim/imu/imperfections.h"
#include "firmware_sim/imu/sensor_classes.h"
#include "firmware_sim/imu/wheel_speed.h"
#include "firmware_sim/imusim/failure.h"
#include "firmware_sim/io/can_line.h"
#include "firmware_sim/io/serial_line.h"
#include "firmware_sim/motion/motion.h"

namespace imusim {

enum class Role { kReference, kStudy, kGnss, kOdometry, kTime };
enum class Protocol {
  kXsensMt,
  kIxblueStdbin,
  kGreis,
  kNmea,
  kUbx,
  kRtklibPos,
  kXsensCan,
  kCanOdometry,
  kPps
};
/// Which XSens device plays an S-IMU: an MTx with legacy MTData, or an MTi with MTData2.
enum class XsensModel { kMtx, kMti };

struct PlayedDevice {
  std::string name;
  Role role = Role::kStudy;
  Protocol protocol = Protocol::kXsensMt;
  double rate_hz = 100.0;
  std::string port;            ///< of a serial line; empty where the configuration names none
  std::string address;         ///< tcp: of this PC, where a server plays the device; udp: where it sends to
  std::uint16_t tcp_port = 0;  ///< 0: no TCP server
  std::uint16_t udp_port = 0;  ///< 0: no datagrams
  int bus_id = 0;              ///< place behind an Xbus Master, from 1; 0: the device has a line of its own
  std::string line_owner;     ///< the first device behind the same Xbus Master; its own name where it is that
  std::string can_interface;  ///< of a device on a CAN bus
  std::string dbc;            ///< kCanOdometry: the file that the configuration names
  int baud = 115200;
  Eigen::Matrix3d C_device_frame = Eigen::Matrix3d::Identity();  ///< rotates the device's axes to b or s
  Eigen::Vector3d antenna_b_m = Eigen::Vector3d::Zero();

  [[nodiscard]] bool is_on_network() const { return tcp_port != 0 || udp_port != 0; }
  /// It is no bytes that it gives but pulses: `port` is where the newest lies, live.
  [[nodiscard]] bool gives_pulses() const { return protocol == Protocol::kPps; }
  /// Its data come over the line of another device.
  [[nodiscard]] bool shares_line() const { return bus_id > 0 && line_owner != name; }
};

struct ReferenceSimulation {
  ReferenceClass noise;
  Eigen::Vector3d attitude_sd_rad;  ///< roll, pitch, heading
  double latency_s = 0.001;
  double alignment_s = 0.0;
};

struct GnssSimulation {
  Eigen::Vector3d position_sd_m{0.01, 0.01, 0.02};
  Eigen::Vector3d velocity_sd_mps{0.02, 0.02, 0.03};
  double latency_s = 0.040;
  double epoch_error_s = 0.0;  ///< a solution is of so much later than its epoch says
};

/// The four wheels of the vehicle, whose rear axle is under the R-IMU.
struct WheelSimulation {
  WheelErrors errors;
  double latency_s = 0.002;
};

struct SImuSimulation {
  std::string name;
  XsensModel model = XsensModel::kMtx;
  MtiOutput can_output = MtiOutput::kIncrements;
  std::optional<Eigen::Vector3d> rotation_vector_b_s_rad;
  std::optional<Eigen::Vector3d> r_bs_b_m;
  double latency_s = 0.002;
  std::optional<double> clock_skew_ppm;        ///< drawn within +-30 where absent
  std::optional<std::uint16_t> first_counter;  ///< drawn where absent
  MtxClass draw;
  // Taken instead of what is drawn.
  std::optional<Eigen::Vector3d> gyro_bias_radps;
  std::optional<Eigen::Vector3d> accel_bias_mps2;
  std::optional<Eigen::Vector3d> gyro_scale;
  std::optional<Eigen::Vector3d> accel_scale;
  /// Misalignment, g-sensitivity, range, quantisation and low-pass; noise, bias and scale of these two are
  /// not used.
  TriadErrors gyro;
  TriadErrors accel;
  std::optional<Temperature> temperature;
  NoiseDependence gyro_white;
};

struct Configuration {
  std::filesystem::path file;
  std::string text;
  std::string run_name;
  std::string channel_prefix = "IMUSCOPE";
  std::vector<PlayedDevice> devices;
  WorldKind world = WorldKind::kIdeal;
  Scenario scenario;
  Utc utc_begin;
  ReferenceSimulation reference;
  GnssSimulation gnss;
  WheelSimulation wheels;
  CanLineOptions can;
  LineOptions line;                     ///< all but the baud rate
  bool has_pc_rate = false;             ///< line.clock has a rate that is given, not drawn
  std::vector<SImuSimulation> studies;  ///< one for each device with role study, in its order
  std::vector<Fault> faults;            ///< of a fault script
  std::string fault_text;               ///< the script as read; empty where there is none

  [[nodiscard]] static bool is_on_can(const PlayedDevice& device) {
    return device.protocol == Protocol::kXsensCan || device.protocol == Protocol::kCanOdometry;
  }
  [[nodiscard]] std::vector<Fault> faults_of(const std::string& device) const;
};

/// Reads and checks a configuration file.
Outcome<Configuration> load_configuration(const std::filesystem::path& file);

/// The same for a text; `file` stands for it in messages.
Outcome<Configuration> parse_configuration(const std::string& text, const std::filesystem::path& file);

}  // namespace imusim
