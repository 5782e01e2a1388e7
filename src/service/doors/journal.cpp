#include "service/doors/journal.h"

#include <fmt/format.h>
#include <spdlog/sinks/base_sink.h>
#include <spdlog/spdlog.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/time.h>
#include <sys/un.h>
#include <syslog.h>
#include <unistd.h>
#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <mutex>
#include <utility>

#include "base/text.h"

namespace imuscope {

namespace {

/// Of what an entry is, for whoever searches the journal (systemd.journal-fields(7)): drawn once, at random.
constexpr const char* kAlarmBegan = "1190cfcc60da4281b172fcc80d0029df";
constexpr const char* kAlarmEnded = "504d18b9d0ad43c4913f8d99a5effc63";

struct Run {
  std::mutex mutex;
  std::string name;
  std::vector<std::string> devices;
};

/// One process, one log.
Run& run() {
  static Run the_run;
  return the_run;
}

int priority_of(spdlog::level::level_enum level) {
  switch (level) {
    case spdlog::level::critical:
      return LOG_CRIT;
    case spdlog::level::err:
      return LOG_ERR;
    case spdlog::level::warn:
      return LOG_WARNING;
    case spdlog::level::info:
      return LOG_INFO;
    default:
      return LOG_DEBUG;
  }
}

constexpr const char* kJournalSocket = "/run/systemd/journal/socket";
/// A longer one is cut: the kernel takes two hundred kilobytes at once.
constexpr std::size_t kValueMax = std::size_t{64} << 10U;
/// A journal that stands still holds a line of the log for so long, and does not get it.
constexpr timeval kJournalPatience{1, 0};

bool journal_listens() { return access(kJournalSocket, W_OK) == 0; }

/// What entries are sent through, for the time of the process. The journal may be started anew meanwhile:
/// each entry is addressed by itself.
int journal_socket() {
  static const int the_socket = [] {
    const int fd = socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    (void)setsockopt(fd, SOL_SOCKET, SO_SNDTIMEO, &kJournalPatience, sizeof kJournalPatience);
    return fd;
  }();
  return the_socket;
}

/// One entry of the journal, in its native protocol (systemd.io/JOURNAL_NATIVE_PROTOCOL): a datagram of
/// fields.
class Entry {
 public:
  Entry(int priority, std::string_view message) {
    add("MESSAGE", message);
    add("PRIORITY", fmt::format("{}", priority));
    add("SYSLOG_IDENTIFIER", "imuscope");
    auto& known = run();
    const std::lock_guard lock(known.mutex);
    if (!known.name.empty()) add("IMUSCOPE_RUN", known.name);
    const auto device = message.substr(0, message.find(": "));
    if (std::find(known.devices.begin(), known.devices.end(), device) != known.devices.end())
      add("IMUSCOPE_DEVICE", device);
  }
  /// A value is one line: what is of several would need its length before it.
  void add(std::string_view name, std::string_view value) {
    fields_ += fmt::format("{}={}\n", name, one_line(value, kValueMax));
  }
  void send() const {
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    std::strcpy(address.sun_path, kJournalSocket);
    // Lost where nobody listens: there is nobody else to tell.
    (void)sendto(journal_socket(), fields_.data(), fields_.size(), MSG_NOSIGNAL,
                 reinterpret_cast<const sockaddr*>(&address), sizeof address);
  }

 private:
  std::string fields_;
};

class JournalSink final : public spdlog::sinks::base_sink<std::mutex> {
 protected:
  void sink_it_(const spdlog::details::log_msg& message) override {
    const int priority = priority_of(message.level);
    const std::string_view text{message.payload.data(), message.payload.size()};
    if (journal_listens()) {
      Entry(priority, text).send();
    } else {
      // As sd-daemon(3) has it: whoever reads standard error in the journal's place.
      fmt::print(stderr, "<{}>{}\n", priority, printable(text));
    }
  }
  void flush_() override {}
};

}  // namespace

bool logs_to_journal() {
  const char* const stream = std::getenv("JOURNAL_STREAM");
  struct stat file {};
  if (stream == nullptr || fstat(STDERR_FILENO, &file) != 0) return false;
  return fmt::format("{}:{}", file.st_dev, file.st_ino) == stream;
}

std::shared_ptr<spdlog::sinks::sink> journal_sink() { return std::make_shared<JournalSink>(); }

void set_journal_run(const std::string& name, std::vector<std::string> devices) {
  auto& known = run();
  const std::lock_guard lock(known.mutex);
  known.name = name;
  known.devices = std::move(devices);
}

void tell_alarm(const alarm_t& alarm) {
  if (!logs_to_journal() || !journal_listens()) return;
  const bool began = alarm.active != 0;
  Entry entry(began ? LOG_WARNING : LOG_INFO,
              began ? fmt::format("alarm: {}", alarm.what)
                    : fmt::format("alarm over after {:.0f} s: {}", alarm.lasted_s, alarm.what));
  entry.add("MESSAGE_ID", began ? kAlarmBegan : kAlarmEnded);
  entry.add("IMUSCOPE_ALARM", alarm.kind);
  entry.add("IMUSCOPE_SUBJECT", alarm.subject);
  entry.add("IMUSCOPE_ACTIVE", began ? "1" : "0");
  entry.add("IMUSCOPE_REMEDY", alarm.remedy);
  entry.add("IMUSCOPE_TIMES", fmt::format("{}", alarm.times));
  entry.send();
}

}  // namespace imuscope
