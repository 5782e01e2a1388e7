#pragma once

/// The recorded bytes of one device, read by read.

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/result.h"
#include "base/time.h"
#include "capture/raw_dump.h"

namespace imuscope {

/// One read as it was made when it was recorded; `bytes` stay valid until the next call of next().
struct RecordedRead {
  std::optional<HostTime> arrival;  ///< absent in recordings without arrival stamps
  std::span<const std::uint8_t> bytes;
  std::optional<Duration> per_byte{};  ///< on the wire from here on, where the line's rate is another one
  std::optional<HostTime> received{};  ///< its last byte had come, where the kernel or the card said so
};

class ByteSource {
 public:
  virtual ~ByteSource() = default;
  /// The next read, or nothing at the end.
  virtual Result<std::optional<RecordedRead>> next() = 0;
  /// Bytes handed out so far and in all, for progress bars.
  [[nodiscard]] virtual std::uint64_t bytes_read() const = 0;
  [[nodiscard]] virtual std::uint64_t bytes_total() const = 0;
};

/// A raw dump: X.bin or a text file, with X.arrivals.csv beside it where the arrivals were kept; or a .mtb
/// log, whose header is passed over.
Result<std::unique_ptr<ByteSource>> open_raw_dump(const std::filesystem::path& file,
                                                  RawDump::Arrivals arrivals = RawDump::Arrivals::kToCheck);

/// Who reads a recording: the thread that asks for the bytes, or another one ahead of it, where the recording
/// can be read so. What is read is the same.
enum class Reading : std::uint8_t { kWhenAsked, kAhead };

/// The reads of one device out of a capture.
/// @param bytes  of this device in the capture, as CaptureSummary says
Result<std::unique_ptr<ByteSource>> open_captured_device(const std::filesystem::path& capture,
                                                         const std::string& device, std::uint64_t bytes,
                                                         Reading reading = Reading::kWhenAsked);

/// A device whose reads are wanted, and their bytes, as CaptureSummary says.
struct CapturedLine {
  std::string device;
  std::uint64_t bytes = 0;
};

/// The reads of several devices by one pass over the capture, for those who go through them side by side; a
/// device may be named twice. One that is asked for far ahead of the others reads the capture by itself.
Result<std::vector<std::unique_ptr<ByteSource>>> open_captured_lines(const std::filesystem::path& capture,
                                                                     const std::vector<CapturedLine>& lines,
                                                                     Reading reading);

}  // namespace imuscope
