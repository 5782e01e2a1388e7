#include "service/run/alarms.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "publish/message_values.h"
#include "service/run/health.h"

namespace imuscope {
namespace {

using std::chrono::seconds;
using testing::IsEmpty;
using testing::SizeIs;

constexpr HostTime kAlarmsBegin{std::chrono::hours(1)};
const UtcTime kAlarmsUtc = utc_time_from_ns(1'700'000'000'000'000'000);

Condition disk_full() { return {alarm_kind::kDisk, "capture", "no space left", "free space"}; }

TEST(Alarms, SayWhenTheyBeganHowOftenAndHowLong) {
  AlarmBook book;
  EXPECT_THAT(book.look({}, kAlarmsUtc, kAlarmsBegin).began, IsEmpty());
  const std::vector<Condition> full{disk_full()};
  EXPECT_THAT(book.look(full, kAlarmsUtc, kAlarmsBegin).began, SizeIs(1));
  EXPECT_THAT(book.look(full, kAlarmsUtc + seconds(5), kAlarmsBegin + seconds(5)).began, IsEmpty())
      << "it is the same one";
  ASSERT_THAT(book.list(), SizeIs(1));
  EXPECT_EQ(book.list()[0].active, 1);
  EXPECT_EQ(book.list()[0].since_utime, to_utime(kAlarmsUtc));
  EXPECT_DOUBLE_EQ(book.list()[0].lasted_s, 5.0);
  const auto news = book.look({}, kAlarmsUtc + seconds(7), kAlarmsBegin + seconds(7));
  ASSERT_THAT(news.ended, SizeIs(1));
  EXPECT_DOUBLE_EQ(news.ended[0].lasted_s, 7.0);
  EXPECT_EQ(book.list()[0].active, 0);
  (void)book.look({}, kAlarmsUtc + seconds(60), kAlarmsBegin + seconds(60));
  EXPECT_DOUBLE_EQ(book.list()[0].lasted_s, 7.0) << "what is over lasts no longer";
  EXPECT_THAT(book.look(full, kAlarmsUtc + seconds(90), kAlarmsBegin + seconds(90)).began, SizeIs(1));
  EXPECT_EQ(book.list()[0].times, 2);
  EXPECT_EQ(book.list()[0].since_utime, to_utime(kAlarmsUtc + seconds(90)));
}

TEST(Alarms, ActiveOnesComeFirstAndTheirNumberIsBounded) {
  AlarmBook book;
  std::vector<Condition> many;
  for (std::size_t i = 0; i < 2 * AlarmBook::kMost; ++i)
    many.push_back({alarm_kind::kPrivilege, std::to_string(i), "refused", ""});
  (void)book.look(many, kAlarmsUtc, kAlarmsBegin);
  EXPECT_THAT(book.list(), SizeIs(AlarmBook::kMost));
  const std::vector<Condition> one{many[7]};
  (void)book.look(one, kAlarmsUtc, kAlarmsBegin + seconds(1));
  EXPECT_EQ(book.list()[0].subject, "7");
  EXPECT_EQ(book.list()[1].active, 0);
}

TEST(Alarms, ACountIsOneWhileItGrowsAndForAWhile) {
  GrowingCounts counts;
  EXPECT_FALSE(counts.grows("lost", 0, kAlarmsBegin));
  EXPECT_TRUE(counts.grows("lost", 3, kAlarmsBegin + seconds(1)));
  EXPECT_TRUE(counts.grows("lost", 3, kAlarmsBegin + seconds(5)));
  EXPECT_FALSE(counts.grows("lost", 3, kAlarmsBegin + seconds(1) + GrowingCounts::kStillGrowing));
  EXPECT_TRUE(counts.grows("lost", 4, kAlarmsBegin + seconds(60)));
}

TEST(Alarms, DevicesThatDoNotStreamAndQueuesThatLoseAreConditions) {
  status_t status{};
  status.devices.resize(3);
  for (std::size_t i = 0; i < 3; ++i) status.devices[i].name = "mtx" + std::to_string(i + 1);
  status.devices[0].state = "streaming";
  status.devices[1].state = "connecting";
  status.devices[2].state = "failed";
  status.devices[2].problem = "another device is on this port; set device_id to 00000002";
  status.devices[0].frames_dropped = 2;
  status.capture_lost = 7;
  status.rings.resize(1);
  status.rings[0].name = "errors";
  GrowingCounts counts;
  const auto conditions = conditions_of(status, counts, kAlarmsBegin);
  ASSERT_THAT(conditions, SizeIs(4));
  EXPECT_EQ(conditions[0].what, "mtx2: connecting");
  EXPECT_NE(conditions[0].remedy, "") << "there is always something to do";
  EXPECT_EQ(conditions[1].what, "mtx3: failed: another device is on this port");
  EXPECT_EQ(conditions[1].remedy, "set device_id to 00000002");
  EXPECT_EQ(conditions[2].kind, alarm_kind::kDeviceLoss);
  EXPECT_EQ(conditions[3].kind, alarm_kind::kCaptureLoss);
}

TEST(Alarms, ASentenceIsTakenApartWhereItWasJoined) {
  const Error error{ErrorKind::kWork, "no route", "ip route add; or ttl=0"};
  const auto condition = condition_of(alarm_kind::kBus, "LCM", error.text());
  EXPECT_EQ(condition.what, error.what);
  EXPECT_EQ(condition.remedy, error.remedy);
  EXPECT_EQ(condition.text(), error.text());
  EXPECT_EQ(condition_of(alarm_kind::kBus, "LCM", "no route").remedy, "");
}

}  // namespace
}  // namespace imuscope
