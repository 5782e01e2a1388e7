#include "drivers/nmea/messages.h"
#include "drivers/nmea/scanner.h"
#include "stream_protocols.h"
#include "whole_stream.h"

namespace imuscope::cli {
namespace {

using namespace nmea;
using Json = nlohmann::ordered_json;

Json value_json(const NamedValue& value) {
  switch (value.kind) {
    case NamedValue::Kind::kText:
      return value.text;
    case NamedValue::Kind::kBool:
      return value.number != 0.0;
    case NamedValue::Kind::kInteger:
      return json_number(value.number, true);
    case NamedValue::Kind::kReal:
      break;
  }
  return json_number(value.number, false);
}

}  // namespace

void decode_nmea(std::span<const std::uint8_t> stream, const Visitor& visitor) {
  scan_whole<Scanner, Frame>(stream, visitor, [&](const Frame& frame) {
    const Fields sentence(frame.sentence);
    DecodedMessage message;
    message.offset = frame.offset;
    message.size = behind_line_end(stream, frame.offset + frame.sentence.size()) - frame.offset;
    message.message = sentence.type().empty() ? sentence.address() : sentence.type();
    message.fields["sentence"] = frame.sentence;
    for_each_field(sentence, [&](const NamedValue& value) {
      message.fields[std::string(value.name)] = value_json(value);
    });
    visitor.message(message);
  });
}

}  // namespace imuscope::cli
