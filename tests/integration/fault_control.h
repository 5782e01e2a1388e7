#pragma once

/// How a test tells a preloaded library what is to go wrong: by the first letter of a file. Of the C library
/// alone, as the functions that it is called from stand in for the others.

#include <fcntl.h>
#include <unistd.h>
#include <cstdlib>

/// First letter of the file that the environment variable names; 0 where there is none.
inline char fault_letter(const char* variable) {
  const char* const path = getenv(variable);
  const int fd = path != nullptr ? open(path, O_RDONLY | O_CLOEXEC) : -1;
  if (fd < 0) return 0;
  char letter = 0;
  if (read(fd, &letter, 1) != 1) letter = 0;
  close(fd);
  return letter;
}
