#pragma once

/// The door of `imuscope status`: a Unix socket in the runtime directory of the service. Whoever connects
/// gets the age of the newest STATUS (int64, ns, big-endian), that STATUS as LCM encodes it, and the end. It
/// takes no byte from anybody; of users it answers its own and root.
///
/// Runtime directory: what systemd names (RUNTIME_DIRECTORY), else `imuscope` in XDG_RUNTIME_DIR, else, for
/// root, /run/imuscope. Each run has a socket of its own there, PID.status.

#include <filesystem>
#include <imuscope/status_t.hpp>
#include <memory>
#include <vector>

#include "base/result.h"
#include "service/doors/status_board.h"

namespace imuscope {

/// As top and the kernel show its thread.
inline constexpr const char* kStatusThreadName = "imuscope-status";

class StatusSocket {
 public:
  /// Makes the directory and the socket, and answers from a thread of its own.
  /// @return kWork where there is no runtime directory, or it cannot be made, or is open to other users
  static Result<std::unique_ptr<StatusSocket>> open(const StatusBoard& board);
  ~StatusSocket();
  StatusSocket(const StatusSocket&) = delete;
  StatusSocket& operator=(const StatusSocket&) = delete;

  [[nodiscard]] const std::filesystem::path& path() const noexcept;

 private:
  struct Impl;
  explicit StatusSocket(std::unique_ptr<Impl> impl) noexcept;
  std::unique_ptr<Impl> impl_;
};

/// Sockets of runs in all runtime directories that this user may look into, oldest first.
/// @return kWork with what stands in the way where there is none
[[nodiscard]] Result<std::vector<std::filesystem::path>> find_status_sockets();

struct AskedStatus {
  status_t status;
  double age_s = 0.0;  ///< more than a second or two: the thread that makes it stands still
};

/// Asks one run. Waits at most two seconds for it.
/// @return kWork where nobody answers (a run that was killed leaves its socket) or the run is of another
/// version
[[nodiscard]] Result<AskedStatus> ask_status(const std::filesystem::path& socket);

}  // namespace imuscope
