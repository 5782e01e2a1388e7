#include "candump.h"

#include <fmt/format.h>
#include <algorithm>

#include "drivers/can_bus/error_frame.h"
#include "drivers/transport/candump.h"
#include "whole_stream.h"

namespace imuscope::cli {
namespace {

nlohmann::ordered_json value_json(const dbc::SignalLayout& layout, std::uint64_t raw) {
  const bool is_number_itself = layout.factor == 1.0 && layout.offset == 0.0;
  if (is_number_itself && layout.coding == dbc::Coding::kUnsigned) return raw;
  if (is_number_itself && layout.coding == dbc::Coding::kSigned) return dbc::signed_of(layout, raw);
  return dbc::value_of(layout, raw);
}

/// What the DBC file says of a frame; false where it does not know it.
bool describe_signals(const CanFrame& frame, const dbc::Database& database, DecodedMessage& out) {
  const dbc::Message* message = database.find(frame.id, frame.is_extended);
  if (message == nullptr || frame.is_remote) return false;
  out.message = message->name;
  auto signals = nlohmann::ordered_json::object();
  auto names = nlohmann::ordered_json::object();
  auto absent = nlohmann::ordered_json::array();
  for (std::size_t s = 0; s < message->signals.size(); ++s) {
    const dbc::Signal& signal = message->signals[s];
    const auto raw = dbc::raw_in_frame(*message, s, frame.payload());
    if (!raw) {
      // Another multiplex is the rule; a frame that is too short is worth a word.
      if (frame.length < dbc::bytes_needed(signal.layout)) absent.push_back(signal.name);
      continue;
    }
    signals[signal.name] = value_json(signal.layout, *raw);
    if (const auto name = dbc::name_of(signal, *raw); !name.empty()) names[signal.name] = name;
  }
  out.fields["signals"] = std::move(signals);
  if (!names.empty()) out.fields["names"] = std::move(names);
  if (!absent.empty()) out.fields["beyond_the_frame"] = std::move(absent);
  return true;
}

std::string id_text(const CanFrame& frame) {
  return frame.is_extended ? fmt::format("{:08X}", frame.id) : fmt::format("{:03X}", frame.id);
}

void describe_frame(std::string_view line, const CandumpFrame& logged, const dbc::Database* database,
                    DecodedMessage& out) {
  const CanFrame& frame = logged.frame;
  out.fields = nlohmann::ordered_json::object();
  // The log's own stamp, digit for digit.
  const auto open = line.find('(');
  out.fields["time"] = line.substr(open + 1, line.find(')') - open - 1);
  out.fields["interface"] = logged.interface;
  out.fields["id"] = frame.id;
  if (frame.is_error) {
    out.message = "error frame";
    out.fields["error"] = describe_can_error(frame);
    out.fields["data"] = hex(frame.payload());
    return;
  }
  out.fields["extended"] = frame.is_extended;
  out.fields["fd"] = frame.is_fd;
  if (database != nullptr && describe_signals(frame, *database, out)) return;
  out.message = frame.is_remote ? "remote " + id_text(frame) : id_text(frame);
  out.fields["length"] = frame.length;
  if (!frame.is_remote) out.fields["data"] = hex(frame.payload());
}

}  // namespace

void decode_candump(std::span<const std::uint8_t> stream, const dbc::Database* database,
                    const Visitor& visitor) {
  const std::string_view text(reinterpret_cast<const char*>(stream.data()), stream.size());
  std::uint64_t told = 0;
  for (std::size_t at = 0; at < text.size();) {
    tell_position(visitor, at, told);
    const std::size_t end = line_end(text, at, "\n");
    const std::size_t next = end < text.size() && text[end] == '\n' ? end + 1 : end;
    std::string_view line = text.substr(at, end - at);
    if (line.ends_with('\r')) line.remove_suffix(1);
    const CandumpLine read = read_candump_line(line);
    if (read.kind == CandumpLine::Kind::kFrame) {
      DecodedMessage message;
      message.offset = at;
      message.size = next - at;
      describe_frame(line, read.frame, database, message);
      visitor.message(message);
    }
    at = next;
  }
}

void decode_candump_frames(std::span<const std::uint8_t> stream, const Visitor& visitor) {
  decode_candump(stream, nullptr, visitor);
}

}  // namespace imuscope::cli
