/// A minute of hardship: three S-IMUs, reference and receiver, refits whose models go back to the filter,
/// recording; both processors busy and the disk, too; the vehicle's devices stall and burst, all of them are
/// unplugged and come back, the service itself is stopped for a moment. All the while a guard in the
/// unmodified program watches the core's threads. Then: the capture without its published messages replays to
/// the same files, to the bit, every time, and a single flipped payload bit shows.

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <openssl/evp.h>
#include <sched.h>
#include <sys/wait.h>
#include <unistd.h>
#include <array>
#include <atomic>
#include <chrono>
#include <csignal>
#include <fstream>
#include <iostream>
#include <optional>
#include <regex>
#include <thread>

#include "capture/capture_reader.h"
#include "capture/capture_writer.h"
#include "capture/event_log_reader.h"
#include "demo_vehicle.h"
#include "guard_report.h"
#include "programs.h"
#include "tests/support/shared_data.h"

namespace imuscope::test {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr int kRun_s = 60;
/// Afterwards, without load: what starved at idle priority catches up, and its model goes back to the filter.
constexpr int kCalm_s = 8;
constexpr std::array kOutputs{"navigation.csv",       "calibration_mtx1.csv", "calibration_mtx2.csv",
                              "calibration_mtx3.csv", "errors_mtx1.csv",      "errors_mtx2.csv",
                              "errors_mtx3.csv",      "calibration.json",     "models.json"};

std::string sha256(const std::string& bytes) {
  std::array<unsigned char, EVP_MAX_MD_SIZE> digest{};
  unsigned int size = 0;
  EVP_Digest(bytes.data(), bytes.size(), digest.data(), &size, EVP_sha256(), nullptr);
  std::string hex;
  for (unsigned int i = 0; i < size; ++i) {
    char two[3];
    std::snprintf(two, sizeof two, "%02x", digest[i]);
    hex += two;
  }
  return hex;
}

using Hashes = std::map<std::string, std::string>;

Hashes hashes_of(const std::filesystem::path& run) {
  Hashes hashes;
  for (const char* name : kOutputs) {
    const auto text = read_text(run / name);
    EXPECT_GT(text.size(), 1000U) << run / name;
    hashes[name] = sha256(text);
  }
  return hashes;
}

/// Processors and disk kept busy, by processes that end with this object.
class Load {
 public:
  explicit Load(const std::filesystem::path& folder) {
    for (int i = 0; i < 2; ++i)
      add([] {
        std::atomic<unsigned> n{0};
        for (;;) n.fetch_add(1, std::memory_order_relaxed);
      });
    add([&] {
      const std::string block(1 << 20, 'x');
      for (;;) std::ofstream(folder / "load") << block << std::flush;
    });
  }
  ~Load() {
    for (const pid_t process : processes_) {
      kill(process, SIGKILL);
      waitpid(process, nullptr, 0);
    }
  }
  Load(const Load&) = delete;
  Load& operator=(const Load&) = delete;

 private:
  template <typename Work>
  void add(const Work& work) {
    const pid_t child = fork();
    if (child == 0) {
      work();
      _exit(0);
    }
    processes_.push_back(child);
  }
  std::vector<pid_t> processes_;
};

/// The demo's configuration with ports in `folder`, frequent refits that go back to the filter, and mountings
/// that are roughly known, so that the filter works from the first seconds on.
std::filesystem::path configuration_in(const std::filesystem::path& folder) {
  return DemoVehicle()
      .ports_in(folder / "ports")
      .with_priors()
      .set("noise.refit_interval_s", 8.0)
      .set("noise.apply_to_filter", true)
      .write(folder / "hardship.toml");
}

/// The capture again, event by event; `change` may alter an event, or leave it out by returning false.
template <typename Change>
void copy_capture(const std::filesystem::path& from, const std::filesystem::path& to, const Change& change) {
  auto log = EventLogReader::open(from);
  ASSERT_TRUE(log.has_value());
  auto copy = CaptureWriter::create(to);
  ASSERT_TRUE(copy.has_value());
  for (LogEvent event; log->next(event);) {
    if (change(event)) copy->append(event.channel, event.utime, event.data);
  }
  ASSERT_TRUE(copy->close().has_value());
}

bool is_published(const std::string& channel) {
  return !std::regex_match(channel, std::regex("IMUSCOPE_(RUN|RAW_.*|EXCEPTION|APPLIED_MODEL)"));
}

class Hardship : public testing::Test {
 protected:
  void SetUp() override {
    if (unshare(CLONE_NEWNET) != 0) GTEST_SKIP() << "a private network namespace needs root";
    ASSERT_EQ(std::system("ip link set lo up multicast on && ip route add 224.0.0.0/4 dev lo"), 0);
  }

  std::unique_ptr<BackgroundProgram> vehicle(int from_s) {
    return std::make_unique<BackgroundProgram>(
        "imusim",
        std::vector<std::string>{"live", configuration_.string(), "--start-s", std::to_string(from_s),
                                 "--seconds", std::to_string(kRun_s + 30)},
        folder_ / "imusim.log");
  }

  /// The minute. Times are those of the disturbance, not asserted anywhere.
  void run_live() {
    constexpr int kBegin_s = 62;  // the scenario's vehicle drives from its second minute on
    auto devices = vehicle(kBegin_s);
    std::unique_ptr<BackgroundProgram> service;
    {
#ifdef IMUSCOPE_HAS_CORE_GUARD
      const ScopedGuard guard(folder_ / "guard.txt");
#endif
      service = std::make_unique<BackgroundProgram>(
          "imuscope",
          std::vector<std::string>{"run", configuration_.string(), "--out", (folder_ / "live").string()},
          folder_ / "imuscope.log");
    }
    std::optional<Load> load(std::in_place, folder_);
    const auto begin = std::chrono::steady_clock::now();
    const auto at = [&](int second) { std::this_thread::sleep_until(begin + seconds(second)); };
    at(28);
    for (int i = 0; i < 5; ++i) {  // the devices fall silent and burst
      devices->send(SIGSTOP);
      std::this_thread::sleep_for(milliseconds(150));
      devices->send(SIGCONT);
      std::this_thread::sleep_for(milliseconds(300));
    }
    at(34);
    for (int i = 0; i < 5; ++i) {  // the service is held up over several ticks
      service->send(SIGSTOP);
      std::this_thread::sleep_for(milliseconds(60));
      service->send(SIGCONT);
      std::this_thread::sleep_for(milliseconds(200));
    }
    at(38);
    devices->send(SIGKILL);  // everything is unplugged
    devices->wait();
    std::this_thread::sleep_for(milliseconds(400));
    devices = vehicle(kBegin_s + 40);
    at(kRun_s);
    load.reset();
    at(kRun_s + kCalm_s);
    service->interrupt();
    ASSERT_EQ(service->wait(), 0) << read_text(folder_ / "imuscope.log");
    devices->interrupt();
    devices->wait();
  }

  Hashes replay(const std::filesystem::path& capture, const std::string& name) {
    EXPECT_EQ(run_program("imuscope", {"replay", capture.string(), "--out", (folder_ / name).string()},
                          folder_ / (name + ".log")),
              0)
        << read_text(folder_ / (name + ".log"));
    return hashes_of(folder_ / name);
  }

  void check_guard() const {
#ifdef IMUSCOPE_HAS_CORE_GUARD
    const auto report = read_guard_report(folder_ / "guard.txt");
    for (const char* thread : {"imuscope-io", "imuscope-est"}) {
      ASSERT_TRUE(report.contains(thread)) << read_text(folder_ / "guard.txt");
      std::cout << thread << ": " << report.at(thread).at("waits") << " turns watched;";
      EXPECT_GT(report.at(thread).at("waits"), 4000) << thread;
      for (const auto& [what, count] : offences_of(report.at(thread))) {
        std::cout << " " << what << " " << count;
        EXPECT_EQ(count, 0) << thread << ": " << what << "\n" << read_text(folder_ / "guard.txt");
      }
      // Told, not failed: the kernel may move a page whose owner did nothing.
      std::cout << " (page faults " << report.at(thread).at("page_faults") << ")\n";
    }
#endif
  }

  std::filesystem::path folder_ = scratch_folder();
  std::filesystem::path configuration_ = configuration_in(folder_);
};

TEST_F(Hardship, TheCoreKeepsItsRulesAndTheCaptureReplaysToTheBit) {
  run_live();
  if (HasFatalFailure()) return;
  SCOPED_TRACE(read_text(folder_ / "imuscope.log"));
  check_guard();

  const auto capture = folder_ / "live" / "capture.lcm";
  const auto summary = summarise_capture(capture);
  ASSERT_TRUE(summary.has_value()) << summary.error().text();
  EXPECT_TRUE(summary->losses.empty());
  EXPECT_GT(summary->other_messages, 1000U) << "what is published is recorded, too";
  EXPECT_FALSE(summary->applied_models.empty()) << "no model went back to the filter";
  EXPECT_FALSE(summary->exceptions.empty()) << "the hardship left no trace: it was none";

  const auto bare = folder_ / "bare.lcm";
  copy_capture(capture, bare, [](const LogEvent& event) { return !is_published(event.channel); });
  const auto live = hashes_of(folder_ / "live");
  for (const auto& [name, hash] : live) std::cout << hash.substr(0, 16) << "  " << name << "\n";
  EXPECT_EQ(replay(bare, "first"), live);
  EXPECT_EQ(replay(bare, "second"), live);

  // A third into the run, before anything is disturbed: from here on every output depends on the byte.
  const auto flipped = folder_ / "flipped.lcm";
  std::int64_t reads = 0;
  copy_capture(bare, flipped, [&](LogEvent& event) {
    const auto wanted = static_cast<std::int64_t>(summary->devices.at("mtx2").reads / 3);
    if (event.channel == "IMUSCOPE_RAW_MTX2" && ++reads == wanted) event.data.back() ^= 1U;  // of the payload
    return true;
  });
  const auto changed = replay(flipped, "flipped");
  EXPECT_NE(changed.at("errors_mtx2.csv"), live.at("errors_mtx2.csv"));
  EXPECT_NE(changed.at("calibration_mtx2.csv"), live.at("calibration_mtx2.csv"));
}

}  // namespace
}  // namespace imuscope::test
