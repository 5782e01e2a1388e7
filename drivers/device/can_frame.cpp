#include "drivers/device/can_frame.h"

#include <algorithm>

#include "base/bytes.h"
#include "base/contracts.h"

namespace imuscope {

namespace {

// As in <linux/can.h>, which this folder does not need: the records outlive the system that made them.
constexpr std::uint32_t kExtendedFlag = 0x8000'0000;
constexpr std::uint32_t kRemoteFlag = 0x4000'0000;
constexpr std::uint32_t kErrorFlag = 0x2000'0000;
constexpr std::uint8_t kBitRateSwitch = 0x01;
constexpr std::uint8_t kErrorStateIndicator = 0x02;
constexpr std::uint8_t kFd = 0x04;
constexpr std::uint8_t kKnownFlags = kBitRateSwitch | kErrorStateIndicator | kFd;

constexpr std::size_t kClassicMaxData = 8;
constexpr std::size_t kLengthAt = 4;
constexpr std::size_t kFlagsAt = 5;
constexpr std::size_t kRawDlcAt = 6;
constexpr std::size_t kReservedAt = 7;
constexpr std::size_t kStampAt = 8;

bool is_record(const CanFrame& frame, std::uint8_t flags, std::uint8_t reserved) noexcept {
  const std::uint32_t id_max = frame.is_extended || frame.is_error ? kCanExtendedIdMax : kCanStandardIdMax;
  return frame.id <= id_max && (flags & ~kKnownFlags) == 0 && reserved == 0 &&
         is_can_length(frame.length, frame.is_fd);
}

/// @return bytes of the record; 0 where there is none
std::size_t read_can_record(std::span<const std::uint8_t> bytes, CanFrame& frame) noexcept {
  if (bytes.size() < kCanRecordHeaderBytes) return 0;
  const auto id = read_le<std::uint32_t>(bytes);
  const std::uint8_t flags = bytes[kFlagsAt];
  frame.is_extended = (id & kExtendedFlag) != 0;
  frame.is_remote = (id & kRemoteFlag) != 0;
  frame.is_error = (id & kErrorFlag) != 0;
  frame.id = id & kCanExtendedIdMax;
  frame.is_fd = (flags & kFd) != 0;
  frame.bit_rate_switched = (flags & kBitRateSwitch) != 0;
  frame.sender_error_state = (flags & kErrorStateIndicator) != 0;
  frame.length = bytes[kLengthAt];
  frame.raw_dlc = bytes[kRawDlcAt];
  frame.stamp = host_time_from_ns(read_le<std::int64_t>(bytes, kStampAt));
  if (!is_record(frame, flags, bytes[kReservedAt])) return 0;
  const std::size_t n_data = frame.payload().size();
  if (bytes.size() < kCanRecordHeaderBytes + n_data) return 0;
  frame.data = {};
  std::copy_n(bytes.begin() + kCanRecordHeaderBytes, n_data, frame.data.begin());
  return kCanRecordHeaderBytes + n_data;
}

}  // namespace

bool is_can_length(std::size_t length, bool fd) noexcept {
  if (length <= kClassicMaxData) return true;
  constexpr std::array<std::size_t, 7> kFdLengths{12, 16, 20, 24, 32, 48, 64};
  return fd && std::find(kFdLengths.begin(), kFdLengths.end(), length) != kFdLengths.end();
}

std::size_t write_can_record(const CanFrame& frame, std::span<std::uint8_t> out) noexcept {
  const auto data = frame.payload();
  IMUSCOPE_EXPECTS(frame.length <= kCanMaxData && out.size() >= kCanRecordHeaderBytes + data.size());
  const std::uint32_t id = frame.id | (frame.is_extended ? kExtendedFlag : 0U) |
                           (frame.is_remote ? kRemoteFlag : 0U) | (frame.is_error ? kErrorFlag : 0U);
  write_le(id, out, 0);
  out[kLengthAt] = frame.length;
  out[kFlagsAt] = static_cast<std::uint8_t>((frame.bit_rate_switched ? kBitRateSwitch : 0U) |
                                            (frame.sender_error_state ? kErrorStateIndicator : 0U) |
                                            (frame.is_fd ? kFd : 0U));
  out[kRawDlcAt] = frame.raw_dlc;
  out[kReservedAt] = 0;
  write_le(static_cast<std::uint64_t>(to_ns(frame.stamp)), out, kStampAt);
  std::copy(data.begin(), data.end(), out.begin() + kCanRecordHeaderBytes);
  return kCanRecordHeaderBytes + data.size();
}

bool CanFrameReader::next(CanFrame& frame) noexcept {
  const std::size_t n = read_can_record(rest_, frame);
  if (n == 0) {
    bytes_skipped_ += rest_.size();
    rest_ = {};
    return false;
  }
  rest_ = rest_.subspan(n);
  return true;
}

}  // namespace imuscope
