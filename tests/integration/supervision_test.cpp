/// What systemd is told while parts of the service stand still, and while the world around it does not
/// answer.

#include <gtest/gtest.h>

#include <arpa/inet.h>
#include <fcntl.h>
#include <netinet/in.h>
#include <pty.h>
#include <sched.h>
#include <sys/mount.h>
#include <sys/ptrace.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <sys/wait.h>
#include <unistd.h>
#include <utmp.h>
#include <algorithm>
#include <array>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <functional>
#include <initializer_list>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "programs.h"
#include "systemd.h"
#include "tests/support/shared_data.h"

namespace imuscope::test {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr int kFailedWork = 1;
constexpr seconds kWatchdog{2};

constexpr const char* kSilentVehicle = R"([run]
name = "silent"
[[device]]
name = "airins"
role = "reference"
protocol = "ixblue_stdbin"
transport = { kind = "udp", host = "", port = 18113 }
[[device]]
name = "mtx1"
role = "study"
protocol = "xsens_mt"
transport = { kind = "udp", host = "", port = 18114 }
)";

/// One thread of a child stands still as long as this lives: the tracer has it.
class FrozenThread {
 public:
  FrozenThread(pid_t process, const std::string& name) {
    for (const auto& entry :
         std::filesystem::directory_iterator("/proc/" + std::to_string(process) + "/task")) {
      if (read_text(entry.path() / "comm") == name + "\n")
        thread_ = std::stoi(entry.path().filename().string());
    }
    EXPECT_GT(thread_, 0) << name;
    EXPECT_EQ(ptrace(PTRACE_SEIZE, thread_, nullptr, nullptr), 0);
    EXPECT_EQ(ptrace(PTRACE_INTERRUPT, thread_, nullptr, nullptr), 0);
    EXPECT_EQ(waitpid(thread_, nullptr, __WALL), thread_);
  }
  ~FrozenThread() { ptrace(PTRACE_DETACH, thread_, nullptr, nullptr); }
  FrozenThread(const FrozenThread&) = delete;
  FrozenThread& operator=(const FrozenThread&) = delete;

 private:
  pid_t thread_ = -1;
};

class Supervision : public testing::Test {
 protected:
  void SetUp() override {
    if (unshare(CLONE_NEWNET | CLONE_NEWNS) != 0) GTEST_SKIP() << "private namespaces need root";
    ASSERT_EQ(mount("none", "/", nullptr, MS_REC | MS_PRIVATE, nullptr), 0);
    ASSERT_EQ(std::system("ip link set lo up multicast on && ip route add 224.0.0.0/4 dev lo && "
                          "ip addr add 10.9.9.9/32 dev lo"),
              0);
    folder_ = scratch_folder();
  }

  /// Starts the service and waits until it runs.
  void run(const std::string& configuration) {
    std::ofstream(folder_ / "car.toml") << configuration;
    systemd_.emplace(kWatchdog);
    service_.emplace(
        "imuscope",
        std::vector<std::string>{"run", (folder_ / "car.toml").string(), "--out", (folder_ / "run").string()},
        folder_ / "log.txt");
    ASSERT_TRUE(soon([&] { return log_has("Ctrl-C ends it"); })) << log();
    ASSERT_TRUE(soon([&] { return systemd_->signs() > 0; }));
  }
  static bool soon(const std::function<bool()>& condition) {
    const auto end = std::chrono::steady_clock::now() + seconds(30);
    while (std::chrono::steady_clock::now() < end) {
      if (condition()) return true;
      std::this_thread::sleep_for(milliseconds(50));
    }
    return false;
  }
  int signs_within(seconds length) {
    (void)systemd_->signs();
    std::this_thread::sleep_for(length);
    return systemd_->signs();
  }
  [[nodiscard]] std::string log() const { return read_text(folder_ / "log.txt"); }
  [[nodiscard]] bool log_has(const std::string& text) const { return log().find(text) != std::string::npos; }

  std::filesystem::path folder_;
  std::optional<Systemd> systemd_;
  std::optional<BackgroundProgram> service_;
};

TEST_F(Supervision, AStandingCoreThreadIsToldAndEndsTheSignsOfLifeUntilItMoves) {
  run(kSilentVehicle);
  for (const char* thread : {"imuscope-io", "imuscope-est"}) {
    {
      const FrozenThread frozen(service_->id(), thread);
      ASSERT_TRUE(soon([&] { return log_has("the thread " + std::string(thread) + " has stood still"); }))
          << log();
      std::this_thread::sleep_for(seconds(2));
      EXPECT_EQ(signs_within(2 * kWatchdog), 0) << thread;
    }
    EXPECT_TRUE(soon([&] { return systemd_->signs() > 0; })) << thread << " moves again";
  }
  service_->interrupt();
  EXPECT_EQ(service_->wait(), kFailedWork) << log();
}

TEST_F(Supervision, AStandingWriterIsToldAndOutlived) {
  run(kSilentVehicle);
  for (const char* thread : {"imuscope-rec", "imuscope-pub"}) {
    const FrozenThread frozen(service_->id(), thread);
    ASSERT_TRUE(soon([&] { return log_has("the thread " + std::string(thread) + " has stood still"); }))
        << log();
    EXPECT_GT(signs_within(2 * kWatchdog), 0)
        << thread << " waits for the disk, and a recording goes on without it";
  }
  service_->interrupt();
  EXPECT_EQ(service_->wait(), kFailedWork) << log();
}

TEST_F(Supervision, ABusThatComesLaterIsTakenAndWhatWasSaidBeforeIsRecorded) {
  ASSERT_EQ(std::system("ip route del 224.0.0.0/4"), 0);
  run(kSilentVehicle);
  ASSERT_TRUE(soon([&] { return log_has("nothing is published over LCM: LCM: no route"); })) << log();
  const auto capture = folder_ / "run" / "capture.lcm";
  ASSERT_TRUE(soon([&] { return read_text(capture).find("IMUSCOPE_STATUS") != std::string::npos; }));

  const auto hears = [&](const std::string& text) {
    return soon([&] {
      (void)run_program("imuscope", {"top", "--event", text}, folder_ / "top.txt");
      return log_has("event: " + text);
    });
  };
  ASSERT_EQ(std::system("ip route add 224.0.0.0/4 dev lo"), 0);
  EXPECT_TRUE(hears("a route came")) << log();
  EXPECT_EQ(run_program("imuscope", {"top", "--once"}, folder_ / "top.txt"), 0)
      << read_text(folder_ / "top.txt");
  // The bus moves: a network card comes up, and the route leads there.
  ASSERT_EQ(
      std::system("ip link add here type veth peer name there && ip addr add 10.77.0.1/24 dev here && "
                  "ip link set here up && ip link set there up && ip route replace 224.0.0.0/4 dev here"),
      0);
  EXPECT_TRUE(hears("the route moved")) << log();
  ASSERT_EQ(std::system("ip route del 224.0.0.0/4"), 0);
  std::this_thread::sleep_for(seconds(5));
  ASSERT_EQ(std::system("ip route add 224.0.0.0/4 dev lo"), 0);
  EXPECT_TRUE(hears("the route is back")) << log();
  service_->interrupt();
  EXPECT_EQ(service_->wait(), kFailedWork) << log();
}

TEST_F(Supervision, StatusTellsAStandingThreadItsAgeAndTheAlarm) {
  const auto runtime = std::filesystem::path("/tmp") / ("imuscope-run-" + std::to_string(getpid()));
  std::filesystem::create_directory(runtime);
  setenv("XDG_RUNTIME_DIR", runtime.c_str(), 1);
  run(kSilentVehicle);
  const auto status = [&] {
    // Other tests run services of their own meanwhile: this one's socket alone. Before its first second it
    // has none.
    std::error_code absent;
    for (const auto& socket : std::filesystem::directory_iterator(runtime / "imuscope", absent)) {
      if (run_program("imuscope", {"status", "--json", "--socket", socket.path().string()},
                      folder_ / "status.json") == 0)
        return nlohmann::json::parse(read_text(folder_ / "status.json"));
    }
    return nlohmann::json::object();
  };
  // The devices are silent: an alarm each, with what to do.
  ASSERT_TRUE(soon([&] { return status().value("/alarms/1/active"_json_pointer, false); }));
  EXPECT_FALSE(status()["alarms"][0]["remedy"].get<std::string>().empty());
  {
    const FrozenThread frozen(service_->id(), "imuscope-rec");
    EXPECT_TRUE(soon([&] {
      const auto now = status();
      const bool told = std::any_of(now["alarms"].begin(), now["alarms"].end(), [](const auto& alarm) {
        return alarm["kind"] == "thread" && alarm["subject"] == "imuscope-rec" && alarm["active"];
      });
      const bool aged = std::any_of(now["threads"].begin(), now["threads"].end(), [](const auto& thread) {
        return thread["name"] == "imuscope-rec" && thread["heartbeat_age_s"].is_number() &&
               thread["heartbeat_age_s"] > 3.0;
      });
      return told && aged;
    })) << read_text(folder_ / "status.json");
  }
  EXPECT_TRUE(soon([&] {
    const auto now = status();
    return std::any_of(now["alarms"].begin(), now["alarms"].end(), [](const auto& alarm) {
      return alarm["kind"] == "thread" && !alarm["active"] && alarm["times"] == 1;
    });
  })) << "it is over, and stays in the list";
  {
    const FrozenThread frozen(service_->id(), "imuscope-pub");
    EXPECT_TRUE(soon([&] { return status()["status_age_s"] > 3.0; }))
        << "what makes the status stands still itself";
  }
  service_->interrupt();
  EXPECT_EQ(service_->wait(), kFailedWork) << log();
  EXPECT_TRUE(std::filesystem::is_empty(runtime / "imuscope"));
  std::filesystem::remove_all(runtime);
  unsetenv("XDG_RUNTIME_DIR");
}

TEST_F(Supervision, TheJournalGetsFieldsOfRunDeviceAndAlarm) {
  // The journal's own socket, in this test's mount namespace.
  std::filesystem::create_directories("/run/systemd/journal");
  ASSERT_EQ(mount("tmpfs", "/run/systemd/journal", "tmpfs", 0, nullptr), 0);
  const int journal = socket(AF_UNIX, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  std::strcpy(address.sun_path, "/run/systemd/journal/socket");
  ASSERT_EQ(bind(journal, reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
  std::ofstream(folder_ / "log.txt") << "";
  struct stat file {};
  ASSERT_EQ(stat((folder_ / "log.txt").c_str(), &file), 0);
  setenv("JOURNAL_STREAM", (std::to_string(file.st_dev) + ":" + std::to_string(file.st_ino)).c_str(), 1);
  std::ofstream(folder_ / "car.toml") << kSilentVehicle;
  service_.emplace(
      "imuscope",
      std::vector<std::string>{"run", (folder_ / "car.toml").string(), "--out", (folder_ / "run").string()},
      folder_ / "log.txt");
  std::vector<std::string> entries;
  const auto has = [&](std::initializer_list<std::string> fields) {
    return std::any_of(entries.begin(), entries.end(), [&](const std::string& entry) {
      return std::all_of(fields.begin(), fields.end(), [&](const std::string& field) {
        return entry.find(field + "\n") != std::string::npos;
      });
    });
  };
  EXPECT_TRUE(soon([&] {
    std::array<char, 8192> text{};
    for (ssize_t n = 0; (n = recv(journal, text.data(), text.size(), 0)) > 0;)
      entries.emplace_back(text.data(), static_cast<std::size_t>(n));
    return has({"IMUSCOPE_RUN=silent", "IMUSCOPE_DEVICE=mtx1", "PRIORITY=6"}) &&
           has({"IMUSCOPE_ALARM=device", "IMUSCOPE_SUBJECT=mtx1", "IMUSCOPE_ACTIVE=1", "IMUSCOPE_TIMES=1",
                "PRIORITY=4"});
  }));
  service_->interrupt();
  EXPECT_EQ(service_->wait(), kFailedWork) << log();
  unsetenv("JOURNAL_STREAM");
  close(journal);
}

/// Holds the port of a name server and never answers.
class SilentNameServer {
 public:
  SilentNameServer() : socket_(socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0)) {
    constexpr std::uint16_t kDnsPort = 53;
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(kDnsPort);
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    EXPECT_EQ(bind(socket_, reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
  }
  ~SilentNameServer() { close(socket_); }
  SilentNameServer(const SilentNameServer&) = delete;
  SilentNameServer& operator=(const SilentNameServer&) = delete;

  /// Whether somebody asks.
  [[nodiscard]] bool was_asked() const {
    char byte = 0;
    return recv(socket_, &byte, 1, MSG_DONTWAIT) > 0;
  }

 private:
  int socket_;
};

TEST_F(Supervision, ANameServerThatDoesNotAnswerHoldsNothingButItsLine) {
  const SilentNameServer names;
  std::ofstream(folder_ / "resolv.conf") << "nameserver 127.0.0.1\n";
  if (mount((folder_ / "resolv.conf").c_str(), "/etc/resolv.conf", nullptr, MS_BIND, nullptr) != 0)
    GTEST_SKIP() << "/etc/resolv.conf cannot be mounted over";
  std::string configuration = kSilentVehicle;
  const std::string own = R"(kind = "udp", host = "", port = 18114)";
  configuration.replace(configuration.find(own), own.size(),
                        R"(kind = "tcp", host = "mtx.example", port = 1)");
  run(configuration);
  ASSERT_TRUE(soon([&] { return names.was_asked(); }));
  EXPECT_GE(signs_within(5 * kWatchdog), 5) << "one is due each second";
  EXPECT_TRUE(log_has("mtx.example has not been found for seconds: the name server does not answer"))
      << log();
  EXPECT_TRUE(log_has("airins: udp://:18113 is open")) << log();
  service_->interrupt();
  EXPECT_EQ(service_->wait(), kFailedWork) << log();
}

/// The service with its output in a pipe, or in a terminal of its own.
class Started {
 public:
  /// @param far_end  of its output, taken over; a terminal becomes its controlling one
  Started(const std::filesystem::path& folder, int far_end) : process_(fork()) {
    if (process_ == 0) {
      if (isatty(far_end) != 0) {
        login_tty(far_end);
      } else {
        dup2(far_end, STDOUT_FILENO);
        dup2(far_end, STDERR_FILENO);
      }
      const std::string program = program_path("imuscope").string();
      const std::string configuration = (folder / "car.toml").string();
      const std::string out = (folder / "run").string();
      execl(program.c_str(), program.c_str(), "run", configuration.c_str(), "--out", out.c_str(), nullptr);
      _exit(127);
    }
    close(far_end);
  }
  ~Started() {
    if (process_ <= 0) return;
    kill(process_, SIGKILL);
    waitpid(process_, nullptr, 0);
  }
  Started(const Started&) = delete;
  Started& operator=(const Started&) = delete;
  void interrupt() const { kill(process_, SIGINT); }
  void hang_up() const { kill(process_, SIGHUP); }
  /// Its exit code, or -1 where a signal ended it.
  int wait() {
    int status = 0;
    waitpid(process_, &status, 0);
    process_ = -1;
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  }

 private:
  pid_t process_;
};

/// Reads until the text comes.
bool comes(int fd, const std::string& text) {
  std::string heard;
  std::array<char, 512> bytes{};
  for (ssize_t n = 0; (n = read(fd, bytes.data(), bytes.size())) > 0;) {
    heard.append(bytes.data(), static_cast<std::size_t>(n));
    if (heard.find(text) != std::string::npos) return true;
  }
  return false;
}

TEST_F(Supervision, ALogThatNobodyReadsAnyMoreCostsNoRun) {
  std::ofstream(folder_ / "car.toml") << kSilentVehicle;
  std::array<int, 2> pipe_ends{};
  ASSERT_EQ(pipe2(pipe_ends.data(), O_CLOEXEC), 0);
  Started service(folder_, pipe_ends[1]);
  ASSERT_TRUE(comes(pipe_ends[0], "Ctrl-C ends it"));
  close(pipe_ends[0]);  // as Ctrl-C does to `| tee`
  std::this_thread::sleep_for(seconds(2));
  service.interrupt();
  EXPECT_EQ(service.wait(), kFailedWork) << "no device sent anything";
  EXPECT_TRUE(std::filesystem::exists(folder_ / "run" / "run.json"));
}

TEST_F(Supervision, AClosedTerminalEndsTheRunAndAnOpenOneReadsTheConfigurationAgain) {
  std::ofstream(folder_ / "car.toml") << kSilentVehicle;
  int terminal = -1;
  int far_end = -1;
  ASSERT_EQ(openpty(&terminal, &far_end, nullptr, nullptr, nullptr), 0);
  fcntl(terminal, F_SETFD, FD_CLOEXEC);
  Started service(folder_, far_end);
  ASSERT_TRUE(comes(terminal, "Ctrl-C ends it"));
  service.hang_up();
  ASSERT_TRUE(comes(terminal, "[lcm] and [noise] of"));
  close(terminal);  // the kernel sends SIGHUP
  EXPECT_EQ(service.wait(), kFailedWork) << "no device sent anything";
  EXPECT_TRUE(std::filesystem::exists(folder_ / "run" / "run.json"));
}

}  // namespace
}  // namespace imuscope::test
