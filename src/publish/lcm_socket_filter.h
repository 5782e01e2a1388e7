#pragma once

/// Keeps what nobody here asked for away from an LCM receiver. LCM's own thread wakes up for every datagram
/// of the multicast group, also for the hundreds a second that this very process publishes, and sorts them
/// afterwards; a filter on its socket lets the kernel do that without a wake-up.

#include <string>
#include <vector>

namespace imuscope {

/// Thread: one. To be made before the library opens its socket.
class LcmSocketFilter {
 public:
  /// @param url  as given to the library, after check_lcm_url()
  explicit LcmSocketFilter(std::string url);

  /// Lets only the wanted channels through to the socket that the library has opened since. Whole messages of
  /// other channels are dropped by the kernel (and counted as drops in /proc/net/udp); fragments of large
  /// ones pass. Where the socket is not found or the kernel refuses, everything passes as before: it is
  /// thrift alone.
  /// @param channels  whole names, or beginnings followed by ".*"; with other regular expressions everything
  ///                  passes
  void let_through(const std::vector<std::string>& channels) const;

 private:
  std::string url_;
  std::vector<int> others_;  ///< of another part of the program, or inherited from the one that started it
};

}  // namespace imuscope
