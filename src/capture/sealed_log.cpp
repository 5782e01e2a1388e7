#include "capture/sealed_log.h"

namespace imuscope {
namespace {

/// The first seal stands right after the header, however long that is. Where there is none, the log is one
/// without seals, and nothing is held for long.
constexpr std::size_t kWaitForFirstSealBytes = std::size_t{64} << 10U;
/// Seals are nearer to each other than any record is long.
constexpr std::size_t kWaitForSealBytes = EventLogReader::kDamageMostBytes;

bool stands_where_it_was_put(const capture_seal_t& seal, const LogEventView& event) {
  return seal.utime == event.utime && event.number - seal.n_records == seal.first_number;
}

}  // namespace

Result<SealedLog> SealedLog::open(const std::filesystem::path& path, EventLogReader::Beginning beginning) {
  auto log = EventLogReader::open(path, beginning);
  if (!log) return tl::unexpected<Error>(log.error());
  return SealedLog(std::move(*log));
}

bool SealedLog::next(LogEventView& event) {
  while (released_ == 0) {
    log_.keep_from(!held_.empty() ? held_.front() : index_.value_or(log_.place()));
    const auto found = log_.look_for(event);
    if (found == EventLogReader::Next::kEvent) {
      take(event);
      release_what_waited_long();
      continue;
    }
    // Behind so much damage, or at the end, nothing comes any more that a record could wait for.
    if (index_ && found == EventLogReader::Next::kFar) held_.push_back(*std::exchange(index_, std::nullopt));
    if (held_.empty() && found == EventLogReader::Next::kEnd) return false;
    release_all();
  }
  event = log_.event_at(held_.front());
  held_.pop_front();
  --released_;
  return true;
}

std::optional<std::uint64_t> SealedLog::place() const {
  if (!held_.empty() || index_ || (health_.is_sealed && given_unsealed_ > 0)) return std::nullopt;
  return log_.place();
}

void SealedLog::go_to(std::uint64_t place) {
  held_.clear();
  index_.reset();
  released_ = 0;
  given_unsealed_ = 0;
  log_.go_to(place);
}

LogHealth SealedLog::health() const {
  LogHealth health = health_;
  health.bytes_skipped = log_.bytes_skipped();
  health.bytes_cut_off = log_.bytes_cut_off();
  return health;
}

/// A record that is as long as that by itself waits for what comes next: its seal, if there is one.
void SealedLog::release_what_waited_long() {
  if (released_ > 0 || held_.empty() || held_.front() == log_.given_place()) return;
  const std::size_t wait = health_.is_sealed ? kWaitForSealBytes : kWaitForFirstSealBytes;
  if (log_.place() - held_.front() > wait) release_all();
}

void SealedLog::take(const LogEventView& event) {
  const std::uint64_t place = log_.given_place();
  // An index is the last of its file: one that something follows was copied from another.
  health_.index.reset();
  if (index_) held_.push_back(*std::exchange(index_, std::nullopt));
  if (is_surely_no_seal(event)) {
    if (!unwanted_ || !unwanted_(event.data)) held_.push_back(place);
    return;
  }
  const auto seal = decode_seal(event.data);
  auto index = decode_index(event.data);
  // What was played and recorded anew, as by lcm-logger, has other stamps and numbers: its seals are of the
  // log that it came from, and records like any other.
  const bool is_foreign =
      (seal && !stands_where_it_was_put(*seal, event)) || (index && index->utime != event.utime);
  if (is_foreign || !is_seal_or_index(event)) return held_.push_back(place);
  health_.is_sealed = true;
  if (seal) {
    check(*seal);
  } else if (index) {
    health_.index = std::move(index);
    index_ = place;
  } else {
    health_.records_damaged += 1;
  }
}

/// Keeps of the held records those that the seal knows as they are, and those from before what it covers:
/// they are of a seal that is lost.
void SealedLog::check(const capture_seal_t& seal) {
  const std::uint64_t given = std::exchange(given_unsealed_, 0);
  std::vector<bool> seen(seal.checksums.size());
  std::uint64_t found = given;
  std::vector<bool> is_kept(held_.size());
  // From the last one: where a number stands twice, the seal is of the later.
  for (std::size_t i = held_.size(); i-- > 0;) {
    const LogEventView event = log_.event_at(held_[i]);
    if (event.number < seal.first_number) {
      health_.records_unsealed += 1;
      is_kept[i] = true;
      continue;
    }
    const auto place =
        static_cast<std::uint64_t>(event.number) - static_cast<std::uint64_t>(seal.first_number);
    const bool is_named = place < seen.size() && !seen[place];
    if (is_named) seen[place] = true;
    found += is_named ? 1 : 0;
    is_kept[i] = is_named && static_cast<std::int32_t>(crc32_of(event)) == seal.checksums[place];
    if (!is_kept[i]) health_.records_damaged += 1;
  }
  if (found < seen.size()) health_.records_missing += seen.size() - found;
  std::size_t end = 0;
  for (std::size_t i = 0; i < held_.size(); ++i) {
    if (!is_kept[i]) continue;
    held_[end++] = held_[i];
  }
  held_.erase(held_.begin() + static_cast<std::ptrdiff_t>(end), held_.end());
  released_ = held_.size();
}

void SealedLog::release_all() {
  health_.records_unsealed += held_.size();
  given_unsealed_ += held_.size();
  released_ = held_.size();
}

}  // namespace imuscope
