#include "models/noise/covariance_memory.h"

namespace imuscope::noise {

std::size_t CovarianceMemory::next_table() {
  const std::lock_guard lock(mutex_);
  return tables_++;
}

std::size_t CovarianceMemory::held() const {
  const std::lock_guard lock(mutex_);
  return held_;
}

std::shared_ptr<const void> CovarianceMemory::find(const Key& key) {
  const std::lock_guard lock(mutex_);
  const auto place = places_.find(key);
  if (place == places_.end()) return nullptr;
  entries_.splice(entries_.begin(), entries_, place->second);
  return place->second->value;
}

void CovarianceMemory::keep(const Key& key, std::shared_ptr<const void> value, std::size_t doubles) {
  std::list<Entry> forgotten;  // freed when the lock is not held any more
  const std::lock_guard lock(mutex_);
  if (doubles > most_ || places_.contains(key)) return;
  entries_.push_front({key, std::move(value), doubles});
  places_.emplace(key, entries_.begin());
  held_ += doubles;
  while (held_ > most_) {
    held_ -= entries_.back().doubles;
    places_.erase(entries_.back().key);
    forgotten.splice(forgotten.begin(), entries_, std::prev(entries_.end()));
  }
}

}  // namespace imuscope::noise
