#include "service/lines/io_thread.h"

#include <sys/epoll.h>
#include <algorithm>
#include <optional>

#include "rt/host_clock.h"
#include "service/lines/latency_window.h"

namespace imuscope {

namespace {

/// A read takes what a burst can bring: 4 kB is 350 ms of a line at 115200 baud.
constexpr std::size_t kReadBytes = 4096;
// When lines are read. A frame of a device trickles in over milliseconds, and a wake-up for each handful of
// bytes would cost the processor more than all else the service does. What the core needs is less: every byte
// by the next cut, and now and then the instant of a first byte, which the clock map follows. So all serial
// lines are read at a beat just before each cut, and in between a line is listened to only now and then, for
// the first bytes of a frame, and rests until then.

/// The beat; sessions are polled at it, at least this often as device.h asks for.
constexpr Duration kBeat = kTickPeriod;
/// The beat's lead over the cut: reading and decoding all lines takes a tenth of it.
constexpr Duration kLead = std::chrono::microseconds(500);
/// A line in which bytes follow each other is in the midst of a frame: it is listened to again after about
/// the time that a frame takes on it (43 bytes of an MTx at 115200 baud: 3.7 ms), at the first wake-up from
/// then on and at the latest after the second time.
constexpr Duration kQuiet = std::chrono::milliseconds(2);
constexpr Duration kRest = std::chrono::milliseconds(4);
constexpr Duration kLongestRest = std::chrono::milliseconds(6);
/// After the first bytes of a frame the line rests for this many beats: at 100 Hz every tenth frame is
/// stamped at its first bytes, twenty in each interval of the clock map. Once the map rests on many
/// intervals, six in each serve it as well.
constexpr int kBeatsOfRest = 9;
constexpr int kBeatsOfLongRest = 29;
constexpr Duration kClockIsLearned = std::chrono::seconds(60);
constexpr Duration kStatusPeriod = std::chrono::milliseconds(100);

}  // namespace

/// One device's line, decoder and books.
class IoThread::Line final : public SampleSink {
 public:
  Line(DeviceIndex index, SampleRing& ring, ExceptionRing& exceptions, std::unique_ptr<DeviceDecoder> decoder)
      : index_(index), ring_(ring), exceptions_(exceptions), decoder_(std::move(decoder)) {}
  ~Line() override {
    delete offered_.load();
    delete returned_.load();
    delete connection_;
  }
  Line(const Line&) = delete;
  Line& operator=(const Line&) = delete;

  void on_sample(const Sample& sample) noexcept override {
    newest_arrival_ = std::max(newest_arrival_, sample.arrival);
    latency_.add(sample.arrival, sample.arrival - sample.time);
    if (sample.kind != SampleKind::kAttitude && sample.kind != SampleKind::kSteering) ++status_.epochs;
    if (ring_.try_push(sample)) return;
    ++status_.refused;
    (void)exceptions_.try_push(
        {ExceptionKind::kRefusedSample, index_, static_cast<std::int64_t>(sample.sequence), -1, 1});
  }

  /// Supervisor's side.
  void offer(Connection* connection) { delete offered_.exchange(connection, std::memory_order_acq_rel); }
  [[nodiscard]] Connection* take_back() { return returned_.exchange(nullptr, std::memory_order_acq_rel); }
  [[nodiscard]] LineStatus status() {
    (void)published_.take();
    return published_.value();
  }

  /// I/O thread's side.
  void adopt(RawTap& tap, int epoll) noexcept {
    if (connection_ != nullptr || offered_.load(std::memory_order_relaxed) == nullptr) return;
    connection_ = offered_.exchange(nullptr, std::memory_order_acq_rel);
    adopted_ = host_now();
    set_timing(tap, connection_->line->timing());
    listen(epoll, EPOLL_CTL_ADD, adopted_);
    dropped_before_ = status_.frames_dropped;
  }

  /// After an event of the line.
  void on_event(RawTap& tap, int epoll, HostTime now) noexcept {
    read(tap, epoll);
    // An event of a serial line has switched its events off.
    if (connection_ == nullptr || !connection_->is_serial) return;
    since_ = now - listens_since_ < kQuiet ? std::optional(now) : std::nullopt;
    beats_ = since_ ? 0 : beats_of_rest(now);
  }

  /// At every wake-up: reads on where a frame was cut in its midst, and listens again.
  void on_wake(RawTap& tap, int epoll, HostTime now) noexcept {
    if (!since_ || now - *since_ < kRest) return;
    read(tap, epoll);
    listen(epoll, EPOLL_CTL_MOD, now);
  }

  /// At every beat: reads what has come during a rest, and listens again when it is over.
  void on_beat(RawTap& tap, int epoll, HostTime now) noexcept {
    if (beats_ == 0) return;
    read(tap, epoll);
    if (--beats_ == 0) listen(epoll, EPOLL_CTL_MOD, now);
  }

  /// When the line is to be looked at, whatever else happens.
  [[nodiscard]] HostTime due() const noexcept { return since_ ? *since_ + kLongestRest : HostTime::max(); }

  void read(RawTap& tap, int epoll) noexcept {
    for (int i = 0; i < kReadsPerWake && connection_ != nullptr; ++i) {
      const auto result = connection_->line->read(std::span(buffer_).subspan(kReceivedBytes));
      if (result.status == IoStatus::kGone) give_back(epoll);
      if (result.status != IoStatus::kDone) return;
      const HostTime now = host_now();
      const Arrival arrival{now, std::min(result.received.value_or(now), now)};
      const auto bytes = record(tap, result.n, arrival);
      decode(bytes, arrival);
      for (Line* sharer : sharers_) sharer->decode(bytes, arrival);
      connection_->session->on_bytes(bytes, now);
      status_.last_arrival = now;
      ++status_.reads;
      if (!result.more) return;
    }
  }

  /// The bytes of a read, which lie after room for its stamp.
  std::span<const std::uint8_t> record(RawTap& tap, std::size_t n, const Arrival& arrival) noexcept {
    const std::span<const std::uint8_t> all(buffer_.data(), kReceivedBytes + n);
    if (arrival.received == arrival.read) {
      tap.record(index_, Direction::kRead, all.subspan(kReceivedBytes), arrival.read);
    } else {
      const auto stamp = received_bytes(arrival.received);
      std::copy(stamp.begin(), stamp.end(), buffer_.begin());
      tap.record(index_, Direction::kStampedRead, all, arrival.read);
    }
    return all.subspan(kReceivedBytes);
  }

  /// A device behind the same head, whose bytes come on this line.
  void share_with(Line& other) { sharers_.push_back(&other); }

  void decode(std::span<const std::uint8_t> bytes, const Arrival& arrival) noexcept {
    decoder_->push(bytes, arrival, *this);
  }

  void say(RawTap& tap, int epoll, HostTime now) noexcept {
    if (connection_ == nullptr) return;
    if (connection_->is_serial && connection_->session->wants_other_baud()) {
      give_back(epoll);
      return;
    }
    const auto bytes = connection_->session->poll(now);
    if (bytes.empty()) return;
    const auto result = connection_->line->write(bytes);
    if (result.status == IoStatus::kDone) tap.record(index_, Direction::kWrite, bytes.first(result.n), now);
  }

  void publish(HostTime now) noexcept {
    if (now - last_status_ < kStatusPeriod) return;
    last_status_ = now;
    publish_status();
  }

  void publish_status() noexcept {
    status_.counters = decoder_->counters();
    status_.latency_s = latency_.mean_s();
    status_.clock_drift_ppm = decoder_->clock_drift_ppm();
    status_.clock_sd_s = decoder_->clock_sd_s();
    if (connection_ != nullptr) {
      const auto health = connection_->line->health();
      status_.line = health.is_up ? LineState::kOpen : LineState::kDown;
      status_.frames_dropped = dropped_before_ + health.frames_dropped;
      status_.stamps = health.stamps;
      status_.session = connection_->session->state();
      auto problem = connection_->session->problem();
      if (problem.empty()) problem = decoder_->remark();
      const std::size_t n = std::min(problem.size(), status_.problem.size() - 1);
      std::copy_n(problem.begin(), n, status_.problem.begin());
      status_.problem[n] = '\0';
    }
    for (Line* sharer : sharers_) sharer->show_line_of(status_);
    published_.write(status_);
  }

  /// The line is another device's, and so is what is known of it.
  void show_line_of(const LineStatus& owner) noexcept {
    status_.line = owner.line;
    status_.timing = owner.timing;
    status_.stamps = owner.stamps;
    status_.session = owner.session;
    status_.problem = owner.problem;
    status_.last_arrival = owner.last_arrival;
    status_.reads = owner.reads;
  }

  [[nodiscard]] HostTime newest_arrival() const { return newest_arrival_; }

 private:
  static constexpr int kReadsPerWake = 4;

  /// A rate that the decoder was not made with is recorded, so that a replay decodes alike.
  void set_timing(RawTap& tap, const LineTiming& timing) noexcept {
    status_.timing = timing;
    if (timing.per_byte == decoder_->per_byte()) return;
    tap.record(index_, Direction::kLine, line_rate_bytes(timing.per_byte), adopted_);
    decoder_->set_per_byte(timing.per_byte);
    for (Line* sharer : sharers_) sharer->decoder_->set_per_byte(timing.per_byte);
  }

  void listen(int epoll, int operation, HostTime now) noexcept {
    since_.reset();
    beats_ = 0;
    if (connection_ == nullptr) return;
    listens_since_ = now;
    epoll_event event{};
    event.events = EPOLLIN | (connection_->is_serial ? EPOLLONESHOT : 0U);
    event.data.ptr = this;
    (void)epoll_ctl(epoll, operation, connection_->line->fd(), &event);
  }

  /// A device that is being set up is answered sooner.
  [[nodiscard]] int beats_of_rest(HostTime now) const noexcept {
    if (connection_->session->state() != SessionState::kStreaming) return 1;
    return now - adopted_ < kClockIsLearned ? kBeatsOfRest : kBeatsOfLongRest;
  }

  void give_back(int epoll) noexcept {
    (void)epoll_ctl(epoll, EPOLL_CTL_DEL, connection_->line->fd(), nullptr);
    // The slot is empty: the supervisor offers a new connection only after it took the old one back.
    returned_.store(connection_, std::memory_order_release);
    connection_ = nullptr;
    status_.line = LineState::kClosed;
    status_.session = SessionState::kConnecting;
  }

  DeviceIndex index_;
  SampleRing& ring_;
  ExceptionRing& exceptions_;
  std::unique_ptr<DeviceDecoder> decoder_;
  std::vector<Line*> sharers_;
  Connection* connection_ = nullptr;
  std::atomic<Connection*> offered_{nullptr};
  std::atomic<Connection*> returned_{nullptr};
  HostTime adopted_{};
  HostTime listens_since_{};
  std::optional<HostTime> since_;  ///< in the midst of a frame, rests since then
  int beats_ = 0;                  ///< of rest that are left
  std::array<std::uint8_t, kReceivedBytes + kReadBytes> buffer_{};  ///< a read, after room for its stamp
  LineStatus status_;
  std::uint64_t dropped_before_ = 0;  ///< on the connections before this one
  LatencyWindow latency_;
  HostTime last_status_{};
  HostTime newest_arrival_{HostTime::min()};
  LatestValue<LineStatus> published_;
};

IoThread::IoThread(Core& core, std::vector<std::unique_ptr<DeviceDecoder>> decoders,
                   const std::vector<std::size_t>& line_owners, std::size_t raw_ring_bytes)
    : raw_ring_(std::make_unique<RawRing>(raw_ring_bytes)),
      exceptions_(std::make_unique<ExceptionRing>()),
      tap_(*raw_ring_) {
  for (std::size_t i = 0; i < decoders.size(); ++i) {
    const auto index = static_cast<DeviceIndex>(i);
    lines_.push_back(std::make_unique<Line>(index, core.ring(index), *exceptions_, std::move(decoders[i])));
  }
  for (std::size_t i = 0; i < lines_.size(); ++i) {
    if (line_owners[i] != i) lines_[line_owners[i]]->share_with(*lines_[i]);
  }
}

IoThread::~IoThread() { stop(); }

Result<void> IoThread::start(const ThreadPlan& plan, HostTime first_cut, std::vector<Error>& refusals) {
  first_cut_ = first_cut;
  if (auto opened = events_.open(); !opened) return opened;
  running_.store(true, std::memory_order_release);
  thread_ = start_core_thread(plan, refusals, [this] { loop(); });
  return {};
}

void IoThread::stop() {
  running_.store(false, std::memory_order_release);
  if (thread_.joinable()) thread_.join();
  // What came since the last status counts, too.
  for (const auto& line : lines_) line->publish_status();
  for (const auto& line : lines_) newest_arrival_ = std::max(newest_arrival_, line->newest_arrival());
}

void IoThread::offer(DeviceIndex device, std::unique_ptr<Connection> connection) {
  lines_[device]->offer(connection.release());
}

std::unique_ptr<Connection> IoThread::take_back(DeviceIndex device) {
  return std::unique_ptr<Connection>(lines_[device]->take_back());
}

LineStatus IoThread::status(DeviceIndex device) { return lines_[device]->status(); }

PeriodicStatistics IoThread::statistics() {
  (void)statistics_.take();
  return statistics_.value();
}

HostTime IoThread::next_look(HostTime beat) const noexcept {
  HostTime next = beat;
  for (const auto& line : lines_) next = std::min(next, line->due());
  return next;
}

void IoThread::loop() {
  std::array<epoll_event, kMaxDevices + 1> events{};
  const int epoll = events_.epoll();
  TickSchedule beat(first_cut_ - kLead, kBeat);
  HostTime last_statistics{};
  while (running_.load(std::memory_order_acquire)) {
    const int n = events_.wait(events, next_look(beat.deadline()));
    const HostTime now = host_now();
    heartbeat_.beat(now);
    const bool beaten = now >= beat.deadline();
    if (beaten) (void)beat.deadline_reached(now);
    for (int i = 0; i < n; ++i) {
      auto* const line = static_cast<Line*>(events[static_cast<std::size_t>(i)].data.ptr);
      line->on_event(tap_, epoll, now);
      line->say(tap_, epoll, now);
    }
    for (const auto& line : lines_) line->on_wake(tap_, epoll, now);
    if (!beaten) continue;
    for (const auto& line : lines_) {
      line->adopt(tap_, epoll);
      line->on_beat(tap_, epoll, now);
      line->say(tap_, epoll, now);
      line->publish(now);
    }
    beat.finish(host_now());
    if (now - last_statistics < kStatusPeriod) continue;
    statistics_.write(beat.statistics());
    last_statistics = now;
  }
}

}  // namespace imuscope
