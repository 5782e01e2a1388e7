#include "configuration/config_reference.h"

#include <fmt/format.h>
#include <algorithm>
#include <array>
#include <utility>

#include "configuration/config.h"
#include "configuration/toml_reader.h"

namespace imuscope {

namespace {

/// Between them these configurations lead the readers through every one of their branches. What they lack
/// (ports, the DBC file) does not keep a reader from asking.
constexpr std::string_view kReferenceAndStudy = R"(
[[device]]
name = "reference"
role = "reference"
protocol = "ixblue_stdbin"
transport = { kind = "tcp", host = "airins", port = 8111 }
[[device]]
name = "mtx"
role = "study"
protocol = "xsens_mt"
transport = { kind = "serial", port = "/dev/ttyUSB0" }
sync_in = { mode = 0 }
)";
constexpr std::array<std::string_view, 7> kDevices{R"(
[[device]]
name = "dot"
role = "study"
protocol = "csv_imu"
[[device]]
name = "gnss"
role = "gnss"
protocol = "csv_gnss"
)",
                                                   R"(
[[device]]
name = "bag"
role = "study"
protocol = "mcap"
[[device]]
name = "gnss"
role = "gnss"
protocol = "mcap"
)",
                                                   R"(
[[device]]
name = "mti"
role = "study"
protocol = "xsens_can"
transport = { kind = "can", interface = "can0" }
)",
                                                   R"(
[[device]]
name = "gnss"
role = "gnss"
protocol = "nmea"
transport = { kind = "udp", port = 5000 }
)",
                                                   R"(
[[device]]
name = "gnss"
role = "gnss"
protocol = "rtklib_pos"
base_lat_lon_height = [46.0, 7.0, 500.0]
)",
                                                   R"(
[[device]]
name = "pps"
role = "time"
protocol = "pps"
transport = { kind = "pps", port = "/dev/pps0" }
)",
                                                   R"(
[[device]]
name = "wheels"
role = "odometry"
protocol = "can_odometry"
odometry = { dbc = "vehicle.dbc", speed_signals = ["WHEELS.RL"] }
)"};

using KeySentence = std::pair<std::string_view, std::string_view>;
constexpr auto kSentences = std::to_array<KeySentence>({
    {"run.name",
     "What the run is called in its files. Without it: the name of the configuration's file, which is "
     "`reference` on this page."},
    {"estimator.states",
     "`full`: boresight, lever arm, biases, time offset and scales of every S-IMU, and what data sheets "
     "allow it besides: crooked axes, accelerometers that are turned, late and apart, gyros that feel "
     "forces. `rigid`: without these, for sensors that are known to have none; sd are too small where they "
     "have. `paper`: the six states of the published method, for comparison."},
    {"estimator.mounting",
     "What `process` publishes of a mounting. `batch`: an estimate of the whole drive in which nobody knows "
     "the true motion; it learns the noise, so that it needs no `[device.noise]`, and its sd hold what "
     "crooked axes and the reference's own errors leave open. `filter`: the filter's end value, which is as "
     "good as the configured noise; with `states = \"paper\"` the default."},
    {"estimator.navigation",
     "Navigation of the R-IMU with GNSS. Without it (or without a receiver) the mounting is calibrated all "
     "the same, from the two IMUs alone."},
    {"estimator.differentiator_points",
     "Samples of the reference from which its angular acceleration is found: 5, 7, 9 or 11. What an update "
     "averages decides more, so that this may stay as it is."},
    {"noise.model",
     "Noise model that is fitted to every axis and regime: a sum of WN, QN, RW, DR, GM, such as `WN+2*GM`."},
    {"noise.refit_interval_s", "Live: from one refit to the next, seconds."},
    {"noise.remove_scale_error",
     "Takes the estimated scale errors out of the error process before noise is fitted to it."},
    {"noise.apply_to_filter",
     "Live: models that pass their checks go back to the filter, when they have moved."},
    {"lcm.url", "Where results are published. `ttl=0` stays on this PC, `ttl=1` reaches its network."},
    {"lcm.channel_prefix", "What the channels' names begin with."},
    {"lcm.bridge", "Publishes the widespread `pose_t` and `ins_t`, too."},
    {"regimes.by",
     "What a study tells regimes apart by: `motion` finds static and dynamic, `intensity` splits the dynamic "
     "part, `labels` are what a person named by messages on IMUSCOPE_EVENT while it was recorded. `process "
     "--labels FILE` comes before all of them."},
    {"regimes.motion_speed_mps", "A speed above this is motion; rest is below half of it."},
    {"regimes.motion_rate_deg_per_s", "The same for the spread of the angular rate within half a second."},
    {"regimes.motion_force_mps2", "The same for the spread of the specific force."},
    {"regimes.motion_vibration_mps2",
     "The same for vibration, rms; six times as much where the speed is zero."},
    {"regimes.shortest_static_s",
     "A shorter stop belongs neither to rest nor to the drive, seconds. Stops are found from one second on."},
    {"regimes.guard_s",
     "So many seconds on both sides of a change between rest and motion belong to neither."},
    {"regimes.intensity", "With `intensity`: what it is measured by."},
    {"regimes.bins", "With `intensity`: bins, each with as much of the drive as the others."},
    {"regimes.block_s", "With `intensity`: the drive is looked at in blocks of so many seconds."},
    {"regimes.window_s",
     "Noise parameters are held against rate, vibration, speed and temperature "
     "over windows of so many seconds."},
    {"error_process.low_pass_hz",
     "A low-pass for errors and reference alike, so that sensors of different bandwidth compare; 0 is none. "
     "At most 0.4 of the slowest S-IMU's rate."},
    {"virtual_imu.imus",
     "Live, and in a replay with `--lcm`: the weighted mean of these S-IMUs, in the axes of the reference, is "
     "published on `IMUSCOPE_VIRTUAL`. Two or more of role `study`."},
    {"virtual_imu.gyro_x",
     "Their weights, in the order of `imus`; the sum is 1. `imuscope correlate` writes this table with the "
     "weights of the quietest mean. Without it all weigh the same. Negative ones are possible."},
    {"virtual_imu.gyro_y", "Likewise."},
    {"virtual_imu.gyro_z", "Likewise."},
    {"virtual_imu.accel_x", "Likewise."},
    {"virtual_imu.accel_y", "Likewise."},
    {"virtual_imu.accel_z", "Likewise."},
    {"record.folder",
     "Where live runs are recorded, relative to the working folder; each makes a folder `NAME-TIME` there. "
     "Without it: `runs`. `--out` comes first."},
    {"record.mcap",
     "Live: writes run.mcap into the run's folder, too, for Foxglove, PlotJuggler and rosbag2 "
     "(docs/doors.md). The capture stays the record of the run."},
    {"record.sync_s",
     "Live: what was recorded is on the disk after so many seconds, and safe from the ignition key then. A "
     "cut of the power costs this and the time that the disk takes to write it."},
    {"record.file_gb", "A capture goes on in another file when one has this size."},
    {"record.file_hours", "The same when one is as old."},
    {"record.remove_older_than_days",
     "Live: runs in the folder that ended longer ago are removed. Never one that `imuscope keep` marked, "
     "one that is being recorded, or a folder that no live run made. Without it: none."},
    {"record.remove_beyond_gb",
     "Live: the oldest runs are removed while all together are larger. Without it: none."},
    {"record.remove_below_free_gb",
     "Live: the oldest runs are removed while less of the disk is free. Without it: none."},
    {"metrics.port",
     "Live: numbers of the service for Prometheus, at "
     "`http://ADDRESS:PORT/metrics` (docs/metrics.md). 0: none."},
    {"metrics.address",
     "Where they are offered: an address of this PC in numbers. Beyond a loopback address everybody "
     "on that network may read them."},
    {"threads.io_cores", "Live: processor cores that the I/O thread keeps to; empty: any."},
    {"threads.estimator_cores", "Live: processor cores that the estimator's thread keeps to; empty: any."},
    {"device.name", "Becomes part of file names: letters, digits, `_`, `-`."},
    {"device.role",
     "`reference`: the better IMU, exactly one. `study`: an IMU under study, one to six. `gnss`, `odometry`, "
     "`time`: at most one each."},
    {"device.protocol",
     "What the device speaks. A `gnss` device: greis, nmea, ubx, rtklib_pos, csv_gnss, or xsens_mt where it "
     "has a receiver inside. An `odometry` device: can_odometry. A `time` device: pps. An IMU: any other. "
     "mcap, rosbag, ulog and dataflash, for messages in a file of many topics, have every role."},
    {"device.rate_hz",
     "Samples per second that the device sends. Without it 100 of an IMU, 10 of a receiver, "
     "50 of wheel speeds, 1 of pulses."},
    {"device.axes",
     "Rotates the device's components to its frame; the reference's and the vehicle's is forward-right-down. "
     "Three signed axes, or the rows of a rotation matrix. Without it an ixblue_stdbin telegram, which is "
     "forward-port-up, is turned, and nothing else is."},
    {"device.transport.kind",
     "How the bytes come in. Only a device that is never run live, but given as a file, needs no transport."},
    {"device.transport.port",
     "serial: the device's path, best one under `/dev/serial/by-id/`. tcp, udp: the number. pps: "
     "the path, such as `/dev/pps0`."},
    {"device.transport.edge",
     "pps: the edge of the pulse at which the second begins, as `ppstest` names them."},
    {"device.transport.baud", "serial: bits per second; any rate that the hardware can make."},
    {"device.transport.stop_bits", "serial: stop bits."},
    {"device.transport.host",
     "tcp: the server's name or address. udp: empty, or the multicast group or own address that is sent to."},
    {"device.transport.interface", "can: the interface, such as `can0`; devices share it."},
    {"device.transport.log_clock",
     "can: of a recorded log, whether its stamps are UTC or of the reference's own clock."},
    {"device.bus_id",
     "xsens_mt: place behind an Xbus Master, from 1. Without it the device has its line to itself."},
    {"device.device_id",
     "xsens_mt: eight hexadecimal digits that the device must have, as its label and `imuscope probe` show "
     "them; another device on the same port is refused. Then the device is asked before its data is taken. "
     "Not together with `bus_id`."},
    {"device.sync_in.mode",
     "xsens_mt: edge (1 rising, 2 falling, 3 both) plus 0 to sample, 4 to send the latest, 16 to keep time."},
    {"device.sync_in.skip", "xsens_mt: pulses passed over between two that count."},
    {"device.sync_in.offset_33_9ns",
     "xsens_mt: from the pulse to the action, in the device's ticks of 33.9 ns."},
    {"device.average_samples",
     "study: samples from one update of the filter to the next; an update takes a weighted mean over twice "
     "as many. 0: chosen by the filter from the reference's noise and the motion, which is what fits; "
     "results do not hang on it."},
    {"device.noise.gyro_white_sd_degps", "IMUs: white noise of a sample's angular rate, 1 sigma."},
    {"device.noise.gyro_white_deg_per_sqrt_h",
     "IMUs: the same as a density (angular random walk); give one of the two."},
    {"device.noise.accel_white_sd_mps2", "IMUs: white noise of a sample's specific force, 1 sigma."},
    {"device.noise.accel_white_ug_per_sqrt_hz", "IMUs: the same as a density; give one of the two."},
    {"device.noise.gyro_white_sd_static_degps", "IMUs: the rate's white noise at rest, where it differs."},
    {"device.noise.accel_white_sd_static_mps2",
     "IMUs: the specific force's white noise at rest, where it differs."},
    {"device.noise.gyro_bias_sd_degps",
     "IMUs: how far from zero the gyros' biases may be at switch-on, 1 sigma."},
    {"device.noise.gyro_bias_sd_deg_per_h",
     "IMUs: the same, in the unit of better gyros; give one of the two."},
    {"device.noise.accel_bias_sd_mps2", "IMUs: the same of the accelerometers."},
    {"device.noise.gyro_gm_sd_degps",
     "IMUs: 1 sigma of the wandering part of the gyros' biases (Gauss-Markov)."},
    {"device.noise.gyro_gm_tau_s", "IMUs: its correlation time, seconds."},
    {"device.noise.accel_gm_sd_mps2", "IMUs: 1 sigma of the wandering part of the accelerometers' biases."},
    {"device.noise.accel_gm_tau_s", "IMUs: its correlation time, seconds."},
    {"device.noise.gyro_scale_sd_percent",
     "study: how far from 1 the gyros' scales may be, 1 sigma; 0: exact."},
    {"device.noise.accel_scale_sd_percent", "study: the same of the accelerometers."},
    {"device.data_sheet.gyro_density_degps_per_sqrt_hz",
     "study: the maker's gyro noise density. `imuscope evaluate` holds the data sheet against fitted models; "
     "xsens_mt and xsens_can have the MTx's and the MTi-630's."},
    {"device.data_sheet.gyro_bias_stability_deg_per_h", "study: the maker's gyro bias stability, 1 sigma."},
    {"device.data_sheet.accel_density_ug_per_sqrt_hz", "study: the maker's accelerometer noise density."},
    {"device.data_sheet.accel_bias_stability_ug",
     "study: the maker's accelerometer bias stability, 1 sigma."},
    {"device.data_sheet.bias_time_s",
     "study: the correlation time that such a bias is given, seconds; data sheets do not say."},
    {"device.prior.rotation_vector_b_s_deg",
     "study: the boresight, where it is known: the rotation that takes b to s. "
     "Without it any mounting is found."},
    {"device.prior.boresight_sd_deg", "study: how well the boresight is known, 1 sigma and axis."},
    {"device.prior.lever_arm_b_m", "study: from the R-IMU to the S-IMU, in b."},
    {"device.prior.lever_arm_sd_m", "study: how well the lever arm is known, 1 sigma and axis."},
    {"device.prior.time_offset_ms",
     "study: to be added to the S-IMU's times; a latency of its stream makes it "
     "negative. Searched for where absent."},
    {"device.prior.time_offset_sd_ms", "study: how well the time offset is known, 1 sigma."},
    {"device.prior.accel_boresight_sd_deg",
     "study: gives the accelerometers a boresight of their own, this far from the gyros'."},
    {"device.prior.accel_time_offset_sd_ms",
     "study: gives the accelerometers a time offset of their own, this far from the gyros'."},
    {"device.prior.mount_creep_deg_per_sqrt_h", "study: how fast the mount gives way; 0: it is rigid."},
    {"device.csv.time_column", "csv: the column of the time of validity, seconds."},
    {"device.csv.time_unit_s", "csv: seconds that one unit of the time column is; 0.001 for milliseconds."},
    {"device.csv.time_offset_s", "csv: is added to the file's times; -18 turns GPS time into UTC."},
    {"device.csv.gyro_columns",
     "csv_imu: the columns of the angular rate, x y z; a minus before a name turns its sign."},
    {"device.csv.accel_columns",
     "csv_imu: the columns of the specific force, x y z (upwards at rest); likewise."},
    {"device.csv.gyro_unit", "csv_imu: unit of the angular rate."},
    {"device.csv.accel_unit", "csv_imu: unit of the specific force; g is 9.80665 m/s2."},
    {"device.csv.counter_column", "csv_imu: a sample counter, which shows gaps; without it the rows count."},
    {"device.csv.latitude_column", "csv_gnss: degrees."},
    {"device.csv.longitude_column", "csv_gnss: degrees."},
    {"device.csv.height_column", "csv_gnss: above the WGS-84 ellipsoid, metres."},
    {"device.csv.velocity_columns", "csv_gnss: north, east, down, m/s."},
    {"device.csv.position_sd_columns", "csv_gnss: north, east, down, metres."},
    {"device.csv.clock",
     "csv: `common`: times are of the reference's clock. `own`: of another, found by the motion."},
    {"device.messages.topic",
     "mcap, rosbag, ulog, dataflash: the topic in the file. An IMU is sensor_msgs/Imu, a gnss device "
     "sensor_msgs/NavSatFix, an odometry device nav_msgs/Odometry, a time device sensor_msgs/TimeReference. "
     "Without it the only one of that type."},
    {"device.messages.velocity_topic",
     "The receiver's velocity, east-north-up, at the times of its positions: "
     "geometry_msgs/TwistWithCovarianceStamped or TwistStamped. Without it there is none; ulog and dataflash "
     "take that beside the positions."},
    {"device.messages.frame_id",
     "Messages of another frame_id are passed over, where a topic holds several sensors. Bodies of ROS "
     "are forward-left-up: write axes = \"+x -y -z\" for those."},
    {"device.messages.time",
     "When a message was valid: its header's stamp, or when it was recorded or sent."},
    {"device.messages.times_are_utc", "The times are UTC and not of a clock that nobody set."},
    {"device.messages.clock",
     "`common`: times are of the reference's clock. `own`: of another, found by UTC or the motion."},
    {"device.antenna_lever_arm_b_m", "gnss: from the R-IMU to the antenna, in b."},
    {"device.antenna_lever_arm_sd_m",
     "gnss: of each axis of the lever arm, 1 sigma. It is estimated with this prior. Measured by tape: "
     "0.02."},
    {"device.position_sd_m", "gnss: north, east, down; where the receiver gives none."},
    {"device.velocity_sd_mps", "gnss: north, east, down; where the receiver gives none."},
    {"device.position_sd_floor_m", "gnss: a receiver that claims less is not believed."},
    {"device.velocity_sd_floor_mps", "gnss: a receiver that claims less is not believed."},
    {"device.latency_ms", "gnss: how old a solution is on arrival, where no UTC tells."},
    {"device.latency_sd_ms",
     "gnss: of `latency_ms`, 1 sigma. The latency is estimated with this prior; 0: it is as "
     "given. `csv_gnss` and a common clock: 0. Where UTC tags of receiver and reference carry "
     "solutions, 1 or this, whichever is less."},
    {"device.geoid_separation_m", "nmea: geoid above the ellipsoid, for receivers that do not send it."},
    {"device.clock", "rtklib_pos: whether a file's times are UTC or of the reference's own clock."},
    {"device.base_lat_lon_height",
     "rtklib_pos: degrees, degrees, metres; the base of east-north-up solutions whose header names none."},
    {"device.odometry.dbc",
     "The vehicle's DBC file, beside the configuration. Its text is kept in captures."},
    {"device.odometry.speed_signals",
     "`MESSAGE.SIGNAL`, or `SIGNAL` where it is unique; the speed is their mean. Take the wheels "
     "of the axle that does not steer."},
    {"device.odometry.speed_unit",
     "Where the DBC's own unit is missing or wrong. Without it the DBC's own unit holds, "
     "whatever stands in the last column."},
    {"device.odometry.wheel_radius_m", "For signals in rad/s, which need it."},
    {"device.odometry.speed_has_no_sign",
     "The signals are magnitudes; the filter's own speed gives the sign."},
    {"device.odometry.direction_signal", "A gear or direction signal."},
    {"device.odometry.backward_values", "Values of it, names or numbers, that mean backwards."},
    {"device.odometry.fault_signals", "Anything but 0 in one of them spoils the speeds."},
    {"device.odometry.invalid_raw",
     "Numbers in the frame that are no speeds, beside those the DBC names so."},
    {"device.odometry.counter_signal", "A rolling counter of the speed message, to count lost frames."},
    {"device.odometry.latency_ms", "From the motion to the frame on the bus."},
    {"device.odometry.max_speed_mps", "Beyond it a speed is impossible: refused and counted."},
    {"device.odometry.max_acceleration_mps2", "The same of a step from one speed to the next."},
    {"device.odometry.speed", "Updates the filter with the forward speed."},
    {"device.odometry.non_holonomic", "Updates it with no slip sideways and upwards."},
    {"device.odometry.zero_velocity", "Updates it with no motion at standstill."},
    {"device.odometry.axle_lever_arm_b_m",
     "From the R-IMU to the middle of the axle that does not steer, in b; estimated from there on."},
    {"device.odometry.axle_lever_arm_sd_m", "How well it is known, 1 sigma and axis."},
    {"device.odometry.mounting_sd_deg",
     "How far b may be turned against the vehicle about y and z; estimated."},
    {"device.odometry.scale_sd_percent", "Of the wheels' scale (tyres), 1 sigma; estimated."},
    {"device.odometry.speed_sd_mps", "What wheels and tyres do beyond the model, forwards, 1 sigma."},
    {"device.odometry.sideways_sd_mps", "The same sideways."},
    {"device.odometry.upwards_sd_mps", "The same upwards."},
    {"device.odometry.zero_velocity_sd_mps", "Of standstill, 1 sigma."},
    {"device.odometry.dead_band_mps", "Slower wheels may show zero: such a speed is not used as one."},
    {"device.xsens_can.ids.error",
     "Identifier of the message: 3 hexadecimal digits for 11 bits, 8 for 29. "
     "Without it the MTi's own default."},
    {"device.xsens_can.ids.sample_time", "As above."},
    {"device.xsens_can.ids.group_counter", "As above."},
    {"device.xsens_can.ids.status_word", "As above."},
    {"device.xsens_can.ids.delta_v", "As above."},
    {"device.xsens_can.ids.rate_of_turn", "As above."},
    {"device.xsens_can.ids.delta_q", "As above."},
    {"device.xsens_can.ids.acceleration", "As above."},
    {"device.xsens_can.ids.high_rate_061", "As above."},
    {"device.xsens_can.ids.high_rate_062", "As above."},
});

std::string_view sentence_of(const std::string& key) {
  const auto found = std::find_if(kSentences.begin(), kSentences.end(),
                                  [&](const KeySentence& sentence) { return sentence.first == key; });
  return found == kSentences.end() ? std::string_view{} : found->second;
}

void add(const AskedKey& asked, std::vector<KeyReference>& keys) {
  auto key =
      std::find_if(keys.begin(), keys.end(), [&](const auto& known) { return known.name == asked.name; });
  if (key == keys.end()) {
    keys.push_back({asked.name, asked.values, {}, asked.required, sentence_of(asked.name)});
    key = keys.end() - 1;
  } else if (key->values.empty()) {
    key->values = asked.values;
  } else if (key->values.find(asked.values) == std::string::npos) {
    key->values += " or " + asked.values;
  }
  key->required |= asked.required;
  if (asked.preset.empty() ||
      std::find(key->presets.begin(), key->presets.end(), asked.preset) != key->presets.end())
    return;
  key->presets.push_back(asked.preset);
}

}  // namespace

std::vector<KeyReference> configuration_reference() {
  std::vector<KeyReference> keys;
  for (const auto devices : kDevices) {
    std::vector<AskedKey> asked;
    // Whether it could be run does not matter here.
    (void)parse_configuration(fmt::format("{}{}", kReferenceAndStudy, devices), "reference", &asked);
    for (const auto& key : asked) add(key, keys);
  }
  // A list of tables is required, too; it is no key.
  keys.erase(std::remove_if(keys.begin(), keys.end(), [](const auto& key) { return key.values.empty(); }),
             keys.end());
  const auto table_of = [](const KeyReference& key) { return key.name.substr(0, key.name.rfind('.')); };
  // Tables in the order of their first key; inside a table, keys as they came.
  std::vector<std::string> tables;
  for (const auto& key : keys) {
    if (std::find(tables.begin(), tables.end(), table_of(key)) == tables.end())
      tables.push_back(table_of(key));
  }
  std::stable_sort(keys.begin(), keys.end(), [&](const auto& a, const auto& b) {
    return std::find(tables.begin(), tables.end(), table_of(a)) <
           std::find(tables.begin(), tables.end(), table_of(b));
  });
  return keys;
}

std::vector<std::string_view> sentences_without_key() {
  const auto keys = configuration_reference();
  std::vector<std::string_view> orphans;
  for (const auto& [name, about] : kSentences) {
    const bool asked =
        std::any_of(keys.begin(), keys.end(), [name = name](const auto& key) { return key.name == name; });
    if (!asked) orphans.push_back(name);
  }
  return orphans;
}

}  // namespace imuscope
