/// The golden drive through every instruction set that this processor has: the same numbers, far below their
/// sd.

#include <gtest/gtest.h>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <vector>

#include "calibration/covariance_loops.h"
#include "service/estimator_setup.h"
#include "service/recording.h"
#include "service/replay.h"
#include "tests/support/shared_data.h"

namespace imuscope::test {
namespace {

constexpr double kShareOfSd = 1e-6;

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

void expect_same(const Vector3& a, const Vector3& b, const Vector3& sd, const char* what, std::size_t k) {
  for (std::size_t i = 0; i < 3; ++i)
    EXPECT_NEAR(a[i], b[i], kShareOfSd * sd[i]) << what << " axis " << i << ", snapshot " << k;
}

void expect_same(const StudyOutput& a, const StudyOutput& b, std::size_t k) {
  ASSERT_EQ(a.status, b.status);
  if (a.status < StudyStatus::kConverging) return;
  expect_same(a.psi_rad, b.psi_rad, b.sd_psi_rad, "psi", k);
  expect_same(a.r_bs_b_m, b.r_bs_b_m, b.sd_r_bs_b_m, "r", k);
  expect_same(a.gyro_bias_radps, b.gyro_bias_radps, b.sd_gyro_bias_radps, "gyro bias", k);
  expect_same(a.accel_bias_mps2, b.accel_bias_mps2, b.sd_accel_bias_mps2, "accel bias", k);
  expect_same(a.gyro_scale, b.gyro_scale, b.sd_gyro_scale, "gyro scale", k);
  expect_same(a.accel_scale, b.accel_scale, b.sd_accel_scale, "accel scale", k);
  EXPECT_NEAR(a.t_d_s, b.t_d_s, kShareOfSd * b.sd_t_d_s) << "t_d, snapshot " << k;
}

void expect_same(const NavigationOutput& a, const NavigationOutput& b, std::size_t k) {
  ASSERT_EQ(a.status, b.status);
  if (a.status != NavigationStatus::kNavigating) return;
  expect_same(a.v_n_mps, b.v_n_mps, b.sd_velocity_mps, "velocity", k);
  expect_same(a.rpy_rad, b.rpy_rad, b.sd_rpy_rad, "attitude", k);
  EXPECT_NEAR(a.height_m, b.height_m, kShareOfSd * b.sd_position_m[2]) << "height, snapshot " << k;
}

TEST(InstructionSets, AgreeOnTheGoldenDriveToAMillionthOfTheSd) {
  const std::filesystem::path folder = testing::TempDir() + "imuscope_instruction_sets";
  std::filesystem::create_directories(folder);
  const auto capture = folder / "capture.lcm";
  const std::string unpack =
      "gzip -dc '" + source_path("tests/golden/capture.lcm.gz").string() + "' > '" + capture.string() + "'";
  ASSERT_EQ(std::system(unpack.c_str()), 0);
  const auto opened = open_recording({capture.string()}, {});
  ASSERT_TRUE(opened.has_value()) << opened.error().text();

  const auto baseline = snapshots_with(InstructionSet::kBaseline, *opened);
  ASSERT_GT(baseline.size(), 100U);
  ASSERT_GE(baseline.back().studies[0].status, StudyStatus::kConverging);
  std::size_t compared = 0;
  for (const InstructionSet set : {InstructionSet::kAvx2, InstructionSet::kAvx512}) {
    if (covariance_loops(set) == nullptr) continue;
    SCOPED_TRACE(covariance_loops(set)->name);
    const auto other = snapshots_with(set, *opened);
    ASSERT_EQ(other.size(), baseline.size());
    for (std::size_t k = 0; k < other.size(); ++k) {
      expect_same(other[k].navigation, baseline[k].navigation, k);
      for (std::size_t i = 0; i < other[k].n_studies; ++i)
        expect_same(other[k].studies[i], baseline[k].studies[i], k);
    }
    ++compared;
  }
  if (compared == 0) GTEST_SKIP() << "this processor has the baseline alone";
}

}  // namespace
}  // namespace imuscope::test
