#pragma once

/// Plays a recording into a picture: at every time it is the picture that a page would have had live. A jump
/// costs at most what a sixtieth of the recording does.

#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/result.h"
#include "view/page_command.h"
#include "view/picture.h"
#include "view/recorded_messages.h"

namespace imuscope::view {

class Player {
 public:
  /// Played faster, a part would hold more rows than a page can draw: it gets the extremes instead.
  static constexpr double kRowsUpTo = 10.0;

  /// Reads all of it once.
  /// @return kWork for a recording without a time
  static Result<std::unique_ptr<Player>> open(std::unique_ptr<RecordedMessages> recording);

  /// Any thread. What does not concern a recording is passed over.
  void on_said(std::string_view text);
  /// Of the picture, and how it is played. Any thread.
  [[nodiscard]] std::string whole() const;

  /// Goes on by `passed_s` of a clock on the wall, or to where it was sought; empty where nothing changed.
  /// One thread.
  [[nodiscard]] std::string turn(double passed_s);

  [[nodiscard]] double length_s() const noexcept { return length_s_; }
  /// One thread, that of turn().
  [[nodiscard]] double time_s() const noexcept { return picture_.time_s(); }

 private:
  explicit Player(std::unique_ptr<RecordedMessages> recording) : recording_(std::move(recording)) {}
  /// The picture as it was somewhere in the recording: a jump begins at the last one before it.
  struct Stop {
    double time_s;
    RecordedMessages::Place place;
    Picture picture;
  };
  Result<void> read_through();
  void add_stop();
  [[nodiscard]] const Stop* stop_before(double time_s) const;
  void go_near(double time_s);
  void feed_until(double time_s, bool is_seek);
  [[nodiscard]] std::string extra() const;

  std::unique_ptr<RecordedMessages> recording_;
  std::vector<std::uint8_t> message_;
  std::vector<Stop> stops_;  ///< rising; made by read_through()
  double stop_every_s_ = 10.0;
  double length_s_ = 0.0;
  double clock_s_ = 0.0;  ///< to where it has been played
  bool at_end_ = false;
  mutable std::mutex mutex_;  ///< of what follows
  Picture picture_;
  double speed_ = 1.0;
  bool is_playing_ = true;
  bool was_asked_ = false;
  std::optional<double> sought_s_;
};

}  // namespace imuscope::view
