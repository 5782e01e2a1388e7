#pragma once

/// The I/O thread: waits for bytes on every line, stamps their arrival, hands them to the recorder and to the
/// device's decoder, and says to each device what its session wants said. Core: after start() it neither
/// allocates nor locks nor opens anything; lines are opened by the supervisor and handed over through an
/// atomic pointer.

#include <array>
#include <atomic>
#include <cstdint>
#include <memory>
#include <thread>
#include <vector>

#include "capture/raw_chunk.h"
#include "capture/records.h"
#include "drivers/device/device.h"
#include "drivers/transport/transport.h"
#include "rt/heartbeat.h"
#include "rt/host_clock.h"
#include "rt/latest_value.h"
#include "rt/periodic.h"
#include "rt/thread_setup.h"
#include "service/lines/line_events.h"
#include "service/pipeline/core.h"

namespace imuscope {

/// An open line and the conversation on it. Made and destroyed by the supervisor, used by the I/O thread.
struct Connection {
  std::unique_ptr<Transport> line;
  std::unique_ptr<DeviceSession> session;
  /// Its bytes trickle in at the line's speed; it may be opened at another one when the session wants it.
  bool is_serial = false;
};

enum class LineState : std::uint8_t {
  kClosed,
  kDown,  ///< open, and the line itself cannot carry anything
  kOpen,
};

/// What the I/O thread says of one device, ten times a second.
struct LineStatus {
  LineState line = LineState::kClosed;
  SessionState session = SessionState::kConnecting;
  DecoderCounters counters{};
  std::uint64_t refused = 0;         ///< samples that found the ring to the core full
  std::uint64_t frames_dropped = 0;  ///< lost by this PC before they were read
  std::uint64_t reads = 0;
  std::uint64_t epochs = 0;  ///< samples without the attitude that a reference sends beside its IMU samples
  /// From the time of validity to the read that brought the sample, mean over the last second that had
  /// samples: device, line, and the wait for the beat.
  double latency_s = 0.0;
  double clock_drift_ppm = 0.0;  ///< of the device's clock, fast where positive; NaN where unknown
  double clock_sd_s = 0.0;       ///< how well their relation is known; NaN where it is not
  LineTiming timing{};           ///< of the line as it was opened last
  StampQuality stamps{};         ///< of the line, lately
  HostTime last_arrival{};
  std::array<char, 200> problem{};  ///< of the session; NUL-terminated
};
static_assert(std::is_trivially_copyable_v<LineStatus>);

class IoThread {
 public:
  /// @param decoders     one a device
  /// @param line_owners  per device, the one on whose line its bytes come: itself, or another one's
  /// @param raw_ring_bytes  of the ring to the recorder (line_rate.h)
  IoThread(Core& core, std::vector<std::unique_ptr<DeviceDecoder>> decoders,
           const std::vector<std::size_t>& line_owners, std::size_t raw_ring_bytes);
  ~IoThread();
  IoThread(const IoThread&) = delete;
  IoThread& operator=(const IoThread&) = delete;

  /// @param first_cut      of the core's ticks: lines are read just before each cut
  /// @param[out] refusals  what the system refused of the plan, appended
  Result<void> start(const ThreadPlan& plan, HostTime first_cut, std::vector<Error>& refusals);
  /// Ends the loop and joins. No byte is read after it returns.
  void stop();

  /// Hands a connection to the thread. Supervisor only; one may wait at a time.
  void offer(DeviceIndex device, std::unique_ptr<Connection> connection);
  /// Takes back a connection whose device vanished, to be destroyed and opened anew. Supervisor only.
  [[nodiscard]] std::unique_ptr<Connection> take_back(DeviceIndex device);

  /// Newest status of a device. One reader: the publisher.
  [[nodiscard]] LineStatus status(DeviceIndex device);
  /// Newest statistics of the beat at which sessions are polled. One reader: the publisher.
  [[nodiscard]] PeriodicStatistics statistics();

  [[nodiscard]] const Heartbeat& heartbeat() const { return heartbeat_; }

  [[nodiscard]] RawRing& raw_ring() { return *raw_ring_; }
  [[nodiscard]] ExceptionRing& exceptions() { return *exceptions_; }
  /// Arrival of the newest sample pushed; valid after stop().
  [[nodiscard]] HostTime newest_arrival() const { return newest_arrival_; }

 private:
  class Line;
  void loop();
  /// @param beat  its next deadline
  [[nodiscard]] HostTime next_look(HostTime beat) const noexcept;

  std::vector<std::unique_ptr<Line>> lines_;
  std::unique_ptr<RawRing> raw_ring_;
  std::unique_ptr<ExceptionRing> exceptions_;
  RawTap tap_;
  LineEvents events_;
  HostTime first_cut_{};
  LatestValue<PeriodicStatistics> statistics_;
  Heartbeat heartbeat_{host_now()};
  HostTime newest_arrival_{HostTime::min()};
  std::atomic<bool> running_{false};
  std::thread thread_;
};

}  // namespace imuscope
