/// The batch estimate that begins while the pass over a recording goes on: when it may, and that it makes no difference.

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include "study/batch_study.h"
#include "tests/estimation/batch/synthetic_pair.h"
#include "tests/support/two_devices.h"

namespace imuscope {
namespace {

constexpr double kLongest_s = 150.0;
/// The pass keeps the reference this much longer than the S-IMU is used.
constexpr double kMargin_s = 60.0;

Configuration two_devices() { return *parse_configuration(test::kTwoDevices, "test.toml"); }

Sample sample_of(const batch::ImuRecord& record, std::size_t i, DeviceIndex device) {
  Sample sample{};
  sample.kind = SampleKind::kImu;
  sample.device = device;
  sample.time = host_time_from_ns(0) + from_seconds(record.time_s[i]);
  sample.imu.flags = kGyroValid | kAccelValid;
  for (std::size_t k = 0; k < 3; ++k) {
    sample.imu.omega_radps[k] = record.omega_radps[i][static_cast<Eigen::Index>(k)];
    sample.imu.f_mps2[k] = record.f_mps2[i][static_cast<Eigen::Index>(k)];
  }
  return sample;
}

void add_until(const batch::ImuRecord& record, DeviceIndex device, double until_s,
               BatchEstimates& estimates) {
  for (std::size_t i = 0; i < record.size() && record.time_s[i] < until_s; ++i)
    estimates.add(sample_of(record, i, device));
}

synthetic::Pair long_pair() {
  synthetic::PairOptions options;
  options.duration_s = kLongest_s + 2.0 * kMargin_s;
  return make_pair(options, 7);
}

/// What the S-IMU's mounting is after so much of the reference and of the S-IMU.
batch::BatchMounting mounting_after(const synthetic::Pair& pair, double reference_until_s,
                                    double study_until_s, bool is_to_begin) {
  const Configuration configuration = two_devices();
  BatchEstimates estimates(configuration, {}, kLongest_s);
  add_until(pair.reference, 0, reference_until_s, estimates);
  EXPECT_FALSE(estimates.has_begun(0));
  add_until(pair.study, 1, study_until_s, estimates);
  EXPECT_EQ(estimates.has_begun(0), is_to_begin);
  const auto outcomes = estimates.outcomes(FormerMountings(1));
  EXPECT_TRUE(outcomes[0].mounting) << outcomes[0].why_not.text();
  return outcomes[0].mounting.value_or(batch::BatchMounting{});
}

void expect_same(const batch::BatchMounting& a, const batch::BatchMounting& b) {
  EXPECT_EQ(a.sensor.C_b_s, b.sensor.C_b_s);
  EXPECT_EQ(a.sensor.x, b.sensor.x);
  EXPECT_EQ(a.covariance, b.covariance);
  EXPECT_EQ(a.windows, b.windows);
}

TEST(BatchEstimates, BeginBesideThePassOnceNothingOfTheirHourIsToCome) {
  const auto pair = long_pair();
  const double end_s = kLongest_s + 2.0 * kMargin_s;
  // Its last sample of the margin may still be to come; the one after it says that it is not.
  const double kept_s = kLongest_s + kMargin_s - 0.005;
  const auto late = mounting_after(pair, kept_s, kept_s, false);
  expect_same(late, mounting_after(pair, end_s, kept_s, false));
  expect_same(late, mounting_after(pair, kept_s, end_s, false));
  expect_same(late, mounting_after(pair, end_s, end_s, true));
}

TEST(BatchEstimates, AreTheSameByOneThread) {
  const auto pair = long_pair();
  const double end_s = kLongest_s + 2.0 * kMargin_s;
  const auto by_all = mounting_after(pair, end_s, end_s, true);
  const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
  expect_same(by_all, mounting_after(pair, end_s, end_s, true));
}

TEST(BatchEstimates, SayAheadWhatComesOut) {
  const auto pair = long_pair();
  const Configuration configuration = two_devices();
  std::vector<std::vector<BatchOutcome>> foreseen;
  BatchEstimates estimates(
      configuration, [&](const std::vector<BatchOutcome>& outcomes) { foreseen.push_back(outcomes); },
      kLongest_s);
  add_until(pair.reference, 0, 1e9, estimates);
  add_until(pair.study, 1, 1e9, estimates);
  const auto outcomes = estimates.outcomes(FormerMountings(1));
  ASSERT_EQ(foreseen.size(), 1U);
  ASSERT_EQ(foreseen[0].size(), 1U);
  ASSERT_TRUE(foreseen[0][0].mounting && outcomes[0].mounting);
  expect_same(*foreseen[0][0].mounting, *outcomes[0].mounting);
}

TEST(BatchEstimates, SayNothingAheadOfASensorThatFoundNone) {
  auto pair = long_pair();
  // Of another vehicle.
  pair.study = synthetic::make_pair({.duration_s = kLongest_s + 2.0 * kMargin_s}, 8).study;
  const Configuration configuration = two_devices();
  int foreseen = 0;
  BatchEstimates estimates(
      configuration, [&](const std::vector<BatchOutcome>&) { ++foreseen; }, kLongest_s);
  add_until(pair.reference, 0, 1e9, estimates);
  add_until(pair.study, 1, 1e9, estimates);
  EXPECT_TRUE(estimates.has_begun(0));
  EXPECT_FALSE(estimates.outcomes(FormerMountings(1))[0].mounting);
  EXPECT_EQ(foreseen, 0);
}

TEST(BatchEstimates, EndWithThePassThatFailed) {
  const auto pair = long_pair();
  const Configuration configuration = two_devices();
  BatchEstimates estimates(configuration, {}, kLongest_s);
  add_until(pair.reference, 0, 1e9, estimates);
  add_until(pair.study, 1, 1e9, estimates);
  EXPECT_TRUE(estimates.has_begun(0));
}

}  // namespace
}  // namespace imuscope
