#include "service/run/alarms.h"

#include <algorithm>

#include "publish/message_values.h"

namespace imuscope {

Condition condition_of(const char* kind, std::string subject, const std::string& sentence) {
  constexpr std::string_view kJoint = "; ";
  const auto joint = sentence.find(kJoint);
  if (joint == std::string::npos) return {kind, std::move(subject), sentence, {}};
  return {kind, std::move(subject), sentence.substr(0, joint), sentence.substr(joint + kJoint.size())};
}

bool GrowingCounts::grows(const std::string& name, std::int64_t count, HostTime now) {
  auto found = std::find_if(counts_.begin(), counts_.end(), [&](const Count& c) { return c.name == name; });
  if (found == counts_.end()) {
    counts_.push_back({name, 0, HostTime{}});
    found = counts_.end() - 1;
  }
  if (count > found->value) found->grew = now;
  found->value = count;
  return count > 0 && now - found->grew < kStillGrowing;
}

AlarmBook::News AlarmBook::look(std::span<const Condition> holding, UtcTime utc, HostTime now) {
  News news;
  for (auto& entry : entries_) {
    if (entry.alarm.active == 0) continue;
    entry.alarm.lasted_s = to_seconds(now - entry.began);
    const bool holds = std::any_of(holding.begin(), holding.end(), [&](const Condition& condition) {
      return condition.kind == entry.alarm.kind && condition.subject == entry.alarm.subject;
    });
    if (holds) continue;
    entry.alarm.active = 0;
    news.ended.push_back(entry.alarm);
  }
  for (const auto& condition : holding) {
    auto found = std::find_if(entries_.begin(), entries_.end(), [&](const Entry& entry) {
      return condition.kind == entry.alarm.kind && condition.subject == entry.alarm.subject;
    });
    if (found == entries_.end()) {
      if (entries_.size() == kMost) continue;
      Entry fresh{};
      fresh.alarm.kind = condition.kind;
      fresh.alarm.subject = condition.subject;
      entries_.push_back(std::move(fresh));
      found = entries_.end() - 1;
    }
    auto& alarm = found->alarm;
    alarm.what = condition.what;
    alarm.remedy = condition.remedy;
    if (alarm.active != 0) continue;
    alarm.active = 1;
    alarm.since_utime = to_utime(utc);
    alarm.lasted_s = 0.0;
    ++alarm.times;
    found->began = now;
    news.began.push_back(alarm);
  }
  return news;
}

std::vector<alarm_t> AlarmBook::list() const {
  std::vector<alarm_t> alarms;
  for (const auto& entry : entries_) alarms.push_back(entry.alarm);
  std::stable_sort(alarms.begin(), alarms.end(), [](const alarm_t& a, const alarm_t& b) {
    return a.active != b.active ? a.active > b.active : a.since_utime > b.since_utime;
  });
  return alarms;
}

}  // namespace imuscope
