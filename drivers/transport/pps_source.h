#pragma once

/// Pulses of a PPS device of the kernel (RFC 2783; /dev/pps0 of pps-gpio, pps-ldisc or a card): each as a
/// pulse_record.h, on the host's time scale. The kernel stamps a pulse in its interrupt, so it does not
/// matter when the kernel is asked. It is asked fifty times a second, to notice at once how the PC steers its
/// clock: a pulse a second later tells of 500 ppm only when they have become half a millisecond.

#include <linux/pps.h>

#include <cstdint>
#include <memory>
#include <string>

#include "base/result.h"
#include "drivers/device/pulse_record.h"
#include "drivers/transport/kernel_stamp.h"
#include "drivers/transport/steering_watch.h"
#include "drivers/transport/transport.h"

namespace imuscope {

struct PpsSettings {
  std::string path;
  PulseEdge edge = PulseEdge::kAssert;  ///< the one that marks the second
};

/// What a PPS device of the kernel offers: its ioctls. Tests put another in its place.
class PpsDevice {
 public:
  virtual ~PpsDevice() = default;
  /// PPS_GETCAP, PPS_GETPARAMS and PPS_SETPARAMS: 0, or errno.
  virtual int capabilities(int& modes) noexcept = 0;
  virtual int parameters(pps_kparams& params) noexcept = 0;
  virtual int set_parameters(const pps_kparams& params) noexcept = 0;
  /// PPS_FETCH without waiting: the newest edges. 0, or errno. Core: no allocation.
  virtual int fetch(pps_kinfo& newest) noexcept = 0;
};

class PpsSource final : public Transport {
 public:
  static constexpr std::size_t kReadBytes = 2 * kPulseRecordBytes;

  /// Errors name the remedy: a missing device lists those there are. Not for the real-time thread.
  static Result<std::unique_ptr<PpsSource>> open(const PpsSettings& settings);
  /// The same with the kernel's part already there, for tests.
  static Result<std::unique_ptr<PpsSource>> with(const PpsSettings& settings,
                                                 std::unique_ptr<PpsDevice> device);

  PpsSource(const PpsSource&) = delete;
  PpsSource& operator=(const PpsSource&) = delete;
  ~PpsSource() override;

  /// The newest pulse, and before it how the PC steers its clock where that has changed: two records at most.
  /// @param buffer  of at least kReadBytes
  [[nodiscard]] IoResult read(std::span<std::uint8_t> buffer) noexcept override;
  /// A pulse cannot be spoken to: always kNothing.
  [[nodiscard]] IoResult write(std::span<const std::uint8_t> bytes) noexcept override;
  /// A timer's, that says when to ask: older kernels call a PPS device readable for ever.
  [[nodiscard]] int fd() const noexcept override { return timer_; }
  [[nodiscard]] LineHealth health() noexcept override;
  [[nodiscard]] std::string describe() const override;

 private:
  PpsSource(PpsSettings settings, std::unique_ptr<PpsDevice> device, int timer);
  Result<void> choose_edge();
  [[nodiscard]] std::optional<UtcPulse> newest_pulse(const pps_kinfo& newest) noexcept;

  PpsSettings settings_;
  std::unique_ptr<PpsDevice> device_;
  int timer_;
  bool has_last_ = false;
  std::uint32_t last_sequence_ = 0;
  bool has_clocks_ = false;
  BothClocks clocks_;  ///< as they were last
  SteeringWatch steering_;
  HostTime trusted_from_{
      HostTime::min()};  ///< what came before was stamped by a wall clock that was stepped since
};

}  // namespace imuscope
