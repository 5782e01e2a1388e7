#include "service/run/pc_clock.h"

#include <sys/timex.h>

#include <cmath>
#include <ctime>

#include "rt/host_clock.h"

namespace imuscope {

namespace {

/// A thread that lost the processor between two readings tries again, so often at most.
constexpr int kReadings = 5;
constexpr Duration kApartGood = std::chrono::microseconds(20);
/// Steps smaller than this are of no concern: NTP steps by 128 ms and more, chrony by what it is told to.
constexpr Duration kStepMin = std::chrono::milliseconds(1);
/// NTP slews the wall clock by at most 500 ppm (adjtimex(2)); chrony and adjtime() by as much as a tenth.
constexpr double kSlewMax = 500e-6;
/// Nobody suspends a PC for less; two readings of clocks are closer.
constexpr Duration kSuspendMin = std::chrono::milliseconds(50);

Duration boot_time() noexcept {
  timespec now{};
  clock_gettime(CLOCK_BOOTTIME, &now);
  return std::chrono::seconds(now.tv_sec) + Duration(now.tv_nsec);
}

}  // namespace

std::optional<KernelClockState> read_kernel_clock() noexcept {
  timex clock{};  // no mode is set: nothing is changed
  const int state = adjtimex(&clock);
  return kernel_clock_of(state, clock);
}

std::optional<KernelClockState> kernel_clock_of(int state, const timex& clock) noexcept {
  if (state < 0) return std::nullopt;
  constexpr double kMicro = 1e-6;
  constexpr double kNano = 1e-9;
  constexpr double kPpmPerUnit = 1.0 / 65536.0;  // 16 bits after the point
  KernelClockState told;
  told.status = clock.status;
  told.is_synchronised = state != TIME_ERROR && (clock.status & STA_UNSYNC) == 0;
  told.offset_s = static_cast<double>(clock.offset) * ((clock.status & STA_NANO) != 0 ? kNano : kMicro);
  told.frequency_ppm = static_cast<double>(clock.freq) * kPpmPerUnit;
  told.max_error_s = static_cast<double>(clock.maxerror) * kMicro;
  told.estimated_error_s = static_cast<double>(clock.esterror) * kMicro;
  told.tai_minus_utc_s = clock.tai;
  return told;
}

PcClockReading read_pc_clocks() noexcept {
  PcClockReading best;
  best.apart = Duration::max();
  for (int i = 0; i < kReadings && best.apart > kApartGood; ++i) {
    const HostTime before = host_now();
    const UtcTime wall = wall_clock_now();
    const HostTime after = host_now();
    const Duration apart = after - before;
    if (apart < best.apart) best = {before + apart / 2, wall, apart, boot_time() - after.time_since_epoch()};
  }
  return best;
}

std::optional<WallClockStep> WallClockWatch::look(const PcClockReading& reading) noexcept {
  const std::optional<PcClockReading> before = last_;
  last_ = reading;
  suspend_.reset();
  if (!before) return std::nullopt;
  const Duration passed = reading.host - before->host;
  Duration change = (reading.wall - before->wall) - passed;
  const Duration slept = reading.asleep - before->asleep;
  if (slept > kSuspendMin) {
    suspend_ = PcSuspend{before->host, reading.host, to_seconds(slept)};
    // The wall clock is set from the hardware's, which counts less finely.
    change -= slept;
    if (std::chrono::abs(change) < std::chrono::seconds(1)) return std::nullopt;
  }
  const double unsure_s =
      to_seconds(kStepMin + before->apart + reading.apart) + kSlewMax * to_seconds(passed);
  if (std::abs(to_seconds(change)) <= unsure_s) return std::nullopt;
  return WallClockStep{before->host, reading.host, to_seconds(change)};
}

std::optional<PcClockLog::News> PcClockLog::look(HostTime now) {
  const bool is_first = !record_.first;
  if (!is_first && now - looked_ < kStepPeriod) return std::nullopt;
  looked_ = now;
  const PcClockReading reading = read_();
  const auto step = watch_.look(reading);
  if (step) {
    if (record_.steps.size() < kStepsMax) {
      record_.steps.push_back(*step);
    } else {
      ++record_.steps_left_out;
    }
  }
  const auto& suspend = watch_.suspend();
  if (suspend && record_.suspends.size() < kStepsMax) record_.suspends.push_back(*suspend);
  if (!is_first && !step && !suspend && now - told_ < kStatePeriod) return std::nullopt;
  told_ = now;
  record_.last = {reading, ask_(), record_.last ? record_.last->keepers : std::vector<ClockKeeper>{}};
  if (is_first) record_.first = record_.last;
  return News{*record_.last, step, suspend};
}

PcClockLog::News PcClockLog::take(std::vector<ClockKeeper> keepers) {
  const PcClockReading reading = read_();
  if (!record_.first) record_.first = PcClockRecord::State{reading, ask_()};
  if (record_.first->keepers.empty()) record_.first->keepers = keepers;
  record_.last = {reading, ask_(), std::move(keepers)};
  return {*record_.last, std::nullopt, std::nullopt};
}

}  // namespace imuscope
