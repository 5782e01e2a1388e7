#include "service/run/clock_keepers.h"

#include <fcntl.h>
#include <linux/ptp_clock.h>
#include <poll.h>
#include <spawn.h>
#include <sys/ioctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <chrono>
#include <cmath>
#include <csignal>

#include "base/text.h"

namespace imuscope {

namespace {

using std::chrono::steady_clock;

constexpr std::chrono::milliseconds kAnswersWithin{2000};
constexpr std::size_t kAnswerBytesMax = 65'536;
constexpr double kNanosecond_s = 1e-9;
/// TAI is ahead of UTC by 37 s since 2017, and of nothing by more than this.
constexpr double kTaiMinusUtcMax_s = 60.0;
constexpr int kCardClocksMax = 4;
constexpr unsigned kCardReadings = 5;
/// Of a socket's path, sockaddr_un.
constexpr std::size_t kSocketPathMax = 100;

std::optional<double> number(std::string_view text) {
  double value = 0.0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{} || end != text.data() + text.size() || !std::isfinite(value)) return std::nullopt;
  return value;
}

std::vector<std::string_view> fields_of(std::string_view line, char separator) {
  std::vector<std::string_view> fields;
  for (;;) {
    const auto end = line.find(separator);
    fields.push_back(line.substr(0, end));
    if (end == std::string_view::npos) return fields;
    line.remove_prefix(end + 1);
  }
}

/// The word after `key` in the lines of pmc: "\tstepsRemoved     1".
std::optional<std::string_view> value_after(std::string_view text, std::string_view key) {
  for (const std::string_view line : fields_of(text, '\n')) {
    const auto begin = line.find_first_not_of(" \t");
    if (begin == std::string_view::npos || line.substr(begin).find(key) != 0) continue;
    std::string_view rest = line.substr(begin + key.size());
    const auto value = rest.find_first_not_of(" \t");
    if (value == std::string_view::npos || value == 0) continue;
    rest.remove_prefix(value);
    return rest.substr(0, rest.find_last_not_of(" \t\r") + 1);
  }
  return std::nullopt;
}

bool is_program(const std::string& path) { return ::access(path.c_str(), X_OK) == 0; }

std::string read_until(int fd, steady_clock::time_point deadline) {
  std::string text;
  std::array<char, 4096> piece{};
  while (text.size() <= kAnswerBytesMax) {
    const auto left = std::chrono::duration_cast<std::chrono::milliseconds>(deadline - steady_clock::now());
    pollfd waiting{fd, POLLIN, 0};
    if (left.count() <= 0 || ::poll(&waiting, 1, static_cast<int>(left.count())) <= 0) break;
    const ssize_t n = ::read(fd, piece.data(), piece.size());
    if (n <= 0) return text;
    text.append(piece.data(), static_cast<std::size_t>(n));
  }
  return {};
}

/// What the program ended with; it is killed at the deadline.
int status_of(pid_t child, steady_clock::time_point deadline) {
  constexpr std::chrono::milliseconds kLook{10};
  int status = 0;
  while (::waitpid(child, &status, WNOHANG) == 0) {
    if (steady_clock::now() > deadline) ::kill(child, SIGKILL);
    std::this_thread::sleep_for(kLook);
  }
  return status;
}

std::optional<ClockKeeper> ask_chrony() {
  for (const char* path : {"/usr/bin/chronyc", "/bin/chronyc"}) {
    if (!is_program(path)) continue;
    const auto text = output_of({path, "-c", "-n", "tracking"});
    return text ? read_chrony_tracking(*text) : std::nullopt;
  }
  return std::nullopt;
}

std::optional<ClockKeeper> ask_ptp(const std::filesystem::path& socket_folder) {
  const std::string socket = (std::filesystem::absolute(socket_folder) / "pmc.socket").string();
  if (socket.size() > kSocketPathMax) return std::nullopt;
  for (const char* server : {"/run/ptp4lro", "/run/ptp4l"}) {
    if (::access(server, W_OK) != 0) continue;
    for (const char* path : {"/usr/sbin/pmc", "/usr/bin/pmc"}) {
      if (!is_program(path)) continue;
      const auto text = output_of(
          {path, "-u", "-b", "0", "-i", socket, "-s", server, "GET CURRENT_DATA_SET", "GET PARENT_DATA_SET"});
      std::error_code ignored;
      std::filesystem::remove(socket, ignored);
      return text ? read_ptp_management(*text) : std::nullopt;
    }
  }
  return std::nullopt;
}

std::int64_t ns_of(const ptp_clock_time& time) {
  // A card may show anything; the difference of two such times fits 64 bits of nanoseconds.
  constexpr std::int64_t kSecondsMost = 4'000'000'000;
  const auto seconds = std::clamp<std::int64_t>(time.sec, -kSecondsMost, kSecondsMost);
  return std::chrono::nanoseconds(std::chrono::seconds(seconds)).count() + time.nsec;
}

/// The card's clock is read between two readings of the wall clock, some times.
std::optional<ClockKeeper> read_card_clock(const std::string& path) {
  const int fd = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (fd < 0) return std::nullopt;
  ptp_sys_offset_extended read{};
  read.n_samples = kCardReadings;
  const bool is_read = ::ioctl(fd, PTP_SYS_OFFSET_EXTENDED, &read) == 0;
  ::close(fd);
  if (!is_read) return std::nullopt;
  std::vector<CardReading> readings;
  for (unsigned i = 0; i < std::min(read.n_samples, kCardReadings); ++i)
    readings.push_back({ns_of(read.ts[i][0]), ns_of(read.ts[i][1]), ns_of(read.ts[i][2])});
  const auto found = card_difference(readings);
  if (!found) return std::nullopt;
  return card_clock(path, found->card_minus_wall_s, found->apart_s);
}

}  // namespace

std::optional<ClockKeeper> read_chrony_tracking(std::string_view text) {
  // chronyc(1), -c; client.c of chrony 4: reference id, name, stratum, reference time, offset (slow:
  // positive), last offset, rms offset, frequency (slow: positive), residual frequency, skew, root delay,
  // root dispersion, update interval, leap status.
  constexpr std::size_t kFields = 14;
  enum : std::size_t {
    kSource = 1,
    kStratum,
    kOffset = 4,
    kRmsOffset = 6,
    kFrequency,
    kRootDelay = 10,
    kRootDispersion
  };
  const auto line = text.substr(0, text.find_first_of("\r\n"));
  const auto fields = fields_of(line, ',');
  if (fields.size() < kFields) return std::nullopt;
  std::array<double, kFields> values{};
  for (const std::size_t i : {kStratum, kOffset, kRmsOffset, kFrequency, kRootDelay, kRootDispersion}) {
    const auto value = number(fields[i]);
    if (!value) return std::nullopt;
    values[i] = *value;
  }
  ClockKeeper keeper;
  keeper.name = "chrony";
  keeper.source = one_line(fields[kSource]);
  keeper.stratum = static_cast<int>(std::clamp(values[kStratum], 0.0, 16.0));
  keeper.is_synchronised = fields[kFields - 1] != "Not synchronised";
  keeper.offset_s = -values[kOffset];
  keeper.sd_s = values[kRmsOffset];
  // chrony.conf(5): clock_error <= |system_time_offset| + root_dispersion + 0.5 * root_delay.
  keeper.max_error_s = std::abs(values[kOffset]) + values[kRootDispersion] + 0.5 * values[kRootDelay];
  keeper.frequency_ppm = values[kFrequency];
  return keeper;
}

std::optional<ClockKeeper> read_ptp_management(std::string_view text) {
  const auto steps = value_after(text, "stepsRemoved");
  const auto offset = value_after(text, "offsetFromMaster");
  const auto path = value_after(text, "meanPathDelay");
  if (!steps || !offset || !path) return std::nullopt;
  const auto steps_value = number(*steps);
  const auto offset_ns = number(*offset);
  const auto path_ns = number(*path);
  if (!steps_value || !offset_ns || !path_ns) return std::nullopt;
  ClockKeeper keeper;
  keeper.name = "ptp4l";
  keeper.source = one_line(value_after(text, "grandmasterIdentity").value_or(std::string_view{}));
  keeper.stratum = static_cast<int>(std::clamp(*steps_value, 0.0, 255.0));
  keeper.is_synchronised = keeper.stratum > 0;
  keeper.offset_s = kNanosecond_s * *offset_ns;
  // The way to the source is measured there and back: what the two differ by is at most all of it.
  keeper.max_error_s = kNanosecond_s * (std::abs(*offset_ns) + std::abs(*path_ns));
  return keeper;
}

std::optional<CardDifference> card_difference(std::span<const CardReading> readings) {
  const CardReading* closest = nullptr;
  for (const CardReading& reading : readings) {
    const std::int64_t apart_ns = reading.after_ns - reading.before_ns;
    if (apart_ns >= 0 && (closest == nullptr || apart_ns < closest->after_ns - closest->before_ns))
      closest = &reading;
  }
  if (closest == nullptr) return std::nullopt;
  // As whole nanoseconds: a double holds those of a difference, not of a date.
  const auto apart_ns = static_cast<double>(closest->after_ns - closest->before_ns);
  return CardDifference{
      kNanosecond_s * (static_cast<double>(closest->card_ns - closest->before_ns) - 0.5 * apart_ns),
      kNanosecond_s * apart_ns};
}

ClockKeeper card_clock(const std::string& path, double card_minus_wall_s, double apart_s) {
  ClockKeeper keeper;
  keeper.name = path;
  const double whole_s = std::round(card_minus_wall_s);
  const bool is_tai_or_utc = whole_s >= 0.0 && whole_s < kTaiMinusUtcMax_s;
  keeper.is_synchronised = is_tai_or_utc;  // a card's clock that nobody set begins in 1970
  keeper.offset_s = is_tai_or_utc ? whole_s - card_minus_wall_s : -card_minus_wall_s;
  keeper.max_error_s = 0.5 * apart_s;
  return keeper;
}

std::optional<std::string> output_of(const std::vector<std::string>& arguments) {
  std::array<int, 2> ends{};
  if (::pipe2(ends.data(), O_CLOEXEC) != 0) return std::nullopt;
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_adddup2(&actions, ends[1], STDOUT_FILENO);
  // What it complains of goes nowhere: it cannot be written there.
  posix_spawn_file_actions_adddup2(&actions, STDIN_FILENO, STDERR_FILENO);
  std::vector<char*> words;
  for (const std::string& argument : arguments) words.push_back(const_cast<char*>(argument.c_str()));
  words.push_back(nullptr);
  char* const environment[] = {nullptr};
  pid_t child = -1;
  const int failed = ::posix_spawn(&child, words[0], &actions, nullptr, words.data(), environment);
  posix_spawn_file_actions_destroy(&actions);
  ::close(ends[1]);
  std::string text;
  int status = -1;
  if (failed == 0) {
    const auto deadline = steady_clock::now() + kAnswersWithin;
    text = read_until(ends[0], deadline);
    status = status_of(child, deadline);
  }
  ::close(ends[0]);
  if (!WIFEXITED(status) || WEXITSTATUS(status) != 0 || text.empty()) return std::nullopt;
  return text;
}

std::vector<ClockKeeper> ask_clock_keepers(const std::filesystem::path& socket_folder) {
  std::vector<ClockKeeper> keepers;
  if (auto chrony = ask_chrony()) keepers.push_back(std::move(*chrony));
  if (auto ptp = ask_ptp(socket_folder)) keepers.push_back(std::move(*ptp));
  for (int i = 0; i < kCardClocksMax; ++i) {
    if (auto card = read_card_clock("/dev/ptp" + std::to_string(i))) keepers.push_back(std::move(*card));
  }
  return keepers;
}

ClockKeeperInquiry::~ClockKeeperInquiry() {
  if (thread_.joinable()) thread_.join();
}

void ClockKeeperInquiry::begin() {
  if (thread_.joinable()) return;
  is_answered_.store(false, std::memory_order_relaxed);
  thread_ = std::thread([this] {
    answer_ = ask_();
    is_answered_.store(true, std::memory_order_release);
  });
}

std::optional<std::vector<ClockKeeper>> ClockKeeperInquiry::take() {
  if (!thread_.joinable() || !is_answered_.load(std::memory_order_acquire)) return std::nullopt;
  thread_.join();
  return std::move(answer_);
}

}  // namespace imuscope
