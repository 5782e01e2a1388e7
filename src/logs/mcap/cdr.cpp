#include "logs/mcap/cdr.h"

#include <algorithm>

namespace imuscope::mcap {
namespace {

constexpr char kPlainLittleEndian = 1;

}  // namespace

void CdrWriter::begin() { out_.assign({0, kPlainLittleEndian, 0, 0}); }

void CdrWriter::text(std::string_view text) {
  number(static_cast<std::uint32_t>(text.size() + 1));
  out_.append(text);
  out_.push_back('\0');
}

CdrReader::CdrReader(Bytes message, Wire wire) noexcept : wire_(wire) {
  if (wire_ == Wire::kRos1) {
    body_ = message;
    return;
  }
  // 0 and 1 are plain CDR; what else there is (parameter lists, XCDR2) no ROS message of these types is
  // written in.
  good_ = message.size() >= kCdrHead && message[0] == 0 && message[1] <= kPlainLittleEndian;
  if (!good_) return;
  swap_ = message[1] != kPlainLittleEndian;
  body_ = message.subspan(kCdrHead);
}

void CdrReader::align(std::size_t size) noexcept {
  const std::size_t over = wire_ == Wire::kCdr ? at_ % size : 0;
  if (over > 0) at_ = std::min(body_.size(), at_ + size - over);
}

std::string_view CdrReader::text() noexcept {
  const auto size = number<std::uint32_t>();
  if (size > body_.size() - at_) {
    good_ = false;
    at_ = body_.size();
    return {};
  }
  auto text = text_of(body_.subspan(at_, size));
  at_ += size;
  if (wire_ == Wire::kCdr && text.ends_with('\0')) text.remove_suffix(1);
  return text;
}

}  // namespace imuscope::mcap
