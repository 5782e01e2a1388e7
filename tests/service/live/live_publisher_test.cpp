/// What a live run makes of what its core puts out, without a device and without a thread of the core.

#include "service/live/live_publisher.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "capture/event_log_reader.h"
#include "publish/message_codec.h"
#include "rich_run.h"
#include "service/pipeline/device_factory.h"
#include "service/pipeline/estimator_setup.h"
#include "tests/support/file_content.h"
#include "tests/support/lcm_text.h"
#include "tests/support/recorded_answer.h"
#include "tests/support/shared_data.h"

namespace imuscope {
namespace {

constexpr std::size_t kRawRingBytes = std::size_t{1} << 20U;

std::vector<std::unique_ptr<DeviceDecoder>> decoders_of(const Configuration& configuration) {
  std::vector<std::unique_ptr<DeviceDecoder>> decoders;
  for (std::size_t i = 0; i < configuration.devices.size(); ++i)
    decoders.push_back(make_decoder(configuration.devices[i], static_cast<DeviceIndex>(i), ClockMapConfig{}));
  return decoders;
}

/// Numbers of this PC and this moment are taken out.
status_t of_any_time(status_t status) {
  EXPECT_GT(status.utime, 0);
  EXPECT_GT(status.uptime_s, 0.0);
  status.utime = 0;
  status.uptime_s = 0.0;
  status.build.clear();
  EXPECT_TRUE(status.capture_path.ends_with("capture.lcm")) << status.capture_path;
  status.capture_path.clear();
  status.capture_bytes = 0;
  EXPECT_GT(status.resident_memory_mb, 1.0);
  EXPECT_LT(status.resident_memory_mb, 10'000.0);
  status.resident_memory_mb = 0.0;
  EXPECT_GT(status.threads.size(), 0U);
  status.threads.clear();
  for (auto& alarm : status.alarms) alarm.since_utime = 0;
  // Whether there is a bus is another matter, and threads that were not started stand still.
  std::erase_if(status.alarms, [](const alarm_t& alarm) {
    return alarm.kind == alarm_kind::kBus || alarm.kind == alarm_kind::kThread;
  });
  count_elements(status);
  return status;
}

TEST(LivePublisher, WritesRecordsAndTellsWhatTheCorePutsOut) {
  const Configuration configuration = test::rich_configuration();
  Core core(estimator_config(configuration), configuration.devices.size());
  IoThread io(core, decoders_of(configuration), {0, 1, 2, 3}, kRawRingBytes);
  CoreThread estimator(core, host_now());
  LiveOptions options;
  options.out = test::scratch_folder() / "run";
  options.version = "1.2.3";
  auto publisher = LivePublisher::create(configuration, *noise::parse_model("WN"), options, io, estimator);
  ASSERT_TRUE(publisher) << publisher.error().text();
  EXPECT_EQ((*publisher)->health().state, "starting");
  const auto capture = options.out / "capture.lcm";
  auto recorder = Recorder::start({capture, configuration.lcm.channel_prefix, {}}, {&io.raw_ring()},
                                  {&io.exceptions(), &estimator.rings().exceptions});
  ASSERT_TRUE(recorder) << recorder.error().text();
  EXPECT_EQ((*publisher)->pulses().size(), 4U);
  (*publisher)->set_recorder(**recorder);
  EXPECT_EQ((*publisher)->pulses().size(), 5U);
  (*publisher)->set_refusals({{ErrorKind::kWork, "memory is not locked", "give it the right"}});
  (*publisher)->set_line_problem(1, "its port is missing; plug it in");
  EXPECT_EQ((*publisher)->board().newest(), nullptr);

  auto& rings = estimator.rings();
  for (int tick = 0; tick < 4; ++tick) ASSERT_TRUE(rings.snapshots.try_push(test::rich_snapshot(tick)));
  for (int sample = 0; sample < 30; ++sample) ASSERT_TRUE(rings.errors.try_push(test::rich_error(1, sample)));
  ASSERT_TRUE(
      rings.events.try_push({event::SImuReturned{2.5}, 1, test::kRichFirst + std::chrono::seconds(1)}));
  for (const std::int64_t version : {1, 2})
    ASSERT_TRUE(rings.noises.try_push({1, 77, {6000, mtx_class_noise(), version}}));
  ASSERT_TRUE((*publisher)->finish(399));
  ASSERT_TRUE((*recorder)->stop());

  const test::LcmText reader;
  const auto posted = (*publisher)->board().newest();
  ASSERT_NE(posted, nullptr);
  EXPECT_EQ((*publisher)->health().state, posted->status.state);
  std::string text = test::lcm_text(reader, of_any_time(posted->status));
  nlohmann::json run = nlohmann::json::parse(test::content_of(options.out / "run.json"));
  for (const char* of_this_build : {"build", "configuration_text", "pc_clock"}) run.erase(of_this_build);
  text += run.dump(1) + '\n';
  for (const char* name : {"navigation.csv", "odometry.csv", "calibration_left.csv", "errors_right.csv"})
    text += std::string(name) + '\n' + test::content_of(options.out / name);
  EXPECT_TRUE(std::filesystem::exists(options.out / "calibration.json"));

  auto log = EventLogReader::open(capture);
  ASSERT_TRUE(log) << log.error().text();
  std::map<std::string, int> messages;
  LogEvent event;
  while (log->next(event)) {
    ++messages[event.channel];
    if (!event.channel.ends_with("APPLIED_MODEL")) continue;
    auto model = decode_message<applied_model_t>(event.data);
    ASSERT_TRUE(model);
    EXPECT_GT(model->utime, 0);
    model->utime = 0;
    text += test::lcm_text(reader, *model);
  }
  // As many as the recorder finds time for.
  for (const char* of_the_file : {"IMUSCOPE_SEAL", "IMUSCOPE_INDEX"}) messages.erase(of_the_file);
  for (const auto& [channel, n] : messages) text += fmt::format("{} {}\n", channel, n);
  test::expect_recorded("service/live/published.txt", text);
}

}  // namespace
}  // namespace imuscope
