/// The golden drive through the estimator without any optimisation and with all of it: the same numbers as
/// the build that is deployed gives, far below their sd.

#include <gtest/gtest.h>
#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <iostream>
#include <utility>
#include <vector>

#include "estimator_run.h"
#include "service/pipeline/estimator_setup.h"
#include "service/recording/recording.h"
#include "service/recording/replay.h"
#include "tests/support/output_difference.h"
#include "tests/support/shared_data.h"

namespace imuscope::test {
namespace {

struct Outputs {
  NavigationOutput navigation;
  std::vector<SImuOutput> studies;
};

void keep(void* context, const NavigationOutput& navigation, const SImuOutput* studies, std::size_t n) {
  static_cast<std::vector<Outputs>*>(context)->push_back({navigation, {studies, studies + n}});
}

std::vector<Outputs> run(EstimatorRun* build, const EstimatorConfig& config,
                         const std::vector<Sample>& samples) {
  std::vector<Outputs> outputs;
  build(config, samples, keep, &outputs);
  return outputs;
}

class NoResults final : public CoreSink {
 public:
  void on_error(const ErrorRecord&) noexcept override {}
  void on_event(const EstimatorEvent&) noexcept override {}
  void on_snapshot(const Snapshot&) noexcept override {}
  void on_late_sample(const LateSample&) noexcept override {}
};

TEST(Numerics, UnoptimisedAndOptimisedBuildsAgreeOnTheGoldenDriveToAMillionthOfTheSd) {
  const auto folder = scratch_folder();
  const auto capture = folder / "capture.lcm";
  const std::string unpack =
      "gzip -dc '" + source_path("tests/golden/capture.lcm.gz").string() + "' > '" + capture.string() + "'";
  ASSERT_EQ(std::system(unpack.c_str()), 0);
  const auto opened = open_recording({capture.string()}, {});
  ASSERT_TRUE(opened.has_value()) << opened.error().text();
  EstimatorConfig config = estimator_config(opened->configuration);
  config.instruction_set = InstructionSet::kBaseline;
  std::vector<Sample> samples;
  ReplayOptions options;
  options.on_sample = [&](const Sample& sample) { samples.push_back(sample); };
  NoResults nowhere;
  ASSERT_TRUE(replay(opened->configuration, config, opened->recording, nowhere, options).has_value());
  std::stable_sort(samples.begin(), samples.end(),
                   [](const Sample& a, const Sample& b) { return a.arrival < b.arrival; });

  const auto deployed = run(estimator_run_release, config, samples);
  ASSERT_GT(deployed.size(), 100U);
  ASSERT_GE(deployed.back().studies.at(0).status, CalibrationStatus::kConverging);
  for (const auto& [name, build] : {std::pair{"O0", &estimator_run_O0}, std::pair{"O3", &estimator_run_O3}}) {
    const auto other = run(build, config, samples);
    ASSERT_EQ(other.size(), deployed.size()) << name;
    double worst = 0.0;
    for (std::size_t k = 0; k < other.size(); ++k) {
      worst = std::max(worst, difference(other[k].navigation, deployed[k].navigation));
      for (std::size_t i = 0; i < other[k].studies.size(); ++i)
        worst = std::max(worst, difference(other[k].studies[i], deployed[k].studies[i]));
    }
    EXPECT_LE(worst, kShareOfSd) << name;
    std::cout << "-" << name << ": at most " << worst << " of the sd from the deployed build\n";
  }
}

}  // namespace
}  // namespace imuscope::test
