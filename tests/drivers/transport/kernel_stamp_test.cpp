#include "drivers/transport/kernel_stamp.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace imuscope {
namespace {

using std::chrono::microseconds;
using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr std::int64_t kWallAtHostZero_ns = 1'772'000'000'000'000'000;

UtcTime wall_at(HostTime host, Duration offset = Duration{0}) {
  return utc_time_from_ns(kWallAtHostZero_ns + to_ns(host) + offset.count());
}

KernelStamps stamped(HostTime received, Duration offset = Duration{0}) {
  return {to_ns(wall_at(received, offset)), 0};
}

const HostTime kStart = host_time_from_ns(50'000'000'000);

TEST(KernelStamp, SoftwareStampsComeOnTheHostsTimeScale) {
  KernelStampMap map;
  for (int i = 0; i < 100; ++i) {
    const HostTime received = kStart + milliseconds(10 * i);
    const HostTime read = received + microseconds(700);
    map.begin_read(wall_at(read), read);
    EXPECT_EQ(map.map(stamped(received)), received);
  }
  EXPECT_EQ(map.clock_steps(), 0U);
  EXPECT_EQ(map.hardware_stamps(), 0U);
}

TEST(KernelStamp, FrameWithoutAStampHasTheTimeOfItsRead) {
  KernelStampMap map;
  map.begin_read(wall_at(kStart), kStart);
  EXPECT_EQ(map.map({}), kStart);
}

TEST(KernelStamp, StepOfTheWallClockCostsTheReadItsStampsAndNothingElse) {
  for (const Duration step :
       {Duration{seconds(3600)}, Duration{-seconds(3600)}, Duration{milliseconds(20)}}) {
    KernelStampMap map;
    map.begin_read(wall_at(kStart), kStart);
    (void)map.map(stamped(kStart));
    // The frame is stamped before the step and read after it.
    const HostTime received = kStart + milliseconds(10);
    const HostTime read = received + milliseconds(1);
    map.begin_read(wall_at(read, step), read);
    EXPECT_EQ(map.map(stamped(received)), read);
    EXPECT_EQ(map.clock_steps(), 1U);
    const HostTime next = read + milliseconds(10);
    map.begin_read(wall_at(next + milliseconds(1), step), next + milliseconds(1));
    EXPECT_EQ(map.map(stamped(next, step)), next);
    EXPECT_EQ(map.clock_steps(), 1U);
  }
}

TEST(KernelStamp, SlewByNtpIsNoStep) {
  KernelStampMap map;
  constexpr double kSlew = 500e-6;
  for (int i = 0; i < 1000; ++i) {
    const HostTime received = kStart + milliseconds(100 * i);
    const Duration offset{static_cast<std::int64_t>(kSlew * 1e8 * i)};
    const HostTime read = received + microseconds(500);
    map.begin_read(wall_at(read, offset), read);
    EXPECT_EQ(map.map(stamped(received, offset)), received);
  }
  EXPECT_EQ(map.clock_steps(), 0U);
}

TEST(KernelStamp, TimesNeverFallNorLieInTheFuture) {
  KernelStampMap map;
  std::mt19937 random(3);
  std::uniform_int_distribution<std::int64_t> wild(-2'000'000'000, 2'000'000'000);
  HostTime last = HostTime::min();
  for (int i = 0; i < 5000; ++i) {
    const HostTime read = kStart + milliseconds(i);
    map.begin_read(wall_at(read), read);
    KernelStamps stamps = stamped(read + Duration{wild(random)});
    if (i % 3 == 0) stamps.hardware_ns = to_ns(read) + wild(random);
    const HostTime time = map.map(stamps);
    EXPECT_LE(time, read);
    EXPECT_GE(time, last);
    last = time;
  }
}

TEST(KernelStamp, InterfacesOwnClockRemovesTheJitterOfTheKernels) {
  // A clock 40 ppm fast, from an origin of its own; software stamps late by an exponential 200 us.
  constexpr double kRate = 1.0 + 40e-6;
  KernelStampMap map;
  std::mt19937 random(7);
  std::exponential_distribution<double> late_s(1.0 / 200e-6);
  double worst_late_s = 0.0;
  double sum2 = 0.0;
  int n = 0;
  for (int i = 0; i < 12'000; ++i) {
    const HostTime received = kStart + milliseconds(10 * i);
    const HostTime heard = received + from_seconds(late_s(random));
    const HostTime read = heard + microseconds(300);
    map.begin_read(wall_at(read), read);
    KernelStamps stamps = stamped(heard);
    stamps.hardware_ns = 1'000'000 + static_cast<std::int64_t>(kRate * 1e7 * i);
    const double error_s = to_seconds(map.map(stamps) - received);
    if (i < 6000) continue;
    worst_late_s = std::max(worst_late_s, std::abs(error_s));
    sum2 += error_s * error_s;
    ++n;
  }
  EXPECT_EQ(map.hardware_stamps(), 12'000U);
  // The kernel's stamps alone are off by 200 us on average; the lowest of some hundred by a few.
  EXPECT_LT(std::sqrt(sum2 / n), 15e-6);
  EXPECT_LT(worst_late_s, 40e-6);
}

}  // namespace
}  // namespace imuscope
