#include "view/player.h"

#include <fmt/format.h>
#include <algorithm>
#include <limits>
#include <utility>

namespace imuscope::view {

namespace {

constexpr double kToTheEnd = std::numeric_limits<double>::infinity();

}  // namespace

Result<std::unique_ptr<Player>> Player::open(std::unique_ptr<RecordedMessages> recording) {
  std::unique_ptr<Player> player(new Player(std::move(recording)));
  if (auto read = player->read_through(); !read) return tl::unexpected<Error>(read.error());
  return player;
}

Result<void> Player::read_through() {
  while (recording_->next(message_)) (void)picture_.hear(message_);
  length_s_ = picture_.time_s();
  if (!(length_s_ > 0.0)) {
    return work_error(
        "the recording holds nothing that a page shows: no navigation, no calibration, no error",
        "make a run of it first: imuscope process FILE --out DIR, and view that folder");
  }
  picture_.begin_anew();
  return recording_->rewind();
}

void Player::on_said(std::string_view text) {
  const auto command = read_page_command(text);
  if (!command) return;
  const std::scoped_lock lock(mutex_);
  was_asked_ = true;
  if (const auto* seek = std::get_if<Seek>(&*command)) sought_s_ = std::min(seek->time_s, length_s_);
  if (std::holds_alternative<Pause>(*command)) is_playing_ = false;
  if (const auto* play = std::get_if<Play>(&*command)) {
    speed_ = play->speed;
    is_playing_ = true;
    if (at_end_ && !sought_s_) sought_s_ = 0.0;
  }
}

std::string Player::extra() const {
  return fmt::format(R"(,"play":{{"playing":{},"speed":{:g},"time_s":{:.3f},"length_s":{:.3f}}})",
                     is_playing_, speed_, clock_s_, length_s_);
}

std::string Player::whole() const {
  const std::scoped_lock lock(mutex_);
  return picture_.whole(extra());
}

void Player::feed_until(double time_s, bool is_seek) {
  constexpr int kAtOnce = 256;  // between two looks whether a page has thought better of it
  while (!at_end_) {
    const std::scoped_lock lock(mutex_);
    if (is_seek && sought_s_) return;
    for (int i = 0; i < kAtOnce; ++i) {
      if (picture_.time_s() >= time_s) return;
      if (!recording_->next(message_)) {
        at_end_ = true;
        return;
      }
      (void)picture_.hear(message_);
    }
  }
}

std::string Player::turn(double passed_s) {
  bool is_seek = false;
  bool backwards = false;
  bool plays = false;
  {
    const std::scoped_lock lock(mutex_);
    is_seek = sought_s_.has_value();
    plays = is_playing_ && !at_end_;
    if (!is_seek && !plays && !was_asked_) return {};
    was_asked_ = false;
    backwards = is_seek && *sought_s_ < picture_.time_s();
    if (is_seek) clock_s_ = *std::exchange(sought_s_, std::nullopt);
    if (!is_seek && plays) clock_s_ = std::min(length_s_, clock_s_ + speed_ * passed_s);
    if (backwards) picture_.begin_anew();
    if (backwards) at_end_ = !recording_->rewind();
    if (is_seek || speed_ > kRowsUpTo) picture_.tell_all_next();
  }
  // What bears the last time may not be the last message.
  if (is_seek || plays) feed_until(clock_s_ < length_s_ ? clock_s_ : kToTheEnd, is_seek);
  const std::scoped_lock lock(mutex_);
  if (at_end_) is_playing_ = false;
  return picture_.part(extra());
}

}  // namespace imuscope::view
