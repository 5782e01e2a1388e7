#pragma once

/// Goals of the form "so many of a hundred": what was counted, kept in a file between calls, and held against
/// the bands that are asked for.

#include <map>
#include <string>
#include <vector>

namespace imuscope {

/// Of how many series something was so.
struct Count {
  int hits = 0;
  int of = 0;
};
using Counts = std::map<std::string, Count>;

/// Per cent that a count of this name has to lie in.
struct Band {
  std::string name;
  double low;
  double high;
};

void count(Counts& counts, const std::string& name, bool hit);

/// What earlier calls counted, and the file to go on in. Runs are numbered; each cell goes on where it ended.
class Results {
 public:
  /// @param file  empty: nothing is kept
  explicit Results(const std::string& file);

  [[nodiscard]] int done(const std::string& cell) const;
  [[nodiscard]] const Counts& counts(const std::string& cell) { return counts_[cell]; }
  /// Counts of the runs from done() to `end`.
  void keep(const std::string& cell, int end, const Counts& counts);

 private:
  void add(const std::string& cell, int end, const Counts& counts);

  std::string file_;
  std::map<std::string, int> done_;
  std::map<std::string, Counts> counts_;
};

/// Prints a cell's counts beside its bands. A band is missed where the share lies beyond it by more than kOwnSd
/// of its binomial sd. False where one is.
bool judge(const std::string& cell, const std::vector<Band>& bands, const Counts& counts);

}  // namespace imuscope
