#include "sample_axes.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <random>
#include <vector>

namespace imuscope::cli {
namespace {

constexpr std::size_t kTogether = 1000;

/// A sensor of 200 Hz whose clock drifts, some of whose samples, forces and temperatures are missing.
std::vector<Sample> made_samples(std::size_t n, std::mt19937_64& random) {
  std::uniform_real_distribution<double> uniform;
  std::vector<Sample> samples;
  double at_s = 100.0;
  double period_s = 0.005;
  for (std::size_t i = 0; i < n; ++i) {
    at_s += period_s;
    period_s *= 1.0 + 1e-7;
    if (uniform(random) < 0.01) continue;
    Sample sample;
    sample.kind = SampleKind::kImu;
    sample.time = HostTime{} + from_seconds(at_s);
    sample.imu.flags = kGyroValid;
    if (uniform(random) > 0.02) sample.imu.flags |= kAccelValid;
    if (i > 1500 && i % 100 == 0) sample.imu.flags |= kHasTemperature;
    for (std::size_t k = 0; k < 3; ++k) {
      sample.imu.omega_radps[k] = uniform(random);
      sample.imu.f_mps2[k] = uniform(random);
    }
    sample.imu.temperature_degC = static_cast<float>(i);
    samples.push_back(sample);
  }
  return samples;
}

Result<SampleAxes> axes_of(const std::vector<Sample>& samples, AxesSink sink,
                           std::optional<double> rate_hz = {}) {
  for (const Sample& sample : samples) sink.on_sample(sample);
  return std::move(sink).axes(rate_hz);
}

Result<SampleAxes> axes_on_disk(const std::vector<Sample>& samples, std::optional<double> rate_hz = {}) {
  return axes_of(samples, AxesSink(AxesSink::Keeps::kLongOnesOnDisk, kTogether), rate_hz);
}

// Of lengths at and about the ends of windows; what a drift of the clock makes of a long record's end is not in
// this one: 0.1 % over the whole of it.
TEST(AxesSink, OnTheDiskSaysWhatInMemoryIsSaid) {
  for (const std::size_t n : {1001UL, 1002UL, 2000UL, 2001UL, 2020UL, 3000UL, 7999UL, 10'000UL}) {
    std::mt19937_64 random(n);
    const auto samples = made_samples(n, random);
    const auto in_memory = axes_of(samples, AxesSink());
    const auto on_disk = axes_on_disk(samples);
    ASSERT_TRUE(in_memory) << in_memory.error().text();
    ASSERT_TRUE(on_disk) << on_disk.error().text();
    // Short ones are in memory either way.
    const bool is_on_disk = static_cast<bool>(on_disk->fetches[0]);
    ASSERT_EQ(in_memory->temperature_c != nullptr, is_on_disk
                                                       ? static_cast<bool>(on_disk->read_with_temperature[0])
                                                       : on_disk->temperature_c != nullptr);
    for (std::size_t axis = 0; axis < kMessageAxes.size(); ++axis) {
      const Signal& signal = in_memory->axes[axis];
      if (!on_disk->fetches[axis]) continue;  // short enough
      const auto fetched = on_disk->fetches[axis]();
      ASSERT_TRUE(fetched);
      ASSERT_EQ(fetched->size(), signal.values.size()) << n;
      EXPECT_GE(fetched->capacity(), fetched->size() + 1);
      for (std::size_t i = 0; i < fetched->size(); ++i) {
        ASSERT_EQ(std::isnan((*fetched)[i]), signal.mask[i] == 0) << n << " " << i;
        if (signal.mask[i] != 0) {
          ASSERT_EQ((*fetched)[i], signal.values[i]);
        }
      }
    }
    if (!on_disk->read_with_temperature[0]) continue;
    for (std::size_t axis = 0; axis < kMessageAxes.size(); ++axis) {
      const Signal& signal = in_memory->axes[axis];
      std::size_t i = 0;
      const auto done =
          on_disk->read_with_temperature[axis]([&](const certificate::PieceWithTemperature& piece) {
            ASSERT_EQ(piece.temperature_c.size(), piece.x.size());
            for (std::size_t k = 0; k < piece.x.size(); ++k, ++i) {
              ASSERT_LT(i, signal.values.size());
              const float a = piece.temperature_c[k];
              const float b = (*in_memory->temperature_c)[i];
              ASSERT_TRUE(a == b || (std::isnan(a) && std::isnan(b))) << i;
              ASSERT_EQ(std::isnan(piece.x[k]), signal.mask[i] == 0) << i;
              if (signal.mask[i] != 0) {
                ASSERT_EQ(piece.x[k], signal.values[i]) << i;
              }
            }
          });
      ASSERT_TRUE(done);
      EXPECT_EQ(i, signal.values.size());
    }
  }
}

TEST(AxesSink, HoldsAsManySamplesAsTheTimesOfALongRecordHaveRoomFor) {
  std::mt19937_64 random(3);
  constexpr std::size_t kSamples = 50'000;
  const auto on_disk = axes_on_disk(made_samples(kSamples, random));
  ASSERT_TRUE(on_disk) << on_disk.error().text();
  ASSERT_TRUE(on_disk->fetches[0]);
  // The clock has drifted by 0.5 % in the end. The first and the last one may be among those that are missing.
  EXPECT_NEAR(static_cast<double>(on_disk->fetches[0]()->size()), static_cast<double>(kSamples), 5.0);
  EXPECT_TRUE(on_disk->is_sent[5]);
}

TEST(AxesSink, ATimeThatGoesBackIsToldWithItsRowWhereverItIs) {
  std::mt19937_64 random(3);
  auto samples = made_samples(9000, random);
  samples[7000].time = samples[6000].time;
  const auto on_disk = axes_on_disk(samples);
  ASSERT_FALSE(on_disk);
  EXPECT_NE(on_disk.error().text().find("at row 7001"), std::string::npos) << on_disk.error().text();
}

TEST(AxesSink, AChangeOfTheRateIsToldAsOne) {
  std::mt19937_64 random(3);
  auto samples = made_samples(9000, random);
  for (std::size_t i = 5000; i < samples.size(); ++i)
    samples[i].time = samples[5000].time + 2 * (samples[i].time - samples[5000].time);
  const auto on_disk = axes_on_disk(samples);
  ASSERT_FALSE(on_disk);
  EXPECT_NE(on_disk.error().text().find("the rate changes from 199.9"), std::string::npos)
      << on_disk.error().text();
}

TEST(AxesSink, ADiskThatTakesNothingIsAnErrorWithARemedy) {
  std::mt19937_64 random(3);
  const auto samples = made_samples(3000, random);
  setenv("TMPDIR", "/proc", 1);
  const auto on_disk = axes_on_disk(samples);
  unsetenv("TMPDIR");
  ASSERT_FALSE(on_disk);
  EXPECT_NE(on_disk.error().text().find("TMPDIR"), std::string::npos) << on_disk.error().text();
}

TEST(AxesSink, ARateThatContradictsTheTimesIsRefused) {
  std::mt19937_64 random(3);
  EXPECT_FALSE(axes_on_disk(made_samples(3000, random), 100.0));
  EXPECT_TRUE(axes_on_disk(made_samples(3000, random), 200.0));
}

}  // namespace
}  // namespace imuscope::cli
