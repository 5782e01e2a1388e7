/// The golden drive through every instruction set that this processor has: the same numbers, far below their
/// sd.

#include <gtest/gtest.h>
#include <algorithm>
#include <cstdlib>
#include <iostream>
#include <vector>

#include "estimation/calibration/covariance_loops.h"
#include "service/pipeline/estimator_setup.h"
#include "service/recording/recording.h"
#include "service/recording/replay.h"
#include "tests/support/output_difference.h"
#include "tests/support/shared_data.h"

namespace imuscope::test {
namespace {

class Snapshots final : public CoreSink {
 public:
  void on_error(const ErrorRecord&) noexcept override {}
  void on_event(const EstimatorEvent&) noexcept override {}
  void on_snapshot(const Snapshot& snapshot) noexcept override { all.push_back(snapshot); }
  void on_late_sample(const LateSample&) noexcept override {}
  std::vector<Snapshot> all;
};

std::vector<Snapshot> snapshots_with(InstructionSet set, const OpenedRecording& opened) {
  EstimatorConfig config = estimator_config(opened.configuration);
  config.instruction_set = set;
  Snapshots sink;
  const auto replayed = replay(opened.configuration, config, opened.recording, sink);
  EXPECT_TRUE(replayed.has_value());
  return std::move(sink.all);
}

TEST(InstructionSets, AgreeOnTheGoldenDriveToAMillionthOfTheSd) {
  const auto folder = scratch_folder();
  const auto capture = folder / "capture.lcm";
  const std::string unpack =
      "gzip -dc '" + source_path("tests/golden/capture.lcm.gz").string() + "' > '" + capture.string() + "'";
  ASSERT_EQ(std::system(unpack.c_str()), 0);
  const auto opened = open_recording({capture.string()}, {});
  ASSERT_TRUE(opened.has_value()) << opened.error().text();

  const auto baseline = snapshots_with(InstructionSet::kBaseline, *opened);
  ASSERT_GT(baseline.size(), 100U);
  ASSERT_GE(baseline.back().studies[0].status, CalibrationStatus::kConverging);
  std::size_t compared = 0;
  for (const InstructionSet set : {InstructionSet::kAvx2, InstructionSet::kAvx512}) {
    if (covariance_loops(set) == nullptr) continue;
    SCOPED_TRACE(covariance_loops(set)->name);
    const auto other = snapshots_with(set, *opened);
    ASSERT_EQ(other.size(), baseline.size());
    double worst = 0.0;
    for (std::size_t k = 0; k < other.size(); ++k) {
      worst = std::max(worst, difference(other[k].navigation, baseline[k].navigation));
      for (std::size_t i = 0; i < other[k].n_studies; ++i)
        worst = std::max(worst, difference(other[k].studies[i], baseline[k].studies[i]));
    }
    EXPECT_LE(worst, kShareOfSd);
    std::cout << covariance_loops(set)->name << ": at most " << worst << " of the sd from the baseline\n";
    ++compared;
  }
  if (compared == 0) GTEST_SKIP() << "this processor has the baseline alone";
}

}  // namespace
}  // namespace imuscope::test
