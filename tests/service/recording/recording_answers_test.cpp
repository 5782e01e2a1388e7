/// How recordings are found, brought to one time and told to be damaged, whole.

#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <string>

#include "logs/mcap/ros_messages.h"
#include "logs/mcap/writer.h"
#include "service/recording/byte_source.h"
#include "service/recording/candump_source.h"
#include "service/recording/capture_damage.h"
#include "service/recording/clock_alignment.h"
#include "service/recording/message_log.h"
#include "service/recording/replay.h"
#include "tests/support/answer.h"
#include "tests/support/recorded_answer.h"
#include "tests/support/shared_data.h"
#include "tests/support/two_devices.h"

namespace imuscope {
namespace {

using test::Answer;

void write_to(const std::filesystem::path& path, std::string_view text) {
  std::ofstream(path, std::ios::binary) << text;
}

/// Without the folder, which is another one each time.
std::string told(const Error& error, const std::filesystem::path& folder) {
  std::string text = error.text();
  for (std::size_t at = text.find(folder.string()); at != std::string::npos; at = text.find(folder.string()))
    text.replace(at, folder.string().size(), "FOLDER");
  return text;
}

TEST(RecordingWhole, WhatACaptureLacks) {
  CaptureSummary summary;
  summary.breaks = {{2, 1, 3, false, 1.26}, {5, 3, 8, false, 20.0}, {0, 0, 9, true, 0.5}};
  const auto at = [](double s) { return HostTime{from_seconds(s)}; };
  summary.losses = {
      {"mtx1", at(1.0), at(2.5), 3}, {"mtx1", at(9.0), at(8.0), 4}, {"airins", at(3.0), at(3.2), 1}};
  Answer answer;
  const auto tell = [&] {
    for (const auto& sentence : damage_of(summary, "run/capture.lcm")) answer.line(sentence);
    answer.line("-");
  };
  tell();
  summary.breaks.clear();
  summary.losses.clear();
  tell();
  summary.files.resize(3);
  for (int i = 0; i < 3; ++i) summary.files[static_cast<std::size_t>(i)].number = i;
  tell();  // of an older version: without seals
  for (auto& file : summary.files) file.health.is_sealed = true;
  tell();
  for (auto& file : summary.files) file.health.index.emplace();
  tell();
  summary.files[0].health.bytes_skipped = 11;
  summary.files[1].health.bytes_cut_off = 12;
  summary.files[1].health.records_damaged = 1;
  summary.files[2].health.records_unsealed = 14;
  summary.files[2].health.records_missing = 15;
  tell();
  for (auto& file : summary.files) file.health.is_sealed = false;
  tell();
  test::expect_recorded("service/recording/damage.txt", answer.text());
}

TEST(RecordingWhole, PausesThatWereSteppedOver) {
  Recording recording;
  recording.damage = {"a part is missing"};
  ReplayResult result;
  EXPECT_EQ(warnings_of(recording, result), recording.damage);
  result.pauses = {3, std::chrono::minutes(90), std::chrono::minutes(45)};
  const auto warnings = warnings_of(recording, result);
  ASSERT_EQ(warnings.size(), 2U);
  EXPECT_EQ(
      warnings[1],
      "3 times no device said anything for more than 2 minutes, 1.50 h in all and 0.75 h at most; these "
      "pauses were stepped over");
}

constexpr std::int64_t kUtc_ns = 1'700'000'000'000'000'000;

/// A drive with turns, as a clock shows it that is late by `late_s` and fast by `fast`.
std::vector<Sample> turning(DeviceIndex device, double length_s, double late_s, double fast,
                            bool has_utc = false) {
  std::vector<Sample> samples;
  constexpr double kStep_s = 0.02;
  for (int i = 0; i * kStep_s < length_s; ++i) {
    const double t = i * kStep_s;
    Sample sample{};
    sample.kind = SampleKind::kImu;
    sample.device = device;
    sample.sequence = static_cast<std::uint64_t>(i);
    sample.time = HostTime{from_seconds((t - late_s) / (1.0 + fast))};
    sample.has_utc = has_utc;
    sample.utc = utc_time_from_ns(kUtc_ns) + from_seconds(t);
    sample.imu.omega_radps = {0.3 * std::sin(0.9 * t), 0.2 * std::sin(2.3 * t + std::sin(0.31 * t)),
                              0.4 * std::sin(0.37 * t * (1.0 + 0.003 * t))};
    sample.imu.flags = i % 50 == 7 ? kAccelValid : kGyroValid | kAccelValid;
    samples.push_back(sample);
  }
  return samples;
}

Configuration three_devices() {
  return *parse_configuration(std::string(test::kTwoDevices) + R"(csv = { clock = "own" }
[[device]]
name = "g"
role = "gnss"
protocol = "csv_gnss"
csv = { clock = "own" }
)",
                              "three.toml");
}

void add_clock(Answer& answer, const DeviceClock& clock) {
  const bool is_fixed = clock.map.mode == ClockMapConfig::Mode::kFixed;
  answer.line(is_fixed, to_seconds(clock.map.origin.time_since_epoch()), 1e6 * (clock.map.rate_ratio - 1.0),
              clock.shift_s, clock.shift_sd_s, clock.how);
}

TEST(RecordingWhole, ClocksThatAreBroughtTogether) {
  Configuration configuration = three_devices();
  ASSERT_EQ(configuration.devices.size(), 3U);
  Answer answer;
  const auto align = [&](const std::vector<bool>& unstamped, const ReadSamples& read) {
    const auto clocks = align_clocks(configuration, unstamped, read);
    if (!clocks) {
      answer.line(clocks.error().text());
      return;
    }
    for (const auto& clock : *clocks) add_clock(answer, clock);
    answer.line("-");
  };
  const auto by_utc = [](DeviceIndex device) -> Result<std::vector<Sample>> {
    return turning(device, 20.0, 1.5 * device, 0.0, true);
  };
  const auto without_utc = [](DeviceIndex device) -> Result<std::vector<Sample>> {
    return turning(device, 100.0, device == 0 ? 0.0 : 2.75, 0.0);
  };
  const auto no_match = [](DeviceIndex device) -> Result<std::vector<Sample>> {
    if (device == 1) return std::vector<Sample>{};
    return turning(device, 100.0, 0.0, 0.0);
  };
  const auto unreadable = [](DeviceIndex device) -> Result<std::vector<Sample>> {
    if (device == 1) return work_error("nobody can read it", "take another");
    return turning(device, 100.0, 0.0, 0.0);
  };
  align({false, true, true}, by_utc);
  align({true, true, true}, by_utc);
  align({true, true, false}, without_utc);
  align({true, true, true}, without_utc);
  align({true, true, false}, no_match);
  align({true, true, false}, unreadable);
  configuration.devices[1].csv.common_clock = configuration.devices[2].csv.common_clock = true;
  align({true, true, true}, without_utc);
  test::expect_recorded("service/recording/clocks.txt", answer.text(), 1e-4, 1e-7);
}

TEST(RecordingWhole, TheClockOfALongDriveHasARate) {
  const Configuration configuration = three_devices();
  constexpr double kFast = 40e-6;
  for (const bool is_long : {false, true}) {
    const auto clocks = align_clocks(configuration, {true, true, false},
                                     [&](DeviceIndex device) -> Result<std::vector<Sample>> {
                                       return turning(device, is_long ? 301.0 : 299.0,
                                                      device == 0 ? 0.0 : 3.25, device == 0 ? 0.0 : kFast);
                                     });
    ASSERT_TRUE(clocks) << clocks.error().text();
    const DeviceClock& clock = (*clocks)[1];
    EXPECT_NEAR(clock.map.rate_ratio - 1.0, is_long ? kFast : 0.0, 5e-6);
    EXPECT_NEAR(clock.shift_s, 3.25 + kFast * 147.0, 2e-3);
    EXPECT_GT(clock.shift_sd_s, 0.0);
  }
}

/// Clocks that only count begin anywhere: hours apart, the recordings are taken to have begun together.
TEST(RecordingWhole, AClockThatBeganHoursBeforeIsFoundWithItsRate) {
  const Configuration configuration = three_devices();
  constexpr double kFast = 40e-6;
  constexpr double kBegun_s = 20'000.0;
  const auto clocks = align_clocks(configuration, {true, true, false},
                                   [&](DeviceIndex device) -> Result<std::vector<Sample>> {
                                     if (device == 0) return turning(device, 400.0, 0.0, 0.0);
                                     auto samples = turning(device, 400.0, 3.25, kFast);
                                     for (auto& sample : samples) sample.time += from_seconds(kBegun_s);
                                     return samples;
                                   });
  ASSERT_TRUE(clocks) << clocks.error().text();
  const ClockMapConfig& map = (*clocks)[1].map;
  EXPECT_NEAR(map.rate_ratio - 1.0, kFast, 5e-6);
  // Anywhere in the drive it shows the reference's time.
  for (const double t : {20.0, 200.0, 380.0}) {
    const double shown_s = kBegun_s + (t - 3.25) / (1.0 + kFast);
    EXPECT_NEAR(to_seconds(map.origin.time_since_epoch()) + map.rate_ratio * shown_s, t, 2e-3);
  }
}

TEST(RecordingWhole, UtcLessTimeIsTheMedian) {
  auto samples = turning(0, 0.1, 0.0, 0.0, true);
  ASSERT_EQ(samples.size(), 5U);
  samples[0].utc += std::chrono::hours(1);
  samples[4].has_utc = false;
  samples[1].utc += Duration{7};
  samples[2].utc -= Duration{5};
  EXPECT_EQ(utc_minus_time(samples), Duration{kUtc_ns + 7});
  for (auto& sample : samples) sample.has_utc = false;
  EXPECT_FALSE(utc_minus_time(samples));
}

TEST(RecordingWhole, TheStampsOfALog) {
  DeviceConfig device;
  device.name = "wheels";
  device.role = DeviceRole::kOdometry;
  Answer answer;
  const auto read = []() -> Result<std::vector<Sample>> { return turning(0, 100.0, 0.0, 0.0); };
  const auto read_own = []() -> Result<std::vector<Sample>> { return turning(1, 100.0, 1.25, 0.0); };
  const auto align = [&](const LogStamps& stamps) {
    const auto clock = align_log(device, stamps, read, read_own);
    if (clock) add_clock(answer, *clock);
    if (!clock) answer.line(clock.error().text());
  };
  align({false, true, {}});
  align({true, false, Duration{2'500'000'000}});
  align({true, false, {}});
  align({false, false, Duration{2'500'000'000}});
  device.role = DeviceRole::kStudy;
  align({true, false, {}});
  device.can.emplace();
  device.can->log_has_common_clock = true;
  align({false, false, {}});
  test::expect_recorded("service/recording/log_stamps.txt", answer.text(), 1e-4, 1e-7);
}

TEST(RecordingWhole, ALogOfCandump) {
  const auto folder = test::scratch_folder();
  DeviceConfig device;
  device.name = "wheels";
  Answer answer;
  const auto look = [&](const std::string& text) {
    write_to(folder / "can.log", text);
    const auto survey = survey_candump(folder / "can.log", device);
    if (!survey) {
      answer.line(told(survey.error(), folder));
      return;
    }
    answer.line(survey->interface, survey->frames, survey->stamps_are_utc);
    for (const auto& remark : survey->remarks) answer.line(told(Error{ErrorKind::kWork, remark, {}}, folder));
    for (const std::string& interface : {survey->interface, std::string()}) {
      auto source = open_candump(folder / "can.log", interface,
                                 ClockMapConfig::fixed(HostTime{Duration{500}}, 1.0 + 1e-3));
      ASSERT_TRUE(source);
      answer.line("total", (*source)->bytes_total());
      while (auto next = (*source)->next()) {
        if (!next->has_value()) break;
        const RecordedRead& frame = **next;
        answer.line((to_ns(*frame.arrival) / 1'000) % 1'000'000'000, frame.bytes.size(),
                    (*source)->bytes_read());
      }
    }
  };
  look(
      "(10.000000) can0 123#01\n(10.010000) can0 123#0203\nnonsense\n(10.012000) can0 124#\n(10.040000) can0 123#01\n"
      "(9.000000) can0 123#01\n(9.019000) can0 123#01\n(9.000000) can0 123#02\n(9.100000) can0 123#01\n"
      "(8.000000) can0 123#01\n(8.001000) can0 123#01\n");
  look("(946684800.000000) can0 123#01\n(946684801.000000) can1 123#01\n");
  device.can.emplace();
  device.can->interface = "can1";
  look("(946684800.000000) can0 123#01\n(946684801.000000) can1 123#0102\n");
  look("(946684799.999999) can1 123#01\n(946684801.000000) can1 123#01\n");
  device.can->interface = "can7";
  look("(946684800.000000) can0 123#01\n(946684801.000000) can1 123#01\n");
  look("(1.000000) can0 123#01\n");
  look("");
  test::expect_recorded("service/recording/candump.txt", answer.text());
}

std::string whole_mcap() {
  std::string content;
  mcap::Writer writer{{"ros2", "test"}, [&content](std::string_view bytes) { content += bytes; }};
  const auto imu = writer.add_channel("/imu", writer.add_schema("sensor_msgs/msg/Imu", "ros2msg", ""), "cdr");
  const auto fix =
      writer.add_channel("/fix", writer.add_schema("sensor_msgs/msg/NavSatFix", "ros2msg", ""), "cdr");
  for (int i = 0; i < 5; ++i) {
    mcap::CdrWriter cdr;
    mcap::write(cdr, mcap::Imu{});
    // The last one is recorded before the others.
    const auto time = static_cast<std::uint64_t>(i == 4 ? 0 : 100'000'000 + 50'000'000 * i);
    writer.write(imu, time, time, cdr.bytes());
  }
  mcap::CdrWriter cdr;
  mcap::write(cdr, mcap::NavSatFix{});
  writer.write(fix, 7, 7, cdr.bytes());
  writer.finish();
  return content;
}

TEST(RecordingWhole, LogsOfMessagesByTheirFirstBytes) {
  const auto folder = test::scratch_folder();
  Answer answer;
  const std::string mcap = whole_mcap();
  const std::vector<std::pair<std::string, std::string>> files{
      {"whole.mcap", mcap},
      {"seven.mcap", mcap.substr(0, 7)},
      {"bag.bag", "#ROSBAG V2.0\n"},
      {"short.bag", "#ROSBAG V2.0"},
      {"flight.ulg", std::string("ULog\x01\x12\x35\x01", 8)},
      {"flight.bin", "\xA3\x95\x80"},
      {"other.bin", "\xA3\x95\x81"},
      {"two.bin", "\xA3\x95"},
      {"lite.db3", "SQLite format 3"},
      {"packed.zst", "\x28\xB5\x2F\xFD and more"},
      {"packed.gz", "\x1F\x8B and more"},
      {"text.txt", "hello"},
      {"empty", ""}};
  for (const auto& [name, content] : files) {
    write_to(folder / name, content);
    const auto found = find_message_log(folder / name);
    answer.line(name, found ? name_of(*found) : std::string_view("none"));
    for (const Protocol protocol :
         {Protocol::kMcap, Protocol::kRosbag, Protocol::kUlog, Protocol::kDataflash}) {
      const auto opened = open_message_log(folder / name, protocol);
      answer.line(" ", name_of(protocol), opened ? "opens" : told(opened.error(), folder));
    }
  }
  answer.line(find_message_log(folder).has_value(), find_message_log(folder / "nothing").has_value());
  const auto tell_topics = [&](const std::filesystem::path& log) {
    const auto topics = find_topics(log, Protocol::kMcap);
    if (!topics) {
      answer.line(told(topics.error(), folder));
      return;
    }
    for (const auto& topic : *topics) answer.line(topic.name, topic.type, topic.messages, topic.rate_hz);
    auto reader = open_message_log(log, Protocol::kMcap);
    ASSERT_TRUE(reader);
    // Whole files, of which the size depends on who packed their chunks.
    const auto size_of_one = std::filesystem::file_size(folder / "whole.mcap");
    const auto size = (*reader)->bytes_total();
    answer.line("files", size / size_of_one, "rest", size % size_of_one, (*reader)->bytes_read() <= size);
    while ((*reader)->next()) continue;
    answer.line("read beyond a quarter", (*reader)->bytes_read() > size / 4, "losses",
                (*reader)->losses().size());
  };
  tell_topics(folder / "whole.mcap");
  tell_topics(folder);
  for (
      const char* metadata :
      {"relative_file_paths:\n  - whole.mcap\n  - \"sub/whole.mcap\"\n- 'whole.mcap' \r\nother: 1\n  - seven.mcap\n",
       "- whole.mcap\nrelative_file_paths:\nno\n- whole.mcap\n", "relative_file_paths:\n- ..\n- .\n- \"\n",
       "relative_file_paths:\n- a.db3\n", "relative_file_paths:\n- a.mcap.zstd\n",
       "relative_file_paths:\n- whole.mcap\n- absent.mcap\n", ""}) {
    write_to(folder / "metadata.yaml", metadata);
    const auto found = find_message_log(folder);
    answer.line("-", found ? name_of(*found) : std::string_view("none"));
    tell_topics(folder);
  }
  for (const char* type : {"sensor_msgs/msg/Imu", "sensor_msgs.Imu", "sensor_msgs/Imu", "a.msg.B", "/msg/"})
    answer.line(plain_type(type));
  test::expect_recorded("service/recording/message_logs.txt", answer.text());
}

}  // namespace
}  // namespace imuscope
