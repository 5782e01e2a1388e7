#pragma once

/// Kernel memory for what has arrived at a socket and waits to be read. Non-real-time only.

#include <string>

namespace imuscope {

/// Asks for `wanted_bytes`, past the system's limit where the program may (CAP_NET_ADMIN).
/// @return what the kernel granted
int grow_receive_buffer(int fd, int wanted_bytes) noexcept;

/// Where less was granted than wanted, that with the remedy, for the description of a line; empty otherwise.
std::string buffer_shortage(int granted_bytes, int wanted_bytes);

}  // namespace imuscope
