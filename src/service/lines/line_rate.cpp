#include "service/lines/line_rate.h"

#include <algorithm>

#include "base/limits.h"
#include "capture/raw_chunk.h"
#include "drivers/device/frame_buffer.h"
#include "drivers/device/pulse_record.h"
#include "service/lines/line_factory.h"

namespace imuscope {

namespace {

/// An IMU's sample with attitude, status and a checksum, in the longest output that drivers/ knows; an epoch
/// of a receiver that sends several messages; the frames of a speed.
constexpr double kImuSampleBytes = 256.0;
constexpr double kGnssEpochBytes = 1024.0;
constexpr double kOdometrySampleBytes = 128.0;

/// A serial line is read at every beat, and now and then while a frame is on its way; any other whenever
/// something has come: on a CAN bus a sample comes in as many frames.
constexpr double kSerialReadsPerSample = 2.0;
constexpr double kOtherReadsPerSample = 8.0;

double sample_bytes(DeviceRole role) {
  switch (role) {
    case DeviceRole::kGnss:
      return kGnssEpochBytes;
    case DeviceRole::kOdometry:
      return kOdometrySampleBytes;
    case DeviceRole::kTime:
      return kPulseRecordBytes;
    default:
      return kImuSampleBytes;
  }
}

}  // namespace

LineRate line_rate(const DeviceConfig& device) {
  if (!has_line(device)) return {};
  double bytes_per_s = device.rate_hz * sample_bytes(device.role);
  if (device.serial) {
    const double carried = device.serial->baud / (kBitsBeforeStop + device.serial->stop_bits);
    bytes_per_s = std::min(bytes_per_s, carried);
  }
  const double reads = device.serial ? kSerialReadsPerSample : kOtherReadsPerSample;
  return {bytes_per_s, kReadRate_hz + reads * device.rate_hz};
}

std::size_t raw_ring_bytes(std::span<const DeviceConfig> devices) {
  LineRate all;
  for (const auto& device : devices) {
    const LineRate rate = line_rate(device);
    all.bytes_per_s += rate.bytes_per_s;
    all.reads_per_s += rate.reads_per_s;
  }
  return raw_ring_capacity(all.bytes_per_s, all.reads_per_s);
}

}  // namespace imuscope
