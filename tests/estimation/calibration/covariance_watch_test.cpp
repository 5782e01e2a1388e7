#include "estimation/calibration/covariance_kernel.h"

#include <gtest/gtest.h>
#include <cmath>
#include <limits>

#include "estimation/calibration/state_name.h"

namespace imuscope {
namespace {

constexpr std::size_t kWatchedStates = 34;

CovarianceKernel diagonal(std::optional<InstructionSet> set = {}) {
  CovarianceKernel P(kWatchedStates, set);
  for (std::size_t i = 0; i < kWatchedStates; ++i) P.set(i, i, std::pow(10.0, -static_cast<double>(i % 7)));
  return P;
}

/// By the loops of every instruction set that this processor has.
class CovarianceWatch : public testing::TestWithParam<InstructionSet> {
 protected:
  void SetUp() override {
    if (covariance_loops(GetParam()) == nullptr) GTEST_SKIP() << "this processor has no such instructions";
  }
};

TEST_P(CovarianceWatch, FindsNothingInACovarianceWhateverItsScales) {
  CovarianceKernel P = diagonal(GetParam());
  P.set(3, 20, 0.999 * std::sqrt(P(3, 3) * P(20, 20)));
  P.reset_state(5, 0.0);
  EXPECT_EQ(P.first_bad_state(), std::nullopt);
}

TEST_P(CovarianceWatch, NamesTheStateThatIsACombinationOfOthers) {
  CovarianceKernel P = diagonal(GetParam());
  // 21 = 3 + 20, each scaled: one variance too little.
  P.set(3, 21, std::sqrt(0.5 * P(3, 3) * P(21, 21)));
  P.set(20, 21, std::sqrt(0.5 * P(20, 20) * P(21, 21)));
  EXPECT_EQ(P.first_bad_state(), 21U);
}

TEST_P(CovarianceWatch, NamesNegativeVariancesAndNumbersThatAreNone) {
  CovarianceKernel P = diagonal(GetParam());
  P.set(9, 9, -1e-12);
  EXPECT_EQ(P.first_bad_state(), 9U);
  P = diagonal(GetParam());
  P.set(4, 11, std::numeric_limits<double>::quiet_NaN());
  EXPECT_EQ(P.first_bad_state(), 11U);
}

INSTANTIATE_TEST_SUITE_P(EveryInstructionSet, CovarianceWatch,
                         testing::Values(InstructionSet::kBaseline, InstructionSet::kAvx2,
                                         InstructionSet::kAvx512));

TEST(CovarianceKernel, RefusesACorrectionThatIsNotFinite) {
  CovarianceKernel P = diagonal();
  P.set(4, 20, std::numeric_limits<double>::quiet_NaN());
  SparseMeasurement H;
  H.append(15, 3).h = {{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};
  H.append(20, 1).h = {{{1, 0, 0}, {0, 0, 0}, {0, 0, 0}}};
  P.project(H, {1, 0, 0, 0, 1, 0, 0, 0, 1});
  const double before = P(15, 15);
  EXPECT_FALSE(P.update({1, 1, 1}, {true, true, true}));
  EXPECT_EQ(P(15, 15), before);
}

TEST(StateName, FollowsTheOrderOfTheErrorState) {
  EstimatorConfig config;
  config.studies.resize(2);
  config.studies[0].blocks = kPaperSImuBlocks;
  EXPECT_EQ(state_name(config, 4).name, "velocity_e");
  EXPECT_FALSE(state_name(config, 4).study.has_value());
  EXPECT_EQ(state_name(config, 15 + 4).name, "r_y");
  EXPECT_EQ(state_name(config, 15 + 4).study, 0U);
  EXPECT_EQ(state_name(config, 21 + 12).name, "t_d");
  EXPECT_EQ(state_name(config, 21 + 12).study, 1U);
  EXPECT_EQ(state_name(config, 21 + 18).name, "accel_scale_z");
  EXPECT_EQ(state_name(config, 21 + 19).name, "state 40");
  config.odometry.enabled = config.gnss.enabled = true;
  EXPECT_EQ(state_name(config, 40).name, "wheel_scale");
  EXPECT_EQ(state_name(config, 40 + 6).name, "antenna_lever_arm_x");
  EXPECT_EQ(state_name(config, 40 + 9).name, "receiver_latency");
  EXPECT_EQ(state_name(config, 40 + 10).name, "state 50");
}

}  // namespace
}  // namespace imuscope
