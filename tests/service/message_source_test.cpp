/// What each role takes out of an MCAP file, as samples.

#include "service/mcap_source.h"

#include <gtest/gtest.h>
#include <unistd.h>
#include <cmath>
#include <fstream>

#include "base/units.h"
#include "mcap/ros_messages.h"
#include "mcap/writer.h"
#include "service/device_factory.h"

namespace imuscope {
namespace {

constexpr std::int64_t kTime_ns = 1'700'000'000'250'000'000;

/// A file that `fill` writes through functions that add messages of any type to any topic.
class Bag {
 public:
  Bag()
      : path_(std::filesystem::temp_directory_path() /
              ("mcap_source_" + std::to_string(::getpid()) + "_" + std::to_string(count_++))) {}
  Bag(const Bag&) = delete;
  Bag& operator=(const Bag&) = delete;
  ~Bag() { std::filesystem::remove(path_); }

  template <typename Message>
  void add(const std::string& topic, const char* type, const Message& message, std::uint64_t log_time = 1) {
    mcap::CdrWriter cdr;
    mcap::write(cdr, message);
    writer_.write(channel(topic, type, "cdr"), log_time, log_time + 1, cdr.bytes());
  }
  void add_json(const std::string& topic, const char* type, const std::string& text) {
    writer_.write(channel(topic, type, "json"), 1, 1, mcap::bytes_of(text));
  }
  std::filesystem::path finish() {
    writer_.finish();
    std::ofstream(path_, std::ios::binary) << content_;
    return path_;
  }

 private:
  mcap::ChannelId channel(const std::string& topic, const char* type, const char* encoding) {
    auto& known = channels_[topic];
    if (known == 0) known = writer_.add_channel(topic, writer_.add_schema(type, "ros2msg", ""), encoding);
    return known;
  }
  static inline int count_ = 0;
  std::filesystem::path path_;
  std::string content_;
  mcap::Writer writer_{{"ros2", "test"}, [this](std::string_view bytes) { content_ += bytes; }};
  std::map<std::string, mcap::ChannelId> channels_;
};

DeviceConfig device_of(DeviceRole role, const std::string& topic = {}) {
  DeviceConfig device;
  device.name = "device";
  device.role = role;
  device.protocol = Protocol::kMcap;
  device.rate_hz = 10.0;
  device.mcap.topic = topic;
  return device;
}

class Samples final : public SampleSink {
 public:
  void on_sample(const Sample& sample) noexcept override { samples.push_back(sample); }
  std::vector<Sample> samples;
};

std::vector<Sample> samples_of(const std::filesystem::path& file, const DeviceConfig& device) {
  const auto survey = survey_mcap(file, device);
  EXPECT_TRUE(survey) << survey.error().text();
  if (!survey) return {};
  Samples sink;
  const auto decoder = make_decoder(device, 0, ClockMapConfig::fixed(HostTime{}, 1.0));
  auto source = open_mcap(file, device, *survey);
  while (source) {
    const auto read = (*source)->next();
    if (!read || !*read) break;
    decoder->push((*read)->bytes, HostTime{}, sink);
  }
  decoder->finish(HostTime{}, sink);
  EXPECT_EQ(decoder->counters().bytes_skipped, 0U);
  return sink.samples;
}

mcap::Imu imu_at(std::int64_t stamp_ns, const std::string& frame, double x) {
  mcap::Imu imu;
  imu.header = {stamp_ns, frame};
  imu.angular_velocity = {x, 2.0, 3.0};
  imu.linear_acceleration = {4.0, 5.0, 6.0};
  return imu;
}

TEST(McapSource, AnImuIsTurnedAndStampedAsConfigured) {
  Bag bag;
  bag.add("/imu", "sensor_msgs/msg/Imu", imu_at(kTime_ns, "imu", 1.0), 77);
  auto device = device_of(DeviceRole::kStudy);
  device.axes = {1, 0, 0, 0, -1, 0, 0, 0, -1};
  device.mcap.times_are_utc = true;
  const auto path = bag.finish();
  auto samples = samples_of(path, device);
  ASSERT_EQ(samples.size(), 1U);
  EXPECT_EQ(samples[0].imu.omega_radps, (Vector3{1, -2, -3}));
  EXPECT_EQ(samples[0].imu.f_mps2, (Vector3{4, -5, -6}));
  EXPECT_EQ(to_ns(samples[0].time), kTime_ns);
  EXPECT_TRUE(samples[0].has_utc);
  EXPECT_EQ(to_ns(samples[0].utc), kTime_ns);
  device.mcap.time = McapTime::kLog;
  EXPECT_EQ(to_ns(samples_of(path, device)[0].time), 77);
  device.mcap.time = McapTime::kPublish;
  EXPECT_EQ(to_ns(samples_of(path, device)[0].time), 78);
}

TEST(McapSource, SensorsOfOneTopicAreToldApartByTheirFrames) {
  Bag bag;
  for (int i = 0; i < 4; ++i)
    bag.add("/imu", "sensor_msgs/msg/Imu", imu_at(kTime_ns + i, i % 2 == 0 ? "left" : "right", i));
  auto device = device_of(DeviceRole::kStudy);
  device.mcap.frame_id = "right";
  const auto samples = samples_of(bag.finish(), device);
  ASSERT_EQ(samples.size(), 2U);
  EXPECT_EQ(samples[0].imu.omega_radps[0], 1.0);
  EXPECT_EQ(samples[1].imu.omega_radps[0], 3.0);
}

TEST(McapSource, WhatIsNotMeasuredIsNotValid) {
  Bag bag;
  auto imu = imu_at(kTime_ns, "", 1.0);
  imu.linear_acceleration_covariance[0] = -1.0;
  bag.add("/imu", "sensor_msgs/msg/Imu", imu);
  EXPECT_EQ(samples_of(bag.finish(), device_of(DeviceRole::kReference))[0].imu.flags, kGyroValid);
}

TEST(McapSource, GapsAndTimesThatGoBackAreTold) {
  Bag bag;
  for (const std::int64_t at : {0, 1, 5, 4, 6})
    bag.add("/imu", "sensor_msgs/msg/Imu", imu_at(kTime_ns + at * 100'000'000, "", 1.0));
  const auto samples = samples_of(bag.finish(), device_of(DeviceRole::kStudy));
  ASSERT_EQ(samples.size(), 4U);
  EXPECT_EQ(samples[1].imu.flags & kGapBefore, 0U);
  EXPECT_NE(samples[2].imu.flags & kGapBefore, 0U);
}

/// The velocity may stand before or behind its position; one of another instant belongs to neither.
TEST(McapSource, AVelocityMeetsThePositionOfItsInstant) {
  for (const bool before : {true, false}) {
    Bag bag;
    for (int i = 0; i < 4; ++i) {
      mcap::NavSatFix fix;
      fix.header.stamp_ns = kTime_ns + i * 100'000'000;
      fix.status = 2;
      fix.latitude_deg = 45.0;
      fix.longitude_deg = 190.0;
      fix.altitude_m = 100.0 + i;
      fix.position_covariance_type = 2;
      fix.position_covariance = {0.0004, 0, 0, 0, 0.0009, 0, 0, 0, 0.0016};
      mcap::TwistStamped twist;
      twist.header.stamp_ns = fix.header.stamp_ns + (i == 2 ? 50'000'000 : 0);
      twist.linear_mps = {1.0, 2.0, 3.0};
      twist.covariance[0] = 0.01, twist.covariance[7] = 0.04, twist.covariance[14] = 0.09;
      if (before) bag.add("/velocity", "geometry_msgs/msg/TwistWithCovarianceStamped", twist);
      bag.add("/fix", "sensor_msgs/msg/NavSatFix", fix);
      if (!before) bag.add("/velocity", "geometry_msgs/msg/TwistWithCovarianceStamped", twist);
    }
    auto device = device_of(DeviceRole::kGnss, "/fix");
    device.mcap.velocity_topic = "/velocity";
    const auto samples = samples_of(bag.finish(), device);
    ASSERT_EQ(samples.size(), 4U);
    for (std::size_t i = 0; i < samples.size(); ++i) {
      const GnssData& gnss = samples[i].gnss;
      EXPECT_EQ(gnss.height_m, 100.0 + static_cast<double>(i));
      EXPECT_NEAR(gnss.longitude_rad, -170.0 * kRadPerDeg, 1e-12);
      EXPECT_EQ(gnss.solution, GnssSolution::kFixed);
      EXPECT_NEAR(gnss.sd_position_m[0], 0.03, 1e-12) << "north";
      EXPECT_NEAR(gnss.sd_position_m[1], 0.02, 1e-12) << "east";
      EXPECT_EQ((gnss.flags & kVelocityValid) != 0, i != 2) << i;
      if (i == 2) continue;
      EXPECT_EQ(gnss.v_n_mps, (Vector3{2.0, 1.0, -3.0}));
      EXPECT_NEAR(gnss.sd_velocity_mps[0], 0.2, 1e-12);
    }
  }
}

TEST(McapSource, SolutionsSayHowGoodTheyAre) {
  Bag bag;
  int i = 0;
  for (const auto& [status, sd] : {std::pair{-1, 0.0}, {0, 2.0}, {1, 0.8}, {2, 0.02}, {2, 0.4}, {2, 0.0}}) {
    mcap::NavSatFix fix;
    fix.header.stamp_ns = kTime_ns + 100'000'000 * i++;
    fix.status = static_cast<std::int8_t>(status);
    if (status < 0) fix.latitude_deg = fix.longitude_deg = fix.altitude_m = std::nan("");
    fix.position_covariance = {sd * sd, 0, 0, 0, sd * sd, 0, 0, 0, sd * sd};
    fix.position_covariance_type = sd > 0.0 ? 1 : 0;
    bag.add("/fix", "sensor_msgs/msg/NavSatFix", fix);
  }
  std::vector<GnssSolution> solutions;
  for (const auto& sample : samples_of(bag.finish(), device_of(DeviceRole::kGnss)))
    solutions.push_back(sample.gnss.solution);
  EXPECT_EQ(solutions, (std::vector<GnssSolution>{GnssSolution::kNone, GnssSolution::kSingle,
                                                  GnssSolution::kDifferential, GnssSolution::kFixed,
                                                  GnssSolution::kFloat, GnssSolution::kFloat}));
}

TEST(McapSource, SpeedsAndPulses) {
  Bag bag;
  mcap::Odometry odometry;
  odometry.header.stamp_ns = kTime_ns;
  odometry.linear_mps = {-3.5, 0.2, 0.1};
  bag.add("/odom", "nav_msgs/msg/Odometry", odometry);
  // The PC's clock showed 17.250 when it was 16.998 UTC: the second 17 came 2 ms later.
  bag.add("/time", "sensor_msgs/msg/TimeReference",
          mcap::TimeReference{{kTime_ns, ""}, kTime_ns - 252'000'000, "gps"});
  const auto path = bag.finish();
  const auto speeds = samples_of(path, device_of(DeviceRole::kOdometry));
  ASSERT_EQ(speeds.size(), 1U);
  EXPECT_EQ(speeds[0].odometry.speed_mps, -3.5);
  const auto pulses = samples_of(path, device_of(DeviceRole::kTime));
  ASSERT_EQ(pulses.size(), 1U);
  EXPECT_EQ(pulses[0].pulse.wall_ns, 1'700'000'000'000'000'000);
  EXPECT_EQ(to_ns(pulses[0].time), kTime_ns + 2'000'000);
}

TEST(McapSource, JsonAndCdrAreTheSame) {
  Bag bag;
  bag.add_json("/imu", "sensor_msgs/Imu",
               R"({"header":{"stamp":{"sec":1700000000,"nanosec":250000000},"frame_id":"x"},)"
               R"("angular_velocity":{"x":1,"y":2,"z":3},"linear_acceleration":{"x":4,"y":5,"z":6}})");
  bag.add_json("/imu", "sensor_msgs/Imu", R"({"header":{}})");
  const auto path = bag.finish();
  const auto device = device_of(DeviceRole::kStudy);
  const auto samples = samples_of(path, device);
  ASSERT_EQ(samples.size(), 1U);
  EXPECT_EQ(to_ns(samples[0].time), kTime_ns);
  EXPECT_EQ(samples[0].imu.f_mps2, (Vector3{4, 5, 6}));
  const auto survey = survey_mcap(path, device);
  ASSERT_EQ(survey->losses.size(), 1U);
  EXPECT_NE(survey->losses[0].find("1 messages"), std::string::npos) << survey->losses[0];
}

TEST(McapSource, NamesOfAStrangerAreText) {
  Bag bag;
  bag.add("/a\x1b[2J\nb", "sensor_msgs/msg/Imu", imu_at(kTime_ns, "f\x1b]0;x\x07", 1.0));
  bag.add("/c", "sensor_msgs/msg/Imu", imu_at(kTime_ns, "g", 1.0));
  const auto path = bag.finish();
  auto device = device_of(DeviceRole::kStudy);
  const auto choice = survey_mcap(path, device);
  ASSERT_FALSE(choice);
  device.mcap.topic = "/absent";
  const auto absent = survey_mcap(path, device);
  ASSERT_FALSE(absent);
  device.mcap.topic = "/a\x1b[2J\nb";
  device.mcap.frame_id = "none";
  const auto frame = survey_mcap(path, device);
  ASSERT_FALSE(frame);
  for (const auto* error : {&choice.error(), &absent.error()}) {
    for (const char c : error->text()) EXPECT_TRUE(static_cast<unsigned char>(c) >= ' ') << error->text();
  }
  EXPECT_EQ(frame.error().remedy.find('\x1b'), std::string::npos);
}

}  // namespace
}  // namespace imuscope
