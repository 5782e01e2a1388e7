#pragma once

/// Sentences that several sensors or axes share, said once.

#include <string>
#include <utility>
#include <vector>

namespace imuscope {

/// A sentence and whose it is.
struct Named {
  std::string name;
  std::string sentence;
};

/// Each sentence once, in the order of its first: "mtx1, mtx2: no temperature in this record".
std::vector<std::string> grouped(const std::vector<Named>& sentences);

/// The same of sentences that begin with a name of `names` and a colon or comma: "mtx1, static: too short",
/// "mtx2, static: too short" become "mtx1, mtx2 (static): too short". Others stay as they are.
std::vector<std::string> grouped_by_name(const std::vector<std::string>& sentences,
                                         const std::vector<std::string>& names);

}  // namespace imuscope
