#pragma once

/// Who keeps the PC's clock, and how well it says it does: chrony and ptp4l, asked through their own
/// programs, and the clocks of network cards (PTP), read against the wall clock. Non-real-time: starts
/// programs, each for two seconds at most, in a thread of its own.

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

namespace imuscope {

/// NaN: it does not say.
struct ClockKeeper {
  static constexpr double kUnsaid = std::numeric_limits<double>::quiet_NaN();

  std::string name;    ///< chrony, ptp4l, or the device file of a card's clock
  std::string source;  ///< whom it follows
  int stratum = -1;    ///< of ptp4l: steps to the grandmaster; -1: none
  bool is_synchronised = false;
  double offset_s =
      kUnsaid;  ///< of the wall clock against its source; of ptp4l of the card's clock; ahead: positive
  double sd_s = kUnsaid;
  double max_error_s = kUnsaid;
  double frequency_ppm = kUnsaid;
};

/// One line of `chronyc -c tracking`; nothing where it is none.
[[nodiscard]] std::optional<ClockKeeper> read_chrony_tracking(std::string_view text);
/// What `pmc` answers to GET CURRENT_DATA_SET and GET PARENT_DATA_SET.
[[nodiscard]] std::optional<ClockKeeper> read_ptp_management(std::string_view text);
/// A card's clock, read between two readings of the wall clock; ns since the epoch of each.
struct CardReading {
  std::int64_t before_ns;
  std::int64_t card_ns;
  std::int64_t after_ns;
};
/// The card's clock less the wall clock, s, by the reading whose two others lie closest, and how far apart they lie.
struct CardDifference {
  double card_minus_wall_s;
  double apart_s;
};
/// Nothing where no reading has its two others in their order.
[[nodiscard]] std::optional<CardDifference> card_difference(std::span<const CardReading> readings);
/// A card's clock against the wall clock.
/// @param card_minus_wall_s  as read, with the seconds that TAI is ahead of UTC
/// @param apart_s            from the reading of one before to that of the other after
[[nodiscard]] ClockKeeper card_clock(const std::string& path, double card_minus_wall_s, double apart_s);

/// Runs a program with an empty environment, without a shell.
/// @param arguments  the first is its path
/// @return what it printed; nothing where it failed, took longer than two seconds or printed more than 64 kB
[[nodiscard]] std::optional<std::string> output_of(const std::vector<std::string>& arguments);

/// Asks all that there are. May take seconds.
/// @param socket_folder  where pmc's socket may lie for the time of its question; ptp4l has to reach it
[[nodiscard]] std::vector<ClockKeeper> ask_clock_keepers(const std::filesystem::path& socket_folder);

/// Asks in a thread of its own. Thread: one.
class ClockKeeperInquiry {
 public:
  using Ask = std::function<std::vector<ClockKeeper>()>;
  explicit ClockKeeperInquiry(Ask ask) : ask_(std::move(ask)) {}
  ClockKeeperInquiry(const ClockKeeperInquiry&) = delete;
  ClockKeeperInquiry& operator=(const ClockKeeperInquiry&) = delete;
  /// Waits for an answer that is under way.
  ~ClockKeeperInquiry();

  /// Begins to ask, unless it asks already.
  void begin();
  /// The answer, once; nothing while there is none.
  [[nodiscard]] std::optional<std::vector<ClockKeeper>> take();

 private:
  Ask ask_;
  std::thread thread_;
  std::atomic<bool> is_answered_{false};
  std::vector<ClockKeeper> answer_;
};

}  // namespace imuscope
