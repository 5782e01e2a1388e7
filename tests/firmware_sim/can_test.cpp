/// The simulator's CAN end, against lines of the published vectors (can_odometry, can_xsens) and arithmetic.

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "firmware_sim/devices/can_encoder.h"
#include "firmware_sim/io/can_line.h"

namespace imusim {
namespace {

TEST(CanEncoder, WheelFrameIsTheVectorOfTheSameSpeeds) {
  // 0AA#2E102DF62DF8187B: 50.25, 49.99, 50.01 and -5 km/h.
  const CanFrame frame = wheel_frame({50.25 / 3.6, 49.99 / 3.6, 50.01 / 3.6, -5.0 / 3.6});
  EXPECT_EQ(frame.id, 0x0AA);
  EXPECT_EQ(frame.data, (Bytes{0x2E, 0x10, 0x2D, 0xF6, 0x2D, 0xF8, 0x18, 0x7B}));
  EXPECT_EQ(wheel_frame({0, 0, 0, 0}).data, (Bytes{0x1A, 0x6F, 0x1A, 0x6F, 0x1A, 0x6F, 0x1A, 0x6F}));
}

TEST(CanEncoder, MtiGroupIsTheVectorsOfTheSameValues) {
  MtiGroup group;
  group.sample_time_100us = 99;
  group.counter = 0;
  group.status = 0x01800007;
  group.delta_v_mps = Eigen::Vector3d(1, -2, 3) / 32768.0;
  group.rotation_vector_rad = Eigen::Vector3d(0.0, 0.02, 0.0);
  const auto frames = mti_frames(group);
  ASSERT_EQ(frames.size(), 5U);
  EXPECT_EQ(frames[0].id, 0x005);
  EXPECT_EQ(frames[0].data, (Bytes{0x00, 0x00, 0x00, 0x63}));
  EXPECT_EQ(frames[1].id, 0x006);
  EXPECT_EQ(frames[1].data, (Bytes{0x00, 0x00}));
  EXPECT_EQ(frames[2].id, 0x011);
  EXPECT_EQ(frames[2].data, (Bytes{0x01, 0x80, 0x00, 0x07}));
  EXPECT_EQ(frames[3].id, 0x031);
  EXPECT_EQ(frames[3].data, (Bytes{0x00, 0x01, 0xFF, 0xFE, 0x00, 0x03, 0x0F}));
  EXPECT_EQ(frames[4].id, 0x033);
  // cos(0.01) and sin(0.01) times 32767.
  EXPECT_EQ(frames[4].data, (Bytes{0x7F, 0xFD, 0x00, 0x00, 0x01, 0x48, 0x00, 0x00}));
}

TEST(CanEncoder, HighRateMessagesComeInEitherOfTheDocumentedOrders) {
  MtiGroup group;
  group.output = MtiOutput::kHighRate;
  group.f_mps2 = Eigen::Vector3d(0.0, 1.0, -9.8125);        // 0, 256, -2512
  group.omega_radps = Eigen::Vector3d(0.001953125, -1, 0);  // 1, -512, 0
  const Bytes acceleration{0x00, 0x00, 0x01, 0x00, 0xF6, 0x30};
  const Bytes rate{0x00, 0x01, 0xFE, 0x00, 0x00, 0x00};
  const auto frames = mti_frames(group);
  ASSERT_EQ(frames.size(), 5U);
  EXPECT_EQ(frames[3].id, 0x061);
  EXPECT_EQ(frames[3].data, acceleration);
  EXPECT_EQ(frames[4].id, 0x062);
  EXPECT_EQ(frames[4].data, rate);
  group.output = MtiOutput::kHighRateSwapped;
  const auto swapped = mti_frames(group);
  EXPECT_EQ(swapped[3].id, 0x061);
  EXPECT_EQ(swapped[3].data, rate);
  EXPECT_EQ(swapped[4].id, 0x062);
  EXPECT_EQ(swapped[4].data, acceleration);
}

TEST(CanNode, SendsItsFramesAtItsInstantsAndLeavesOutWhatItIsTold) {
  CanNode node({100.0, 0.003, 0.0, 0.002}, [](double, double device_s, std::int64_t index) {
    EXPECT_NEAR(device_s, 0.003 + 0.01 * static_cast<double>(index), 1e-12);
    return std::vector<CanFrame>{{0x005, {1}}, {0x031, {2}}};
  });
  std::vector<Emission> out;
  node.run_until(0.0249, out);
  ASSERT_EQ(out.size(), 4U);
  EXPECT_NEAR(out[2].ready_s, 0.015, 1e-12);
  EXPECT_EQ(unpack(out[2].bytes).id, 0x005);
  EXPECT_TRUE(node.leave_out({"031"}));
  EXPECT_FALSE(node.leave_out({"wheel"}));
  out.clear();
  node.run_until(0.0449, out);
  EXPECT_EQ(out.size(), 2U);
}

TEST(CanLine, FramesTakeTheirTimeOnTheBusAndKeepTheirOrder) {
  // 47 bits and 8 of each byte, a tenth of stuffing, at 500 kbit/s: 0.2442 ms a frame of 8 bytes.
  CanLine line({500e3, 0.0, 0.0}, Random(1, "line"));
  for (int i = 0; i < 10; ++i) line.send({1.0, pack({0x100, Bytes(8)})});
  std::vector<double> stamps_s;
  line.deliver_until(2.0, [&](const CanFrame& frame, double t_s) {
    EXPECT_EQ(frame.data.size(), 8U);
    stamps_s.push_back(t_s);
  });
  ASSERT_EQ(stamps_s.size(), 10U);
  EXPECT_NEAR(stamps_s.front(), 1.0, 1e-12) << "ready means received, on an idle bus";
  for (std::size_t i = 1; i < stamps_s.size(); ++i)
    EXPECT_NEAR(stamps_s[i] - stamps_s[i - 1], 0.2442e-3, 1e-9);
}

}  // namespace
}  // namespace imusim
