#include "base/bytes.h"
#include "drivers/ixblue_stdbin/messages.h"
#include "drivers/ixblue_stdbin/scanner.h"
#include "drivers/ixblue_stdbin/status_names.h"
#include "stream_protocols.h"
#include "whole_stream.h"

namespace imuscope::cli {
namespace {

using namespace ixblue_stdbin;
using Json = nlohmann::ordered_json;

bool is_real(FieldType type) { return type == FieldType::kF32 || type == FieldType::kF64; }
bool is_text(FieldType type) { return type == FieldType::kText8 || type == FieldType::kText32; }

Json blocks_json(const Telegram& telegram) {
  Json blocks = Json::object();
  telegram.for_each_block([&](const BlockLayout& layout, std::span<const std::uint8_t> bytes) {
    Json& block = blocks[std::string(layout.name)];
    for_each_field(layout, bytes, [&](const FieldLayout& field, const FieldValue& value) {
      block[std::string(field.name)] =
          is_text(field.type) ? Json(value.text) : json_number(value.number, !is_real(field.type));
    });
  });
  return blocks;
}

/// Names of the set bits of each status block that came.
Json status_json(const Telegram& telegram) {
  Json status = Json::object();
  telegram.for_each_block([&](const BlockLayout& layout, std::span<const std::uint8_t> bytes) {
    for (const StatusBlock& known : kStatusBlocks) {
      if (known.block != layout.name) continue;
      Json& names = status[std::string(layout.name)] = Json::array();
      for (std::size_t word = 0; 4 * word < bytes.size() && known.words[word] != nullptr; ++word) {
        for_each_set_bit(*known.words[word], read_be<std::uint32_t>(bytes, 4 * word),
                         [&](std::string_view name) { names.push_back(name); });
      }
    }
  });
  return status;
}

/// After the last block of a group that was read, or `from` where it has none.
template <typename Layouts, typename Offsets>
std::size_t end_of(const Layouts& layouts, const Offsets& offsets, std::size_t from) {
  for (std::size_t i = 0; i < offsets.size(); ++i) {
    if (offsets[i] != 0) from = offsets[i] + layouts[i].size;
  }
  return from;
}

Json telegram_json(const Telegram& telegram) {
  const std::size_t header = header_layout(telegram.version).size;
  const std::size_t nav_end =
      end_of(kExtendedBlocks, telegram.extended_at, end_of(kNavBlocks, telegram.nav_at, header));
  const std::size_t consumed = end_of(kExternalBlocks, telegram.external_at, nav_end);
  Json fields = {{"version", telegram.version},
                 {"nav_mask", telegram.nav_mask},
                 {"ext_mask", telegram.extended_mask},
                 {"external_mask", telegram.external_mask},
                 {"nav_size", nullptr},
                 {"telegram_size", telegram.total_size},
                 {"validity_100us", telegram.validity_ticks},
                 {"counter", telegram.counter},
                 {"header_len", header},
                 {"checksum", telegram.checksum},
                 {"checksum_ok", true},
                 {"blocks", blocks_json(telegram)},
                 {"nav_end", nav_end},
                 {"consumed", consumed},
                 {"leftover", telegram.bytes.size() - kChecksumSize - consumed}};
  if (telegram.nav_size) fields["nav_size"] = *telegram.nav_size;
  if (Json status = status_json(telegram); !status.empty()) fields["status"] = std::move(status);
  if (telegram.rest_unread) fields["rest_unread"] = true;
  return fields;
}

Json answer_json(std::span<const std::uint8_t> bytes) {
  const auto payload = bytes.subspan(kAnswerHeaderSize, bytes.size() - kAnswerHeaderSize - kChecksumSize);
  return {{"kind", "answer"},
          {"version", bytes[kVersionOffset]},
          {"size", read_be<std::uint16_t>(bytes, kAnswerSizeOffset)},
          {"payload", hex(payload)}};
}

}  // namespace

void decode_ixblue_stdbin(std::span<const std::uint8_t> stream, const Visitor& visitor) {
  scan_whole<Scanner, Frame>(stream, visitor, [&](const Frame& frame) {
    const bool telegram = frame.kind == Frame::Kind::kTelegram;
    visitor.message({frame.offset, frame.bytes.size(), telegram ? "telegram" : "answer", true,
                     telegram ? telegram_json(parse_telegram(frame.bytes)) : answer_json(frame.bytes)});
  });
}

}  // namespace imuscope::cli
