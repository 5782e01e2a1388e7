#pragma once

/// Watches the interface of a CAN device beside its line: whether it is up, what its controller says, and
/// what else travels on the bus. Non-real-time.

#include <string>
#include <vector>

#include "base/time.h"
#include "drivers/device/can_frame.h"
#include "service/lines/io_thread.h"

namespace imuscope {

class CanWatch {
 public:
  /// @param ids  that the device needs
  CanWatch(std::string interface, const std::vector<CanId>& ids);

  /// @return what is wrong, with the remedy, in one sentence; empty when all is well
  [[nodiscard]] std::string look(const LineStatus& line, HostTime now);

 private:
  std::string interface_;
  std::string ids_;
  bool has_looked_ = false;
  HostTime heard_at_{};
  std::uint64_t frames_ = 0;
  std::uint64_t bytes_ = 0;  ///< that were read
  std::uint64_t dropped_ = 0;
  std::uint64_t interface_frames_ = 0;
};

}  // namespace imuscope
