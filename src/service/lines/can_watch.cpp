#include "service/lines/can_watch.h"

#include <fmt/format.h>

#include <algorithm>

#include "drivers/transport/can_interface.h"

namespace imuscope {

namespace {

/// More than these are not worth their room in a sentence.
constexpr std::size_t kIdsNamed = 8;
/// An error frame has 8 bytes of data.
constexpr std::uint64_t kErrorRecordBytes = kCanRecordHeaderBytes + 8;

std::string text_of(const std::vector<CanId>& ids) {
  std::string text;
  for (std::size_t i = 0; i < ids.size() && i < kIdsNamed; ++i) {
    constexpr int kStandardDigits = 3;
    constexpr int kExtendedDigits = 8;
    text += fmt::format("{}{:0{}X}", i == 0 ? "" : ", ", ids[i].id,
                        ids[i].is_extended ? kExtendedDigits : kStandardDigits);
  }
  return ids.size() > kIdsNamed ? text + ", ..." : text;
}

}  // namespace

CanWatch::CanWatch(std::string interface, const std::vector<CanId>& ids)
    : interface_(std::move(interface)), ids_(text_of(ids)) {}

std::string CanWatch::look(const LineStatus& line, HostTime now) {
  const auto interface = look_at_can_interface(interface_);
  if (!interface) return interface.error().text();
  CanObservation seen;
  seen.ids = ids_;
  const bool heard = line.counters.frames != frames_;
  if (!has_looked_ || heard) heard_at_ = now;
  if (has_looked_) {
    seen.silent_s = to_seconds(now - heard_at_);
    if (!heard) {
      // What is read and is no frame for the decoder is an error frame. Some drivers count those as received,
      // too.
      seen.error_frames = (line.counters.bytes - bytes_) / kErrorRecordBytes;
      const std::uint64_t received = interface->frames_received - interface_frames_;
      seen.other_frames = received - std::min(received, seen.error_frames);
    }
    seen.frames_dropped = line.frames_dropped - dropped_;
  }
  has_looked_ = true;
  frames_ = line.counters.frames;
  bytes_ = line.counters.bytes;
  dropped_ = line.frames_dropped;
  interface_frames_ = interface->frames_received;
  return explain_can_trouble(*interface, seen);
}

}  // namespace imuscope
