#include "service/pipeline/device_factory.h"

#include <fmt/format.h>

#include "base/contracts.h"
#include "drivers/can_bus/session.h"
#include "drivers/can_odometry/decoder.h"
#include "drivers/csv/decoder.h"
#include "drivers/csv/validate.h"
#include "drivers/device/frame_buffer.h"
#include "drivers/greis/decoder.h"
#include "drivers/greis/session.h"
#include "drivers/ixblue_stdbin/decoder.h"
#include "drivers/ixblue_stdbin/session.h"
#include "drivers/nmea/decoder.h"
#include "drivers/nmea/session.h"
#include "drivers/pps/decoder.h"
#include "drivers/pps/session.h"
#include "drivers/ros_message/decoder.h"
#include "drivers/rtklib_pos/decoder.h"
#include "drivers/rtklib_pos/session.h"
#include "drivers/ubx/decoder.h"
#include "drivers/ubx/session.h"
#include "drivers/xsens_can/decoder.h"
#include "drivers/xsens_mt/decoder.h"
#include "drivers/xsens_mt/session.h"

namespace imuscope {

namespace {

/// Of the configured line, also for a recording that was made from it, until the line itself says otherwise.
Duration per_byte_of(const DeviceConfig& device) {
  return device.serial ? byte_time(device.serial->baud, device.serial->stop_bits) : Duration::zero();
}

std::unique_ptr<DeviceDecoder> make_xsens(const DeviceConfig& device, DeviceIndex index,
                                          const ClockMapConfig& clock) {
  xsens::MtDecoderConfig config;
  config.device = index;
  config.rate_hz = device.rate_hz;
  config.per_byte = per_byte_of(device);
  config.axes = device.axes;
  config.clock = clock;
  config.wants_imu = device.role != DeviceRole::kGnss;
  config.wants_attitude = device.role == DeviceRole::kReference;
  config.wants_gnss = device.role == DeviceRole::kGnss;
  if (device.xsens.bus_id > 0) {
    config.bus.resize(static_cast<std::size_t>(device.xsens.bus_size));
    config.bus[static_cast<std::size_t>(device.xsens.bus_id) - 1] = xsens::BusDevice{index, device.axes};
  }
  return std::make_unique<xsens::MtDecoder>(config);
}

std::unique_ptr<DeviceDecoder> make_stdbin(const DeviceConfig& device, DeviceIndex index,
                                           const ClockMapConfig& clock) {
  return std::make_unique<ixblue_stdbin::Decoder>(
      ixblue_stdbin::DecoderConfig{index, device.axes, per_byte_of(device), clock});
}

std::unique_ptr<DeviceDecoder> make_greis(const DeviceConfig& device, DeviceIndex index,
                                          const ClockMapConfig& clock) {
  return std::make_unique<greis::Decoder>(
      greis::DecoderConfig{index, from_seconds(1.0 / device.rate_hz), per_byte_of(device), clock});
}

std::unique_ptr<DeviceDecoder> make_can_odometry(const DeviceConfig& device, DeviceIndex index) {
  can_odometry::DecoderConfig config;
  config.device = index;
  config.rate_hz = device.rate_hz;
  config.latency = from_seconds(device.odometry.latency_s);
  config.max_speed_mps = device.odometry.max_speed_mps;
  config.max_acceleration_mps2 = device.odometry.max_acceleration_mps2;
  auto made = can_odometry::Decoder::make(*device.odometry.database, device.odometry.choice, config);
  // The configuration was made sure of when it was read.
  IMUSCOPE_EXPECTS(made.has_value());
  return std::move(*made);
}

std::unique_ptr<DeviceDecoder> make_xsens_can(const DeviceConfig& device, DeviceIndex index,
                                              const ClockMapConfig& clock) {
  xsens_can::DecoderConfig config;
  config.device = index;
  config.rate_hz = device.rate_hz;
  config.ids = device.xsens_can_ids;
  config.axes = device.axes;
  config.clock = clock;
  return std::make_unique<xsens_can::Decoder>(config);
}

std::unique_ptr<DeviceDecoder> make_nmea(const DeviceConfig& device, DeviceIndex index,
                                         const ClockMapConfig& clock) {
  nmea::DecoderConfig config;
  config.device = index;
  config.period = from_seconds(1.0 / device.rate_hz);
  config.per_byte = per_byte_of(device);
  config.geoid_separation_m = device.gnss.geoid_separation_m;
  config.clock = clock;
  return std::make_unique<nmea::Decoder>(config);
}

std::unique_ptr<DeviceDecoder> make_ubx(const DeviceConfig& device, DeviceIndex index,
                                        const ClockMapConfig& clock) {
  return std::make_unique<ubx::Decoder>(
      ubx::DecoderConfig{index, from_seconds(1.0 / device.rate_hz), per_byte_of(device), clock});
}

std::unique_ptr<DeviceDecoder> make_rtklib_pos(const DeviceConfig& device, DeviceIndex index,
                                               const ClockMapConfig& clock) {
  rtklib_pos::DecoderConfig config;
  config.device = index;
  config.period = from_seconds(1.0 / device.rate_hz);
  if (const auto& base = device.gnss.base_lat_lon_height) config.base = {(*base)[0], (*base)[1], (*base)[2]};
  config.per_byte = per_byte_of(device);
  config.clock = clock;
  return std::make_unique<rtklib_pos::Decoder>(config);
}

std::unique_ptr<DeviceDecoder> make_ros_message(const DeviceConfig& device, DeviceIndex index,
                                                const ClockMapConfig& clock) {
  return std::make_unique<ros_message::Decoder>(ros_message::DecoderConfig{
      index, device.axes, from_seconds(1.0 / device.rate_hz), device.messages.times_are_utc, clock});
}

csv::ImuConfig csv_imu(const DeviceConfig& device, DeviceIndex index, const ClockMapConfig& clock) {
  csv::ImuConfig config;
  config.device = index;
  config.time_column = device.csv.time_column;
  config.time_unit_s = device.csv.time_unit_s;
  config.time_offset_s = device.csv.time_offset_s;
  config.gyro_columns = device.csv.gyro_columns;
  config.gyro_unit = device.csv.gyro_in_degps ? csv::AngularRateUnit::kDegps : csv::AngularRateUnit::kRadps;
  config.accel_columns = device.csv.accel_columns;
  config.accel_unit = device.csv.accel_in_g ? csv::AccelerationUnit::kG : csv::AccelerationUnit::kMps2;
  config.counter_column = device.csv.counter_column;
  config.axes = device.axes;
  config.period = from_seconds(1.0 / device.rate_hz);
  config.clock = clock;
  return config;
}

csv::GnssConfig csv_gnss(const DeviceConfig& device, DeviceIndex index, const ClockMapConfig& clock) {
  csv::GnssConfig config;
  config.device = index;
  config.time_column = device.csv.time_column;
  config.time_unit_s = device.csv.time_unit_s;
  config.time_offset_s = device.csv.time_offset_s;
  config.latitude_column = device.csv.latitude_column;
  config.longitude_column = device.csv.longitude_column;
  config.height_column = device.csv.height_column;
  config.velocity_columns = device.csv.velocity_columns;
  config.position_sd_columns = device.csv.position_sd_columns;
  config.period = from_seconds(1.0 / device.rate_hz);
  config.clock = clock;
  return config;
}

}  // namespace

std::unique_ptr<DeviceDecoder> make_decoder(const DeviceConfig& device, DeviceIndex index,
                                            const ClockMapConfig& clock) {
  switch (device.protocol) {
    case Protocol::kXsensMt:
      return make_xsens(device, index, clock);
    case Protocol::kIxblueStdbin:
      return make_stdbin(device, index, clock);
    case Protocol::kGreis:
      return make_greis(device, index, clock);
    case Protocol::kNmea:
      return make_nmea(device, index, clock);
    case Protocol::kUbx:
      return make_ubx(device, index, clock);
    case Protocol::kRtklibPos:
      return make_rtklib_pos(device, index, clock);
    case Protocol::kCsvImu:
      return std::make_unique<csv::ImuDecoder>(csv_imu(device, index, clock));
    case Protocol::kCsvGnss:
      return std::make_unique<csv::GnssDecoder>(csv_gnss(device, index, clock));
    case Protocol::kXsensCan:
      return make_xsens_can(device, index, clock);
    case Protocol::kCanOdometry:
      return make_can_odometry(device, index);
    case Protocol::kPps:
      return std::make_unique<pps::Decoder>(pps::DecoderConfig{index});
    case Protocol::kMcap:
    case Protocol::kRosbag:
    case Protocol::kUlog:
    case Protocol::kDataflash:
      return make_ros_message(device, index, clock);
  }
  return nullptr;
}

std::unique_ptr<DeviceSession> make_session(const DeviceConfig& device, bool searching_baud) {
  switch (device.protocol) {
    case Protocol::kXsensMt: {
      xsens::MtSessionConfig config;
      config.output = xsens::MtSessionConfig::Output::kAsDevice;
      config.rate_hz = device.rate_hz;
      config.baud = device.serial ? device.serial->baud : 0.0;
      config.stop_bits = device.serial ? device.serial->stop_bits : 1;
      config.searching_baud = searching_baud;
      config.device_id = device.xsens.device_id;
      config.bus_devices = static_cast<std::size_t>(device.xsens.bus_size);
      if (const auto& sync = device.xsens.sync_in) config.sync_in = {sync->mode, sync->skip, sync->offset};
      return std::make_unique<xsens::MtSession>(config);
    }
    case Protocol::kIxblueStdbin:
      return std::make_unique<ixblue_stdbin::Session>();
    case Protocol::kGreis:
      return std::make_unique<greis::Session>(greis::SessionConfig{from_seconds(1.0 / device.rate_hz), true});
    case Protocol::kNmea:
      return std::make_unique<nmea::Session>();
    case Protocol::kUbx:
      return std::make_unique<ubx::Session>();
    case Protocol::kRtklibPos:
      return std::make_unique<rtklib_pos::Session>();
    case Protocol::kXsensCan:
    case Protocol::kCanOdometry:
      return std::make_unique<CanSession>();
    case Protocol::kPps:
      return std::make_unique<pps::Session>();
    case Protocol::kCsvImu:
    case Protocol::kCsvGnss:
    case Protocol::kMcap:
    case Protocol::kRosbag:
    case Protocol::kUlog:
    case Protocol::kDataflash:
      break;
  }
  return nullptr;
}

std::string decoder_problem(const DeviceConfig& device, const DeviceDecoder& decoder) {
  switch (device.protocol) {
    case Protocol::kCsvImu:
    case Protocol::kCsvGnss: {
      const auto& error = static_cast<const csv::RowDecoder&>(decoder).error();
      return error.kind == csv::RowError::Kind::kNone ? std::string() : csv::describe(error);
    }
    default:
      return std::string(decoder.remark());
  }
}

Error no_sample_error(const DeviceConfig& device, const std::vector<std::string>& inputs,
                      const DeviceDecoder& decoder) {
  std::string file = inputs.front();
  bool is_dump = false;
  for (const auto& input : inputs) {
    if (!input.starts_with(device.name + "=")) continue;
    file = input.substr(device.name.size() + 1);
    is_dump = true;
  }
  if (const auto problem = decoder_problem(device, decoder); !problem.empty()) {
    return {ErrorKind::kWork, fmt::format("{}: {}: {}", device.name, file, problem), {}};
  }
  return {ErrorKind::kWork,
          fmt::format("{}: {}: {} bytes, and not one {} sample in them", device.name, file,
                      decoder.counters().bytes, name_of(device.protocol)),
          is_dump ? fmt::format("check that the file is this device's and the protocol is right; "
                                "imuscope decode {} shows what it holds",
                                file)
                  : "check that the device's protocol is right"};
}

Result<void> check_recorded_file(const DeviceConfig& device, const std::filesystem::path& file) {
  switch (device.protocol) {
    case Protocol::kCsvImu:
      return csv::validate_file(file, csv_imu(device, 0, ClockMapConfig::fixed(HostTime{}, 1.0)));
    case Protocol::kCsvGnss:
      return csv::validate_file(file, csv_gnss(device, 0, ClockMapConfig::fixed(HostTime{}, 1.0)));
    default:
      return {};
  }
}

}  // namespace imuscope
