#pragma once

/// NAV-PVT as it stands on the wire.

#include <cstdint>
#include <span>
#include <string_view>

#include "base/bytes.h"
#include "drivers/device/nav_pvt.h"
#include "drivers/ubx/wire.h"

namespace imuscope::ubx {

/// @param payload  at least kPvtMin bytes
[[nodiscard]] inline NavPvt parse_nav_pvt(std::span<const std::uint8_t> payload) noexcept {
  const auto u16 = [&](std::size_t at) { return read_le<std::uint16_t>(payload, at); };
  const auto u32 = [&](std::size_t at) { return read_le<std::uint32_t>(payload, at); };
  const auto i32 = [&](std::size_t at) { return read_le<std::int32_t>(payload, at); };
  NavPvt pvt{};
  pvt.itow = u32(0);
  pvt.year = u16(4);
  pvt.month = payload[6], pvt.day = payload[7], pvt.hour = payload[8];
  pvt.minute = payload[9], pvt.sec = payload[10], pvt.valid = payload[11];
  pvt.tacc = u32(12);
  pvt.nano = i32(16);
  pvt.fix = payload[20], pvt.flags = payload[21], pvt.flags2 = payload[22], pvt.nsv = payload[23];
  pvt.lon = i32(24), pvt.lat = i32(28), pvt.h = i32(32), pvt.hmsl = i32(36);
  pvt.hacc = u32(40), pvt.vacc = u32(44);
  pvt.vn = i32(48), pvt.ve = i32(52), pvt.vd = i32(56);
  pvt.gs = i32(60), pvt.hm = i32(64), pvt.sacc = u32(68), pvt.hda = u32(72), pvt.pdop = u16(76);
  return pvt;
}

/// Calls visit(std::string_view name, double value) for each field; every value of the message is an integer.
template <typename Visit>
void for_each_field(const NavPvt& pvt, Visit&& visit) {
  const auto field = [&](std::string_view name, auto value) { visit(name, static_cast<double>(value)); };
  field("itow", pvt.itow), field("year", pvt.year), field("month", pvt.month), field("day", pvt.day);
  field("hour", pvt.hour), field("minute", pvt.minute), field("sec", pvt.sec), field("valid", pvt.valid);
  field("tacc", pvt.tacc), field("nano", pvt.nano), field("fix", pvt.fix), field("flags", pvt.flags);
  field("flags2", pvt.flags2), field("nsv", pvt.nsv), field("lon", pvt.lon), field("lat", pvt.lat);
  field("h", pvt.h), field("hmsl", pvt.hmsl), field("hacc", pvt.hacc), field("vacc", pvt.vacc);
  field("vn", pvt.vn), field("ve", pvt.ve), field("vd", pvt.vd), field("gs", pvt.gs), field("hm", pvt.hm);
  field("sacc", pvt.sacc), field("hda", pvt.hda), field("pdop", pvt.pdop);
}

}  // namespace imuscope::ubx
