/// A PPS device of the kernel, played at its ioctls: edges stamped by the wall clock, the newest alone kept.

#include "drivers/transport/pps_source.h"

#include <gtest/gtest.h>

#include <array>
#include <cerrno>
#include <chrono>
#include <thread>

namespace imuscope {
namespace {

struct PlayedEdges {
  int modes = PPS_CAPTUREBOTH | PPS_TSFMT_TSPEC;
  int mode = PPS_CAPTUREASSERT;
  int fetch_error = 0;
  int set_error = 0;
  pps_kinfo newest{};

  static pps_ktime ktime(UtcTime time) {
    const auto s = std::chrono::floor<std::chrono::seconds>(time);
    return {s.time_since_epoch().count(), static_cast<__s32>((time - s).count()), 0};
  }
  void assert_at(UtcTime wall) {
    ++newest.assert_sequence;
    newest.assert_tu = ktime(wall);
  }
  void clear_at(UtcTime wall) {
    ++newest.clear_sequence;
    newest.clear_tu = ktime(wall);
  }
};

class PlayedPps final : public PpsDevice {
 public:
  explicit PlayedPps(PlayedEdges& edges) : edges_(edges) {}
  int capabilities(int& modes) noexcept override {
    modes = edges_.modes;
    return 0;
  }
  int parameters(pps_kparams& params) noexcept override {
    params.mode = edges_.mode;
    return 0;
  }
  int set_parameters(const pps_kparams& params) noexcept override {
    if (edges_.set_error == 0) edges_.mode = params.mode;
    return edges_.set_error;
  }
  int fetch(pps_kinfo& newest) noexcept override {
    newest = edges_.newest;
    return edges_.fetch_error;
  }

 private:
  PlayedEdges& edges_;
};

class PpsSourceTest : public testing::Test {
 protected:
  std::unique_ptr<PpsSource> open(PulseEdge edge = PulseEdge::kAssert) {
    auto opened = PpsSource::with({"/dev/pps7", edge}, std::make_unique<PlayedPps>(edges_));
    EXPECT_TRUE(opened.has_value()) << opened.error().text();
    return opened ? std::move(*opened) : nullptr;
  }
  std::optional<UtcPulse> read(PpsSource& source) {
    std::array<std::uint8_t, PpsSource::kReadBytes> buffer{};
    const IoResult result = source.read(buffer);
    if (result.status != IoStatus::kDone) return std::nullopt;
    const auto told = std::span(buffer).first(result.n);
    if (!read_steering_record(told)) return read_pulse_record(told);
    ++steered_;
    return read_pulse_record(told.subspan(kPulseRecordBytes));
  }
  PlayedEdges edges_;
  int steered_ = 0;
};

TEST_F(PpsSourceTest, TellsHowThisPcSteersItsClockAndThenIsSilent) {
  auto source = open();
  std::optional<ClockSteering> told;
  for (int k = 0; k < 50; ++k) {
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
    std::array<std::uint8_t, PpsSource::kReadBytes> buffer{};
    const IoResult result = source->read(buffer);
    if (result.status == IoStatus::kDone) {
      told = read_steering_record(std::span(buffer).first(result.n));
      ASSERT_TRUE(told);
    }
  }
  const ClockSteering now = read_quartz();
  if (now.apart > std::chrono::microseconds(2)) GTEST_SKIP() << "this PC reads its clocks too slowly";
  ASSERT_TRUE(told);
  const double since_s = to_seconds(now.time - told->time);
  EXPECT_NEAR(to_seconds(now.unsteered - told->unsteered) - since_s, told->rate * since_s, 20e-6);
}

TEST_F(PpsSourceTest, TellsEachPulseOnceOnTheHostsClock) {
  auto source = open();
  edges_.assert_at(read_both_clocks().wall - std::chrono::hours(1));
  EXPECT_FALSE(read(*source)) << "the first that is seen may be old";
  for (std::uint32_t k = 2; k < 6; ++k) {
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
    const BothClocks then = read_both_clocks();
    edges_.assert_at(then.wall);
    edges_.clear_at(then.wall + std::chrono::microseconds(10));
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
    const auto pulse = read(*source);
    ASSERT_TRUE(pulse);
    EXPECT_EQ(pulse->sequence, k);
    EXPECT_EQ(pulse->edge, PulseEdge::kAssert);
    EXPECT_EQ(pulse->wall, then.wall);
    EXPECT_NEAR(to_seconds(pulse->time - then.host), 0.0, 50e-6) << "two readings of both clocks lie between";
    EXPECT_FALSE(read(*source));
  }
}

TEST_F(PpsSourceTest, TheOtherEdgeIsTakenWhereItIsConfigured) {
  edges_.mode = PPS_CAPTUREASSERT;
  auto source = open(PulseEdge::kClear);
  EXPECT_EQ(edges_.mode, PPS_CAPTUREASSERT | PPS_CAPTURECLEAR) << "told to capture it";
  EXPECT_FALSE(read(*source));
  const BothClocks then = read_both_clocks();
  edges_.assert_at(then.wall);
  EXPECT_FALSE(read(*source));
  edges_.clear_at(then.wall);
  const auto pulse = read(*source);
  ASSERT_TRUE(pulse);
  EXPECT_EQ(pulse->edge, PulseEdge::kClear);
}

TEST_F(PpsSourceTest, APulseStampedByAWallClockThatWasSteppedIsNotTold) {
  auto source = open();
  EXPECT_FALSE(read(*source));
  // In the future: the clock has been set back since.
  edges_.assert_at(read_both_clocks().wall + std::chrono::seconds(1));
  EXPECT_FALSE(read(*source));
  edges_.assert_at(read_both_clocks().wall);
  EXPECT_TRUE(read(*source)) << "the next one counts again";
}

TEST_F(PpsSourceTest, WhatIsMissingIsToldWithItsRemedy) {
  edges_.modes = PPS_CAPTUREASSERT;
  auto opened = PpsSource::with({"/dev/pps7", PulseEdge::kClear}, std::make_unique<PlayedPps>(edges_));
  ASSERT_FALSE(opened);
  EXPECT_NE(opened.error().text().find("edge = \"assert\""), std::string::npos) << opened.error().text();
  edges_.modes = PPS_CAPTUREBOTH;
  edges_.set_error = EPERM;
  opened = PpsSource::with({"/dev/pps7", PulseEdge::kClear}, std::make_unique<PlayedPps>(edges_));
  ASSERT_FALSE(opened);
  EXPECT_NE(opened.error().text().find("ppstest"), std::string::npos) << opened.error().text();
  const auto missing = PpsSource::open({"/dev/no_such_pps", PulseEdge::kAssert});
  ASSERT_FALSE(missing);
  EXPECT_NE(missing.error().text().find("/dev/no_such_pps"), std::string::npos);
  const auto other = PpsSource::open({"/dev/null", PulseEdge::kAssert});
  ASSERT_FALSE(other);
  EXPECT_NE(other.error().text().find("is no PPS device"), std::string::npos) << other.error().text();
}

TEST_F(PpsSourceTest, ADeviceThatVanishesIsGone) {
  auto source = open();
  EXPECT_FALSE(read(*source));
  edges_.fetch_error = ENODEV;
  std::array<std::uint8_t, PpsSource::kReadBytes> buffer{};
  EXPECT_EQ(source->read(buffer).status, IoStatus::kGone);
  edges_.fetch_error = EINTR;
  EXPECT_EQ(source->read(buffer).status, IoStatus::kNothing);
}

}  // namespace
}  // namespace imuscope
