#include "estimation/navigation/gnss_gate.h"

#include <gtest/gtest.h>
#include <limits>
#include <random>

namespace imuscope {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

HostTime at(double seconds) { return HostTime{from_seconds(seconds)}; }
const Matrix3d kR = 0.01 * Matrix3d::Identity();
const Matrix3d kS = 0.04 * Matrix3d::Identity();

TEST(GnssGate, AcceptsTheShareOfGoodSolutionsThatItsLimitPromises) {
  std::mt19937 random(1);
  std::normal_distribution<> noise(0.0, 0.2);
  GnssGate gate;
  constexpr int kCount = 100000;
  for (int i = 0; i < kCount; ++i) {
    (void)gate.decide(at(0.2 * i), {noise(random), noise(random), noise(random)}, kS, kR);
  }
  // 0.1 %, binomial sd 10.
  EXPECT_NEAR(static_cast<double>(gate.rejected()), 100.0, 40.0);
  EXPECT_EQ(gate.reacquisitions(), 0U);
}

TEST(GnssGate, ReportsTheNormalisedInnovationSquared) {
  GnssGate gate;
  (void)gate.decide(at(0.0), {0.2, 0.0, 0.4}, kS, kR);
  EXPECT_NEAR(gate.last_nis(), 1.0 + 4.0, 1e-12);
}

TEST(GnssGate, RejectsASingleJumpAndForgetsIt) {
  GnssGate gate;
  EXPECT_EQ(gate.decide(at(0.0), {20.0, 0.0, 0.0}, kS, kR), GateDecision::kReject);
  EXPECT_EQ(gate.streak(), 1);
  EXPECT_EQ(gate.decide(at(0.2), {0.1, 0.0, 0.0}, kS, kR), GateDecision::kAccept);
  EXPECT_EQ(gate.streak(), 0);
}

TEST(GnssGate, ReacquiresOnceWhenTheReceiverAgreesWithItselfForLongEnough) {
  GnssGate gate;
  int reacquired_at = -1;
  for (int i = 0; i < 100 && reacquired_at < 0; ++i) {
    const double wobble = i % 2 == 0 ? 0.05 : -0.05;
    const GateDecision decision = gate.decide(at(0.2 * i), {20.0 + wobble, -5.0, 1.0}, kS, kR);
    if (decision == GateDecision::kReacquire) reacquired_at = i;
  }
  EXPECT_EQ(reacquired_at, 50);  // 10 s at 5 Hz
  EXPECT_EQ(gate.streak(), 0);
}

TEST(GnssGate, ASlowReceiverNeedsTheCountNotOnlyTheTime) {
  GnssGate gate;
  for (int i = 0; i < 9; ++i) {
    EXPECT_EQ(gate.decide(at(5.0 * i), {20.0, 0.0, 0.0}, kS, kR), GateDecision::kReject);
  }
  EXPECT_EQ(gate.decide(at(45.0), {20.0, 0.0, 0.0}, kS, kR), GateDecision::kReacquire);
}

TEST(GnssGate, NeverReacquiresAReceiverThatJumpsAbout) {
  GnssGate gate;
  std::mt19937 random(2);
  std::normal_distribution<> noise(0.0, 20.0);
  for (int i = 0; i < 1000; ++i) {
    const Vector3d jump(30.0 + noise(random), noise(random), 10.0 + noise(random));
    EXPECT_EQ(gate.decide(at(0.2 * i), jump, kS, kR), GateDecision::kReject);
  }
}

TEST(GnssGate, RejectsWhatIsNotANumber) {
  GnssGate gate;
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(gate.decide(at(0.0), {nan, 0.0, 0.0}, kS, kR), GateDecision::kReject);
  EXPECT_EQ(gate.decide(at(0.2), {0.0, 0.0, 0.0}, nan * kS, kR), GateDecision::kReject);
  EXPECT_EQ(gate.decide(at(0.4), {0.0, 0.0, 0.0}, kS, kR), GateDecision::kAccept);
}

TEST(GnssGate, TheFloorHoldsAgainstOptimisticMissingAndImpossibleSds) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const Vector3d floor(0.01, 0.01, 0.02);
  EXPECT_EQ(floored_sd({0.001, 0.5, 0.02}, floor), Vector3d(0.01, 0.5, 0.02));
  EXPECT_EQ(floored_sd({nan, -1.0, 0.0}, floor), floor);
}

}  // namespace
}  // namespace imuscope
