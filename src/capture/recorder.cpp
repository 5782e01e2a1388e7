#include "capture/recorder.h"

#include <algorithm>
#include <chrono>
#include <system_error>
#include <utility>

#include "base/contracts.h"
#include "capture/capture_files.h"
#include "rt/host_clock.h"
#include "rt/thread_setup.h"

namespace imuscope {
namespace {

// A kill loses at most what came since the last flush, a cut of the power what came since the last sync.
constexpr Duration kDrainInterval = std::chrono::milliseconds(100);
constexpr Duration kFlushInterval = std::chrono::milliseconds(250);
constexpr std::size_t kFlushBytes = std::size_t{1} << 20U;
/// What is published in kRecordStall_s: snapshots ten times a second, rows of errors by the hundred.
constexpr std::size_t kMaxWaitingMessageBytes = std::size_t{16} << 20U;

}  // namespace

Result<std::unique_ptr<Recorder>> Recorder::start(Options options, std::vector<RawRing*> raw_rings,
                                                  std::vector<ExceptionRing*> exception_rings) {
  IMUSCOPE_EXPECTS(options.run.devices.size() <= kMaxDevices);
  auto writer = begin_file(options, 0);
  if (!writer) return tl::unexpected(writer.error());
  auto recorder = std::unique_ptr<Recorder>(
      new Recorder(std::move(options), std::move(*writer), std::move(raw_rings), std::move(exception_rings)));
  recorder->update_status({});
  recorder->thread_ = std::thread([raw = recorder.get()] { raw->run(); });
  return recorder;
}

Recorder::Recorder(Options options, std::unique_ptr<CaptureWriter> writer, std::vector<RawRing*> raw_rings,
                   std::vector<ExceptionRing*> exception_rings)
    : options_(std::move(options)),
      clock_{options_.run.t0, options_.run.t0_wall},
      exception_channel_(channel_name(options_.channel_prefix, "EXCEPTION")),
      raw_rings_(std::move(raw_rings)),
      exception_rings_(std::move(exception_rings)),
      writer_(std::move(writer)),
      file_begin_(host_now()) {
  for (const std::string& device : options_.run.devices) {
    raw_channels_.push_back(channel_name(options_.channel_prefix, "RAW", device));
  }
}

Recorder::~Recorder() {
  if (thread_.joinable()) (void)stop();
}

Result<void> Recorder::stop() {
  IMUSCOPE_EXPECTS(thread_.joinable());
  stop_.store(true);
  thread_.join();
  drain();  // this thread is the consumer now: join() orders it after the other
  Result<void> closed = writer_->close();
  update_status(closed);
  return closed;
}

RecorderStatus Recorder::status() const {
  const std::scoped_lock lock(status_mutex_, messages_mutex_);
  RecorderStatus status = status_;
  status.messages_lost = messages_lost_;
  return status;
}

void Recorder::run() {
  (void)setup_this_thread({kRecorderThreadName, Scheduling::kNormal, 0, {}});  // a name is never refused
  HostTime flush_due = host_now() + kFlushInterval;
  HostTime sync_due = host_now() + options_.sync_interval;
  while (!stop_.load()) {
    const HostTime now = host_now();
    heartbeat_.beat(now);
    drain();
    if (now >= flush_due || now >= sync_due) {
      flush();
      flush_due = now + kFlushInterval;
    }
    if (now >= sync_due) {
      sync();
      sync_due = now + options_.sync_interval;
    }
    std::this_thread::sleep_for(std::min(kDrainInterval, sync_due - host_now()));
  }
}

void Recorder::drain() {
  while (drain_oldest_chunk()) {
    if (writer_->pending_bytes() > kFlushBytes) flush();
  }
  drain_exceptions();
  drain_messages();
}

/// Records the chunk that arrived first among the heads of the rings, so that the file is nearly in order.
bool Recorder::drain_oldest_chunk() {
  RawRing* oldest_ring = nullptr;
  std::optional<RawChunk> oldest;
  for (RawRing* ring : raw_rings_) {
    const auto chunk = ring->front();
    if (chunk && (!oldest || chunk->info.arrival < oldest->info.arrival)) {
      oldest_ring = ring;
      oldest = chunk;
    }
  }
  if (!oldest) return false;
  const DeviceIndex device = oldest->info.device;
  IMUSCOPE_EXPECTS(device < raw_channels_.size());
  const std::vector<std::uint8_t> message = encode(*oldest, options_.run.devices[device], clock_);
  writer_->append(raw_channels_[device], clock_.utime(oldest->info.arrival), message);
  if (options_.raw_tap) options_.raw_tap(*oldest);
  oldest_ring->pop();
  return true;
}

void Recorder::drain_exceptions() {
  for (ExceptionRing* ring : exception_rings_) {
    while (const RunException* exception = ring->front()) {
      const HostTime now = host_now();
      const bool has_device = exception->kind != ExceptionKind::kSkippedTicks;
      IMUSCOPE_EXPECTS(!has_device || exception->device < options_.run.devices.size());
      const std::string device = has_device ? options_.run.devices[exception->device] : std::string();
      const std::vector<std::uint8_t> message = encode(*exception, device, now, exceptions_++, clock_);
      writer_->append(exception_channel_, clock_.utime(now), message);
      ring->pop();
    }
  }
}

void Recorder::drain_messages() {
  std::vector<LogEvent> messages;
  {
    const std::lock_guard lock(messages_mutex_);
    messages.swap(messages_);
    messages_bytes_ = 0;
  }
  for (const LogEvent& message : messages) writer_->append(message.channel, message.utime, message.data);
}

void Recorder::record_heard(std::string_view channel, HostTime heard, std::span<const std::uint8_t> message) {
  record_message(channel, clock_.utime(heard), message);
}

void Recorder::record_message(std::string_view channel, std::int64_t utime,
                              std::span<const std::uint8_t> message) {
  const std::lock_guard lock(messages_mutex_);
  if (messages_bytes_ + message.size() > kMaxWaitingMessageBytes) {
    messages_lost_ += 1;
    return;
  }
  messages_bytes_ += message.size();
  messages_.push_back({0, utime, std::string(channel), {message.begin(), message.end()}});
}

/// Creates a file of the capture and writes the run header, so that each can be understood by itself.
Result<std::unique_ptr<CaptureWriter>> Recorder::begin_file(const Options& options, int number) {
  auto created = CaptureWriter::create(capture_file(options.path, number), options.channel_prefix, number);
  if (!created) return tl::unexpected(created.error());
  auto writer = std::make_unique<CaptureWriter>(std::move(*created));
  const RecordClock clock{options.run.t0, options.run.t0_wall};
  const std::vector<std::uint8_t> header = encode(options.run, number);
  writer->append(channel_name(options.channel_prefix, "RUN"), clock.utime(options.run.t0), header);
  if (auto flushed = writer->flush(); !flushed) {
    std::error_code ignored;  // an empty file left behind would only stand in the way of the next attempt
    std::filesystem::remove(writer->path(), ignored);
    return tl::unexpected(flushed.error());
  }
  return writer;
}

void Recorder::sync() {
  // What a disk did not keep it may not be told of again: the problem stays.
  if (auto synced = writer_->sync(); !synced) {
    finished_.problem = synced.error();
    update_status(synced);
  }
}

void Recorder::flush() {
  update_status(writer_->flush());
  rotate_if_due();
}

/// Where the next file cannot be made, the present one goes on and the problem shows in the status. In place
/// of one that somebody removed, a new one begins.
void Recorder::rotate_if_due() {
  const bool is_full = options_.max_file_bytes > 0 && writer_->bytes_written() >= options_.max_file_bytes;
  const bool is_old =
      options_.max_file_age > Duration::zero() && host_now() - file_begin_ >= options_.max_file_age;
  const bool is_removed = writer_->is_removed();
  if (!is_full && !is_old && !is_removed) return;
  const int number = file_number_ + (is_removed ? 0 : 1);
  auto next = begin_file(options_, number);
  Result<void> outcome;
  if (next) {
    outcome = writer_->close();
    if (is_removed && !outcome) finished_.problem = std::exchange(outcome, {}).error();
    finished_.bytes += writer_->bytes_written();
    finished_.records += writer_->records_written();
    finished_.records_lost += writer_->records_lost();
    writer_ = std::move(*next);
    file_number_ = number;
    file_begin_ = host_now();
  } else {
    outcome = tl::unexpected(next.error());
  }
  update_status(outcome);
}

void Recorder::update_status(const Result<void>& flushed) {
  const std::lock_guard lock(status_mutex_);
  status_.path = writer_->path();
  status_.bytes = finished_.bytes + writer_->bytes_written();
  status_.records = finished_.records + writer_->records_written();
  status_.records_lost = finished_.records_lost + writer_->records_lost();
  status_.problem = flushed ? finished_.problem : flushed.error();
}

}  // namespace imuscope
