#pragma once

/// Samples as a decoder gives them, one behind the other. Non-real-time: allocates.

#include <vector>

#include "sample/sample.h"

namespace imuscope {

class SampleCollector final : public SampleSink {
 public:
  explicit SampleCollector(std::vector<Sample>& samples) : samples_(samples) {}
  void on_sample(const Sample& sample) noexcept override { samples_.push_back(sample); }

 private:
  std::vector<Sample>& samples_;
};

}  // namespace imuscope
