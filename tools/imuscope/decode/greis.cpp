#include "drivers/greis/messages.h"
#include "drivers/greis/scanner.h"
#include "drivers/nmea/scanner.h"
#include "stream_protocols.h"
#include "whole_stream.h"

namespace imuscope::cli {
namespace {

using namespace greis;
using Json = nlohmann::ordered_json;

std::string text_of(std::span<const std::uint8_t> bytes) { return {bytes.begin(), bytes.end()}; }

/// Messages whose bodies are text.
bool is_text_message(std::uint16_t id) {
  return id == kFileIdentifier || id == kReply || id == kErrorReply || id == kMessagesFormat ||
         id == kParameter;
}

Json message_json(const Frame& frame) {
  Json fields = {{"id", text_of(frame.bytes.first(kIdSize))}, {"body_len", frame.body.size()}};
  if (is_text_message(frame.id)) {
    fields["text"] = text_of(frame.body);
    return fields;
  }
  fields["checksum"] = frame.body.back();
  bool known = false;
  for_each_field(frame.id, frame.body, [&](const NamedValue& value) {
    known = true;
    fields[std::string(value.name)] = json_number(value.number, value.is_integer);
  });
  if (!known) fields["data"] = hex(frame.body.first(frame.body.size() - 1));
  return fields;
}

/// A sentence with its checksum is NMEA's, whatever the receiver it comes from.
bool is_sentence(std::span<const std::uint8_t> line) {
  return line[0] == '$' && nmea::examine_sentence(line).verdict == Verdict::kFrame;
}

}  // namespace

void decode_greis(std::span<const std::uint8_t> stream, const Visitor& visitor) {
  scan_whole<Scanner, Frame>(stream, visitor, [&](const Frame& frame) {
    const auto size = behind_line_end(stream, frame.offset + frame.bytes.size()) - frame.offset;
    if (frame.kind == Frame::Kind::kText) {
      if (is_sentence(frame.bytes)) return;
      visitor.message({frame.offset, size, "TEXT", false, {{"text", text_of(frame.bytes)}}});
      return;
    }
    visitor.message({frame.offset, size, text_of(frame.bytes.first(kIdSize)), true, message_json(frame)});
  });
}

}  // namespace imuscope::cli
