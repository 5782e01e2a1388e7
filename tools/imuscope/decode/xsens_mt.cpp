#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <vector>

#include "base/bytes.h"
#include "drivers/xsens_mt/layout_guess.h"
#include "drivers/xsens_mt/messages.h"
#include "drivers/xsens_mt/mtdata.h"
#include "drivers/xsens_mt/mtdata2.h"
#include "drivers/xsens_mt/scanner.h"
#include "stream_protocols.h"
#include "whole_stream.h"

namespace imuscope::cli {
namespace {

using namespace xsens;
using Json = nlohmann::ordered_json;
using Bytes = std::span<const std::uint8_t>;

/// Messages that a guess of the layout looks at.
constexpr std::size_t kMessagesForGuess = 64;

/// What MTData holds: as a Configuration message said, else as its numbers suggest.
class Layouts {
 public:
  /// Guesses from the MTData that comes before any Configuration.
  Layouts(Bytes stream, const Visitor& visitor) {
    std::vector<std::vector<std::uint8_t>> kept;
    bool configured = false;
    scan_whole<Scanner, Frame>(stream, visitor, [&](const Frame& frame) {
      configured = configured || frame.mid == mid::kConfiguration;
      if (configured || frame.mid != mid::kMtData || kept.size() == kMessagesForGuess) return;
      if (kept.empty() || kept[0].size() == frame.data.size())
        kept.emplace_back(frame.data.begin(), frame.data.end());
    });
    const std::vector<Bytes> messages(kept.begin(), kept.end());
    if (const auto guess = guess_layout(messages)) {
      layouts_ = {*guess};
      guessed_ = true;
    } else {
      guess_xbus(messages);
    }
  }

  void learn(const Configuration& configuration) {
    if (configuration.n_devices == 0 || configuration.devices[0].data_length == 0) return;
    layouts_.clear();
    for (std::size_t k = 0; k < configuration.n_devices; ++k) {
      layouts_.push_back({configuration.devices[k].output_mode, configuration.devices[k].output_settings});
    }
    xbus_ = configuration.is_xbus_master();
    guessed_ = false;
  }

  [[nodiscard]] const std::vector<DataLayout>& layouts() const { return layouts_; }
  [[nodiscard]] bool xbus() const { return xbus_; }
  [[nodiscard]] bool guessed() const { return guessed_; }

 private:
  /// An Xbus Master's message: its counter, then blocks of devices that are all set up alike.
  void guess_xbus(const std::vector<Bytes>& messages) {
    if (messages.empty() || messages[0].size() <= sizeof(std::uint16_t)) return;
    const std::size_t blocks_size = messages[0].size() - sizeof(std::uint16_t);
    for (std::size_t n = 2; n <= kBusDevicesMax; ++n) {
      if (blocks_size % n != 0) continue;
      std::vector<Bytes> blocks;
      for (const Bytes& message : messages) {
        for (std::size_t k = 0; k < n; ++k) {
          blocks.push_back(message.subspan(sizeof(std::uint16_t) + k * (blocks_size / n), blocks_size / n));
        }
      }
      const auto guess = guess_layout(blocks);
      if (!guess || (guess->mode & (output_mode::kCalibrated | output_mode::kOrientation)) == 0) continue;
      layouts_.assign(n, *guess);
      xbus_ = true;
      guessed_ = true;
      return;
    }
  }

  std::vector<DataLayout> layouts_;
  bool xbus_ = false;
  bool guessed_ = false;
};

Json utc_json(const UtcFields& utc) {
  return {utc.nanoseconds, utc.year, utc.month, utc.day, utc.hour, utc.minute, utc.second, utc.flags};
}

Json gps_json(const GpsPvt& gps) {
  return {{"pressure", gps.pressure},
          {"pressure_age", gps.pressure_age},
          {"itow_ms", gps.time_of_week_ms},
          {"lat_1e7_deg", gps.latitude_1e7_deg},
          {"lon_1e7_deg", gps.longitude_1e7_deg},
          {"alt_mm", gps.altitude_mm},
          {"vel_ned_cmps", gps.velocity_ned_cmps},
          {"hacc_mm", gps.horizontal_accuracy_mm},
          {"vacc_mm", gps.vertical_accuracy_mm},
          {"sacc_cmps", gps.speed_accuracy_cmps},
          {"gps_age", gps.gps_age}};
}

Json mtdata_json(const MtData& data) {
  Json fields = Json::object();
  if (data.has(Field::kRaw)) {
    fields["raw_acc"] = data.raw.acceleration;
    fields["raw_gyr"] = data.raw.rate;
    fields["raw_mag"] = data.raw.field;
    fields["raw_temp"] = data.raw.temperature;
  }
  if (data.has(Field::kGpsPvt)) fields["gps_pvt"] = gps_json(data.gps);
  if (data.has(Field::kTemperature)) fields["temp_degC"] = data.temperature_degc;
  if (data.has(Field::kAcceleration)) fields["acc_ms2"] = data.acceleration_mps2;
  if (data.has(Field::kRate)) fields["gyr_rads"] = data.rate_radps;
  if (data.has(Field::kMagneticField)) fields["mag_au"] = data.field_au;
  if (data.has(Field::kQuaternion)) fields["quat"] = data.quaternion;
  if (data.has(Field::kEuler)) fields["euler_deg"] = data.euler_deg;
  if (data.has(Field::kMatrix)) fields["matrix"] = data.matrix_as_sent;
  if (data.has(Field::kAnalogue1)) fields["ain1"] = data.analogue[0];
  if (data.has(Field::kAnalogue2)) fields["ain2"] = data.analogue[1];
  if (data.has(Field::kPosition)) fields["pos"] = data.position;
  if (data.has(Field::kVelocity)) fields["vel"] = data.velocity_mps;
  if (data.has(Field::kStatus)) fields["status"] = data.status;
  if (data.has(Field::kCounter)) fields["sample_counter"] = data.counter;
  if (data.has(Field::kUtc)) fields["utc"] = utc_json(data.utc);
  return fields;
}

/// Fields of all devices of a message; nothing where the layouts do not fit its length.
std::optional<Json> mtdata_fields(Bytes data, const Layouts& layouts) {
  MtData message;
  if (!layouts.xbus()) {
    if (layouts.layouts().empty() || !read_mtdata(data, layouts.layouts()[0], message)) return std::nullopt;
    Json fields = mtdata_json(message);
    if (layouts.guessed()) fields["layout"] = "guessed";
    return fields;
  }
  if (data.size() < 2) return std::nullopt;
  Json fields = {{"xm_counter", read_be<std::uint16_t>(data)}};
  Json devices = Json::array();
  data = data.subspan(2);
  for (const DataLayout& layout : layouts.layouts()) {
    const auto length = data_length(layout);
    if (!length || *length > data.size()) return std::nullopt;
    if (!read_mtdata(data.first(*length), layout, message)) return std::nullopt;
    Json device = {{"bid", devices.size() + 1}};
    device.update(mtdata_json(message));
    devices.push_back(std::move(device));
    data = data.subspan(*length);
  }
  if (!data.empty()) return std::nullopt;
  fields["devices"] = std::move(devices);
  if (layouts.guessed()) fields["layout"] = "guessed";
  return fields;
}

std::string text_of(const std::array<char, 8>& text) {
  std::string out;
  for (const char c : text) {
    if (c >= ' ' && c <= '~') out += c;
  }
  return out;
}

Json configuration_json(const Configuration& c) {
  Json devices = Json::array();
  for (std::size_t k = 0; k < c.n_devices; ++k) {
    const DeviceRecord& d = c.devices[k];
    devices.push_back({{"did", d.device_id},
                       {"data_length", d.data_length},
                       {"output_mode", d.output_mode},
                       {"output_settings", d.output_settings},
                       {"scenario", d.scenario},
                       {"fw", d.firmware}});
  }
  return {{"master_did", c.master_id},        {"period", c.period},
          {"rate_hz", c.rate_hz()},           {"skip", c.skip_factor},
          {"date", text_of(c.date)},          {"time", text_of(c.time)},
          {"num_devices", c.n_devices},       {"devices", std::move(devices)},
          {"xbus_master", c.is_xbus_master()}};
}

Json pvt_json(const GnssPvt& pvt) {
  return {{"itow", pvt.time_of_week_ms},
          {"year", pvt.year},
          {"month", pvt.month},
          {"day", pvt.day},
          {"hour", pvt.hour},
          {"min", pvt.minute},
          {"sec", pvt.second},
          {"valid", pvt.valid},
          {"tAcc", pvt.time_accuracy_ns},
          {"nano", pvt.nanoseconds},
          {"fixType", pvt.fix_type},
          {"flags", pvt.flags},
          {"numSV", pvt.n_satellites},
          {"lon", pvt.longitude_1e7_deg},
          {"lat", pvt.latitude_1e7_deg},
          {"height", pvt.height_mm},
          {"hMSL", pvt.height_msl_mm},
          {"hAcc", pvt.horizontal_accuracy_mm},
          {"vAcc", pvt.vertical_accuracy_mm},
          {"velN", pvt.velocity_ned_mmps[0]},
          {"velE", pvt.velocity_ned_mmps[1]},
          {"velD", pvt.velocity_ned_mmps[2]},
          {"gSpeed", pvt.ground_speed_mmps},
          {"headMot", pvt.course_1e5_deg},
          {"sAcc", pvt.speed_accuracy_mmps},
          {"headAcc", pvt.course_accuracy_1e5_deg},
          {"headVeh", pvt.vehicle_heading_1e5_deg},
          {"dop", pvt.dop_centi}};
}

Json satellites_json(Bytes data) {
  constexpr std::size_t kFixed = 8;
  constexpr std::size_t kPerSatellite = 4;
  if (data.size() < kFixed || data.size() != kFixed + kPerSatellite * data[4]) return nullptr;
  Json satellites = Json::array();
  for (std::size_t at = kFixed; at < data.size(); at += kPerSatellite) {
    satellites.push_back(
        {{"gnssId", data[at]}, {"svId", data[at + 1]}, {"cno", data[at + 2]}, {"flags", data[at + 3]}});
  }
  return {{"itow", read_be<std::uint32_t>(data)}, {"satellites", std::move(satellites)}};
}

template <typename T>
Json integers(Bytes data, std::size_t n) {
  if (data.size() != n * sizeof(T)) return nullptr;
  if (n == 1) return read_be<T>(data);
  Json values = Json::array();
  for (std::size_t i = 0; i < n; ++i) values.push_back(read_be<T>(data, i * sizeof(T)));
  return values;
}

/// Null where the size is not that of the content.
Json item_value(const Item& item, const ItemKind& kind) {
  switch (kind.content) {
    case ItemContent::kNumbers: {
      const std::size_t size = size_of(item.format());
      if (item.data.size() != kind.count * size) return nullptr;
      Json values = Json::array();
      for (std::size_t i = 0; i < kind.count; ++i)
        values.push_back(read_number(item.data, i * size, item.format()));
      return values;
    }
    case ItemContent::kU8:
      return integers<std::uint8_t>(item.data, kind.count);
    case ItemContent::kU16:
      return integers<std::uint16_t>(item.data, kind.count);
    case ItemContent::kU32:
      return integers<std::uint32_t>(item.data, kind.count);
    case ItemContent::kUtc:
      return item.data.size() == kUtcSize ? utc_json(read_utc(item.data)) : Json(nullptr);
    case ItemContent::kGnssPvt: {
      const auto pvt = read_gnss_pvt(item.data);
      return pvt ? pvt_json(*pvt) : Json(nullptr);
    }
    case ItemContent::kSatellites:
      return satellites_json(item.data);
    case ItemContent::kRawInertial:
      return integers<std::uint16_t>(item.data, kind.count);
    case ItemContent::kGyroTemperatures:
      return integers<std::int16_t>(item.data, kind.count);
    case ItemContent::kBytes:
      return nullptr;
  }
  return nullptr;
}

Json item_json(const Item& item) {
  Json out = {{"xdi", fmt::format("{:04X}", item.id)}, {"size", item.data.size()}};
  const ItemKind* kind = find_item_kind(item.id);
  if (kind == nullptr) {
    out["raw"] = hex(item.data);
    return out;
  }
  out["name"] = kind->name;
  Json value = item_value(item, *kind);
  if (value.is_null()) {
    out["raw"] = hex(item.data);
    return out;
  }
  if (kind->content == ItemContent::kNumbers) {
    out["format"] = item.id & 0x3U;
    out["coord"] = item.id >> 2U & 0x3U;
  }
  out["value"] = std::move(value);
  return out;
}

/// False where the content contradicts itself although the checksum is right.
bool add_fields(const Frame& frame, Layouts& layouts, Json& fields) {
  switch (frame.mid) {
    case mid::kMtData2: {
      if (!items_are_whole(frame.data)) return false;
      Json items = Json::array();
      ItemReader reader(frame.data);
      Item item;
      while (reader.next(item)) items.push_back(item_json(item));
      fields["items"] = std::move(items);
      return true;
    }
    case mid::kMtData:
      if (auto known = mtdata_fields(frame.data, layouts)) {
        fields.update(*known);
        return true;
      }
      break;
    case mid::kConfiguration: {
      const auto configuration = read_configuration(frame.data);
      if (!configuration) return false;
      layouts.learn(*configuration);
      fields.update(configuration_json(*configuration));
      return true;
    }
    case mid::kDeviceId:
      if (frame.data.size() >= 4) fields["did"] = read_be<std::uint32_t>(frame.data);
      break;
    case mid::kError:
      if (!frame.data.empty()) {
        fields["code"] = frame.data[0];
        fields["text"] = error_text(frame.data[0]);
      }
      break;
    default:
      break;
  }
  fields["data"] = hex(frame.data);
  return true;
}

}  // namespace

void decode_xsens_mt(std::span<const std::uint8_t> stream, const Visitor& visitor) {
  Layouts layouts(stream, visitor);
  scan_whole<Scanner, Frame>(stream, visitor, [&](const Frame& frame) {
    if (frame.nested && frame.mid != mid::kMtData && frame.mid != mid::kMtData2) return;
    DecodedMessage message{frame.offset, frame.size, std::string(message_name(frame.mid)), true,
                           Json::object()};
    if (message.message.empty()) message.message = fmt::format("MID_{:02X}", frame.mid);
    message.fields["bid"] = frame.bid;
    message.fields["mid"] = frame.mid;
    if (add_fields(frame, layouts, message.fields)) visitor.message(message);
  });
}

}  // namespace imuscope::cli
