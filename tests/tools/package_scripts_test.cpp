/// What the Debian package does to a PC on which a recording goes on, and what its unit lets the service
/// open.

#include <gtest/gtest.h>
#include <sys/mount.h>
#include <sys/stat.h>
#include <unistd.h>

#include <sched.h>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <set>
#include <string>

#include "tests/support/child_process.h"
#include "tests/support/file_content.h"
#include "tests/support/shared_data.h"

namespace imuscope {
namespace {

using test::in_child;
using test::kNotPermitted;

TEST(PackageScripts, AnUpgradeCutsNoRecording) {
  const auto folder = test::scratch_folder();
  std::filesystem::create_directory(folder / "bin");
  // A systemctl whose service is active; what it is asked for stays.
  for (const char* program : {"systemctl", "udevadm"}) {
    std::ofstream(folder / "bin" / program)
        << "#!/bin/sh\necho " << program << " \"$*\" >>'" << (folder / "asked.txt").string() << "'\n";
    std::filesystem::permissions(folder / "bin" / program, std::filesystem::perms::owner_all);
  }
  const int outcome = in_child([&] {
    if (unshare(CLONE_NEWNS) != 0 || mount("none", "/", nullptr, MS_REC | MS_PRIVATE, nullptr) != 0 ||
        mount("tmpfs", "/run", "tmpfs", 0, nullptr) != 0)
      return kNotPermitted;
    std::filesystem::create_directories("/run/systemd/system");
    setenv("PATH", ((folder / "bin").string() + ":/bin:/usr/bin").c_str(), 1);
    const std::string scripts = test::source_path("cmake/debian").string();
    const std::string said = " >>'" + (folder / "said.txt").string() + "' 2>&1";
    if (std::system(("sh " + scripts + "/prerm upgrade 0.2.0" + said).c_str()) != 0) return 1;
    if (std::system(("sh " + scripts + "/postinst configure 0.1.0" + said).c_str()) != 0) return 2;
    return 0;
  });
  if (outcome == kNotPermitted) GTEST_SKIP() << "a private mount namespace needs root";
  ASSERT_EQ(outcome, 0) << test::content_of(folder / "said.txt");
  const std::string asked = test::content_of(folder / "asked.txt");
  EXPECT_NE(asked.find("systemctl daemon-reload"), std::string::npos) << asked;
  EXPECT_EQ(asked.find("restart"), std::string::npos) << asked;
  EXPECT_EQ(asked.find("stop"), std::string::npos) << asked;
  EXPECT_EQ(asked.find("disable"), std::string::npos) << asked;
  EXPECT_NE(test::content_of(folder / "said.txt").find("when it may end: systemctl restart imuscope"),
            std::string::npos);
}

TEST(PackageScripts, TheUnitLetsTheStateOfTheClockBeReadAndNobodySetIt) {
  std::ifstream unit(test::source_path("config/imuscope.service"));
  std::set<std::string> lines;
  for (std::string line; std::getline(unit, line);) lines.insert(line);
  EXPECT_TRUE(lines.contains("SystemCallFilter=@system-service adjtimex clock_adjtime clock_adjtime64"))
      << "the set of systemd leaves out the calls that read it";
  EXPECT_FALSE(lines.contains("ProtectClock=yes")) << "it refuses these calls whatever the filter allows";
  EXPECT_TRUE(lines.contains("CapabilityBoundingSet=")) << "CAP_SYS_TIME would set the clock";
  EXPECT_TRUE(lines.contains("NoNewPrivileges=yes"));
}

TEST(PackageScripts, TheUnitKeepsItsSocketToItselfAndOutlivesAShortageOfMemory) {
  std::ifstream unit(test::source_path("config/imuscope.service"));
  std::set<std::string> lines;
  for (std::string line; std::getline(unit, line);) lines.insert(line);
  EXPECT_TRUE(lines.contains("RuntimeDirectory=imuscope"));
  EXPECT_TRUE(lines.contains("RuntimeDirectoryMode=0700"));
  EXPECT_TRUE(lines.contains("OOMScoreAdjust=-500"));
}

TEST(PackageScripts, TheUnitAllowsPortsThatArePluggedInLater) {
  std::ifstream unit(test::source_path("config/imuscope.service"));
  std::set<std::string> allowed;
  constexpr std::string_view kKey = "DeviceAllow=";
  for (std::string line; std::getline(unit, line);) {
    if (line.starts_with(kKey)) allowed.insert(line.substr(kKey.size()));
  }
  for (const char* ports : {"char-188 rw", "char-166 rw", "char-4 rw", "char-204 rw", "char-207 rw"})
    EXPECT_TRUE(allowed.contains(ports)) << ports;
  for (const char* clocks : {"char-pps rw", "char-ptp r"})
    EXPECT_TRUE(allowed.contains(clocks)) << "pulses of UTC, clocks of network cards: " << clocks;
  for (const char* loaded_later : {"char-ttyUSB rw", "char-ttyACM rw"})
    EXPECT_FALSE(allowed.contains(loaded_later)) << "unknown to the kernel until the first is plugged in";
}

}  // namespace
}  // namespace imuscope
