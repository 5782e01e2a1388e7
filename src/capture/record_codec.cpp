#include "capture/record_codec.h"

#include <algorithm>
#include <imuscope/exception_t.hpp>
#include <imuscope/raw_t.hpp>
#include <imuscope/run_t.hpp>
#include <span>
#include <utility>

#include "capture/stamp_range.h"
#include "publish/message_codec.h"
#include "publish/message_values.h"

namespace imuscope {
namespace {

constexpr std::int64_t kNsPerUs = 1000;
/// Nothing that is counted one by one gets as far: beyond is damage, and so is the record.
constexpr std::int64_t kCountEnd = std::int64_t{1} << 62U;

bool is_count(std::int64_t n) { return n >= 0 && n < kCountEnd; }

std::int64_t fingerprint_of(const std::vector<std::uint8_t>& message) {
  std::uint64_t fingerprint = 0;
  for (std::size_t i = 0; i < sizeof fingerprint; ++i) fingerprint = fingerprint << 8U | message[i];
  return static_cast<std::int64_t>(fingerprint);
}

std::optional<CaptureRecord> to_record(const run_t& message) {
  if (!is_stamp_ns(message.t0_ns) || message.t0_utime < 0 || !is_stamp_us(message.t0_utime))
    return std::nullopt;
  RunHeader header;
  header.name = message.name;
  header.version = message.version;
  header.build = message.build;
  header.processor = message.processor;
  header.t0 = host_time_from_ns(message.t0_ns);
  header.period = Duration{message.period_ns};
  header.t0_wall = utc_time_from_ns(message.t0_utime * kNsPerUs);
  header.configuration = message.configuration;
  header.configuration_hash = message.configuration_hash;
  header.devices = message.devices;
  return header;
}

Direction direction_of(std::int8_t direction) {
  switch (direction) {
    case raw_t::WRITE:
      return Direction::kWrite;
    case raw_t::LINE:
      return Direction::kLine;
    default:
      return Direction::kRead;
  }
}

std::int8_t code_of(Direction direction) {
  switch (direction) {
    case Direction::kRead:
      return raw_t::READ;
    case Direction::kWrite:
      return raw_t::WRITE;
    case Direction::kLine:
      return raw_t::LINE;
    case Direction::kStampedRead:
      return raw_t::STAMPED_READ;
  }
  return raw_t::READ;
}

std::optional<CaptureRecord> to_record(raw_t&& message) {
  if (!is_stamp_ns(message.arrival_ns) || !is_count(message.sequence)) return std::nullopt;
  RawPiece piece;
  piece.read.device = std::move(message.device);
  piece.read.direction = direction_of(message.direction);
  piece.read.arrival = host_time_from_ns(message.arrival_ns);
  piece.read.bytes = std::move(message.bytes);
  piece.sequence = message.sequence;
  piece.continues = message.continues != 0;
  if (message.direction == raw_t::STAMPED_READ) {
    if (piece.read.bytes.size() < kReceivedBytes) return std::nullopt;
    const std::int64_t received_ns =
        nanoseconds_of(std::span<const std::uint8_t>(piece.read.bytes).first<kReceivedBytes>());
    if (!is_stamp_ns(received_ns)) return std::nullopt;
    piece.read.received = std::min(host_time_from_ns(received_ns), piece.read.arrival);
    piece.read.bytes.erase(piece.read.bytes.begin(), piece.read.bytes.begin() + kReceivedBytes);
  }
  return piece;
}

std::int8_t kind_of(ExceptionKind kind) {
  switch (kind) {
    case ExceptionKind::kLateSample:
      return exception_t::LATE_SAMPLE;
    case ExceptionKind::kRefusedSample:
      return exception_t::REFUSED_SAMPLE;
    case ExceptionKind::kSkippedTicks:
      break;
  }
  return exception_t::SKIPPED_TICKS;
}

std::optional<CaptureRecord> to_record(const exception_t& message) {
  for (const std::int64_t number : {message.sample_sequence, message.tick}) {
    if (number != -1 && !is_count(number)) return std::nullopt;
  }
  if (!is_count(message.count)) return std::nullopt;
  StoredException stored;
  switch (message.kind) {
    case exception_t::LATE_SAMPLE:
      stored.exception.kind = ExceptionKind::kLateSample;
      break;
    case exception_t::REFUSED_SAMPLE:
      stored.exception.kind = ExceptionKind::kRefusedSample;
      break;
    case exception_t::SKIPPED_TICKS:
      stored.exception.kind = ExceptionKind::kSkippedTicks;
      break;
    default:
      return std::nullopt;
  }
  stored.device = message.device;
  stored.exception.sample_sequence = message.sample_sequence;
  stored.exception.tick = message.tick;
  stored.exception.count = message.count;
  return stored;
}

}  // namespace

std::int64_t RecordClock::utime(HostTime time) const noexcept { return to_utime(t0_wall + (time - t0)); }

HostTime RecordClock::host_time(std::int64_t utime) const noexcept {
  return t0 + (utc_time_from_ns(utime * kNsPerUs) - t0_wall);
}

std::vector<std::uint8_t> encode(const RunHeader& header, std::int64_t file) {
  run_t message;
  message.utime = to_utime(header.t0_wall);
  message.sequence = file;
  message.format = kCaptureFormat;
  message.name = header.name;
  message.version = header.version;
  message.build = header.build;
  message.processor = header.processor;
  message.t0_ns = to_ns(header.t0);
  message.period_ns = header.period.count();
  message.t0_utime = message.utime;
  message.configuration = header.configuration;
  message.configuration_hash = header.configuration_hash;
  message.n_devices = static_cast<std::int32_t>(header.devices.size());
  message.devices = header.devices;
  return encode_message(message);
}

std::vector<std::uint8_t> encode(const RawChunk& chunk, const std::string& device, const RecordClock& clock) {
  raw_t message;
  message.utime = clock.utime(chunk.info.arrival);
  message.sequence = chunk.info.sequence;
  message.device = device;
  message.direction = code_of(chunk.info.direction);
  message.arrival_ns = to_ns(chunk.info.arrival);
  message.continues = chunk.info.continues ? 1 : 0;
  message.n_bytes = static_cast<std::int32_t>(chunk.bytes.size());
  message.bytes.assign(chunk.bytes.begin(), chunk.bytes.end());
  return encode_message(message);
}

std::vector<std::uint8_t> encode(const RunException& exception, const std::string& device, HostTime at,
                                 std::int64_t sequence, const RecordClock& clock) {
  exception_t message;
  message.utime = clock.utime(at);
  message.sequence = sequence;
  message.kind = kind_of(exception.kind);
  if (exception.kind != ExceptionKind::kSkippedTicks) message.device = device;
  message.sample_sequence = exception.sample_sequence;
  message.tick = exception.tick;
  message.count = exception.count;
  return encode_message(message);
}

std::optional<CaptureRecord> decode_record(const std::vector<std::uint8_t>& message) {
  if (message.size() < sizeof(std::int64_t)) return std::nullopt;
  const std::int64_t fingerprint = fingerprint_of(message);
  if (fingerprint == raw_t::getHash()) {
    if (auto raw = decode_message<raw_t>(message)) return to_record(std::move(*raw));
  } else if (fingerprint == run_t::getHash()) {
    const auto run = decode_message<run_t>(message);
    if (run && run->format == kCaptureFormat) return to_record(*run);
  } else if (fingerprint == exception_t::getHash()) {
    if (const auto exception = decode_message<exception_t>(message)) return to_record(*exception);
  } else if (fingerprint == applied_model_t::getHash()) {
    if (auto applied = decode_message<applied_model_t>(message)) return std::move(*applied);
  } else if (fingerprint == event_t::getHash()) {
    auto event = decode_message<event_t>(message);
    if (event && is_stamp_us(event->utime)) return std::move(*event);
  }
  return std::nullopt;
}

std::string_view device_of_bytes(const std::vector<std::uint8_t>& message) {
  // Fingerprint, utime and sequence stand before the name: its length with the zero at its end, its letters.
  constexpr std::size_t kLengthAt = 3 * sizeof(std::int64_t);
  constexpr std::size_t kNameAt = kLengthAt + sizeof(std::int32_t);
  if (message.size() < kNameAt || fingerprint_of(message) != raw_t::getHash()) return {};
  std::size_t length = 0;
  for (std::size_t i = kLengthAt; i < kNameAt; ++i) length = length << 8U | message[i];
  if (length == 0 || length > message.size() - kNameAt) return {};
  return {reinterpret_cast<const char*>(message.data()) + kNameAt, length - 1};
}

}  // namespace imuscope
