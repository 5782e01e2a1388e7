#include "estimation/calibration/fixed_lag.h"

#include <gtest/gtest.h>
#include <optional>

#include "tests/estimation/calibration/simulated_drive.h"

namespace imuscope {
namespace {

using test::SimulatedDrive;
using test::SimulatedStudy;

/// Smooths as the history comes, and notes how old every epoch was when it was given.
class LiveSink final : public HistorySink {
 public:
  struct Given {
    SmoothedEpoch epoch;
    std::size_t seen = 0;  ///< epochs of the history by then
    Duration age{};
  };

  void on_history(const HistoryEpoch& epoch) noexcept override {
    const FilterCore& core = epoch.core;
    const std::size_t states = core.covariance().dimension();
    if (!smoother_) {
      smoother_.emplace(std::vector<SImuLayout>{core.layout(0)}, states);
      record_.resize(history::history_doubles(states, 1));
    }
    history::pack(epoch, record_);
    ++seen;
    filtered.push_back(core.navigation());
    smoother_->add(record_, [&](const SmoothedEpoch& smoothed) {
      given.push_back({smoothed, seen, epoch.time - smoothed.time});
    });
  }

  std::size_t seen = 0;
  std::vector<Given> given;
  std::vector<NavigationState> filtered;

 private:
  std::optional<FixedLagSmoother> smoother_;
  std::vector<double> record_;
};

/// A smoother of a whole run that ended after `last` epochs.
class Until final : public HistorySink {
 public:
  explicit Until(std::size_t last) : last_(last) {}
  void on_history(const HistoryEpoch& epoch) noexcept override {
    if (smoother.size() < last_) smoother.on_history(epoch);
  }
  Smoother smoother{{std::size_t{1} << 30U, testing::TempDir()}};

 private:
  std::size_t last_;
};

void run(HistorySink& sink) {
  SimulatedDrive drive(85.0, {SimulatedStudy{}}, 8);
  EstimatorConfig config = drive.config();
  config.studies[0].prior_C_b_s = Matrix3{1, 0, 0, 0, 1, 0, 0, 0, 1};
  config.studies[0].prior_t_d_s = 0.004;
  Estimator estimator(config, &sink);
  test::run(drive, estimator);
}

TEST(FixedLagSmoother, GivesEveryEpochOnceFiveToTenSecondsLateAsSmoothingUpToThenWouldHave) {
  LiveSink live;
  run(live);
  ASSERT_GT(live.given.size(), 300U);
  for (std::size_t k = 0; k < live.given.size(); ++k) {
    EXPECT_GE(live.given[k].age, FixedLagSmoother::kLag);
    EXPECT_LE(live.given[k].age,
              FixedLagSmoother::kLag + FixedLagSmoother::kEvery + std::chrono::milliseconds{400});
    if (k > 0) {
      EXPECT_GT(live.given[k].epoch.time, live.given[k - 1].epoch.time);
      EXPECT_LT(live.given[k].epoch.time - live.given[k - 1].epoch.time, std::chrono::milliseconds{250});
    }
  }
  // The oracle: a run that had ended when the last of them was given, smoothed as a whole.
  Until ended(live.given.back().seen);
  run(ended);
  const auto track = ended.smoother.smooth();
  ASSERT_TRUE(track);
  int compared = 0;
  for (std::size_t k = 0; k < track->size(); ++k) {
    const auto whole = track->at(k);
    ASSERT_TRUE(whole);
    for (const auto& given : live.given) {
      if (given.seen != live.given.back().seen || given.epoch.time != whole->time) continue;
      EXPECT_EQ((given.epoch.navigation.v_n_mps - whole->navigation.v_n_mps).norm(), 0.0);
      EXPECT_EQ((given.epoch.studies[0].accel_bias_s_mps2 - whole->studies[0].accel_bias_s_mps2).norm(), 0.0);
      EXPECT_EQ((given.epoch.sd - whole->sd).norm(), 0.0);
      ++compared;
    }
  }
  EXPECT_GE(compared, 5);
}

TEST(FixedLagSmoother, ImprovesOnTheVelocityOfTheFilter) {
  LiveSink live;
  run(live);
  SimulatedDrive drive(85.0, {SimulatedStudy{}}, 8);
  double filtered = 0.0;
  double smoothed = 0.0;
  for (std::size_t k = 25; k < live.given.size(); ++k) {
    const auto& epoch = live.given[k].epoch;
    const double t_s = static_cast<double>(to_ns(epoch.time)) * 1e-9 - 10.0;
    const Eigen::Vector3d v = drive.motion().state_at(t_s).v_n_mps;
    smoothed += (epoch.navigation.v_n_mps - v).squaredNorm();
    filtered += (live.filtered[k].v_n_mps - v).squaredNorm();
  }
  EXPECT_LT(smoothed, 0.7 * filtered);
}

}  // namespace
}  // namespace imuscope
