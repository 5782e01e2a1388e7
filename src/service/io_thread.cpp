#include "service/io_thread.h"

#include <fmt/format.h>
#include <sys/epoll.h>
#include <sys/timerfd.h>
#include <unistd.h>
#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <future>
#include <limits>

#include "rt/host_clock.h"

namespace imuscope {

namespace {

/// A read takes what a burst can bring: 4 kB is 350 ms of a line at 115200 baud.
constexpr std::size_t kReadBytes = 4096;
/// Sessions are polled at least this often (device.h asks for 10 ms).
constexpr Duration kPollPeriod = std::chrono::milliseconds(5);
constexpr Duration kStatusPeriod = std::chrono::milliseconds(100);
constexpr std::size_t kPrefaultedStack = 128 * 1024;

/// From `first` on, every `period`, on CLOCK_MONOTONIC.
void set_timer(int timer, HostTime first, Duration period) noexcept {
  constexpr std::int64_t kNsPerSecond = 1'000'000'000;
  itimerspec times{};
  times.it_value.tv_sec = to_ns(first) / kNsPerSecond;
  times.it_value.tv_nsec = to_ns(first) % kNsPerSecond;
  times.it_interval.tv_nsec = period.count();
  (void)timerfd_settime(timer, TFD_TIMER_ABSTIME, &times, nullptr);
}

/// How late the samples of one device came, second by second.
class LatencyWindow {
 public:
  void add(HostTime arrival, Duration latency) noexcept {
    if (arrival - begin_ >= std::chrono::seconds(1)) close(arrival);
    const double value_s = to_seconds(latency);
    n_ += 1.0;
    const double step = value_s - mean_s_;
    mean_s_ += step / n_;
    sum_of_squares_ += step * (value_s - mean_s_);
  }
  [[nodiscard]] double mean_s() const noexcept { return closed_mean_s_; }
  [[nodiscard]] double sd_s() const noexcept { return closed_sd_s_; }

 private:
  void close(HostTime now) noexcept {
    if (n_ > 1.0) {
      closed_mean_s_ = mean_s_;
      closed_sd_s_ = std::sqrt(sum_of_squares_ / (n_ - 1.0));
    }
    begin_ = now;
    n_ = mean_s_ = sum_of_squares_ = 0.0;
  }

  HostTime begin_{};
  double n_ = 0.0;
  double mean_s_ = 0.0;
  double sum_of_squares_ = 0.0;
  double closed_mean_s_ = std::numeric_limits<double>::quiet_NaN();
  double closed_sd_s_ = std::numeric_limits<double>::quiet_NaN();
};

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
    if (sample.kind != SampleKind::kAttitude) ++status_.epochs;
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
  void adopt(int epoll) noexcept {
    if (connection_ != nullptr || offered_.load(std::memory_order_relaxed) == nullptr) return;
    connection_ = offered_.exchange(nullptr, std::memory_order_acq_rel);
    epoll_event event{};
    event.events = EPOLLIN;
    event.data.ptr = this;
    (void)epoll_ctl(epoll, EPOLL_CTL_ADD, connection_->line->fd(), &event);
    dropped_before_ = status_.frames_dropped;
  }

  void read(RawTap& tap, int epoll) noexcept {
    for (int i = 0; i < kReadsPerWake && connection_ != nullptr; ++i) {
      const auto result = connection_->line->read(buffer_);
      if (result.status == IoStatus::kGone) give_back(epoll);
      if (result.status != IoStatus::kDone) return;
      const HostTime arrival = host_now();
      const std::span<const std::uint8_t> bytes(buffer_.data(), result.n);
      tap.record(index_, Direction::kRead, bytes, arrival);
      decode(bytes, arrival);
      for (Line* sharer : sharers_) sharer->decode(bytes, arrival);
      connection_->session->on_bytes(bytes, arrival);
      status_.last_arrival = arrival;
      ++status_.reads;
      if (!result.more) return;
    }
  }

  /// A device behind the same head, whose bytes come on this line.
  void share_with(Line& other) { sharers_.push_back(&other); }

  void decode(std::span<const std::uint8_t> bytes, HostTime arrival) noexcept {
    decoder_->push(bytes, arrival, *this);
  }

  void say(RawTap& tap, int epoll, HostTime now) noexcept {
    if (connection_ == nullptr) return;
    if (connection_->has_baud && connection_->session->wants_other_baud()) {
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
    status_.counters = decoder_->counters();
    status_.latency_s = latency_.mean_s();
    status_.latency_sd_s = latency_.sd_s();
    status_.clock_drift_ppm = decoder_->clock_drift_ppm();
    if (connection_ != nullptr) {
      const auto health = connection_->line->health();
      status_.line = health.is_up ? LineState::kOpen : LineState::kDown;
      status_.frames_dropped = dropped_before_ + health.frames_dropped;
      status_.session = connection_->session->state();
      auto problem = connection_->session->problem();
      if (problem.empty()) problem = decoder_->remark();
      const std::size_t n = std::min(problem.size(), status_.problem.size() - 1);
      std::memcpy(status_.problem.data(), problem.data(), n);
      status_.problem[n] = '\0';
    }
    for (Line* sharer : sharers_) sharer->show_line_of(status_);
    published_.write(status_);
  }

  /// The line is another device's, and so is what is known of it.
  void show_line_of(const LineStatus& owner) noexcept {
    status_.line = owner.line;
    status_.session = owner.session;
    status_.problem = owner.problem;
    status_.last_arrival = owner.last_arrival;
    status_.reads = owner.reads;
  }

  [[nodiscard]] HostTime newest_arrival() const { return newest_arrival_; }

 private:
  static constexpr int kReadsPerWake = 4;

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
  std::array<std::uint8_t, kReadBytes> buffer_{};
  LineStatus status_;
  std::uint64_t dropped_before_ = 0;  ///< on the connections before this one
  LatencyWindow latency_;
  HostTime last_status_{};
  HostTime newest_arrival_{HostTime::min()};
  LatestValue<LineStatus> published_;
};

IoThread::IoThread(Core& core, std::vector<std::unique_ptr<DeviceDecoder>> decoders,
                   const std::vector<std::size_t>& line_owners)
    : raw_ring_(std::make_unique<RawRing>()),
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

IoThread::~IoThread() {
  stop();
  if (timer_ >= 0) ::close(timer_);
  if (epoll_ >= 0) ::close(epoll_);
}

Result<void> IoThread::start(const ThreadPlan& plan, std::vector<Error>& refusals) {
  epoll_ = epoll_create1(EPOLL_CLOEXEC);
  if (epoll_ < 0) {
    return work_error(fmt::format("no epoll descriptor: {}", std::strerror(errno)),
                      "raise the limit of open files");
  }
  timer_ = timerfd_create(CLOCK_MONOTONIC, TFD_CLOEXEC | TFD_NONBLOCK);
  epoll_event event{};  // no pointer: told apart from the lines by that
  event.events = EPOLLIN;
  if (timer_ < 0 || epoll_ctl(epoll_, EPOLL_CTL_ADD, timer_, &event) != 0) {
    return work_error(fmt::format("no timer for the I/O thread: {}", std::strerror(errno)),
                      "raise the limit of open files");
  }
  running_.store(true, std::memory_order_release);
  std::promise<std::vector<Error>> ready;
  auto refused = ready.get_future();
  thread_ = std::thread([this, plan, &ready] {
    auto errors = setup_this_thread(plan);
    prefault_stack(kPrefaultedStack);
    ready.set_value(std::move(errors));
    loop();
  });
  for (auto& error : refused.get()) refusals.push_back(std::move(error));
  return {};
}

void IoThread::stop() {
  running_.store(false, std::memory_order_release);
  if (thread_.joinable()) thread_.join();
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

void IoThread::loop() {
  std::array<epoll_event, kMaxDevices + 1> events{};
  const HostTime first = host_now() + kPollPeriod;
  set_timer(timer_, first, kPollPeriod);
  TickSchedule beat(first, kPollPeriod);
  HostTime last_statistics{};
  while (running_.load(std::memory_order_acquire)) {
    for (const auto& line : lines_) line->adopt(epoll_);
    const int n = epoll_wait(epoll_, events.data(), static_cast<int>(events.size()), -1);
    bool beaten = false;
    for (int i = 0; i < n; ++i) {
      auto* const line = static_cast<Line*>(events[static_cast<std::size_t>(i)].data.ptr);
      if (line != nullptr) {
        line->read(tap_, epoll_);
      } else if (std::uint64_t expirations = 0; ::read(timer_, &expirations, sizeof expirations) > 0) {
        // An expiration between the timer's read and this look at the clock was counted with the one before.
        const HostTime woken = host_now();
        if (woken < beat.deadline()) continue;
        (void)beat.wake(woken);
        beaten = true;
      }
    }
    const HostTime now = host_now();
    for (const auto& line : lines_) {
      line->say(tap_, epoll_, now);
      line->publish(now);
    }
    if (beaten) beat.finish(host_now());
    if (now - last_statistics >= kStatusPeriod) {
      statistics_.write(beat.statistics());
      last_statistics = now;
    }
  }
}

}  // namespace imuscope
