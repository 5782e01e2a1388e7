#pragma once

/// Opens a line beside the supervisor: a name server that does not answer, a server that is not there or a
/// driver that hangs holds up nobody but this one line.

#include <functional>
#include <memory>
#include <optional>

#include "base/result.h"
#include "drivers/transport/transport.h"

namespace imuscope {

/// Thread: one, non-real-time. An attempt that is under way when this ends is left to itself: what it
/// opens it closes again.
class LineOpener {
 public:
  using Outcome = Result<std::unique_ptr<Transport>>;

  /// Calls `open` in a thread of its own. No other attempt may be under way.
  /// @param open  owns all that it uses: it may outlive this object
  void begin(std::function<Outcome()> open);
  [[nodiscard]] bool is_under_way() const { return attempt_ != nullptr; }
  /// What came of the attempt, once; nothing before.
  [[nodiscard]] std::optional<Outcome> take();

 private:
  struct Attempt;
  std::shared_ptr<Attempt> attempt_;
};

}  // namespace imuscope
