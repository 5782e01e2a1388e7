#pragma once

/// Error rows of one S-IMU on their way through several passes: kept in a file of the run folder that has no
/// name any more, so that memory does not grow with the drive and nothing is left behind.

#include <cstdio>
#include <memory>

#include "base/output_folder.h"
#include "base/result.h"
#include "dynamics/study.h"

namespace imuscope {

class RowSpool final : public ErrorRowSource {
 public:
  /// Errors (kWork): no file can be made in `folder`.
  static Result<RowSpool> create(const OutputFolder& folder);

  void add(const ErrorRow& row) noexcept;
  /// False once a row could not be kept (disk full): what is read then is not the whole.
  [[nodiscard]] bool whole() const noexcept { return whole_; }

  void rewind() override;
  bool next(ErrorRow& row) override;

 private:
  struct Close {
    void operator()(std::FILE* file) const noexcept { (void)std::fclose(file); }
  };
  explicit RowSpool(std::FILE* file) : file_(file) {}

  std::unique_ptr<std::FILE, Close> file_;
  bool whole_ = true;
};

}  // namespace imuscope
