#include "capture/sealed_log.h"

namespace imuscope {
namespace {

/// The first seal stands right after the header, however long that is. Where there is none, the log is one
/// without seals, and nothing is held for long.
constexpr std::size_t kWaitForFirstSealBytes = std::size_t{64} << 10U;
/// Seals are nearer to each other than any record is long.
constexpr std::size_t kWaitForSealBytes = std::size_t{8} << 20U;

std::size_t cost_of(const LogEvent& event) {
  return kEventLogHeaderBytes + event.channel.size() + event.data.size();
}

bool stands_where_it_was_put(const capture_seal_t& seal, const LogEvent& event) {
  return seal.utime == event.utime && event.number - seal.n_records == seal.first_number;
}

}  // namespace

Result<SealedLog> SealedLog::open(const std::filesystem::path& path, EventLogReader::Beginning beginning) {
  auto log = EventLogReader::open(path, beginning);
  if (!log) return tl::unexpected<Error>(log.error());
  return SealedLog(std::move(*log));
}

bool SealedLog::next(LogEvent& event) {
  // What lines bring between two seals; records as long as a configuration are not kept.
  constexpr std::size_t kSparesMost = 4096;
  constexpr std::size_t kSpareBytesMost = 2048;
  while (released_ == 0) {
    LogEvent read;
    if (!spares_.empty()) {
      read = std::move(spares_.back());
      spares_.pop_back();
    }
    if (log_.next(read)) {
      take(std::move(read));
      continue;
    }
    if (held_.empty()) return false;
    release_all();
  }
  if (spares_.size() < kSparesMost && event.data.capacity() <= kSpareBytesMost)
    spares_.push_back(std::move(event));
  event = std::move(held_.front());
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
  waiting_bytes_ = 0;
  given_unsealed_ = 0;
  log_.go_to(place);
}

LogHealth SealedLog::health() const {
  LogHealth health = health_;
  health.bytes_skipped = log_.bytes_skipped();
  health.bytes_cut_off = log_.bytes_cut_off();
  return health;
}

void SealedLog::hold(LogEvent&& event) {
  waiting_bytes_ += cost_of(event);
  held_.push_back(std::move(event));
  const bool is_first = held_.size() == 1;
  const std::size_t wait = health_.is_sealed ? kWaitForSealBytes : kWaitForFirstSealBytes;
  if (!is_first && waiting_bytes_ > wait) release_all();
}

void SealedLog::take(LogEvent&& event) {
  // An index is the last of its file: one that something follows was copied from another.
  health_.index.reset();
  if (index_) hold(std::move(*std::exchange(index_, std::nullopt)));
  if (is_surely_no_seal(event)) return hold(std::move(event));
  const auto seal = decode_seal(event.data);
  auto index = decode_index(event.data);
  // What was played and recorded anew, as by lcm-logger, has other stamps and numbers: its seals are of the
  // log that it came from, and records like any other.
  const bool is_foreign =
      (seal && !stands_where_it_was_put(*seal, event)) || (index && index->utime != event.utime);
  if (is_foreign || !is_seal_or_index(event)) return hold(std::move(event));
  health_.is_sealed = true;
  if (seal) {
    check(*seal);
  } else if (index) {
    health_.index = std::move(index);
    index_ = std::move(event);
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
  std::vector<bool> is_kept(held_.size() - released_);
  // From the last one: where a number stands twice, the seal is of the later.
  for (std::size_t i = held_.size(); i-- > released_;) {
    const LogEvent& event = held_[i];
    if (event.number < seal.first_number) {
      health_.records_unsealed += 1;
      is_kept[i - released_] = true;
      continue;
    }
    const auto place =
        static_cast<std::uint64_t>(event.number) - static_cast<std::uint64_t>(seal.first_number);
    const bool is_named = place < seen.size() && !seen[place];
    if (is_named) seen[place] = true;
    found += is_named ? 1 : 0;
    is_kept[i - released_] = is_named && static_cast<std::int32_t>(crc32_of(event)) == seal.checksums[place];
    if (!is_kept[i - released_]) health_.records_damaged += 1;
  }
  if (found < seen.size()) health_.records_missing += seen.size() - found;
  std::size_t end = released_;
  for (std::size_t i = released_; i < held_.size(); ++i) {
    if (!is_kept[i - released_]) continue;
    if (i != end) held_[end] = std::move(held_[i]);
    ++end;
  }
  held_.erase(held_.begin() + static_cast<std::ptrdiff_t>(end), held_.end());
  released_ = held_.size();
  waiting_bytes_ = 0;
}

void SealedLog::release_all() {
  const std::size_t unsealed = held_.size() - released_;
  health_.records_unsealed += unsealed;
  given_unsealed_ += unsealed;
  released_ = held_.size();
  waiting_bytes_ = 0;
}

}  // namespace imuscope
