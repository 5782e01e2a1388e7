/// The batch estimate that begins while the pass over a recording goes on: what it reads, and that it makes no difference.

#include <gtest/gtest.h>
#include <tbb/global_control.h>
#include <array>

#include "study/batch_study.h"
#include "tests/estimation/batch/synthetic_pair.h"
#include "tests/support/two_devices.h"

namespace imuscope {
namespace {

constexpr double kLongest_s = 150.0;
/// The reference is kept this much longer than the S-IMU is used.
constexpr double kMargin_s = 60.0;
constexpr double kEnd_s = kLongest_s + 2.0 * kMargin_s;

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

synthetic::Pair long_pair() {
  synthetic::PairOptions options;
  options.duration_s = kEnd_s;
  return make_pair(options, 7);
}

/// Samples before an instant, of one device after the other.
BatchEstimates::Read read_of(const synthetic::Pair& pair, double until_s = kEnd_s) {
  return [&pair, until_s](const BatchEstimates::Take& take) -> Result<void> {
    for (DeviceIndex device = 0; device < 2; ++device) {
      const auto& record = device == 0 ? pair.reference : pair.study;
      for (std::size_t i = 0; i < record.size() && record.time_s[i] < until_s; ++i)
        if (!take(sample_of(record, i, device))) break;
    }
    return {};
  };
}

batch::BatchMounting mounting_of(const synthetic::Pair& pair, double until_s) {
  const Configuration configuration = two_devices();
  BatchEstimates estimates(configuration, read_of(pair, until_s), {}, kLongest_s);
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

TEST(BatchEstimates, WantNoMoreThanTheFirstHourAndItsMargin) {
  const auto pair = long_pair();
  const Configuration configuration = two_devices();
  std::size_t wanted[2] = {};
  const auto read = [&](const BatchEstimates::Take& take) {
    return read_of(pair)([&](const Sample& sample) {
      const bool wants_more = take(sample);
      if (wants_more) ++wanted[sample.device];
      return wants_more;
    });
  };
  BatchEstimates estimates(configuration, read, {}, kLongest_s);
  ASSERT_TRUE(estimates.outcomes(FormerMountings(1))[0].mounting);
  const auto expected = [](const batch::ImuRecord& record) {
    std::size_t n = 0;
    for (const double time_s : record.time_s)
      if (time_s <= record.time_s.front() + kLongest_s + kMargin_s + 1e-9) ++n;
    return n;
  };
  EXPECT_EQ(wanted[0], expected(pair.reference));
  EXPECT_EQ(wanted[1], expected(pair.study));
  EXPECT_LT(wanted[0], pair.reference.size());
}

TEST(BatchEstimates, AreOfTheFirstHour) {
  const auto pair = long_pair();
  expect_same(mounting_of(pair, kEnd_s), mounting_of(pair, kLongest_s + kMargin_s));
}

TEST(BatchEstimates, AreTheSameByOneThread) {
  const auto pair = long_pair();
  const auto by_all = mounting_of(pair, kEnd_s);
  const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
  expect_same(by_all, mounting_of(pair, kEnd_s));
}

TEST(BatchEstimates, SayAheadWhatComesOut) {
  const auto pair = long_pair();
  const Configuration configuration = two_devices();
  std::vector<std::vector<BatchOutcome>> foreseen;
  BatchEstimates estimates(
      configuration, read_of(pair),
      [&](const std::vector<BatchOutcome>& outcomes) { foreseen.push_back(outcomes); }, kLongest_s);
  const auto outcomes = estimates.outcomes(FormerMountings(1));
  ASSERT_EQ(foreseen.size(), 1U);
  ASSERT_EQ(foreseen[0].size(), 1U);
  ASSERT_TRUE(foreseen[0][0].mounting && outcomes[0].mounting);
  expect_same(*foreseen[0][0].mounting, *outcomes[0].mounting);
}

TEST(BatchEstimates, SayNothingAheadOfASensorThatFoundNone) {
  auto pair = long_pair();
  // Of another vehicle.
  pair.study = synthetic::make_pair({.duration_s = kEnd_s}, 8).study;
  const Configuration configuration = two_devices();
  int foreseen = 0;
  BatchEstimates estimates(
      configuration, read_of(pair), [&](const std::vector<BatchOutcome>&) { ++foreseen; }, kLongest_s);
  EXPECT_FALSE(estimates.outcomes(FormerMountings(1))[0].mounting);
  EXPECT_EQ(foreseen, 0);
}

TEST(BatchEstimates, SayWhyNothingCouldBeRead) {
  const Configuration configuration = two_devices();
  BatchEstimates estimates(configuration, [](const BatchEstimates::Take&) -> Result<void> {
    return tl::unexpected<Error>(Error{ErrorKind::kWork, "the disk is gone", "look"});
  });
  const auto outcomes = estimates.outcomes(FormerMountings(1));
  EXPECT_FALSE(outcomes[0].mounting);
  EXPECT_EQ(outcomes[0].why_not.what, "the disk is gone");
}

TEST(BatchEstimates, EndWithThePassThatFailed) {
  const auto pair = long_pair();
  const Configuration configuration = two_devices();
  const BatchEstimates estimates(configuration, read_of(pair), {}, kLongest_s);
}

/// What lies behind the first hour is gathered by another than the first hour, from its own beginning on.
TEST(BatchRecords, AreWholeWhoeverGathersThem) {
  auto pair = long_pair();
  const Configuration configuration = two_devices();
  constexpr double kShort_s = 20.0;
  constexpr std::array<DeviceIndex, 2> kDevices{0, 1};
  constexpr std::array<DeviceIndex, 2> kBackwards{1, 0};
  BatchRecords records(configuration, kShort_s);
  const auto all = [&](DeviceIndex device, const auto& give) {
    const auto& record = device == 0 ? pair.reference : pair.study;
    for (std::size_t i = 0; i < record.size(); ++i) {
      Sample sample = sample_of(record, i, device);
      // What comes twice, or late, does not count with either.
      give(sample);
      give(sample);
      sample.time -= std::chrono::milliseconds{15};
      give(sample);
    }
  };
  for (const DeviceIndex device : kBackwards) all(device, [&](const Sample& s) { records.add_to_later(s); });
  for (const DeviceIndex device : kDevices) all(device, [&](const Sample& s) { records.add_to_first(s); });
  for (const DeviceIndex device : kDevices) {
    const auto& record = device == 0 ? pair.reference : pair.study;
    EXPECT_TRUE(records.is_first_whole(device));
    const auto part = records.part(device, -1e9, 1e9);
    const double kept_from_s = records.kept_to_end_from_s(device);
    ASSERT_GT(part.size(), 1000U);
    // The beginning without a gap, the end without a gap.
    std::size_t i = 0;
    for (; i < part.size() && part.time_s[i] < kShort_s + kMargin_s; ++i) {
      EXPECT_NEAR(part.time_s[i], record.time_s[i] - pair.reference.time_s[0], 1e-8);
      EXPECT_EQ(part.omega_radps[i], record.omega_radps[i]);
    }
    EXPECT_NEAR(records.first_s(device), record.time_s[0] - pair.reference.time_s[0], 1e-8);
    const auto end = records.part(device, kept_from_s, 1e9);
    ASSERT_GE(end.time_s.back() - end.time_s.front(), kShort_s);
    for (std::size_t k = 1; k <= end.size(); ++k)
      EXPECT_EQ(end.f_mps2[end.size() - k], record.f_mps2[record.size() - k]);
  }
}

}  // namespace
}  // namespace imuscope
