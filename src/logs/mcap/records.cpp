#include "logs/mcap/records.h"

#include <zlib.h>

#include <algorithm>

namespace imuscope::mcap {

bool read_exactly(std::istream& in, std::uint64_t n, std::string& out) {
  out.resize(n);
  in.read(out.data(), static_cast<std::streamsize>(n));
  const bool all = in.gcount() == static_cast<std::streamsize>(n);
  if (!all) {
    out.resize(static_cast<std::size_t>(std::max<std::streamsize>(in.gcount(), 0)));
    in.clear();
  }
  return all;
}

void RecordWriter::text(std::string_view text) {
  number(static_cast<std::uint32_t>(text.size()));
  out_.append(text);
}

void RecordWriter::texts(const Texts& texts) {
  std::string packed;
  RecordWriter writer(packed);
  for (const auto& [key, value] : texts) {
    writer.text(key);
    writer.text(value);
  }
  text(packed);
}

std::size_t RecordWriter::begin(Opcode opcode) {
  const std::size_t begun = out_.size();
  number(static_cast<std::uint8_t>(opcode));
  number(std::uint64_t{0});
  return begun;
}

void RecordWriter::end(std::size_t begun) {
  std::string length;
  RecordWriter(length).number(static_cast<std::uint64_t>(out_.size() - begun - kRecordHead));
  out_.replace(begun + 1, length.size(), length);
}

Bytes RecordReader::bytes(std::uint64_t n) noexcept {
  if (n > rest_.size()) {
    good_ = false;
    rest_ = {};
    return {};
  }
  const Bytes taken = rest_.first(n);
  rest_ = rest_.subspan(n);
  return taken;
}

std::string_view RecordReader::text() noexcept { return text_of(bytes(number<std::uint32_t>())); }

std::optional<Record> record_at(Bytes bytes) noexcept {
  RecordReader head(bytes);
  const auto opcode = static_cast<Opcode>(head.number<std::uint8_t>());
  const auto content = head.bytes(head.number<std::uint64_t>());
  if (!head.good()) return std::nullopt;
  return Record{opcode, content, kRecordHead + content.size()};
}

std::uint32_t crc32_of(Bytes bytes, std::uint32_t before) noexcept {
  return static_cast<std::uint32_t>(::crc32_z(before, bytes.data(), bytes.size()));
}

}  // namespace imuscope::mcap
