#pragma once

/// Numbers that are too many for the memory, in a file of their own that nobody else sees and that goes with
/// the program.

#include <cstddef>
#include <span>

#include "base/result.h"

namespace imuscope::cli {

class Spool {
 public:
  /// In the folder for temporary files ($TMPDIR, or /tmp). Errors (kWork): none can be made there.
  static Result<Spool> create();

  Spool(Spool&& other) noexcept;
  Spool& operator=(Spool&& other) noexcept;
  Spool(const Spool&) = delete;
  Spool& operator=(const Spool&) = delete;
  ~Spool();

  /// After what is there. Errors (kWork): the disk is full, ...
  Result<void> append(std::span<const double> values);
  /// Fills `values` with what begins at number `first`; all of it must be there. Errors (kWork): the disk's.
  [[nodiscard]] Result<void> read(std::size_t first, std::span<double> values) const;
  [[nodiscard]] std::size_t size() const { return size_; }

 private:
  explicit Spool(int fd) : fd_(fd) {}

  int fd_ = -1;
  std::size_t size_ = 0;
};

}  // namespace imuscope::cli
