/// Somebody sets the wall clock while a run is recorded: by an hour either way, by a second, by slewing it.
/// What a person marks stays where it was marked, the run's files know of every step, and no result moves.

#include <gtest/gtest.h>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <imuscope/event_t.hpp>
#include <imuscope/pc_clock_t.hpp>
#include <map>

#include "capture/capture_reader.h"
#include "capture/event_log_reader.h"
#include "programs.h"
#include "publish/message_codec.h"
#include "status_listener.h"
#include "tests/support/shared_data.h"

namespace imuscope::test {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr milliseconds kLabelWithin{10};
/// Between events, and from the clock's being set to the next.
constexpr milliseconds kApart{730};

constexpr const char* kVehicle = R"([run]
name = "wall"
[[device]]
name = "airins"
role = "reference"
protocol = "ixblue_stdbin"
axes = "+x -y -z"
transport = { kind = "udp", port = 29500 }
[[device]]
name = "ins"
role = "study"
protocol = "ixblue_stdbin"
transport = { kind = "udp", port = 29501 }
[simulation]
duration_s = 600.0
[[simulation.imu]]
name = "ins"
)";

/// A wall clock that is wrong: how host_fault.cpp calls it, and by how much it steps as it begins.
struct Wrong {
  char mode;
  double step_s;
};
constexpr Wrong kWrongs[] = {{'t', 3600.0}, {'b', -3600.0}, {'s', -1.0}, {'w', 0.0}};

/// CLOCK_MONOTONIC, which the service stamps by.
HostTime now() { return HostTime{std::chrono::steady_clock::now().time_since_epoch()}; }

TEST(WallClock, ThatIsSetDuringARunMovesNoLabelAndIsTold) {
  if (!enter_private_network()) GTEST_SKIP() << "a private network namespace needs root";
  const auto folder = scratch_folder();
  std::ofstream(folder / "car.toml") << kVehicle;
  const auto set_clock = [&](char mode) { std::ofstream(folder / "control") << mode; };
  set_clock('-');
  BackgroundProgram vehicle("imusim", {"live", (folder / "car.toml").string()}, folder / "imusim.log");
  ::setenv("LD_PRELOAD", program_path("libhost_fault.so").c_str(), 1);
  ::setenv("HOST_FAULT_CONTROL", (folder / "control").c_str(), 1);
  BackgroundProgram service("imuscope",
                            {"run", (folder / "car.toml").string(), "--out", (folder / "live").string()},
                            folder / "imuscope.log");
  ::unsetenv("LD_PRELOAD");
  ::unsetenv("HOST_FAULT_CONTROL");
  std::this_thread::sleep_for(seconds(4));

  lcm::LCM bus("udpm://239.255.76.67:7667?ttl=0");
  ASSERT_TRUE(bus.good());
  std::map<std::string, HostTime> marked;
  const auto mark = [&] {
    event_t event{};
    event.source = "test";
    event.text = "event " + std::to_string(marked.size());
    marked[event.text] = now();
    ASSERT_EQ(bus.publish("IMUSCOPE_EVENT", &event), 0);
  };
  for (const Wrong& wrong : kWrongs) {
    for (const char mode : {'-', wrong.mode}) {
      set_clock(mode);
      for (int i = 0; i < 3; ++i) {
        std::this_thread::sleep_for(kApart);
        mark();
      }
    }
  }
  set_clock('-');
  std::this_thread::sleep_for(kApart);
  mark();
  std::this_thread::sleep_for(seconds(1));
  service.interrupt();
  ASSERT_EQ(service.wait(), 0) << read_text(folder / "imuscope.log");
  vehicle.interrupt();
  vehicle.wait();
  SCOPED_TRACE(read_text(folder / "imuscope.log"));

  const auto summary = summarise_capture(folder / "live" / "capture.lcm");
  ASSERT_TRUE(summary.has_value()) << summary.error().text();
  ASSERT_EQ(summary->events.size(), marked.size());
  for (const auto& event : summary->events) {
    ASSERT_TRUE(marked.contains(event.text)) << event.text;
    EXPECT_NEAR(to_seconds(event.time - marked.at(event.text)), 0.0, to_seconds(kLabelWithin)) << event.text;
  }

  // To and fro: each step has its way back. What was slewed for seconds is too small to be one.
  const auto run = read_json(folder / "live" / "run.json").at("pc_clock");
  std::vector<double> expected;
  for (const Wrong& wrong : kWrongs) {
    if (wrong.step_s == 0.0) continue;
    expected.push_back(wrong.step_s);
    expected.push_back(-wrong.step_s);
  }
  std::vector<double> found;
  for (const auto& step : run.at("steps")) {
    if (std::abs(step.at("size_s").get<double>()) > 0.5) found.push_back(step.at("size_s").get<double>());
  }
  ASSERT_EQ(found.size(), expected.size()) << run.dump(2);
  for (std::size_t i = 0; i < found.size(); ++i) EXPECT_NEAR(found[i], expected[i], 0.01);
  EXPECT_FALSE(run.at("first").is_null());

  std::vector<double> recorded;
  auto log = EventLogReader::open(folder / "live" / "capture.lcm");
  ASSERT_TRUE(log.has_value());
  LogEvent record;
  std::int64_t states = 0;
  while (log->next(record)) {
    const auto clock = decode_message<pc_clock_t>(record.data);
    if (!clock) continue;
    EXPECT_EQ(clock->sequence, states++);
    if (std::abs(clock->step_s) > 0.5) recorded.push_back(clock->step_s);
  }
  EXPECT_EQ(recorded, found) << "the capture has them as well";
}

}  // namespace
}  // namespace imuscope::test
