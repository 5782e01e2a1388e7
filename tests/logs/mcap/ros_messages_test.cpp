#include <gtest/gtest.h>

#include "logs/mcap/ros_messages.h"

namespace imuscope::mcap {
namespace {

Imu some_imu() {
  Imu imu;
  imu.header = {1'234'567'890'123'456'789, "mtx1"};
  for (std::size_t i = 0; i < 3; ++i) {
    imu.angular_velocity[i] = 0.1 + static_cast<double>(i);
    imu.linear_acceleration[i] = -9.0 - static_cast<double>(i);
  }
  for (std::size_t i = 0; i < 9; ++i) imu.angular_velocity_covariance[i] = static_cast<double>(i) * 1e-6;
  return imu;
}

/// Bytes worked out by hand from the rules of CDR: alignment counts from behind the head.
TEST(Cdr, ATimeReferenceLiesInMemoryAsTheStandardSays) {
  CdrWriter out;
  write(out, TimeReference{{3'000'000'004, "gps"}, 5'000'000'006, "x"});
  const std::vector<std::uint8_t> expected{0, 1, 0, 0,                    // plain, little-endian
                                           3, 0, 0, 0, 4,   0,   0,   0,  // stamp
                                           4, 0, 0, 0, 'g', 'p', 's', 0,  //
                                           5, 0, 0, 0, 6,   0,   0,   0,  //
                                           2, 0, 0, 0, 'x', 0};
  EXPECT_EQ(std::vector<std::uint8_t>(out.bytes().begin(), out.bytes().end()), expected);
}

TEST(Cdr, DoublesStandAtMultiplesOfEight) {
  CdrWriter out;
  write(out, Imu{{0, "ab"}, {}, {}, {}, {}, {}, {}});
  // Head 4, stamp 8, length 4, "ab" and its end 3: 15 after the head, so the first double is at 16.
  EXPECT_EQ(out.bytes().size(), 4U + 16U + (4 + 9 + 3 + 9 + 3 + 9) * 8U);
}

TEST(Cdr, AnImuComesBack) {
  CdrWriter out;
  const Imu imu = some_imu();
  write(out, imu);
  Imu back;
  ASSERT_TRUE(read(out.bytes(), back));
  EXPECT_EQ(back.header.stamp_ns, imu.header.stamp_ns);
  EXPECT_EQ(back.header.frame_id, imu.header.frame_id);
  EXPECT_EQ(back.angular_velocity, imu.angular_velocity);
  EXPECT_EQ(back.linear_acceleration, imu.linear_acceleration);
  EXPECT_EQ(back.angular_velocity_covariance, imu.angular_velocity_covariance);
}

TEST(Cdr, ABigEndianMessageIsRead) {
  const std::vector<std::uint8_t> bytes{0, 0, 0, 0, 0, 0, 0, 3, 0, 0, 0, 4, 0, 0, 0, 1, 0,
                                        0, 0, 0, 0, 0, 0, 5, 0, 0, 0, 6, 0, 0, 0, 1, 0};
  TimeReference reference;
  ASSERT_TRUE(read(bytes, reference));
  EXPECT_EQ(reference.header.stamp_ns, 3'000'000'004);
  EXPECT_EQ(reference.time_ref_ns, 5'000'000'006);
}

TEST(Cdr, AMessageCutAnywhereIsRefused) {
  CdrWriter out;
  write(out, some_imu());
  for (std::size_t size = 0; size < out.bytes().size(); ++size) {
    Imu back;
    EXPECT_FALSE(read(out.bytes().first(size), back)) << size;
  }
}

TEST(Json, AnImuInTheNamesOfEveryWorldIsRead) {
  for (const char* stamp : {R"({"sec":7,"nanosec":8})", R"({"sec":7,"nsec":8})", R"({"secs":7,"nsecs":8})"}) {
    const std::string text =
        std::string(R"({"header":{"frame_id":"imu","stamp":)") + stamp +
        R"(},"angular_velocity":{"x":1,"y":2,"z":3},"linear_acceleration":{"x":4,"y":5,"z":6.5}})";
    Imu imu;
    ASSERT_TRUE(read_json(bytes_of(text), imu)) << text;
    EXPECT_EQ(imu.header.stamp_ns, 7'000'000'008);
    EXPECT_EQ(imu.header.frame_id, "imu");
    EXPECT_EQ(imu.angular_velocity, (Vector{1, 2, 3}));
    EXPECT_EQ(imu.linear_acceleration, (Vector{4, 5, 6.5}));
  }
}

TEST(Json, WhatIsNoImuIsRefused) {
  const std::string deep = std::string(5000, '[') + std::string(5000, ']');
  for (
      const std::string& text :
      {std::string(), std::string("{"), std::string("[]"), std::string("{}"), std::string("null"), deep,
       std::string(R"({"header":{"stamp":{"sec":1e300,"nanosec":0}}})"),
       std::string(
           R"({"header":{"stamp":{"sec":9223372036854775807,"nanosec":0}},"angular_velocity":{"x":1,"y":2,"z":3},)"
           R"("linear_acceleration":{"x":4,"y":5,"z":6}})"),
       std::string(R"({"header":{"stamp":{"sec":1,"nanosec":0}},"angular_velocity":{"x":"1","y":2,"z":3},)"
                   R"("linear_acceleration":{"x":4,"y":5,"z":6}})")}) {
    Imu imu;
    EXPECT_FALSE(read_json(bytes_of(text), imu)) << text.substr(0, 80);
  }
}

/// An array of `n` numbers from `first` on, as JSON.
std::string counted(std::size_t n, int first) {
  std::string text = "[";
  for (std::size_t i = 0; i < n; ++i)
    text += (i == 0 ? "" : ",") + std::to_string(first + static_cast<int>(i));
  return text + "]";
}

constexpr const char* kHeader = R"({"header":{"frame_id":"here","stamp":{"sec":7,"nanosec":8}},)";

TEST(Json, EveryValueOfAFixIsRead) {
  const std::string text = std::string(kHeader) +
                           R"("status":{"status":2},"latitude":48.5,"longitude":-2.25,"altitude":81.5,)"
                           R"("position_covariance":)" +
                           counted(9, 1) + R"(,"position_covariance_type":3})";
  NavSatFix fix;
  ASSERT_TRUE(read_json(bytes_of(text), fix));
  EXPECT_EQ(fix.header.stamp_ns, 7'000'000'008);
  EXPECT_EQ(fix.header.frame_id, "here");
  EXPECT_EQ(fix.status, 2);
  EXPECT_EQ(fix.latitude_deg, 48.5);
  EXPECT_EQ(fix.longitude_deg, -2.25);
  EXPECT_EQ(fix.altitude_m, 81.5);
  EXPECT_EQ(fix.position_covariance, (Covariance3{1, 2, 3, 4, 5, 6, 7, 8, 9}));
  EXPECT_EQ(fix.position_covariance_type, 3);
}

TEST(Json, AFixThatSaysNothingOfItsCovarianceIsReadAndOneWithoutAPlaceIsRefused) {
  NavSatFix fix;
  ASSERT_TRUE(read_json(bytes_of(std::string(kHeader) + R"("status":{"status":0},"latitude":1,)"
                                                        R"("longitude":2,"altitude":3})"),
                        fix));
  EXPECT_EQ(fix.position_covariance, Covariance3{});
  EXPECT_EQ(fix.position_covariance_type, 0);
  for (const char* rest : {R"("longitude":2,"altitude":3})", R"("latitude":1,"altitude":3})",
                           R"("latitude":1,"longitude":2})"}) {
    EXPECT_FALSE(read_json(bytes_of(std::string(kHeader) + R"("status":{"status":0},)" + rest), fix)) << rest;
  }
}

TEST(Json, EveryValueOfAnOdometryIsRead) {
  const std::string text =
      std::string(kHeader) +
      R"("child_frame_id":"car","pose":{"pose":{"position":{"x":1,"y":2,"z":3},)"
      R"("orientation":{"x":0.1,"y":0.2,"z":0.3,"w":0.9}},"covariance":)" +
      counted(36, 100) +
      R"(},"twist":{"twist":{"linear":{"x":4,"y":5,"z":6},"angular":{"x":7,"y":8,"z":9}},"covariance":)" +
      counted(36, 200) + "}}";
  Odometry odometry;
  ASSERT_TRUE(read_json(bytes_of(text), odometry));
  EXPECT_EQ(odometry.header.stamp_ns, 7'000'000'008);
  EXPECT_EQ(odometry.child_frame_id, "car");
  EXPECT_EQ(odometry.position_m, (Vector{1, 2, 3}));
  EXPECT_EQ(odometry.orientation, (Quaternion{0.1, 0.2, 0.3, 0.9}));
  EXPECT_EQ(odometry.linear_mps, (Vector{4, 5, 6}));
  EXPECT_EQ(odometry.angular_radps, (Vector{7, 8, 9}));
  EXPECT_EQ(odometry.pose_covariance[35], 135.0);
  EXPECT_EQ(odometry.twist_covariance[1], 201.0);
}

TEST(Json, ATwistIsReadWithItsCovarianceAndWithoutOne) {
  const std::string twist = R"({"linear":{"x":4,"y":5,"z":6},"angular":{"x":7,"y":8,"z":9}})";
  TwistStamped bare;
  ASSERT_TRUE(read_json(bytes_of(std::string(kHeader) + R"("twist":)" + twist + "}"), bare));
  EXPECT_EQ(bare.linear_mps, (Vector{4, 5, 6}));
  EXPECT_EQ(bare.angular_radps, (Vector{7, 8, 9}));
  EXPECT_EQ(bare.covariance, Covariance6{});
  TwistStamped known;
  ASSERT_TRUE(read_json(bytes_of(std::string(kHeader) + R"("twist":{"twist":)" + twist + R"(,"covariance":)" +
                                 counted(36, 100) + "}}"),
                        known));
  EXPECT_EQ(known.header.stamp_ns, 7'000'000'008);
  EXPECT_EQ(known.linear_mps, (Vector{4, 5, 6}));
  EXPECT_EQ(known.angular_radps, (Vector{7, 8, 9}));
  EXPECT_EQ(known.covariance[7], 107.0);
}

TEST(Json, EveryValueOfATimeReferenceIsRead) {
  TimeReference reference;
  ASSERT_TRUE(read_json(
      bytes_of(std::string(kHeader) + R"("time_ref":{"sec":5,"nanosec":6},"source":"gps"})"), reference));
  EXPECT_EQ(reference.header.stamp_ns, 7'000'000'008);
  EXPECT_EQ(reference.time_ref_ns, 5'000'000'006);
  EXPECT_EQ(reference.source, "gps");
}

TEST(Schema, EveryTypeThatIsUsedIsDefinedOnce) {
  for (const char* type : {"sensor_msgs/Imu", "sensor_msgs/NavSatFix", "sensor_msgs/TimeReference",
                           "nav_msgs/Odometry", "tf2_msgs/TFMessage", "diagnostic_msgs/DiagnosticArray"}) {
    const auto schema = ros_schema(type);
    EXPECT_NE(schema.name.find("/msg/"), std::string::npos);
    const std::string header = "MSG: std_msgs/Header\n";
    const auto first = schema.text.find(header);
    ASSERT_NE(first, std::string::npos) << type;
    EXPECT_EQ(schema.text.find(header, first + 1), std::string::npos) << type;
  }
}

}  // namespace
}  // namespace imuscope::mcap
