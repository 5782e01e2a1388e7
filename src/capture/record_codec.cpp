#include "capture/record_codec.h"

#include <algorithm>
#include <imuscope/exception_t.hpp>
#include <imuscope/raw_t.hpp>
#include <imuscope/run_t.hpp>
#include <span>
#include <utility>

#include "base/bytes.h"
#include "capture/fingerprint.h"
#include "capture/stamp_range.h"
#include "publish/message_codec.h"
#include "publish/message_values.h"

namespace imuscope {
namespace {

constexpr std::int64_t kNsPerUs = 1000;
/// Nothing that is counted one by one gets as far: beyond is damage, and so is the record.
constexpr std::int64_t kCountEnd = std::int64_t{1} << 62U;

bool is_count(std::int64_t n) { return n >= 0 && n < kCountEnd; }

/// Takes numbers, high byte first, and bytes from a message until it has no more.
class FieldReader {
 public:
  explicit FieldReader(std::span<const std::uint8_t> message) : rest_(message) {}
  template <typename Integer>
  Integer number() noexcept {
    if (!has(sizeof(Integer))) return 0;
    const auto value = read_be<Integer>(rest_);
    rest_ = rest_.subspan(sizeof(Integer));
    return value;
  }
  std::span<const std::uint8_t> bytes(std::int32_t n) noexcept {
    if (n < 0 || !has(static_cast<std::size_t>(n))) {
      is_good_ = false;
      return {};
    }
    const auto taken = rest_.first(static_cast<std::size_t>(n));
    rest_ = rest_.subspan(taken.size());
    return taken;
  }
  /// Whether all was there, and nothing more.
  [[nodiscard]] bool is_whole() const noexcept { return is_good_ && rest_.empty(); }

 private:
  bool has(std::size_t n) noexcept { return is_good_ = is_good_ && n <= rest_.size(); }
  std::span<const std::uint8_t> rest_;
  bool is_good_ = true;
};

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

std::optional<CaptureRecord> decode_record(std::span<const std::uint8_t> message) {
  if (message.size() < sizeof(std::int64_t)) return std::nullopt;
  const std::int64_t fingerprint = fingerprint_of(message);
  if (fingerprint == raw_t::getHash()) {
    if (const auto raw = view_raw(message)) return RawPiece{to_read(*raw), raw->sequence, raw->continues};
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

std::optional<RawView> view_raw(std::span<const std::uint8_t> message) noexcept {
  static const std::int64_t kFingerprint = raw_t::getHash();
  // One object, named by every return and so filled where it is wanted: it is asked for with every read, and a
  // copy of fields that were just written costs more than to find them.
  std::optional<RawView> view;
  FieldReader fields(message);
  if (fields.number<std::int64_t>() != kFingerprint) return view;
  (void)fields.number<std::int64_t>();  // utime
  const auto sequence = fields.number<std::int64_t>();
  const auto device = fields.bytes(fields.number<std::int32_t>());  // and the zero at its end
  const auto direction = fields.number<std::int8_t>();
  const auto arrival_ns = fields.number<std::int64_t>();
  const bool continues = fields.number<std::int8_t>() != 0;
  auto bytes = fields.bytes(fields.number<std::int32_t>());
  if (!fields.is_whole() || device.empty()) return view;
  if (!is_stamp_ns(arrival_ns) || !is_count(sequence)) return view;
  std::optional<HostTime> received;
  if (direction == raw_t::STAMPED_READ) {
    if (bytes.size() < kReceivedBytes) return view;
    const std::int64_t received_ns = nanoseconds_of(bytes.first<kReceivedBytes>());
    if (!is_stamp_ns(received_ns)) return view;
    received = host_time_from_ns(std::min(received_ns, arrival_ns));
    bytes = bytes.subspan(kReceivedBytes);
  }
  view.emplace();
  view->device = {reinterpret_cast<const char*>(device.data()), device.size() - 1};
  view->direction = direction_of(direction);
  view->arrival = host_time_from_ns(arrival_ns);
  view->sequence = sequence;
  view->continues = continues;
  view->bytes = bytes;
  view->received = received;
  return view;
}

bool is_raw(std::span<const std::uint8_t> message) noexcept {
  static const std::int64_t kFingerprint = raw_t::getHash();
  return message.size() > sizeof(std::int64_t) && fingerprint_of(message) == kFingerprint;
}

std::string_view device_of_raw(std::span<const std::uint8_t> message) noexcept {
  if (!is_raw(message)) return {};
  constexpr std::size_t kNameAt = 3 * sizeof(std::int64_t);  // behind fingerprint, utime and sequence
  FieldReader fields(message.subspan(std::min(kNameAt, message.size())));
  const auto device = fields.bytes(fields.number<std::int32_t>());  // and the zero at its end
  if (device.empty()) return {};
  return {reinterpret_cast<const char*>(device.data()), device.size() - 1};
}

RawRead to_read(const RawView& view) {
  return {std::string(view.device),
          view.direction,
          view.arrival,
          {view.bytes.begin(), view.bytes.end()},
          view.received};
}

}  // namespace imuscope
