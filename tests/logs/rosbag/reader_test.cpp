/// Bags that Debian's python3-rosbag wrote (tests/vectors/make_bags.py), whole, cut, damaged and hostile.

#include "logs/rosbag/reader.h"

#include <gtest/gtest.h>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <map>

#include "logs/mcap/ros_messages.h"
#include "tests/support/messages_text.h"
#include "tests/support/recorded_answer.h"
#include "tests/support/shared_data.h"
#include "tests/support/temporary_file.h"

namespace imuscope::rosbag {
namespace {

constexpr std::int64_t kBegin_ns = 1'700'000'000'250'000'000;
constexpr int kImus = 50;

std::string bag(const std::string& compression) {
  std::ifstream in(test::source_path("tests/vectors/bag_" + compression + ".bag"), std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

using test::TemporaryFile;

struct Kept {
  std::map<std::string, std::vector<std::string>> topics;
  std::vector<std::string> order;
  std::vector<std::string> losses;
  std::string error;
};

Kept read_bag(const std::string& content) {
  const TemporaryFile file(content);
  auto reader = Reader::open(file.path());
  Kept kept;
  if (!reader) {
    kept.error = reader.error().text();
    return kept;
  }
  while (const auto message = reader->next()) {
    kept.topics[message->topic->name].emplace_back(mcap::text_of(message->data));
    kept.order.emplace_back(mcap::text_of(message->data));
  }
  kept.losses = reader->losses();
  return kept;
}

bool says(const std::vector<std::string>& losses, const std::string& words) {
  return std::any_of(losses.begin(), losses.end(),
                     [&](const std::string& loss) { return loss.find(words) != std::string::npos; });
}

TEST(Rosbag, EveryMessageComesWithItsNumbers) {
  for (const char* compression : {"none", "lz4", "bz2"}) {
    SCOPED_TRACE(compression);
    const TemporaryFile file(bag(compression));
    auto reader = Reader::open(file.path());
    ASSERT_TRUE(reader) << reader.error().text();
    int imus = 0, fixes = 0, twists = 0, wheels = 0, times = 0;
    while (const auto message = reader->next()) {
      const std::string& topic = message->topic->name;
      EXPECT_EQ(message->topic->encoding, "ros1");
      if (topic == "/imu/data") {
        mcap::Imu imu;
        ASSERT_TRUE(mcap::read(message->data, imu, mcap::Wire::kRos1));
        EXPECT_EQ(message->topic->schema, "sensor_msgs/Imu");
        EXPECT_EQ(imu.header.stamp_ns, kBegin_ns + imus * 10'000'000);
        EXPECT_EQ(message->log_time, static_cast<std::uint64_t>(imu.header.stamp_ns + 2'000'000));
        EXPECT_EQ(imu.header.frame_id, "imu_link");
        EXPECT_EQ(imu.angular_velocity, (mcap::Vector{0.01 * imus, -0.5, imu.angular_velocity[2]}));
        EXPECT_NEAR(imu.angular_velocity[2], std::sin(0.1 * imus), 1e-15);
        EXPECT_EQ(imu.linear_acceleration, (mcap::Vector{0.1, 0.2 * imus, 9.81}));
        EXPECT_EQ(imu.orientation_covariance[0], -1.0);
        ++imus;
      } else if (topic == "/fix") {
        mcap::NavSatFix fix;
        ASSERT_TRUE(mcap::read(message->data, fix, mcap::Wire::kRos1));
        EXPECT_EQ(fix.status, 2);
        EXPECT_EQ(fix.latitude_deg, 45.0 + 1e-6 * (10 * fixes));
        EXPECT_EQ(fix.altitude_m, 300.0 + 10 * fixes);
        EXPECT_EQ(fix.position_covariance[8], 4e-4);
        EXPECT_EQ(fix.position_covariance_type, 2);
        ++fixes;
      } else if (topic == "/vel") {
        mcap::TwistStamped twist;
        ASSERT_TRUE(mcap::read(message->data, twist, mcap::Wire::kRos1));
        EXPECT_EQ(twist.linear_mps, (mcap::Vector{1, 2, 3}));
        ++twists;
      } else if (topic == "/odom") {
        mcap::Odometry odometry;
        ASSERT_TRUE(mcap::read(message->data, odometry, mcap::Wire::kRos1));
        EXPECT_EQ(odometry.child_frame_id, "base_link");
        EXPECT_EQ(odometry.linear_mps[0], 0.5 * wheels);
        ++wheels;
      } else if (topic == "/time") {
        mcap::TimeReference reference;
        ASSERT_TRUE(mcap::read(message->data, reference, mcap::Wire::kRos1));
        EXPECT_EQ(reference.time_ref_ns, kBegin_ns - 252'000'000);
        ++times;
      }
    }
    EXPECT_EQ(imus, kImus);
    EXPECT_EQ(fixes, 5);
    EXPECT_EQ(twists, 5);
    EXPECT_EQ(wheels, 25);
    EXPECT_EQ(times, 1);
    EXPECT_TRUE(reader->losses().empty()) << reader->losses().front();
  }
}

TEST(Rosbag, WithoutIndexEverythingIsThereAndThatItWasNotClosedIsSaid) {
  for (const char* compression : {"none", "lz4", "bz2"}) {
    std::string content = bag(compression);
    const auto whole = read_bag(content);
    // As a recorder that was killed leaves it: where the index will be is not written yet.
    const auto at = content.find("index_pos=");
    ASSERT_NE(at, std::string::npos);
    std::memset(content.data() + at + 10, 0, 8);
    const auto read = read_bag(content);
    EXPECT_EQ(read.topics, whole.topics);
    EXPECT_TRUE(says(read.losses, "was not closed"));
  }
}

TEST(Rosbag, OfACutBagWhatStandsBeforeTheCutIsUsed) {
  for (const char* compression : {"none", "lz4", "bz2"}) {
    SCOPED_TRACE(compression);
    const std::string content = bag(compression);
    const auto whole = read_bag(content);
    std::size_t before = 0;
    for (std::size_t size = kMagic.size(); size < content.size(); size += 131) {
      const auto read = read_bag(content.substr(0, size));
      ASSERT_TRUE(read.error.empty());
      // Where the index alone was cut, no message is missing.
      EXPECT_TRUE(!read.losses.empty() || read.order.size() == whole.order.size()) << size;
      ASSERT_LE(read.order.size(), whole.order.size());
      EXPECT_GE(read.order.size(), before) << size;
      before = read.order.size();
      EXPECT_TRUE(std::equal(read.order.begin(), read.order.end(), whole.order.begin())) << size;
    }
    EXPECT_EQ(before, whole.order.size());
  }
}

TEST(Rosbag, BehindDamageTheIndexLeadsOn) {
  for (const char* compression : {"none", "lz4", "bz2"}) {
    SCOPED_TRACE(compression);
    const std::string content = bag(compression);
    const auto whole = read_bag(content);
    std::string damaged = content;
    std::memset(damaged.data() + content.size() * 2 / 5, 0x5A, 600);
    const auto read = read_bag(damaged);
    EXPECT_FALSE(read.losses.empty());
    EXPECT_LT(read.order.size(), whole.order.size());
    EXPECT_GT(read.order.size(), whole.order.size() / 3);
    EXPECT_EQ(read.order.back(), whole.order.back()) << "the last chunk is whole";
  }
}

std::string sized(const std::string& text) {
  std::string out;
  const auto n = static_cast<std::uint32_t>(text.size());
  for (unsigned i = 0; i < 4; ++i) out += static_cast<char>(n >> (8 * i) & 0xFFU);
  return out + text;
}

std::string number32(std::uint32_t n) { return sized(std::string(n, ' ')).substr(0, 4); }

std::string chunk(const std::string& compression, const std::string& size, const std::string& data) {
  return std::string(kMagic) +
         sized(sized("op=\x05") + sized("compression=" + compression) + sized("size=" + size)) + sized(data);
}

TEST(Rosbag, ChunksThatClaimTooMuchAreRefusedBeforeMemoryIsMade) {
  const std::string huge = "\xFF\xFF\xFF\xFF";
  EXPECT_TRUE(says(read_bag(chunk("none", huge, "abc")).losses, "more than is read"));
  const std::string bomb("\x00\x00\x00\x0F", 4);  // 240 MiB of three bytes
  for (const char* compression : {"lz4", "bz2", "none"})
    EXPECT_TRUE(says(read_bag(chunk(compression, bomb, "abc")).losses, "thousand times"));
  EXPECT_TRUE(says(read_bag(chunk("7z", number32(3), "abc")).losses, "packed by '7z'"));
  // A length that leads beyond the end.
  EXPECT_TRUE(says(read_bag(std::string(kMagic) + "\xFF\xFF\xFF\x7F" + "some bytes").losses, "damaged"));
}

TEST(Rosbag, WhatIsNoBagIsRefused) {
  EXPECT_NE(read_bag("time,value\n1,2\n").error.find("no bag of ROS 1"), std::string::npos);
  EXPECT_NE(read_bag("").error.find("no bag of ROS 1"), std::string::npos);
  EXPECT_NE(read_bag("#ROSRECORD V1.1\n").error.find("another version"), std::string::npos);
  EXPECT_FALSE(Reader::open("/nowhere/at_all.bag"));
  EXPECT_FALSE(Reader::open("/tmp"));
}

TEST(RosbagWhole, MessagesOfEveryKind) {
  std::string text;
  for (const char* compression : {"none", "lz4", "bz2"}) {
    const std::string all = test::whole_log_text<Reader>(bag(compression));
    text += all.substr(0, 12'000) + "...\n" + all.substr(all.size() - 1'500);
  }
  test::expect_recorded("logs/rosbag.txt", text);
}

TEST(RosbagWhole, DamageAndCuts) {
  std::string text;
  for (const char* compression : {"none", "lz4", "bz2"}) {
    const std::string whole = bag(compression);
    const std::size_t step = whole.size() / 260;
    text += std::string(compression) + '\n' +
            test::damaged_log_text<Reader>(whole.size(), step, [&](std::size_t at) {
              std::string bytes = whole;
              bytes[at] = static_cast<char>(bytes[at] ^ 0x15);
              return bytes;
            });
    text += "cut\n" + test::damaged_log_text<Reader>(whole.size(), 3 * step,
                                                     [&](std::size_t at) { return whole.substr(0, at); });
  }
  // The heads, byte by byte.
  const std::string whole = bag("lz4");
  text += "heads\n" + test::damaged_log_text<Reader>(200, 1, [&](std::size_t at) {
            std::string bytes = whole;
            bytes[at] = static_cast<char>(bytes[at] ^ 0x15);
            return bytes;
          });
  text += "first chunk\n" + test::damaged_log_text<Reader>(120, 1, [&](std::size_t at) {
            std::string bytes = whole;
            const std::size_t place = 4096 + 13 + at;
            bytes[place] = static_cast<char>(bytes[place] + 1);
            return bytes;
          });
  text += "end\n" + test::damaged_log_text<Reader>(400, 3, [&](std::size_t at) {
            std::string bytes = whole;
            const std::size_t place = whole.size() - 1 - at;
            bytes[place] = static_cast<char>(bytes[place] ^ 0x15);
            return bytes;
          });
  test::expect_recorded("logs/rosbag_damage.txt", text);
}

}  // namespace
}  // namespace imuscope::rosbag
