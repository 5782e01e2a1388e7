/// What a replay sends, whole.

#include "service/recording/replay_broadcast.h"

#include <gtest/gtest.h>

#include <map>
#include <string>

#include "capture/event_log_reader.h"
#include "publish/message_codec.h"
#include "rich_run.h"
#include "tests/support/lcm_text.h"
#include "tests/support/recorded_answer.h"
#include "tests/support/shared_data.h"

namespace imuscope {
namespace {

TEST(ReplayBroadcast, SendsWhatTheLiveRunDidAndAStatusOfWhatAReplayKnows) {
  const Configuration configuration = test::rich_configuration();
  Recording recording;
  recording.inputs = {"a.lcm", "b.lcm"};
  recording.present = {true, false, true, true};
  const auto events = test::scratch_folder() / "replay.events";
  {
    ReplayBroadcast broadcast(configuration, recording, "1.2.3");
    const auto opened = broadcast.open("file://" + events.string() + "?mode=w");
    ASSERT_TRUE(opened) << opened.error().text();
    for (int tick = 0; tick < 9; ++tick) {
      broadcast.on_snapshot(test::rich_snapshot(tick));
      for (int sample = 0; sample < 25; ++sample) broadcast.on_error(test::rich_error(1, 25 * tick + sample));
      if (tick == 5) broadcast.on_refit(test::rich_refit());
    }
    broadcast.finish();
  }
  auto log = EventLogReader::open(events);
  ASSERT_TRUE(log) << log.error().text();
  const test::LcmText reader;
  std::string text;
  std::map<std::string, int> messages;
  LogEvent event;
  while (log->next(event)) {
    ++messages[event.channel];
    if (!event.channel.ends_with("_STATUS")) continue;
    auto status = decode_message<status_t>(event.data);
    ASSERT_TRUE(status);
    status->build.clear();
    text += test::lcm_text(reader, *status);
  }
  for (const auto& [channel, n] : messages) text += fmt::format("{} {}\n", channel, n);
  test::expect_recorded("service/recording/replay_broadcast.txt", text);
}

TEST(ReplayBroadcast, WhereItCannotSendItSaysSo) {
  const Configuration configuration = test::rich_configuration();
  ReplayBroadcast broadcast(configuration, {}, "1.2.3");
  const auto opened = broadcast.open("nowhere");
  ASSERT_FALSE(opened);
  EXPECT_NE(opened.error().text().find("nowhere"), std::string::npos) << opened.error().text();
}

}  // namespace
}  // namespace imuscope
