/// The messages of a bag, held against the equations of the sensor and of the frames, which stand here again.

#include "logs/bag/bag_writer.h"

#include <gtest/gtest.h>
#include <unistd.h>
#include <Eigen/Geometry>
#include <filesystem>
#include <fstream>
#include <functional>

#include "logs/mcap/reader.h"
#include "tests/support/messages_text.h"
#include "tests/support/recorded_answer.h"

namespace imuscope::bag {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr std::int64_t kTime_ns = 1'700'000'000'123'456'789;

struct InBag {
  std::string topic;
  std::string schema;
  std::uint64_t log_time;
  std::string data;
};

/// What `fill` puts into a bag of three devices.
template <typename Fill>
std::vector<InBag> bag_of(Fill&& fill) {
  const auto path = std::filesystem::temp_directory_path() / ("bag_test_" + std::to_string(::getpid()));
  {
    std::ofstream out(path, std::ios::binary);
    BagWriter writer({"ros2", "test"}, [&out](std::string_view bytes) { out << bytes; },
                     {"airins", "mtx1", "gnss"});
    fill(writer);
    writer.finish();
  }
  std::vector<InBag> messages;
  auto reader = mcap::Reader::open(path);
  EXPECT_TRUE(reader);
  while (const auto message = reader->next())
    messages.push_back({message->topic->name, message->topic->schema, message->log_time,
                        std::string(mcap::text_of(message->data))});
  EXPECT_TRUE(reader->losses().empty());
  std::filesystem::remove(path);
  return messages;
}

template <typename Message>
Message read_as(const InBag& in) {
  Message message;
  EXPECT_TRUE(mcap::read(mcap::bytes_of(in.data), message));
  return message;
}

Matrix3d some_mounting() {
  return (Eigen::AngleAxisd(1.2, Vector3d::UnitZ()) * Eigen::AngleAxisd(-0.3, Vector3d::UnitY()) *
          Eigen::AngleAxisd(2.1, Vector3d::UnitX()))
      .toRotationMatrix();
}

Rotation row_major(const Matrix3d& m) {
  Rotation out{};
  Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(out.data()) = m;
  return out;
}

Sample imu_sample(DeviceIndex device, const Vector3d& rate, const Vector3d& force) {
  Sample sample{};
  sample.kind = SampleKind::kImu;
  sample.device = device;
  sample.imu = ImuData{};
  sample.imu.flags = kGyroValid | kAccelValid;
  sample.imu.omega_radps = {rate.x(), rate.y(), rate.z()};
  sample.imu.f_mps2 = {force.x(), force.y(), force.z()};
  return sample;
}

TEST(Bag, ACorrectedSampleIsTheVehiclesMotionForwardLeftUp) {
  const Matrix3d C = some_mounting();
  const Vector3d rate_b(0.1, -0.2, 0.7), force_b(0.5, 1.5, -9.7);
  Correction correction;
  correction.C_b_s = row_major(C);
  correction.gyro_bias_radps = {0.01, -0.02, 0.03};
  correction.accel_bias_mps2 = {0.1, 0.2, -0.3};
  correction.gyro_scale = {0.01, 0.02, -0.03};
  correction.accel_scale = {-0.01, 0.005, 0.002};
  correction.t_d_s = -0.004;
  // What such a sensor says: (1 + s) C v + b.
  const auto says = [&](const Vector3d& v, const Vector3& scale, const Vector3& bias) {
    const Vector3d s = C * v;
    return Vector3d((1 + scale[0]) * s.x() + bias[0], (1 + scale[1]) * s.y() + bias[1],
                    (1 + scale[2]) * s.z() + bias[2]);
  };
  const auto sample = imu_sample(1, says(rate_b, correction.gyro_scale, correction.gyro_bias_radps),
                                 says(force_b, correction.accel_scale, correction.accel_bias_mps2));
  const WhiteVariance variance{{1e-4, 2e-4, 3e-4}, {1e-2, 2e-2, 3e-2}};
  const auto messages =
      bag_of([&](BagWriter& bag) { bag.add_corrected(sample, kTime_ns, correction, variance); });
  ASSERT_EQ(messages.size(), 1U);
  EXPECT_EQ(messages[0].topic, "/imu/mtx1/corrected");
  EXPECT_EQ(messages[0].schema, "sensor_msgs/msg/Imu");
  const auto imu = read_as<mcap::Imu>(messages[0]);
  EXPECT_EQ(imu.header.frame_id, "mtx1_aligned");
  EXPECT_EQ(imu.header.stamp_ns, kTime_ns - 4'000'000);
  EXPECT_EQ(messages[0].log_time, static_cast<std::uint64_t>(kTime_ns - 4'000'000));
  const double turn[] = {1.0, -1.0, -1.0};
  for (int i = 0; i < 3; ++i) {
    EXPECT_NEAR(imu.angular_velocity[static_cast<std::size_t>(i)], turn[i] * rate_b[i], 1e-12);
    EXPECT_NEAR(imu.linear_acceleration[static_cast<std::size_t>(i)], turn[i] * force_b[i], 1e-12);
  }
  EXPECT_EQ(imu.orientation_covariance[0], mcap::kNotMeasured);
  // The covariance turns with the axes: its trace stays but for the scales, and along s it is the variance
  // again.
  const Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>> P(
      imu.angular_velocity_covariance.data());
  const Matrix3d flu_to_s = C * Vector3d(1, -1, -1).asDiagonal();
  const Matrix3d in_s = flu_to_s * P * flu_to_s.transpose();
  for (int i = 0; i < 3; ++i) {
    const auto at = static_cast<std::size_t>(i);
    const double gain = 1.0 + correction.gyro_scale[at];
    EXPECT_NEAR(in_s(i, i), variance.gyro[at] / (gain * gain), 1e-15);
  }
  EXPECT_NEAR(in_s(0, 1), 0.0, 1e-15);
}

TEST(Bag, ARawSampleIsAsItCame) {
  const auto sample = imu_sample(0, {1, 2, 3}, {4, 5, 6});
  auto half = sample;
  half.imu.flags = kGyroValid;
  const auto messages = bag_of([&](BagWriter& bag) {
    bag.add_sample(sample, kTime_ns);
    bag.add_sample(half, kTime_ns + 1);
  });
  ASSERT_EQ(messages.size(), 2U);
  EXPECT_EQ(messages[0].topic, "/imu/airins/raw");
  const auto imu = read_as<mcap::Imu>(messages[0]);
  EXPECT_EQ(imu.angular_velocity, (mcap::Vector{1, 2, 3}));
  EXPECT_EQ(imu.linear_acceleration, (mcap::Vector{4, 5, 6}));
  EXPECT_EQ(imu.angular_velocity_covariance, mcap::Covariance3{}) << "nobody told it";
  EXPECT_EQ(read_as<mcap::Imu>(messages[1]).linear_acceleration_covariance[0], mcap::kNotMeasured);
}

TEST(Bag, ASolutionIsEastNorthUpAndItsVelocityComesFirst) {
  Sample sample{};
  sample.kind = SampleKind::kGnss;
  sample.device = 2;
  sample.gnss = GnssData{0.8,
                         0.1,
                         450.0,
                         {1, 2, 3},
                         {0.1, 0.2, 0.3},
                         {0.4, 0.5, 0.6},
                         GnssSolution::kFixed,
                         kPositionValid | kVelocityValid | kHasPositionSd | kHasVelocitySd};
  const auto messages = bag_of([&](BagWriter& bag) { bag.add_sample(sample, kTime_ns); });
  ASSERT_EQ(messages.size(), 2U);
  EXPECT_EQ(messages[0].topic, "/gnss/gnss/velocity");
  const auto twist = read_as<mcap::TwistStamped>(messages[0]);
  EXPECT_EQ(twist.linear_mps, (mcap::Vector{2, 1, -3}));
  EXPECT_DOUBLE_EQ(twist.covariance[0], 0.25);
  EXPECT_DOUBLE_EQ(twist.covariance[7], 0.16);
  const auto fix = read_as<mcap::NavSatFix>(messages[1]);
  EXPECT_EQ(fix.status, 2);
  EXPECT_DOUBLE_EQ(fix.position_covariance[0], 0.04);
  EXPECT_DOUBLE_EQ(fix.position_covariance[4], 0.01);
}

TEST(Bag, NavigationHeadsWhereTheVehicleDoes) {
  Navigation at;
  at.latitude_deg = 46.0;
  at.longitude_deg = 7.0;
  at.v_n_mps = {0.0, 10.0, 0.0};  // east
  at.rpy_rad = {0.0, 0.0, M_PI / 2.0};
  Navigation later = at;
  later.longitude_deg += 1e-4;
  const auto messages = bag_of([&](BagWriter& bag) {
    bag.add_navigation(at, kTime_ns);
    bag.add_navigation(later, kTime_ns + 1);
  });
  ASSERT_EQ(messages.size(), 4U);
  const auto odometry = read_as<mcap::Odometry>(messages[2]);
  // A degree of longitude at 46 degrees north is 77.467 km (WGS-84).
  EXPECT_NEAR(odometry.position_m[0], 7.7467, 1e-3);
  EXPECT_NEAR(odometry.position_m[1], 0.0, 1e-9);
  EXPECT_NEAR(odometry.linear_mps[0], 10.0, 1e-9) << "forwards";
  EXPECT_NEAR(odometry.linear_mps[1], 0.0, 1e-9);
  // East is x of the map, so a vehicle that heads there is not turned.
  EXPECT_NEAR(odometry.orientation[3], 1.0, 1e-12);
}

// Everything that a bag may hold, as it once was written.

/// The file itself, record by record, byte by byte.
std::string bytes_of_bag(const std::function<void(BagWriter&)>& fill) {
  std::string file;
  BagWriter writer({"ros2", "test", mcap::Compression::kNone},
                   [&file](std::string_view bytes) { file += bytes; }, {"airins", "mtx1", "gnss"});
  fill(writer);
  writer.finish();
  std::string text;
  mcap::Bytes rest = mcap::bytes_of(file).subspan(mcap::kMagic.size());
  for (auto record = mcap::record_at(rest); record; record = mcap::record_at(rest)) {
    text += fmt::format("{}:", static_cast<int>(record->opcode));
    for (const std::uint8_t byte : record->content) text += fmt::format(" {:02x}", byte);
    text += '\n';
    rest = rest.subspan(record->size);
  }
  return text;
}

std::string content_of_bag(const std::function<void(BagWriter&)>& fill) {
  std::string file;
  BagWriter writer({"ros2", "test", mcap::Compression::kNone},
                   [&file](std::string_view bytes) { file += bytes; }, {"airins", "mtx1", "gnss"});
  fill(writer);
  writer.finish();
  return test::whole_log_text<mcap::Reader>(file) + fmt::format("{} messages\n", writer.messages());
}

Sample sample_of(SampleKind kind, DeviceIndex device) {
  Sample sample{};
  sample.kind = kind;
  sample.device = device;
  return sample;
}

Navigation some_navigation(int i) {
  Navigation at;
  at.latitude_deg = 46.0 + 1e-4 * i;
  at.longitude_deg = 179.9999 + 1e-4 * i - (i > 0 ? 360.0 : 0.0);
  at.height_m = 450.0 - i;
  at.v_n_mps = {1.5, 10.0 - i, -0.25};
  at.rpy_rad = {0.1, -0.2, 0.7 + i};
  at.sd_position_m = {0.1, 0.2, 0.3};
  at.sd_velocity_mps = {0.01, i == 0 ? 0.02 : 0.005, 0.03};
  at.sd_rpy_rad = {0.001, 0.002, 0.003};
  return at;
}

TEST(BagWhole, SamplesOfEveryKind) {
  std::string text = content_of_bag([](BagWriter& bag) {
    Sample imu = imu_sample(1, {1, 2, 3}, {4, 5, 6});
    for (const std::uint32_t flags : {std::uint32_t{kGyroValid}, std::uint32_t{kAccelValid}, std::uint32_t{0},
                                      std::uint32_t{kGyroValid | kAccelValid}}) {
      imu.imu.flags = flags;
      bag.add_sample(imu, kTime_ns, {{1e-4, 2e-4, 3e-4}, {1e-2, 2e-2, 3e-2}});
      Correction correction;
      correction.C_b_s = row_major(some_mounting());
      correction.gyro_bias_radps = {0.01, -0.02, 0.03};
      correction.accel_bias_mps2 = {0.1, 0.2, -0.3};
      correction.gyro_scale = {0.01, 0.02, -0.03};
      correction.accel_scale = {-0.01, 0.005, 0.002};
      correction.t_d_s = -0.004;
      bag.add_corrected(imu, kTime_ns, correction, {{1e-4, 2e-4, 3e-4}, {1e-2, 2e-2, 3e-2}});
    }
    Sample gnss = sample_of(SampleKind::kGnss, 2);
    for (std::uint32_t flags = 0; flags < 16; ++flags) {
      gnss.gnss = GnssData{
          0.8,  0.1, 450.0, {1, 2, 3}, {0.1, 0.2, 0.3}, {0.4, 0.5, 0.6}, static_cast<GnssSolution>(flags % 5),
          flags};
      bag.add_sample(gnss, kTime_ns + static_cast<std::int64_t>(flags));
    }
    Sample wheels = sample_of(SampleKind::kOdometry, 0);
    wheels.odometry = {13.5, 0};
    bag.add_sample(wheels, kTime_ns);
    Sample pulse = sample_of(SampleKind::kPulse, 2);
    for (const std::int64_t off_ns : {std::int64_t{0}, std::int64_t{499'999'999}, std::int64_t{500'000'000},
                                      std::int64_t{-1}, std::int64_t{-500'000'001}}) {
      pulse.pulse.wall_ns = 1'700'000'000'000'000'000 + off_ns;
      bag.add_sample(pulse, -5);
    }
    bag.add_sample(sample_of(SampleKind::kAttitude, 0), kTime_ns);
    bag.add_sample(sample_of(SampleKind::kSteering, 0), kTime_ns);
    for (int i = 0; i < 3; ++i) bag.add_navigation(some_navigation(i), kTime_ns + i);
    bag.add_message("/imuscope/navigation", "navigation_t", "{}", -3);
    bag.add_message("/imuscope/navigation", "navigation_t", "{\"a\":1}", 7);
    bag.add_message("/imuscope/other", "navigation_t", "{}", 8);
  });
  test::expect_recorded("logs/bag_samples.txt", text, 1e-8);
}

TEST(BagWhole, MountingsByteByByte) {
  Mounting good;
  good.name = "mtx1";
  good.C_b_s = {0, 1, 0, 0, 0, 1, 1, 0, 0};
  good.r_bs_b_m = {1.5, -2.5, 0.25};
  good.t_d_s = -0.0123;
  good.sd_boresight_rad = {0.01, 0.02, 0.03};
  good.sd_r_bs_b_m = {0.001, 0.002, 0.003};
  good.sd_t_d_s = 0.0005;
  good.status = "calibrated";
  good.is_usable = true;
  Mounting poor = good;
  poor.name = "mtx2";
  poor.is_usable = false;
  const auto fill = [&](BagWriter& bag) {
    bag.add_mountings({good, poor}, "airins", 1'000'000'002);
    bag.attach("a.txt", "text/plain", -4, "content");
    bag.attach("b.txt", "text/plain", 9, "content");
    bag.end_chunk();
  };
  test::expect_recorded("logs/bag_mountings.txt", bytes_of_bag(fill));
}

}  // namespace
}  // namespace imuscope::bag
