#include "view/player.h"

#include <fmt/format.h>
#include <algorithm>
#include <limits>
#include <utility>

namespace imuscope::view {

namespace {

constexpr double kToTheEnd = std::numeric_limits<double>::infinity();
/// Messages of several tables, each of which begins at its first row, are mixed by no more than this.
constexpr double kMixed_s = 1.0;
/// So many pictures of a recording are kept, of some hundred kB each.
constexpr std::size_t kStopsMost = 120;

}  // namespace

Result<std::unique_ptr<Player>> Player::open(std::unique_ptr<RecordedMessages> recording) {
  std::unique_ptr<Player> player(new Player(std::move(recording)));
  if (auto read = player->read_through(); !read) return tl::unexpected<Error>(read.error());
  return player;
}

Result<void> Player::read_through() {
  double newest_s = 0.0;
  while (recording_->next(message_)) {
    if (!picture_.hear(message_)) continue;
    // After a service that began anew times come twice: a jump means the first.
    if (picture_.time_s() < newest_s - kMixed_s) stop_every_s_ = kToTheEnd;
    newest_s = std::max(newest_s, picture_.time_s());
    if (newest_s >= (stops_.empty() ? 0.0 : stops_.back().time_s) + stop_every_s_) add_stop();
  }
  length_s_ = picture_.time_s();
  if (!(length_s_ > 0.0)) {
    return work_error(
        "the recording holds nothing that a page shows: no navigation, no calibration, no error",
        "make a run of it first: imuscope process FILE --out DIR, and view that folder");
  }
  picture_.begin_anew();
  return recording_->rewind();
}

void Player::add_stop() {
  const auto place = recording_->place();
  if (!place) return;
  if (stops_.size() >= kStopsMost) {
    std::size_t kept = 0;
    for (std::size_t i = 1; i < stops_.size(); i += 2) std::swap(stops_[kept++], stops_[i]);
    stops_.resize(kept);
    stop_every_s_ *= 2.0;
    if (picture_.time_s() < stops_.back().time_s + stop_every_s_) return;
  }
  (void)picture_.part();  // its rows need not be kept
  stops_.push_back({picture_.time_s(), *place, picture_});
}

const Player::Stop* Player::stop_before(double time_s) const {
  const auto behind = std::upper_bound(stops_.begin(), stops_.end(), time_s,
                                       [](double t, const Stop& stop) { return t < stop.time_s; });
  return behind == stops_.begin() ? nullptr : &*std::prev(behind);
}

/// To the last stop before a time, where that is nearer than to play on from here.
void Player::go_near(double time_s) {
  const bool is_behind = time_s < picture_.time_s();
  const Stop* stop = stop_before(time_s);
  if (stop != nullptr && (is_behind || stop->time_s > picture_.time_s())) {
    picture_.become(stop->picture);
    at_end_ = !recording_->go_to(stop->place);
  } else if (is_behind) {
    picture_.begin_anew();
    at_end_ = !recording_->rewind();
  }
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
  bool plays = false;
  {
    const std::scoped_lock lock(mutex_);
    is_seek = sought_s_.has_value();
    plays = is_playing_ && !at_end_;
    if (!is_seek && !plays && !was_asked_) return {};
    was_asked_ = false;
    if (is_seek) clock_s_ = *std::exchange(sought_s_, std::nullopt);
    if (!is_seek && plays) clock_s_ = std::min(length_s_, clock_s_ + speed_ * passed_s);
    if (is_seek) go_near(clock_s_);
    if (is_seek || speed_ > kRowsUpTo) picture_.tell_all_next();
  }
  // What bears the last time may not be the last message.
  if (is_seek || plays) feed_until(clock_s_ < length_s_ ? clock_s_ : kToTheEnd, is_seek);
  const std::scoped_lock lock(mutex_);
  if (at_end_) is_playing_ = false;
  return picture_.part(extra());
}

}  // namespace imuscope::view
