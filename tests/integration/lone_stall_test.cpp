/// The line of one device stands still alone, for up to a minute, in replay: nothing of it is lost, late or
/// measured against another instant, no clock begins anew, whichever device it is. On CAN as on a serial
/// line.

#include <gtest/gtest.h>
#include <algorithm>
#include <fstream>
#include <ostream>
#include <string>

#include "programs.h"
#include "tests/support/shared_data.h"

namespace imuscope::test {
namespace {

struct Stalled {
  const char* device;
  int length_s;
};
std::ostream& operator<<(std::ostream& out, const Stalled& stalled) {
  return out << stalled.device << " for " << stalled.length_s << " s";
}

class LoneStall : public testing::TestWithParam<Stalled> {};

TEST_P(LoneStall, LosesNothing) {
  const auto folder = scratch_folder();
  std::ofstream(folder / "faults.toml") << "[[fault]]\nkind = \"stall\"\ndevice = \"" << GetParam().device
                                        << "\"\nat_s = 240.0\nfor_s = " << GetParam().length_s << ".0\n";
  const auto drive = folder / "drive";
  ASSERT_EQ(run_program("imusim",
                        {"record", source_path("config/demo.toml").string(), "--minutes", "6", "--faults",
                         (folder / "faults.toml").string(), "--out", drive.string()},
                        folder / "imusim.log"),
            0)
      << read_text(folder / "imusim.log");
  const auto out = folder / "run";
  ASSERT_EQ(run_program("imuscope", {"replay", (drive / "capture.lcm").string(), "--out", out.string()},
                        folder / "replay.log"),
            0)
      << read_text(folder / "replay.log");
  const auto run = read_json(out / "run.json");
  for (const auto& event : run.at("events")) {
    const auto said = event.at("text").get<std::string>();
    EXPECT_EQ(said.find("sits differently"), std::string::npos) << said;
    EXPECT_EQ(said.find("calibrated anew"), std::string::npos) << said;
  }
  for (const auto& device : run.at("devices")) {
    EXPECT_EQ(device.at("samples_lost"), 0) << device.at("name");
    EXPECT_EQ(device.at("clock_resets"), 0) << device.at("name");
    EXPECT_EQ(device.at("refused"), 0) << device.at("name");
    if (device.at("role") != "study") continue;
    std::printf("%-6s stalled %2d s: %-5s late %s, waiting at the end %s\n", GetParam().device,
                GetParam().length_s, device.at("name").get<std::string>().c_str(),
                device.at("late").dump().c_str(), device.at("waiting").dump().c_str());
    EXPECT_EQ(device.at("late"), 0) << device.at("name");
    // A row for every sample from the first row to the end of the drive.
    const auto name = "errors_" + device.at("name").get<std::string>() + ".csv";
    const auto text = read_text(out / name);
    const auto n = std::count(text.begin(), text.end(), '\n') - 1;
    const auto first = std::stod(text.substr(text.find('\n') + 1));
    EXPECT_NEAR(static_cast<double>(n), (360.0 - first) * 100.0, 30.0) << name;
  }
}
INSTANTIATE_TEST_SUITE_P(EachDevice, LoneStall,
                         testing::Values(Stalled{"mtx1", 15}, Stalled{"mtx1", 60}, Stalled{"airins", 15},
                                         Stalled{"airins", 60}, Stalled{"gnss", 15}));

}  // namespace
}  // namespace imuscope::test
