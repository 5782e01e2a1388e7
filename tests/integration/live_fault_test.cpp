/// The live service on a simulated vehicle whose devices fail one after another: each is brought back, what
/// is lost is counted, the others notice nothing, and the recording replays to the same estimates.

#include <gtest/gtest.h>
#include <chrono>
#include <fstream>

#include "demo_vehicle.h"
#include "programs.h"
#include "status_listener.h"
#include "tests/support/shared_data.h"

namespace imuscope::test {
namespace {

// The drive shows how the S-IMUs sit by its second 85; the faults come after that. What a line that is opened
// in the middle of a message makes of its tail is counted before them.
constexpr std::chrono::seconds kRun{58};
constexpr const char* kFaults = R"(
[[fault]]
kind = "unplug"
device = "mtx1"
at_s = 90.0
for_s = 3.0
[[fault]]
kind = "flip"
device = "mtx2"
at_s = 90.0
for_s = 8.0
share = 0.001
[[fault]]
kind = "stall"
device = "mtx3"
at_s = 90.0
for_s = 3.0
[[fault]]
kind = "cut"
device = "gnss"
at_s = 90.0
for_s = 5.0
share = 0.3
[[fault]]
kind = "restart"
device = "mtx2"
at_s = 102.0
for_s = 0.5
[[fault]]
kind = "clock_jump"
device = "mtx3"
at_s = 102.0
by_s = 2.0
)";

class LiveFaults : public testing::Test {
 protected:
  void SetUp() override {
    if (!enter_private_network()) GTEST_SKIP() << "a private network namespace needs root";
    DemoVehicle().ports_in(folder_ / "ports").write(folder_ / "live.toml");
    std::ofstream(folder_ / "faults.toml") << kFaults;
  }

  [[nodiscard]] const device_status_t& at(double t_s, const std::string& name) const {
    return listener_.device_at(t_s, name);
  }
  [[nodiscard]] const device_status_t& at_end(const std::string& name) const { return at(1e9, name); }

  std::filesystem::path folder_ = scratch_folder();
  Listener listener_;
};

TEST_F(LiveFaults, EachDeviceComesBackIsCountedAndDisturbsNoOther) {
  ASSERT_NO_FATAL_FAILURE(run_beside(folder_, "live.toml", kRun, listener_));
  SCOPED_TRACE(read_text(folder_ / "imuscope.log"));
  ASSERT_GT(listener_.heard.size(), 30U);

  for (const char* name : {"airins", "mtx1", "mtx2", "mtx3", "gnss"}) {
    EXPECT_EQ(at(89.0, name).state, "streaming") << name;
    EXPECT_EQ(at_end(name).state, "streaming") << name;
    EXPECT_EQ(at_end(name).samples_refused, 0) << name;
  }

  // The reference ran beside all of it and lost nothing.
  EXPECT_EQ(at_end("airins").samples_lost, 0);
  EXPECT_EQ(at_end("airins").bad_checksums, 0);
  EXPECT_EQ(at_end("airins").clock_resets, 0);

  // Unplugged for 3 s: said, opened again by its name, taken over as it streams; the 300 samples are counted.
  EXPECT_TRUE(listener_.any_status("mtx1", [](const device_status_t& d) { return d.state == "no line"; }));
  const auto lost = at_end("mtx1").samples_lost - at(89.0, "mtx1").samples_lost;
  EXPECT_GE(lost, 298);
  EXPECT_LE(lost, 700) << "3 s, and as long again at most of back-off, which doubles";
  EXPECT_NE(read_text(folder_ / "imuscope.log").find("mtx1 at 115200 baud is gone"), std::string::npos);

  // Flipped bits cost the messages that they hit: 8 s of 3100 bytes/s hold some 25 of them.
  const auto damaged = at(100.0, "mtx2").samples_lost - at(89.0, "mtx2").samples_lost;
  EXPECT_GE(damaged, 8);
  EXPECT_LE(damaged, 50);
  EXPECT_GE(at(100.0, "mtx2").bad_checksums - at(89.0, "mtx2").bad_checksums, 8);
  // Without power its settings stay and its counter does not: set up anew, a new segment of its clock.
  EXPECT_GE(at_end("mtx2").clock_resets, 1);

  // A stall that ends by itself loses nothing, though it lasts longer than the second after which a device
  // counts as silent; a jump of its count by 200 looks like 200 lost samples, or like a new segment.
  EXPECT_EQ(at(100.0, "mtx3").samples_lost, at(89.0, "mtx3").samples_lost);
  EXPECT_EQ(at(100.0, "mtx3").bad_checksums, at(89.0, "mtx3").bad_checksums);
  EXPECT_TRUE(at_end("mtx3").samples_lost - at(100.0, "mtx3").samples_lost == 200 ||
              at_end("mtx3").clock_resets == 1);

  // Epochs that lost a piece are dropped, whole ones used.
  EXPECT_GT(at(100.0, "gnss").bytes_skipped, at(89.0, "gnss").bytes_skipped);
  EXPECT_GT(at_end("gnss").samples, at(100.0, "gnss").samples + 50);

  // What happened is in the recording: it replays to the same files.
  ASSERT_EQ(run_program("imuscope",
                        {"replay", (folder_ / "live" / "capture.lcm").string(), "--out",
                         (folder_ / "replay").string()},
                        folder_ / "replay.log"),
            0)
      << read_text(folder_ / "replay.log");
  for (const char* name : {"navigation.csv", "calibration_mtx1.csv", "calibration_mtx2.csv",
                           "errors_mtx1.csv", "errors_mtx2.csv", "errors_mtx3.csv"}) {
    const auto live = read_text(folder_ / "live" / name);
    EXPECT_GT(live.size(), 1000U) << name;
    EXPECT_TRUE(live == read_text(folder_ / "replay" / name)) << name << " differs between live and replay";
  }
}

}  // namespace
}  // namespace imuscope::test
