#pragma once

/// Of CovarianceTable alone: memory for what tables have calculated and may ask for again.

#include <cstddef>
#include <list>
#include <map>
#include <memory>
#include <mutex>
#include <tuple>
#include <utility>

#include "models/noise/covariance_places.h"

namespace imuscope::noise {

[[nodiscard]] inline std::size_t doubles_of(const Eigen::VectorXd& values) {
  return static_cast<std::size_t>(values.size());
}

/// Holds as much as its bound allows: where that is full, what was asked for longest ago goes. Each entry is a
/// function of its key, so that what is forgotten can be calculated again, and no result depends on the bound
/// or on who asked before. Who holds an entry keeps it, whatever is forgotten. Thread-safe.
class CovarianceMemory {
 public:
  /// What an entry is of.
  struct Key {
    std::size_t table = 0;
    Lags lags;
    int process = 0;  ///< of the table, or the places themselves

    bool operator<(const Key& other) const {
      return std::tie(table, lags, process) < std::tie(other.table, other.lags, other.process);
    }
  };

  /// @param most_doubles  that all entries together have; a single one that is larger is not held
  explicit CovarianceMemory(std::size_t most_doubles = kMostDoubles) : most_(most_doubles) {}

  /// A number that no other table of this memory has.
  [[nodiscard]] std::size_t next_table();

  /// The entry of `key`, by `make` where there is none. Two threads that ask for the same at once may both
  /// make it.
  /// @param make  gives a T, which says its size by doubles_of(const T&)
  template <typename T, typename Make>
  std::shared_ptr<const T> get(const Key& key, const Make& make) {
    if (const auto held = find(key)) return std::static_pointer_cast<const T>(held);
    auto made = std::make_shared<const T>(make());
    keep(key, made, doubles_of(*made));
    return made;
  }

  /// Doubles that the entries have together.
  [[nodiscard]] std::size_t held() const;

  /// 32 MB: beside the samples of a long axis they do not weigh, and a search goes back to no more before it has
  /// moved on.
  static constexpr std::size_t kMostDoubles = 4'000'000;

 private:
  struct Entry {
    Key key;
    std::shared_ptr<const void> value;
    std::size_t doubles;
  };

  std::shared_ptr<const void> find(const Key& key);
  void keep(const Key& key, std::shared_ptr<const void> value, std::size_t doubles);

  mutable std::mutex mutex_;
  std::size_t most_;
  std::size_t held_ = 0;
  std::size_t tables_ = 0;
  std::list<Entry> entries_;  ///< what was asked for last stands first
  std::map<Key, std::list<Entry>::iterator> places_;
};

}  // namespace imuscope::noise
