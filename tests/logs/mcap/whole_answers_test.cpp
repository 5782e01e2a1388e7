// Whole files as they are written and read, held as they once were.
#include <gtest/gtest.h>

#include "files.h"
#include "logs/mcap/ros_messages.h"
#include "tests/support/messages_text.h"
#include "tests/support/recorded_answer.h"

namespace imuscope::mcap {
namespace {

using test::expect_recorded;

std::string hex(Bytes bytes) {
  std::string text;
  for (const std::uint8_t byte : bytes) text += fmt::format(" {:02x}", byte);
  return text;
}

/// Record by record, each with its content byte by byte.
std::string records_text(std::string_view file) {
  std::string text;
  Bytes rest = bytes_of(file);
  text += hex(rest.first(kMagic.size())) + '\n';
  rest = rest.subspan(kMagic.size());
  for (auto record = record_at(rest); record; record = record_at(rest)) {
    text += fmt::format("{}:{}\n", static_cast<int>(record->opcode), hex(record->content));
    rest = rest.subspan(record->size);
  }
  return text + hex(rest) + '\n';
}

std::string small_file(std::size_t chunk_bytes, bool packs_beside) {
  std::string file;
  WriterOptions options{"ros2", "test", Compression::kNone, chunk_bytes};
  options.packs_beside = packs_beside;
  Writer writer(options, [&file](std::string_view bytes) { file += bytes; });
  const auto schema = writer.add_schema("a/msg/Text", "ros2msg", "string text\n");
  const auto unused = writer.add_schema("b", "jsonschema", "{}");
  const auto first = writer.add_channel("/first", schema, "cdr");
  const auto second = writer.add_channel("/second", 0, "json", {{"key", "value"}, {"other", ""}});
  const auto third = writer.add_channel("/third", unused, "json");
  for (const auto& [channel, time] : std::vector<std::pair<ChannelId, std::uint64_t>>{
           {first, 50}, {second, 40}, {first, 70}, {first, 60}, {second, 30}, {third, 90}, {third, 20}})
    writer.write(channel, time, time + 1, bytes_of("abc"));
  writer.end_chunk();
  writer.end_chunk();
  writer.write(first, 80, 81, bytes_of("defg"));
  writer.attach("note.txt", "text/plain", 5, "attached");
  writer.add_metadata("run", {{"name", "test"}});
  writer.attach("more.txt", "text/plain", 6, "");
  writer.add_metadata("more", {});
  writer.finish();
  EXPECT_EQ(writer.messages(), 8U);
  return file;
}

TEST(McapWhole, FilesByteByByte) {
  std::string text = records_text(small_file(60, false)) + records_text(small_file(1000, false));
  EXPECT_EQ(small_file(60, false), small_file(60, true));
  std::string empty;
  Writer writer({"", "test", Compression::kNone}, [&empty](std::string_view bytes) { empty += bytes; });
  writer.finish();
  text += records_text(empty);
  expect_recorded("logs/mcap_bytes.txt", text);
}

TEST(McapWhole, FilesOfEveryCompressionAreReadAlike) {
  for (const Compression compression : {Compression::kNone, Compression::kZstd, Compression::kLz4}) {
    const std::string file = written(compression, 200);
    const auto read = read_file(file);
    ASSERT_EQ(read.messages.size(), 200U);
    EXPECT_TRUE(read.losses.empty());
    for (int i = 0; i < 200; ++i) EXPECT_EQ(read.messages[static_cast<std::size_t>(i)].data, data_of(i));
    EXPECT_EQ(compression_of(name_of(compression)), compression);
  }
  EXPECT_FALSE(compression_of("bz2"));
}

TEST(McapWhole, PackedAndUnpackedAtEverySize) {
  for (const Compression compression : {Compression::kNone, Compression::kZstd, Compression::kLz4}) {
    for (const std::size_t size : {1U, 1000U, (4U << 20U) - 1U, 4U << 20U, (4U << 20U) + 1U}) {
      std::string content(size, 'x');
      for (std::size_t i = 0; i < size; i += 7) content[i] = static_cast<char>(i * i);
      Packer packer(compression);
      std::string packed;
      packer.pack(content, packed);
      std::string out = "left over";
      EXPECT_TRUE(unpack(compression, bytes_of(packed), size, out)) << size;
      EXPECT_EQ(out, content);
      EXPECT_FALSE(unpack(compression, bytes_of(packed), size + 1, out)) << size;
      EXPECT_LE(out.size(), size);
      EXPECT_FALSE(unpack(compression, bytes_of(packed).first(packed.size() / 2), size, out)) << size;
      if (compression != Compression::kLz4) {
        EXPECT_FALSE(unpack(compression, bytes_of(packed), size - 1, out)) << size;
      }
      packed += packed;
      if (compression == Compression::kZstd) {
        EXPECT_TRUE(unpack(compression, bytes_of(packed), 2 * size, out)) << "frame behind frame";
        EXPECT_EQ(out, content + content);
      }
    }
  }
}

TEST(McapWhole, DamageAndCutsAtEveryPlace) {
  std::string text;
  const std::string small = small_file(60, false);
  text += test::damaged_log_text<Reader>(small.size(), 1, [&](std::size_t at) {
    std::string bytes = small;
    bytes[at] = static_cast<char>(bytes[at] ^ 0x15);
    return bytes;
  });
  text += "cut\n" + test::damaged_log_text<Reader>(small.size(), 1,
                                                   [&](std::size_t at) { return small.substr(0, at); });
  text += "longer\n" + test::damaged_log_text<Reader>(small.size(), 5, [&](std::size_t at) {
            return small.substr(0, at) + "xyz" + small.substr(at);
          });
  expect_recorded("logs/mcap_damage.txt", text);
}

// ------------------------------------------------------------------------------------- messages of ROS

template <std::size_t N>
std::array<double, N> counting(double from) {
  std::array<double, N> values;
  for (std::size_t i = 0; i < N; ++i) values[i] = from + static_cast<double>(i);
  return values;
}

template <typename Message>
void add_both_ways(const Message& message, std::string& text) {
  CdrWriter out;
  write(out, message);
  text += hex(out.bytes()) + '\n' + test::ros_text<Message>(out.bytes(), Wire::kCdr) + '\n';
  // Cut at every place.
  for (std::size_t size = 0; size < out.bytes().size(); ++size) {
    Message back;
    if (read(out.bytes().first(size), back)) text += fmt::format("good at {}\n", size);
  }
}

TEST(McapWhole, MessagesOfRosByteByByte) {
  std::string text;
  add_both_ways(Imu{{-1, "imu"},
                    {1, 2, 3, 4},
                    counting<9>(10),
                    {5, 6, 7},
                    counting<9>(20),
                    {8, 9, 10},
                    counting<9>(30)},
                text);
  add_both_ways(NavSatFix{{1'500'000'000'123'456'789, "gnss"}, 2, 3, 45.5, -7.25, 300.5, counting<9>(1), 2},
                text);
  add_both_ways(Odometry{{-1'500'000'001, "map"},
                         "base",
                         {1, 2, 3},
                         {4, 5, 6, 7},
                         counting<36>(100),
                         {8, 9, 10},
                         {11, 12, 13},
                         counting<36>(200)},
                text);
  add_both_ways(TwistStamped{{999'999'999, "a"}, {1, 2, 3}, {4, 5, 6}, counting<36>(1)}, text);
  add_both_ways(TimeReference{{1'000'000'000, ""}, -2'000'000'001, "gps"}, text);
  CdrWriter out;
  write(out, std::vector<Transform>{{{1, "a"}, "bc", {1, 2, 3}, {4, 5, 6, 7}},
                                    {{2, "def"}, "g", {1, 2, 3}, {4, 5, 6, 7}}});
  text += hex(out.bytes()) + '\n';
  write_diagnostics(out, {3, "d"},
                    {{1, "name", "message", "id", {{"key", "value"}, {"k", ""}}}, {2, "n", "m", "i", {}}});
  text += hex(out.bytes()) + '\n';
  for (const char* type : {"sensor_msgs/Imu", "sensor_msgs/NavSatFix", "sensor_msgs/TimeReference",
                           "nav_msgs/Odometry", "geometry_msgs/TwistWithCovarianceStamped",
                           "tf2_msgs/TFMessage", "diagnostic_msgs/DiagnosticArray"}) {
    const RosSchema schema = ros_schema(type);
    text += schema.name + '\n' + schema.text + '\n';
  }
  expect_recorded("logs/ros_messages.txt", text);
}

template <typename Message>
std::string json_text_of(const std::string& json) {
  Message message;
  if (!read_json(bytes_of(json), message)) return "nothing";
  return fmt::format("at {} of '{}' {}", test::grouped_ns(message.header.stamp_ns), message.header.frame_id,
                     test::content_text(message));
}

/// The whole message, and without each of its parts.
template <typename Message>
void add_json(const std::string& json, const std::vector<std::string>& parts, std::string& text) {
  text += json_text_of<Message>(json) + '\n';
  for (const std::string& part : parts) {
    for (const char* other : {"x", "\"text\"", "[1]", "1.5", "{}"}) {
      std::string changed = json;
      const std::size_t at = changed.find(part);
      ASSERT_NE(at, std::string::npos) << part;
      if (*other == 'x') {
        changed.replace(at + 1, 1, "#");  // another name
      } else {
        const std::size_t value = changed.find(':', at) + 1;
        std::size_t end = value;
        int depth = 0;
        for (; end < changed.size(); ++end) {
          const char c = changed[end];
          if (depth == 0 && (c == ',' || c == '}' || c == ']')) break;
          if (c == '{' || c == '[') ++depth;
          if (c == '}' || c == ']') --depth;
        }
        changed.replace(value, end - value, other);
      }
      text += fmt::format("{} {}: {}\n", part, other, json_text_of<Message>(changed));
    }
  }
}

std::string list(int n, int from) {
  std::string text = "[";
  for (int i = 0; i < n; ++i) text += (i > 0 ? "," : "") + std::to_string(from + i);
  return text + "]";
}

TEST(McapWhole, MessagesOfRosAsJson) {
  std::string text;
  const std::string header = R"("header":{"frame_id":"imu","stamp":{"sec":7,"nanosec":8}})";
  add_json<Imu>(
      "{" + header +
          R"(,"angular_velocity":{"x":1,"y":2,"z":3},"linear_acceleration":{"x":4,"y":5,"z":6.5},"angular_velocity_covariance":)" +
          list(9, 1) + R"(,"linear_acceleration_covariance":)" + list(9, 11) + "}",
      {"\"header\"", "\"frame_id\"", "\"stamp\"", "\"sec\"", "\"nanosec\"", "\"angular_velocity\"", "\"x\"",
       "\"y\"", "\"z\"", "\"linear_acceleration\"", "\"angular_velocity_covariance\"",
       "\"linear_acceleration_covariance\""},
      text);
  add_json<NavSatFix>(
      "{" + header +
          R"(,"status":{"status":1},"latitude":45.5,"longitude":-7.25,"altitude":300.5,"position_covariance":)" +
          list(9, 1) + R"(,"position_covariance_type":2})",
      {"\"status\"", "\"latitude\"", "\"longitude\"", "\"altitude\"", "\"position_covariance\"",
       "\"position_covariance_type\""},
      text);
  for (const char* status : {"-5", "-1", "0", "2", "9"}) {
    text += json_text_of<NavSatFix>(
                "{" + header + R"(,"status":{"status":)" + status +
                R"(},"latitude":45.5,"longitude":-7.25,"altitude":300.5,"position_covariance_type":)" +
                status + "}") +
            '\n';
  }
  add_json<Odometry>(
      "{" + header +
          R"(,"child_frame_id":"base","pose":{"pose":{"position":{"x":1,"y":2,"z":3},"orientation":{"x":4,"y":5,"z":6,"w":7}},"covariance":)" +
          list(36, 1) +
          R"(},"twist":{"twist":{"linear":{"x":8,"y":9,"z":10},"angular":{"x":11,"y":12,"z":13}},"covariance":)" +
          list(36, 101) + "}}",
      {"\"child_frame_id\"", "\"pose\"", "\"position\"", "\"orientation\"", "\"w\"", "\"covariance\"",
       "\"twist\"", "\"linear\"", "\"angular\""},
      text);
  add_json<TwistStamped>(
      "{" + header +
          R"(,"twist":{"twist":{"linear":{"x":8,"y":9,"z":10},"angular":{"x":11,"y":12,"z":13}},"covariance":)" +
          list(36, 101) + "}}",
      {"\"twist\"", "\"linear\"", "\"angular\"", "\"covariance\""}, text);
  add_json<TwistStamped>(
      "{" + header + R"(,"twist":{"linear":{"x":8,"y":9,"z":10},"angular":{"x":11,"y":12,"z":13}}})",
      {"\"linear\""}, text);
  add_json<TimeReference>("{" + header + R"(,"time_ref":{"secs":9,"nsecs":10},"source":"gps"})",
                          {"\"time_ref\"", "\"secs\"", "\"nsecs\"", "\"source\""}, text);
  for (const char* stamp :
       {R"("sec":9000000000,"nsec":0)", R"("sec":9000000001,"nsec":0)",
        R"("sec":-9000000000,"nsec":999999999)", R"("sec":-9000000001,"nsec":0)",
        R"("secs":1,"nsecs":1000000000)", R"("secs":1,"nsecs":-1)", R"("sec":1.5,"nsec":0)"}) {
    text += json_text_of<TimeReference>(R"({"header":{"stamp":{)" + std::string(stamp) +
                                        R"(}},"time_ref":{"sec":1,"nsec":2}})") +
            '\n';
  }
  for (const int depth : {14, 15, 16, 17})
    text += json_text_of<TimeReference>("{" + header + R"(,"time_ref":{"sec":1,"nsec":2},"deep":)" +
                                        std::string(static_cast<std::size_t>(depth), '[') +
                                        std::string(static_cast<std::size_t>(depth), ']') + "}") +
            '\n';
  for (const std::size_t size : {65'536U, 65'537U}) {
    std::string json = "{" + header + R"(,"time_ref":{"sec":1,"nsec":2},"source":")";
    json += std::string(size - json.size() - 2, 'x') + "\"}";
    const std::string read = json_text_of<TimeReference>(json);
    text += read.substr(0, 60) + '\n';
  }
  for (const char* json : {"", "[]", "1", "{", "null"}) text += json_text_of<Imu>(json) + '\n';
  expect_recorded("logs/ros_json.txt", text);
}

}  // namespace
}  // namespace imuscope::mcap
