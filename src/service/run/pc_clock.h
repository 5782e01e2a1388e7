#pragma once

/// The PC's own clock: what the kernel knows of it, and steps of the wall clock, which nothing of the core
/// looks at and which everything that a person compares with the run is stamped by. And whether the PC slept:
/// CLOCK_MONOTONIC, by which everything is stamped, stands still meanwhile, and the devices go on. Non-real-time.

#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include "base/time.h"
#include "service/run/clock_keepers.h"

struct timex;

namespace imuscope {

/// What adjtimex(2) says of the clock that CLOCK_REALTIME shows.
struct KernelClockState {
  int status = 0;                ///< STA_* bits
  bool is_synchronised = false;  ///< somebody sets it: NTP, PTP, PPS
  double offset_s = 0.0;         ///< still to be slewed away
  double frequency_ppm = 0.0;    ///< by which the PC's quartz is corrected
  double max_error_s = 0.0;      ///< bound, by whoever sets it
  double estimated_error_s = 0.0;
  int tai_minus_utc_s = 0;  ///< 0 where nobody told the kernel
};

/// Reads it; changes nothing and needs no right. Nothing where the system refuses (a sandbox that forbids
/// every call about clocks).
[[nodiscard]] std::optional<KernelClockState> read_kernel_clock() noexcept;

/// The same of an answer of adjtimex(2).
/// @param state  what the call returned
[[nodiscard]] std::optional<KernelClockState> kernel_clock_of(int state, const timex& clock) noexcept;

/// The wall clock departed from CLOCK_MONOTONIC between two looks.
struct WallClockStep {
  HostTime after{};     ///< it was not stepped yet
  HostTime before{};    ///< it was
  double size_s = 0.0;  ///< forward where positive
};

/// The PC was suspended: for so long the wall clock and the devices went on, and the host's clock did not.
struct PcSuspend {
  HostTime after{};   ///< it was awake
  HostTime before{};  ///< it was awake again
  double length_s = 0.0;
};

/// One reading of all clocks.
struct PcClockReading {
  HostTime host{};
  UtcTime wall{};
  Duration apart{};   ///< at most, between the readings of the two clocks
  Duration asleep{};  ///< since the PC was switched on: CLOCK_BOOTTIME less CLOCK_MONOTONIC
};
[[nodiscard]] PcClockReading read_pc_clocks() noexcept;

/// Finds steps by the difference of the two clocks. What NTP slews, at most 500 ppm, is no step, nor is the
/// time for which the PC slept. Thread: one. Deterministic: a function of the readings.
class WallClockWatch {
 public:
  /// A step since the reading before, where there is one.
  [[nodiscard]] std::optional<WallClockStep> look(const PcClockReading& reading) noexcept;
  /// The sleep that the last look() found, where there was one.
  [[nodiscard]] const std::optional<PcSuspend>& suspend() const noexcept { return suspend_; }

 private:
  std::optional<PcClockReading> last_;
  std::optional<PcSuspend> suspend_;
};

/// Everything that a run notes of the PC's clock.
struct PcClockRecord {
  struct State {
    PcClockReading reading;
    std::optional<KernelClockState> kernel;
    std::vector<ClockKeeper> keepers{};  ///< as they answered last, a minute ago at most
  };
  std::optional<State> first;
  std::optional<State> last;
  std::vector<WallClockStep> steps;
  std::uint64_t steps_left_out = 0;  ///< a clock that is stepped for ever fills no file
  std::vector<PcSuspend> suspends;   ///< not more than steps either
};

/// Looks at the clock as often as a run has to. Thread: one, non-real-time.
class PcClockLog {
 public:
  static constexpr Duration kStatePeriod = std::chrono::minutes(1);
  static constexpr Duration kStepPeriod = std::chrono::milliseconds(200);
  static constexpr std::size_t kStepsMax = 1000;

  /// @param read  both clocks, and the kernel's state of them; for tests
  explicit PcClockLog(std::function<PcClockReading()> read = read_pc_clocks,
                      std::function<std::optional<KernelClockState>()> ask = read_kernel_clock)
      : read_(std::move(read)), ask_(std::move(ask)) {}

  /// A state to be published, and the step that came with it.
  struct News {
    PcClockRecord::State state;
    std::optional<WallClockStep> step;
    std::optional<PcSuspend> suspend{};
  };
  /// Call at every turn of the thread: says something at the start, once a minute, and after a step or a
  /// sleep.
  [[nodiscard]] std::optional<News> look(HostTime now);

  /// What those who keep the clock answered; a state to be published, with that.
  [[nodiscard]] News take(std::vector<ClockKeeper> keepers);

  [[nodiscard]] const PcClockRecord& record() const noexcept { return record_; }

 private:
  std::function<PcClockReading()> read_;
  std::function<std::optional<KernelClockState>()> ask_;
  WallClockWatch watch_;
  PcClockRecord record_;
  HostTime looked_{};
  HostTime told_{};
};

}  // namespace imuscope
