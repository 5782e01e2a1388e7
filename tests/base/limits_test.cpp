#include "base/limits.h"

#include <gtest/gtest.h>

namespace imuscope {
namespace {

TEST(Limits, ARingHasRoomForAllThatComesInAStallAndIsAPowerOfTwo) {
  EXPECT_EQ(ring_capacity(100.0, 10.0), 1024U);
  EXPECT_EQ(ring_capacity(128.0, 1.0), 128U) << "what fits exactly is not doubled";
  EXPECT_EQ(ring_capacity(128.5, 1.0), 256U) << "a part of an element needs a place";
}

TEST(Limits, TheRingOfADeviceHoldsTheLongestStallAtItsRate) {
  for (const double rate_hz : {10.0, 100.0, 400.0}) {
    const double came = kSamplesPerMessage * rate_hz * kLongestStall_s;
    EXPECT_GE(static_cast<double>(sample_ring_capacity(rate_hz)),
              std::min(came, static_cast<double>(kSampleRingMax)));
  }
  EXPECT_GE(static_cast<double>(sample_ring_capacity(kLongestStallRate_hz)),
            kLongestStallRate_hz * kLongestStall_s);
  EXPECT_EQ(sample_ring_capacity(kMaxRate_hz), kSampleRingMax) << "memory is locked: it has an end";
}

TEST(Limits, ALineMayStandStillAlone) {
  EXPECT_GE(static_cast<double>(waiting_samples_capacity(100.0)), 100.0 * kLongestStall_s);
  EXPECT_GE(static_cast<double>(reference_window_capacity(100.0)), 100.0 * kLongestStall_s);
  EXPECT_GE(static_cast<double>(waiting_samples_capacity(kMaxRate_hz)), kMaxRate_hz * 30.0);
}

TEST(Limits, ThePastOfTheReferenceLastsAsLongAtEveryRate) {
  EXPECT_EQ(reference_past_capacity(100.0), 256U);
  EXPECT_EQ(reference_past_capacity(10.0), 256U);
  for (const double rate_hz : {200.0, 400.0, kMaxRate_hz})
    EXPECT_GE(static_cast<double>(reference_past_capacity(rate_hz)), rate_hz * kReferencePast_s);
}

}  // namespace
}  // namespace imuscope
