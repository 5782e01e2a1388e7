#pragma once

/// What the decoders of CAN devices share: the walk over the frames of a read, and the count of them.
/// Core: no allocation.

#include "drivers/device/can_frame.h"
#include "drivers/device/device.h"

namespace imuscope {

class CanDecoder : public DeviceDecoder {
 public:
  void push(std::span<const std::uint8_t> bytes, Arrival arrival, SampleSink& sink) noexcept final;
  [[nodiscard]] const DecoderCounters& counters() const noexcept final { return counters_; }

 protected:
  /// One data frame, in the order of arrival. Error and remote frames are the session's.
  virtual void on_frame(const CanFrame& frame, HostTime arrival, SampleSink& sink) noexcept = 0;

  DecoderCounters counters_;
};

}  // namespace imuscope
