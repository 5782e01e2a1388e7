/// `imuscope probe` on simulated devices that hear and speak at their own speed only, and the drafted
/// configuration put to use.

#include <gtest/gtest.h>
#include <thread>

#include "demo_vehicle.h"
#include "programs.h"
#include "tests/support/shared_data.h"

namespace imuscope::test {
namespace {

namespace fs = std::filesystem;

bool wait_for(const fs::path& path) {
  for (int i = 0; i < 200 && !fs::exists(path); ++i)
    std::this_thread::sleep_for(std::chrono::milliseconds(25));
  return fs::exists(path);
}

/// The demo with its ports in `folder`, one MTx at another speed.
fs::path configuration_in(const fs::path& folder) {
  return DemoVehicle()
      .ports_in(folder / "ports")
      .set_device("mtx2", "transport.baud", 921600)
      .write(folder / "vehicle.toml");
}

TEST(Probe, FindsSpeedsProtocolsAndIdsAndDraftsAConfigurationThatRuns) {
  const auto folder = scratch_folder();
  const auto configuration = configuration_in(folder);
  BackgroundProgram vehicle("imusim", {"live", configuration.string(), "--skip-static"},
                            folder / "imusim.log");
  ASSERT_TRUE(wait_for(folder / "ports" / "gnss"));
  const auto port = [&](const char* name) { return (folder / "ports" / name).string(); };
  const auto draft = folder / "draft.toml";
  ASSERT_EQ(run_program("imuscope",
                        {"probe", port("mtx1"), port("airins"), port("mtx2"), port("gnss"), port("none"),
                         "--json", "--write", draft.string()},
                        folder / "probe.log"),
            0)
      << read_text(folder / "probe.log");
  const std::string log = read_text(folder / "probe.log");
  const auto found = nlohmann::json::parse(log.substr(log.find("{\n")))["ports"];
  ASSERT_EQ(found.size(), 5U);
  EXPECT_EQ(found[0]["protocol"], "xsens_mt");
  EXPECT_EQ(found[0]["baud"], 115200);
  EXPECT_EQ(found[0]["device_id"], "00300002");
  EXPECT_EQ(found[1]["protocol"], "ixblue_stdbin");
  EXPECT_EQ(found[1]["baud"], 460800);
  EXPECT_NEAR(found[1]["rate_hz"].get<double>(), 100.0, 5.0);
  EXPECT_EQ(found[2]["protocol"], "xsens_mt");
  EXPECT_EQ(found[2]["baud"], 921600);
  EXPECT_EQ(found[2]["device_id"], "00300003");
  EXPECT_EQ(found[3]["protocol"], "greis");
  EXPECT_TRUE(found[4]["protocol"].is_null());
  EXPECT_NE(found[4]["problem"].get<std::string>().find("does not exist"), std::string::npos);

  // An existing draft is never written over.
  const std::string drafted = read_text(draft);
  EXPECT_EQ(run_program("imuscope", {"probe", port("gnss"), "--write", draft.string()}, folder / "again.log"),
            2);
  EXPECT_EQ(read_text(draft), drafted);

  ASSERT_EQ(
      run_program("imuscope", {"run", draft.string(), "--out", (folder / "run").string(), "--seconds", "8"},
                  folder / "run.log"),
      0)
      << read_text(folder / "run.log");
  const auto run = read_json(folder / "run" / "run.json");
  EXPECT_FALSE(run.contains("regimes")) << "only a study tells rest from motion";
  for (const auto& device : run["devices"]) {
    EXPECT_GT(device["samples"].get<int>(), 20) << device << read_text(folder / "run.log");
    // A device that streams already is joined in the middle of a message, which counts as one damaged.
    EXPECT_LE(device["bad_checksums"].get<int>(), 1) << device;
  }
}

}  // namespace
}  // namespace imuscope::test
