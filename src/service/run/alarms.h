#pragma once

/// What wants a person: since when, how often, and what to do. Non-real-time.

#include <imuscope/alarm_t.hpp>
#include <span>
#include <string>
#include <vector>

#include "base/result.h"
#include "base/time.h"

namespace imuscope {

/// Something that is wrong now.
struct Condition {
  std::string kind;     ///< one of alarm_kind
  std::string subject;  ///< whom it concerns; with the kind it tells one alarm from another
  std::string what;
  std::string remedy;
  [[nodiscard]] std::string text() const { return Error{ErrorKind::kWork, what, remedy}.text(); }
};

namespace alarm_kind {
inline constexpr const char* kDevice = "device";             ///< it does not stream
inline constexpr const char* kDeviceLoss = "device_loss";    ///< this PC loses what it sends
inline constexpr const char* kCaptureLoss = "capture_loss";  ///< records are missing in the capture
inline constexpr const char* kRing = "ring";                 ///< a full ring refuses elements
inline constexpr const char* kThread = "thread";             ///< it stands still
inline constexpr const char* kDisk = "disk";
inline constexpr const char* kBus = "bus";
inline constexpr const char* kPrivilege = "privilege";  ///< the system refused a right at the start
}  // namespace alarm_kind

/// "what; what to do" as Error::text() joins them, taken apart again.
[[nodiscard]] Condition condition_of(const char* kind, std::string subject, const std::string& sentence);

/// Counts that should not grow. Each is an alarm while it grows, and for kStillGrowing after.
class GrowingCounts {
 public:
  static constexpr Duration kStillGrowing = std::chrono::seconds(10);
  /// @return whether the count called `name` has grown lately; from zero on
  [[nodiscard]] bool grows(const std::string& name, std::int64_t count, HostTime now);

 private:
  struct Count {
    std::string name;
    std::int64_t value = 0;
    HostTime grew{};
  };
  std::vector<Count> counts_;
};

/// The alarms of a run.
class AlarmBook {
 public:
  /// So many are kept; a run has one for each of its devices, threads and rings, and a few more.
  static constexpr std::size_t kMost = 256;

  struct News {
    std::vector<alarm_t> began;
    std::vector<alarm_t> ended;
  };

  /// @param holding  all that is wrong now
  /// @param utc      of this look, as the run has it
  /// @return what is not as it was at the last look
  News look(std::span<const Condition> holding, UtcTime utc, HostTime now);

  /// Active ones first, then by their beginning.
  [[nodiscard]] std::vector<alarm_t> list() const;

 private:
  struct Entry {
    alarm_t alarm;
    HostTime began{};
  };
  std::vector<Entry> entries_;
};

}  // namespace imuscope
