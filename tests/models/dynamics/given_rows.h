#pragma once

/// Rows of an error process that a test makes, as often as they are asked for.

#include <utility>
#include <vector>

#include "models/dynamics/study.h"

namespace imuscope::test {

class GivenRows final : public ErrorRowSource {
 public:
  explicit GivenRows(std::vector<ErrorRow> rows) : rows_(std::move(rows)) {}
  void rewind() override { at_ = 0; }
  bool next(ErrorRow& row) override {
    if (at_ == rows_.size()) return false;
    row = rows_[at_++];
    return true;
  }

 private:
  std::vector<ErrorRow> rows_;
  std::size_t at_ = 0;
};

}  // namespace imuscope::test
