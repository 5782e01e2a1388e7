/// What each role takes out of a file of many topics, as samples.

#include "service/recording/message_source.h"

#include <gtest/gtest.h>
#include <unistd.h>
#include <cmath>
#include <fstream>
#include <limits>
#include <map>
#include <tuple>

#include "base/units.h"
#include "logs/mcap/ros_messages.h"
#include "logs/mcap/writer.h"
#include "service/pipeline/device_factory.h"
#include "tests/support/shared_data.h"

namespace imuscope {
namespace {

constexpr std::int64_t kTime_ns = 1'700'000'000'250'000'000;

/// A file that `fill` writes through functions that add messages of any type to any topic.
class Bag {
 public:
  Bag()
      : path_(std::filesystem::temp_directory_path() /
              ("message_source_" + std::to_string(::getpid()) + "_" + std::to_string(count_++))) {}
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
  device.messages.topic = topic;
  return device;
}

class Samples final : public SampleSink {
 public:
  void on_sample(const Sample& sample) noexcept override { samples.push_back(sample); }
  std::vector<Sample> samples;
};

std::vector<Sample> samples_of(const std::filesystem::path& file, const DeviceConfig& device) {
  const auto survey = survey_messages(file, device);
  EXPECT_TRUE(survey) << survey.error().text();
  if (!survey) return {};
  Samples sink;
  const auto decoder = make_decoder(device, 0, ClockMapConfig::fixed(HostTime{}, 1.0));
  auto source = open_messages(file, device, *survey);
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

TEST(MessageSource, AnImuIsTurnedAndStampedAsConfigured) {
  Bag bag;
  bag.add("/imu", "sensor_msgs/msg/Imu", imu_at(kTime_ns, "imu", 1.0), 77);
  auto device = device_of(DeviceRole::kStudy);
  device.axes = {1, 0, 0, 0, -1, 0, 0, 0, -1};
  device.messages.times_are_utc = true;
  const auto path = bag.finish();
  auto samples = samples_of(path, device);
  ASSERT_EQ(samples.size(), 1U);
  EXPECT_EQ(samples[0].imu.omega_radps, (Vector3{1, -2, -3}));
  EXPECT_EQ(samples[0].imu.f_mps2, (Vector3{4, -5, -6}));
  EXPECT_EQ(to_ns(samples[0].time), kTime_ns);
  EXPECT_TRUE(samples[0].has_utc);
  EXPECT_EQ(to_ns(samples[0].utc), kTime_ns);
  device.messages.time = MessageTime::kLog;
  EXPECT_EQ(to_ns(samples_of(path, device)[0].time), 77);
  device.messages.time = MessageTime::kPublish;
  EXPECT_EQ(to_ns(samples_of(path, device)[0].time), 78);
}

TEST(MessageSource, SensorsOfOneTopicAreToldApartByTheirFrames) {
  Bag bag;
  for (int i = 0; i < 4; ++i)
    bag.add("/imu", "sensor_msgs/msg/Imu", imu_at(kTime_ns + i, i % 2 == 0 ? "left" : "right", i));
  auto device = device_of(DeviceRole::kStudy);
  device.messages.frame_id = "right";
  const auto samples = samples_of(bag.finish(), device);
  ASSERT_EQ(samples.size(), 2U);
  EXPECT_EQ(samples[0].imu.omega_radps[0], 1.0);
  EXPECT_EQ(samples[1].imu.omega_radps[0], 3.0);
}

TEST(MessageSource, WhatIsNotMeasuredIsNotValid) {
  Bag bag;
  auto imu = imu_at(kTime_ns, "", 1.0);
  imu.linear_acceleration_covariance[0] = -1.0;
  bag.add("/imu", "sensor_msgs/msg/Imu", imu);
  EXPECT_EQ(samples_of(bag.finish(), device_of(DeviceRole::kReference))[0].imu.flags, kGyroValid);
}

TEST(MessageSource, WhatNoMessageHoldsIsTold) {
  Bag bag;
  auto imu = imu_at(kTime_ns, "", 1.0);
  imu.linear_acceleration_covariance[0] = -1.0;
  bag.add("/imu", "sensor_msgs/msg/Imu", imu);
  const auto survey = survey_messages(bag.finish(), device_of(DeviceRole::kStudy));
  ASSERT_TRUE(survey);
  ASSERT_EQ(survey->losses.size(), 1U);
  EXPECT_NE(survey->losses[0].find("1 of 1 messages"), std::string::npos) << survey->losses[0];
  EXPECT_NE(survey->losses[0].find("no linear acceleration"), std::string::npos) << survey->losses[0];
}

/// Recorders write what comes on several connections as it comes.
TEST(MessageSource, MessagesALittleOutOfOrderArePutInOrder) {
  Bag bag;
  for (const std::int64_t at : {0, 3, 1, 2, 4, 7, 6, 5, 9, 8, 30})
    bag.add("/imu", "sensor_msgs/msg/Imu", imu_at(kTime_ns + at * 10'000'000, "", static_cast<double>(at)));
  auto device = device_of(DeviceRole::kStudy);
  device.rate_hz = 100.0;
  const auto path = bag.finish();
  const auto samples = samples_of(path, device);
  ASSERT_EQ(samples.size(), 11U);
  for (std::size_t i = 0; i < 10; ++i) EXPECT_EQ(samples[i].imu.omega_radps[0], static_cast<double>(i));
  const auto survey = survey_messages(path, device);
  ASSERT_EQ(survey->losses.size(), 1U);
  EXPECT_NE(survey->losses[0].find("5 messages"), std::string::npos) << survey->losses[0];
}

/// A clock that was set back is no disorder: both of its sides stay as they came.
TEST(MessageSource, AClockThatWasSetBackStaysOne) {
  Bag bag;
  for (const std::int64_t at : {100, 101, 102, 0, 1, 2})
    bag.add("/imu", "sensor_msgs/msg/Imu", imu_at(kTime_ns + at * 10'000'000, "", static_cast<double>(at)));
  const auto survey = survey_messages(bag.finish(), device_of(DeviceRole::kStudy));
  ASSERT_TRUE(survey);
  EXPECT_EQ(survey->messages, 6U);
  EXPECT_TRUE(survey->losses.empty());
}

TEST(MessageSource, GapsAndTimesThatGoBackAreTold) {
  Bag bag;
  for (const std::int64_t at : {0, 1, 5, 4, 6})
    bag.add("/imu", "sensor_msgs/msg/Imu", imu_at(kTime_ns + at * 100'000'000, "", 1.0));
  const auto samples = samples_of(bag.finish(), device_of(DeviceRole::kStudy));
  ASSERT_EQ(samples.size(), 4U);
  EXPECT_EQ(samples[1].imu.flags & kGapBefore, 0U);
  EXPECT_NE(samples[2].imu.flags & kGapBefore, 0U);
}

/// The velocity may stand before or after its position; one of another instant belongs to neither.
TEST(MessageSource, AVelocityMeetsThePositionOfItsInstant) {
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
    device.messages.velocity_topic = "/velocity";
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

TEST(MessageSource, SolutionsSayHowGoodTheyAre) {
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

TEST(MessageSource, ACovarianceThatIsInfiniteAlongOneAxisIsNone) {
  Bag bag;
  for (std::size_t axis = 0; axis < 4; ++axis) {
    mcap::NavSatFix fix;
    fix.header.stamp_ns = kTime_ns + 100'000'000 * static_cast<std::int64_t>(axis);
    fix.status = 2;
    fix.position_covariance = {0.0004, 0, 0, 0, 0.0004, 0, 0, 0, 0.0004};
    if (axis < 3) fix.position_covariance[4 * axis] = std::numeric_limits<double>::infinity();
    fix.position_covariance_type = 2;
    bag.add("/fix", "sensor_msgs/msg/NavSatFix", fix);
  }
  std::vector<GnssSolution> solutions;
  for (const auto& sample : samples_of(bag.finish(), device_of(DeviceRole::kGnss)))
    solutions.push_back(sample.gnss.solution);
  EXPECT_EQ(solutions, (std::vector<GnssSolution>{GnssSolution::kFloat, GnssSolution::kFloat,
                                                  GnssSolution::kFloat, GnssSolution::kFixed}));
}

TEST(MessageSource, SpeedsAndPulses) {
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

TEST(MessageSource, JsonAndCdrAreTheSame) {
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
  const auto survey = survey_messages(path, device);
  ASSERT_EQ(survey->losses.size(), 1U);
  EXPECT_NE(survey->losses[0].find("1 messages"), std::string::npos) << survey->losses[0];
}

/// The same numbers as tests/logs/rosbag has them, through the device.
TEST(MessageSource, ABagOfRos1IsADevice) {
  for (const char* compression : {"none", "lz4", "bz2"}) {
    const auto path = test::source_path(std::string("tests/vectors/bag_") + compression + ".bag");
    auto imu = device_of(DeviceRole::kStudy, "/imu/data");
    imu.protocol = Protocol::kRosbag;
    imu.rate_hz = 100.0;
    const auto samples = samples_of(path, imu);
    ASSERT_EQ(samples.size(), 50U);
    EXPECT_EQ(to_ns(samples[49].time), kTime_ns + 490'000'000);
    EXPECT_EQ(samples[49].imu.f_mps2, (Vector3{0.1, 0.2 * 49, 9.81}));
    auto gnss = device_of(DeviceRole::kGnss);
    gnss.protocol = Protocol::kRosbag;
    gnss.messages.velocity_topic = "/vel";
    const auto fixes = samples_of(path, gnss);
    ASSERT_EQ(fixes.size(), 5U);
    EXPECT_EQ(fixes[1].gnss.solution, GnssSolution::kFixed);
    EXPECT_EQ(fixes[1].gnss.v_n_mps, (Vector3{2, 1, -3}));
    auto time = device_of(DeviceRole::kTime);
    time.protocol = Protocol::kRosbag;
    EXPECT_EQ(samples_of(path, time).size(), 1U);
    auto wheels = device_of(DeviceRole::kOdometry);
    wheels.protocol = Protocol::kRosbag;
    EXPECT_EQ(samples_of(path, wheels).size(), 25U);
  }
}

TEST(MessageSource, AFlightLogIsADeviceWithItsVelocities) {
  for (const auto& [name, protocol, imu_topic, fix_topic] :
       {std::tuple{"ulog/flight.ulg", Protocol::kUlog, "vehicle_imu/1", "sensor_gps/0"},
        std::tuple{"dataflash/flight.bin", Protocol::kDataflash, "IMU/1", "GPS/0"}}) {
    SCOPED_TRACE(name);
    const auto path = test::source_path(std::string("tests/fuzz/seeds/") + name);
    auto imu = device_of(DeviceRole::kStudy, imu_topic);
    imu.protocol = protocol;
    imu.rate_hz = 100.0;
    const auto samples = samples_of(path, imu);
    ASSERT_EQ(samples.size(), 40U);
    EXPECT_NEAR(samples[39].imu.f_mps2[2], -9.80665, 1e-5);
    for (const char* topic : {fix_topic, ""}) {
      auto gnss = device_of(DeviceRole::kGnss, topic);
      gnss.protocol = protocol;
      gnss.rate_hz = 5.0;
      const auto fixes = samples_of(path, gnss);
      ASSERT_EQ(fixes.size(), 2U);
      EXPECT_NE(fixes[1].gnss.flags & kVelocityValid, 0U);
      EXPECT_EQ(fixes[1].gnss.solution, GnssSolution::kFixed);
      EXPECT_NEAR(fixes[1].gnss.height_m, 450.02, 0.006);
    }
    auto time = device_of(DeviceRole::kTime);
    time.protocol = protocol;
    const auto pulses = samples_of(path, time);
    ASSERT_EQ(pulses.size(), 2U);
    EXPECT_EQ(pulses[0].pulse.wall_ns, 1'700'000'000'000'000'000);
  }
}

TEST(MessageSource, AnotherKindOfFileIsNamed) {
  auto device = device_of(DeviceRole::kStudy);
  const auto wrong = survey_messages(test::source_path("tests/vectors/bag_lz4.bag"), device);
  ASSERT_FALSE(wrong);
  EXPECT_NE(wrong.error().what.find("is of rosbag, not of mcap"), std::string::npos) << wrong.error().what;
  EXPECT_NE(wrong.error().remedy.find("protocol = \"rosbag\""), std::string::npos);
}

/// A folder of rosbag2: its files in the order of metadata.yaml, and in no other.
class Rosbag2 : public testing::Test {
 protected:
  void SetUp() override { folder_ = test::scratch_folder(); }
  void add_part(const std::string& name, int first) {
    Bag bag;
    for (int i = first; i < first + 3; ++i)
      bag.add("/imu", "sensor_msgs/msg/Imu", imu_at(kTime_ns + i * 100'000'000, "imu", i));
    std::filesystem::copy_file(bag.finish(), folder_ / name);
  }
  void describe(const std::string& files) {
    std::ofstream(folder_ / "metadata.yaml")
        << "rosbag2_bagfile_information:\n  version: 5\n  storage_identifier: mcap\n  duration:\n    "
           "nanoseconds: 1\n"
           "  relative_file_paths:\n"
        << files << "  files:\n    - path: b_0.mcap\n      message_count: 3\n";
  }
  std::filesystem::path folder_;
};

TEST_F(Rosbag2, AFolderIsItsFilesInTheirOrder) {
  add_part("b_0.mcap", 0);
  add_part("b_1.mcap", 3);
  add_part("stray.mcap", 9);
  // Early versions wrote the folder's name before the file's; nothing leads out of the folder.
  describe("    - b_0.mcap\n    - \"old_name/b_1.mcap\"\n");
  const auto samples = samples_of(folder_, device_of(DeviceRole::kStudy));
  ASSERT_EQ(samples.size(), 6U);
  for (std::size_t i = 0; i < samples.size(); ++i)
    EXPECT_EQ(samples[i].imu.omega_radps[0], static_cast<double>(i));
}

TEST_F(Rosbag2, WhatCannotBeReadSaysWhatToDo) {
  const auto error = [&] {
    const auto survey = survey_messages(folder_, device_of(DeviceRole::kStudy));
    return survey ? std::string("none") : survey.error().text();
  };
  EXPECT_NE(error().find("without metadata.yaml"), std::string::npos) << error();
  describe("    - b_0.db3\n");
  EXPECT_NE(error().find("mcap convert"), std::string::npos) << error();
  describe("    - b_0.mcap.zstd\n");
  EXPECT_NE(error().find("zstd -d"), std::string::npos) << error();
  describe("    - ../../etc/passwd\n");
  EXPECT_NE(error().find("no such file"), std::string::npos) << error();
  describe("");
  EXPECT_NE(error().find("names no file"), std::string::npos) << error();
  std::ofstream(folder_ / "b.db3", std::ios::binary) << "SQLite format 3" << '\0' << "more";
  const auto survey = survey_messages(folder_ / "b.db3", device_of(DeviceRole::kStudy));
  ASSERT_FALSE(survey);
  EXPECT_NE(survey.error().text().find("SQLite"), std::string::npos);
}

TEST(MessageSource, NamesOfAStrangerAreText) {
  Bag bag;
  bag.add("/a\x1b[2J\nb", "sensor_msgs/msg/Imu", imu_at(kTime_ns, "f\x1b]0;x\x07", 1.0));
  bag.add("/c", "sensor_msgs/msg/Imu", imu_at(kTime_ns, "g", 1.0));
  const auto path = bag.finish();
  auto device = device_of(DeviceRole::kStudy);
  const auto choice = survey_messages(path, device);
  ASSERT_FALSE(choice);
  device.messages.topic = "/absent";
  const auto absent = survey_messages(path, device);
  ASSERT_FALSE(absent);
  device.messages.topic = "/a\x1b[2J\nb";
  device.messages.frame_id = "none";
  const auto frame = survey_messages(path, device);
  ASSERT_FALSE(frame);
  for (const auto* error : {&choice.error(), &absent.error()}) {
    for (const char c : error->text()) EXPECT_TRUE(static_cast<unsigned char>(c) >= ' ') << error->text();
  }
  EXPECT_EQ(frame.error().remedy.find('\x1b'), std::string::npos);
}

}  // namespace
}  // namespace imuscope
