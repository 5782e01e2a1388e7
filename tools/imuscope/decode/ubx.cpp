#include <fmt/format.h>

#include "drivers/ubx/messages.h"
#include "drivers/ubx/scanner.h"
#include "stream_protocols.h"
#include "whole_stream.h"

namespace imuscope::cli {
namespace {

using namespace ubx;
using Json = nlohmann::ordered_json;

bool is_nav_pvt(const Frame& frame) {
  return frame.message_class == kClassNav && frame.id == kIdPvt && frame.payload.size() >= kPvtMin;
}

}  // namespace

/// UBX messages alone: the sentences between them are NMEA's.
void decode_ubx(std::span<const std::uint8_t> stream, const Visitor& visitor) {
  scan_whole<Scanner, Frame>(stream, visitor, [&](const Frame& frame) {
    if (frame.kind != Frame::Kind::kMessage) return;
    Json fields = {{"cls", frame.message_class}, {"id", frame.id}};
    const bool pvt = is_nav_pvt(frame);
    if (pvt) {
      for_each_field(parse_nav_pvt(frame.payload), [&](std::string_view name, double value) {
        fields[std::string(name)] = json_number(value, true);
      });
    } else {
      fields["data"] = hex(frame.payload);
    }
    visitor.message({frame.offset, frame.bytes.size(),
                     pvt ? "NAV-PVT" : fmt::format("{:02X}-{:02X}", frame.message_class, frame.id), true,
                     std::move(fields)});
  });
}

}  // namespace imuscope::cli
