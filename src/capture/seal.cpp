#include "capture/seal.h"

#include <zlib.h>

#include <utility>

#include "base/bytes.h"
#include "base/contracts.h"
#include "capture/event_log.h"
#include "capture/fingerprint.h"
#include "capture/record_codec.h"
#include "publish/message_codec.h"

namespace imuscope {
namespace {

constexpr std::int64_t kBytesPerPlace = std::int64_t{1} << 20U;

/// Both messages end with a checksum of what stands before it.
constexpr std::size_t kChecksumBytes = sizeof(std::int32_t);

template <typename Message>
std::vector<std::uint8_t> encode_checked(Message& message) {
  const auto bytes = encode_message(message);
  const std::span<const std::uint8_t> all(bytes);
  message.checksum = static_cast<std::int32_t>(crc32_of(all.first(all.size() - kChecksumBytes)));
  return encode_message(message);
}

template <typename Message>
bool claims_to_be(std::span<const std::uint8_t> message) noexcept {
  static const std::int64_t kFingerprint = Message::getHash();
  return fingerprint_of(message) == kFingerprint;
}

template <typename Message>
std::optional<Message> decode_checked(std::span<const std::uint8_t> bytes) {
  // Most messages are neither, and a look is cheaper than to try.
  if (!claims_to_be<Message>(bytes)) return std::nullopt;
  auto message = decode_message<Message>(bytes);
  if (!message) return std::nullopt;
  const auto checksum = static_cast<std::int32_t>(crc32_of(bytes.first(bytes.size() - kChecksumBytes)));
  return checksum == message->checksum ? std::move(message) : std::nullopt;
}

bool is_of_device(std::string_view channel) { return channel.find("_RAW_") != std::string_view::npos; }

/// A device's name comes after the kind: a device called SEAL is none.
bool is_of_kind(std::string_view channel, std::string_view kind) {
  if (!channel.ends_with(kind)) return false;
  channel.remove_suffix(kind.size());
  return channel.ends_with('_') && !is_of_device(channel);
}

}  // namespace

std::uint32_t crc32_of(std::span<const std::uint8_t> bytes, std::uint32_t before) noexcept {
  // zlib takes no pointer as a wish for the first value.
  if (bytes.empty()) return before;
  return static_cast<std::uint32_t>(::crc32_z(before, bytes.data(), bytes.size()));
}

std::uint32_t crc32_of(const LogEventView& event) {
  const auto header = event_log_header(event.number, event.utime, event.channel.size(), event.data.size());
  const std::span channel(reinterpret_cast<const std::uint8_t*>(event.channel.data()), event.channel.size());
  return crc32_of(event.data, crc32_of(channel, crc32_of(header)));
}

void Sealer::add(std::int64_t number, std::int64_t utime, std::span<const std::uint8_t> record) {
  if (checksums_.empty()) first_number_ = number;
  IMUSCOPE_EXPECTS(number == first_number_ + static_cast<std::int64_t>(checksums_.size()));
  checksums_.push_back(static_cast<std::int32_t>(crc32_of(record)));
  utime_ = utime;
}

std::vector<std::uint8_t> Sealer::seal() {
  capture_seal_t seal{};
  seal.utime = utime_;
  seal.sequence = seals_++;
  seal.first_number = first_number_;
  seal.n_records = static_cast<std::int32_t>(checksums_.size());
  seal.checksums = std::exchange(checksums_, {});
  return encode_checked(seal);
}

void Sealer::written(std::span<const std::uint8_t> bytes, std::uint64_t records) {
  file_checksum_ = crc32_of(bytes, file_checksum_);
  n_bytes_ += static_cast<std::int64_t>(bytes.size());
  n_records_ += static_cast<std::int64_t>(records);
  const std::int64_t last_place = offsets_.empty() ? 0 : offsets_.back();
  if (n_bytes_ - last_place < kBytesPerPlace) return;
  offsets_.push_back(n_bytes_);
  utimes_.push_back(utime_);
}

std::vector<std::uint8_t> Sealer::index(std::int64_t file_number) const {
  capture_index_t index{};
  index.utime = utime_;
  index.sequence = file_number;
  index.n_bytes = n_bytes_;
  index.n_records = n_records_;
  index.file_checksum = static_cast<std::int32_t>(file_checksum_);
  index.n_places = static_cast<std::int32_t>(offsets_.size());
  index.offsets = offsets_;
  index.utimes = utimes_;
  return encode_checked(index);
}

std::optional<capture_seal_t> decode_seal(std::span<const std::uint8_t> message) {
  return decode_checked<capture_seal_t>(message);
}

std::optional<capture_index_t> decode_index(std::span<const std::uint8_t> message) {
  return decode_checked<capture_index_t>(message);
}

bool is_seal_or_index(const LogEventView& event) {
  return claims_to_be<capture_seal_t>(event.data) || claims_to_be<capture_index_t>(event.data) ||
         is_of_kind(event.channel, kSealKind) || is_of_kind(event.channel, kIndexKind);
}

bool is_surely_no_seal(const LogEventView& event) {
  return is_raw(event.data) && is_of_device(event.channel);
}

}  // namespace imuscope
