#include "drivers/xsens_mt/mtdata2.h"

#include <algorithm>

#include "base/bytes.h"

namespace imuscope::xsens {
namespace {

using enum ItemContent;
constexpr auto kItemKinds = std::to_array<ItemKind>({
    {0x0810, "Temperature", kNumbers, 1},
    {0x1010, "UtcTime", kUtc, 8},
    {0x1020, "PacketCounter", kU16, 1},
    {0x1030, "GpsTimeOfWeek", kU32, 1},
    {0x1040, "GpsAge", kU8, 1},
    {0x1050, "PressureAge", kU8, 1},
    {0x1060, "SampleTimeFine", kU32, 1},
    {0x1070, "SampleTimeCoarse", kU32, 1},
    {0x1080, "FrameRange", kU16, 2},
    {0x2010, "Quaternion", kNumbers, 4},
    {0x2020, "RotationMatrix", kNumbers, 9},
    {0x2030, "EulerAngles", kNumbers, 3},
    {0x3010, "BaroPressure", kU32, 1},
    {0x4010, "DeltaV", kNumbers, 3},
    {0x4020, "Acceleration", kNumbers, 3},
    {0x4030, "FreeAcceleration", kNumbers, 3},
    {0x4040, "AccelerationHR", kNumbers, 3},
    {0x5020, "AltitudeEllipsoid", kNumbers, 1},
    {0x5030, "PositionEcef", kNumbers, 3},
    {0x5040, "LatLon", kNumbers, 2},
    {0x7010, "GnssPvtData", kGnssPvt, 1},
    {0x7020, "GnssSatInfo", kSatellites, 1},
    {0x8020, "RateOfTurn", kNumbers, 3},
    {0x8030, "DeltaQ", kNumbers, 4},
    {0x8040, "RateOfTurnHR", kNumbers, 3},
    {0x8830, "GpsDop", kBytes, 0},
    {0x8840, "GpsSol", kBytes, 0},
    {0x8880, "GpsTimeUtc", kBytes, 0},
    {0x88A0, "GpsSvInfo", kBytes, 0},
    {0xA010, "RawAccGyrMagTemp", kRawInertial, 10},
    {0xA020, "RawGyroTemp", kGyroTemperatures, 3},
    {0xC020, "MagneticField", kNumbers, 3},
    {0xD010, "VelocityXYZ", kNumbers, 3},
    {0xE010, "StatusByte", kU8, 1},
    {0xE020, "StatusWord", kU32, 1},
});

}  // namespace

bool items_are_whole(std::span<const std::uint8_t> data) noexcept {
  ItemReader reader(data);
  Item item;
  while (reader.next(item)) {
  }
  return reader.at_end();
}

const ItemKind* find_item_kind(std::uint16_t id) noexcept {
  const auto kind = static_cast<std::uint16_t>(id & ~xdi::kFormatBits);
  const auto* found = std::lower_bound(kItemKinds.begin(), kItemKinds.end(), kind,
                                       [](const ItemKind& entry, std::uint16_t k) { return entry.kind < k; });
  return found != kItemKinds.end() && found->kind == kind ? found : nullptr;
}

std::optional<GnssPvt> read_gnss_pvt(std::span<const std::uint8_t> data) noexcept {
  if (data.size() != kGnssPvtSize) return std::nullopt;
  const auto u32 = [data](std::size_t at) { return read_be<std::uint32_t>(data, at); };
  const auto i32 = [data](std::size_t at) { return read_be<std::int32_t>(data, at); };
  GnssPvt pvt{};
  pvt.time_of_week_ms = u32(0);
  pvt.year = read_be<std::uint16_t>(data, 4);
  pvt.month = data[6];
  pvt.day = data[7];
  pvt.hour = data[8];
  pvt.minute = data[9];
  pvt.second = data[10];
  pvt.valid = data[11];
  pvt.time_accuracy_ns = u32(12);
  pvt.nanoseconds = i32(16);
  pvt.fix_type = data[20];
  pvt.flags = data[21];
  pvt.n_satellites = data[22];
  pvt.reserved = data[23];
  pvt.longitude_1e7_deg = i32(24);
  pvt.latitude_1e7_deg = i32(28);
  pvt.height_mm = i32(32);
  pvt.height_msl_mm = i32(36);
  pvt.horizontal_accuracy_mm = u32(40);
  pvt.vertical_accuracy_mm = u32(44);
  pvt.velocity_ned_mmps = {i32(48), i32(52), i32(56)};
  pvt.ground_speed_mmps = i32(60);
  pvt.course_1e5_deg = i32(64);
  pvt.speed_accuracy_mmps = u32(68);
  pvt.course_accuracy_1e5_deg = u32(72);
  pvt.vehicle_heading_1e5_deg = i32(76);
  for (std::size_t i = 0; i < pvt.dop_centi.size(); ++i) {
    pvt.dop_centi[i] = read_be<std::uint16_t>(data, 80 + 2 * i);
  }
  return pvt;
}

NavPvt nav_pvt_of(const GnssPvt& pvt, unsigned rtk) noexcept {
  constexpr std::uint8_t kFlags = kPvtFixOk | kPvtDifferential;
  NavPvt out{};
  out.itow = pvt.time_of_week_ms;
  out.year = pvt.year;
  out.month = pvt.month;
  out.day = pvt.day;
  out.hour = pvt.hour;
  out.minute = pvt.minute;
  out.sec = pvt.second;
  out.valid = pvt.valid;
  out.tacc = pvt.time_accuracy_ns;
  out.nano = pvt.nanoseconds;
  out.fix = pvt.fix_type;
  out.flags = static_cast<std::uint8_t>((pvt.flags & kFlags) | rtk << kPvtCarrierShift);
  out.nsv = pvt.n_satellites;
  out.lon = pvt.longitude_1e7_deg;
  out.lat = pvt.latitude_1e7_deg;
  out.h = pvt.height_mm;
  out.hmsl = pvt.height_msl_mm;
  out.hacc = pvt.horizontal_accuracy_mm;
  out.vacc = pvt.vertical_accuracy_mm;
  out.vn = pvt.velocity_ned_mmps[0];
  out.ve = pvt.velocity_ned_mmps[1];
  out.vd = pvt.velocity_ned_mmps[2];
  out.gs = pvt.ground_speed_mmps;
  out.hm = pvt.course_1e5_deg;
  out.sacc = pvt.speed_accuracy_mmps;
  out.hda = pvt.course_accuracy_1e5_deg;
  out.pdop = pvt.dop_centi[1];
  return out;
}

}  // namespace imuscope::xsens
