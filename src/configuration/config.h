#pragma once

/// The configuration of a run, read from TOML. Keys name their units; here everything is SI and radians.
/// Unknown keys and impossible values are refused with file, line and the nearest valid key. Everything but
/// the devices has a default that works for three MTx and an Airins.

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "base/result.h"
#include "configuration/config_vehicle.h"
#include "configuration/protocols.h"
#include "estimation/regimes/motion_regimes.h"
#include "sample/sample.h"

namespace imuscope {

struct AskedKey;

/// Name of a role as the configuration writes it.
std::string_view name_of(DeviceRole role);

/// How the bytes come in. `port` is empty for a device that only exists as a file given on the command line.
struct SerialConfig {
  std::string port;
  std::uint32_t baud = 115200;
  int stop_bits = 1;
};

/// A CAN interface, which devices share: each hears the identifiers that it needs.
struct CanConfig {
  std::string interface;
  /// Of logs (candump): true where their stamps are of the reference's clock, not UTC.
  bool log_has_common_clock = false;
};

/// A PPS device of the kernel.
struct PpsConfig {
  std::string port;         ///< its path
  bool clear_edge = false;  ///< the second begins at the clear edge, not at the assert edge
};

/// The same over a network: a TCP server that we connect to, or UDP datagrams that are sent to us.
struct NetConfig {
  bool udp = false;
  std::string host;  ///< UDP: empty, or the multicast group or own address that datagrams are sent to
  std::uint16_t port = 0;
};

/// Of an XSens device.
struct XsensConfig {
  /// Behind an Xbus Master, from 1; 0: the device has its line for itself.
  int bus_id = 0;
  int bus_size = 0;  ///< devices behind the same Xbus Master
  /// That the device must have; refused otherwise.
  std::optional<std::uint32_t> device_id;
  /// Settings of the SyncIn input, in the device's own terms; see xsens::SyncIn.
  struct SyncIn {
    std::uint16_t mode = 0;
    std::uint16_t skip = 0;
    std::uint32_t offset = 0;
  };
  std::optional<SyncIn> sync_in;
};

/// What the filter is told of an IMU's errors, where it differs from the estimator's defaults (a
/// navigation-grade reference, MTx-class S-IMUs). White noise is per sample at the device's rate.
struct ImuNoiseConfig {
  std::optional<double> gyro_white_sd_radps;         ///< replaces the default model's fast processes too
  std::optional<double> gyro_white_sd_static_radps;  ///< at rest; the one in motion where absent
  std::optional<double> gyro_bias_sd_radps;          ///< turn-on bias, 1 sigma
  std::optional<double> gyro_gm_sd_radps;            ///< stationary sd of the slow Gauss-Markov bias
  std::optional<double> gyro_gm_tau_s;               ///< its correlation time
  std::optional<double> accel_white_sd_mps2;
  std::optional<double> accel_white_sd_static_mps2;
  std::optional<double> accel_bias_sd_mps2;
  std::optional<double> accel_gm_sd_mps2;
  std::optional<double> accel_gm_tau_s;
  std::optional<double> gyro_scale_sd;  ///< 1 sigma, fraction
  std::optional<double> accel_scale_sd;
};

/// What the maker's data sheet says of an IMU under study: `imuscope evaluate` holds it against fitted
/// models.
struct DataSheetConfig {
  std::optional<double> gyro_density_radps_per_sqrt_hz;
  std::optional<double> gyro_bias_stability_radps;  ///< 1 sigma of what wanders
  std::optional<double> accel_density_mps2_per_sqrt_hz;
  std::optional<double> accel_bias_stability_mps2;
  /// Sheets do not say how fast a bias wanders; filters are commonly tuned with an hour's third.
  double bias_time_s = 1000.0;
};

/// What is known of a mounting beforehand. Without a rotation the estimator finds the mounting by itself.
struct MountingPriorConfig {
  std::optional<std::array<double, 9>> C_b_s;  ///< row-major
  std::optional<double> boresight_sd_rad;
  Vector3 r_bs_b_m{};
  std::optional<double> lever_arm_sd_m;
  std::optional<double> time_offset_s;  ///< to be added to the S time; searched for where absent
  std::optional<double> time_offset_sd_s;
  /// Given: the accelerometer triad has a boresight / a time offset of its own, of this sd against the
  /// gyro's.
  std::optional<double> accel_boresight_sd_rad;
  std::optional<double> accel_time_offset_sd_s;
  double creep_rad_per_sqrt_s = 0.0;  ///< of the mount; 0: rigid
};

/// Columns of a CSV device. See drivers/csv.
struct CsvConfig {
  std::string time_column = "t_s";
  double time_unit_s = 1.0;    ///< seconds that one unit of the time column is
  double time_offset_s = 0.0;  ///< to be added to the times of the file
  std::array<std::string, 3> gyro_columns{"gyro_x_radps", "gyro_y_radps", "gyro_z_radps"};
  std::array<std::string, 3> accel_columns{"accel_x_mps2", "accel_y_mps2", "accel_z_mps2"};
  bool gyro_in_degps = false;
  bool accel_in_g = false;
  std::string counter_column;  ///< empty: the row number counts
  std::string latitude_column = "lat_deg";
  std::string longitude_column = "lon_deg";
  std::string height_column = "height_m";
  std::array<std::string, 3> velocity_columns;     ///< north, east, down; empty: none
  std::array<std::string, 3> position_sd_columns;  ///< north, east, down; empty: none
  bool common_clock = true;  ///< false: the file's times are of a clock of its own, brought to the reference
};

/// When a message of a file of many topics was valid.
enum class MessageTime : std::uint8_t {
  kHeader,   ///< its header's stamp
  kLog,      ///< when it was recorded
  kPublish,  ///< when it was sent
};

/// Messages of a topic as a device (is_message_log() in protocols.h).
struct MessagesConfig {
  std::string topic;           ///< empty: the only one of a type that the role needs
  std::string velocity_topic;  ///< gnss: a twist, east-north-up, at the times of the positions; empty: none,
                               ///< of a flight controller the one beside the topic
  std::string frame_id;        ///< messages of another frame are passed over; empty: all are taken
  MessageTime time = MessageTime::kHeader;
  bool times_are_utc = false;
  bool common_clock = true;  ///< false: times are of a clock of its own, brought to the reference
};

/// What a device of role gnss has beside the rest: the antenna's place in b, and how far its numbers are
/// believed.
struct GnssOptions {
  Vector3 antenna_lever_arm_b_m{};       ///< from the R-IMU to the antenna
  double antenna_lever_arm_sd_m = 0.02;  ///< of each axis
  Vector3 position_sd_m{};               ///< north, east, down; where the receiver gives none
  Vector3 velocity_sd_mps{};             ///< likewise
  double position_sd_floor_m = 0.0;      ///< of each axis: a receiver that claims less is not believed
  double velocity_sd_floor_mps = 0.0;
  double latency_s = 0.0;  ///< of the stamps, where no UTC brings them to the reference's time
  double latency_sd_s = 0.1;
  std::optional<double> geoid_separation_m;  ///< nmea: for receivers that send none
  bool common_clock = false;  ///< rtklib_pos: the lines' times are the reference's, where no stamps say more
  std::optional<Vector3> base_lat_lon_height;  ///< rtklib_pos: deg, deg, m; for east-north-up solutions
};

struct DeviceConfig {
  std::string name;
  DeviceRole role{};
  Protocol protocol{};
  double rate_hz = 0.0;
  std::array<double, 9> axes{1, 0, 0, 0, 1, 0, 0, 0, 1};  ///< rotates the device's components, row-major
  std::optional<SerialConfig> serial;
  std::optional<CanConfig> can;
  std::optional<NetConfig> net;
  std::optional<PpsConfig> pps;
  /// The device whose line also carries this one's bytes: itself, or another one behind the same Xbus Master.
  std::size_t line_owner = 0;
  XsensConfig xsens;
  ImuNoiseConfig noise;        ///< reference and study
  MountingPriorConfig prior;   ///< study
  DataSheetConfig data_sheet;  ///< study
  int average_samples = 0;     ///< study: samples from one update to the next, see SImuConfig
  CsvConfig csv;               ///< csv_imu, csv_gnss
  MessagesConfig messages;     ///< mcap, rosbag, ulog, dataflash
  GnssOptions gnss;            ///< gnss
  OdometryOptions odometry;    ///< odometry
  xsens_can::ItemIds xsens_can_ids = xsens_can::default_ids();  ///< xsens_can
};

/// States of an S-IMU in the filter.
enum class FilterStates : std::uint8_t {
  kFull,   ///< with all that data sheets allow its axes, places and delays to be
  kRigid,  ///< boresight, lever arm, biases, time offset, scales: axes are straight
  kPaper,  ///< the paper's six
};

/// [estimator]: which states the filter has.
struct EstimatorOptions {
  FilterStates states = FilterStates::kFull;
  bool batch_mounting = true;     ///< a study publishes the batch estimate's mounting, not the filter's
  bool navigation = true;         ///< R-IMU/GNSS navigation; needs a gnss device
  int differentiator_points = 5;  ///< of the reference: 5, 7, 9 or 11
};

/// [noise]: which models are fitted to the error process, live how often, and whether the filter uses them.
struct NoiseOptions {
  std::string model = "WN+2*GM";
  double refit_interval_s = 60.0;
  bool remove_scale_error = true;  ///< from the error process before models are fitted
  bool apply_to_filter = false;    ///< live refits replace the estimator's noise model (noise_feedback.h)
};

/// What the regimes of a study are, see regimes/.
enum class RegimesBy : std::uint8_t { kMotion, kIntensity, kLabels };

/// [regimes]: what a study tells regimes apart by; `intensity`, `bins` and `block_s` count with kIntensity
/// only.
struct RegimeOptions {
  RegimesBy by = RegimesBy::kMotion;
  MotionLimits limits;
  Intensity intensity = Intensity::kRate;
  int bins = 3;
  double block_s = 10.0;
  double window_s = 20.0;  ///< of the fits that parameters are held against the dynamics with
};

/// [error_process]: how errors are made comparable between sensors.
struct ErrorProcessOptions {
  double low_pass_hz = 0.0;  ///< corner of the common low-pass of errors and prediction; 0: none
};

/// [virtual_imu]: an S-IMU that a virtual one is made of.
struct VirtualImuMember {
  std::size_t device = 0;        ///< index of the S-IMU
  std::array<double, 3> gyro{};  ///< weights by axis of b; over all members their sum is one
  std::array<double, 3> accel{};
};

/// [lcm]: where and under which names results are published.
struct LcmOptions {
  std::string url = "udpm://239.255.76.67:7667?ttl=0";
  std::string channel_prefix = "IMUSCOPE";
  bool bridge = false;  ///< publishes pose_t and ins_t, too
};

/// [record]: where live runs go, and how long they stay.
struct RecordOptions {
  std::string folder;   ///< where live runs are recorded; relative to the working folder
  double sync_s = 0.5;  ///< a cut of the power costs what came in this time and while it was written
  /// A capture goes on in another file when one is this large or this old.
  double file_bytes = 2e9;
  double file_s = 3600.0;
  bool mcap = false;  ///< run.mcap beside the capture, for other people's tools
  /// Runs that are over and not marked kept are removed, oldest first: those that ended longer ago than
  /// this, while all together are larger than this, and while less of the disk is free than this. Absent: never.
  std::optional<double> remove_older_than_s;
  std::optional<double> remove_beyond_bytes;
  std::optional<double> remove_below_free_bytes;
};

/// [metrics]: numbers of a running service for a monitoring system. Without a port there are none.
struct MetricsOptions {
  std::string address = "127.0.0.1";
  std::uint16_t port = 0;
};

/// Processor cores that the core's threads keep to; empty: any.
struct ThreadOptions {
  std::vector<int> io_cores;
  std::vector<int> estimator_cores;
};

/// A whole configuration, checked when it was read. DeviceIndex counts `devices`; the other tables hold their
/// defaults where the file leaves them out.
struct Configuration {
  std::string run_name;
  std::filesystem::path file;
  std::string text;    ///< as read, and the files that it names as [attached]
  std::string sha256;  ///< of the text
  std::vector<DeviceConfig> devices;
  EstimatorOptions estimator;
  NoiseOptions noise;
  RegimeOptions regimes;
  ErrorProcessOptions error_process;
  std::vector<VirtualImuMember> virtual_imu;  ///< empty: there is none
  LcmOptions lcm;
  RecordOptions record;
  MetricsOptions metrics;
  ThreadOptions threads;

  [[nodiscard]] const DeviceConfig* find(std::string_view name) const;
  [[nodiscard]] std::size_t reference_index() const;
  [[nodiscard]] std::vector<std::size_t> study_indices() const;
  [[nodiscard]] std::optional<std::size_t> gnss_index() const;
  [[nodiscard]] std::optional<std::size_t> odometry_index() const;
};

/// Reads and checks a configuration file.
Result<Configuration> load_configuration(const std::filesystem::path& file);

/// The same for a text that was kept in a capture; `name` stands for the file in messages.
/// @param asked  receives every key that was asked for (config_reference.h); may be null
Result<Configuration> parse_configuration(const std::string& text, const std::filesystem::path& name,
                                          std::vector<AskedKey>* asked = nullptr);

}  // namespace imuscope
