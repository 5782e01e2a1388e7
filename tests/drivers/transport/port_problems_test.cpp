#include "drivers/transport/port_problems.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>

#include "tests/support/shared_data.h"

namespace imuscope {
namespace {

TEST(PortProblems, EveryRefusalComesWithItsRemedy) {
  const Error denied = explain_open_failure("/dev/null", EACCES);
  EXPECT_NE(denied.remedy.find("usermod -aG "), std::string::npos);
  EXPECT_NE(denied.remedy.find("udev rule"), std::string::npos);
  const Error busy = explain_open_failure("/dev/null", EBUSY);
  EXPECT_NE(busy.remedy.find("ID_MM_DEVICE_IGNORE"), std::string::npos);
  EXPECT_NE(explain_open_failure("/dev/ttyS9", ENXIO).remedy.find("plug"), std::string::npos);
  EXPECT_NE(explain_open_failure("/dev/ttyUSB77", ENOENT).remedy.find("plug the device in"),
            std::string::npos);
  const Error folder = explain_open_failure("/dev/serial/by-id", EISDIR);
  EXPECT_NE(folder.text().find("is a folder"), std::string::npos);
  EXPECT_NE(folder.remedy.find("/dev/serial/by-id"), std::string::npos);
  const Error other = explain_open_failure("/dev/ttyS9", EMFILE);
  EXPECT_NE(other.text().find("/dev/ttyS9"), std::string::npos);
  EXPECT_NE(other.text().find(std::strerror(EMFILE)), std::string::npos);
}

TEST(PortProblems, AnAdaptersLatencyTimerIsRead) {
  const auto folder = test::scratch_folder();
  std::filesystem::create_directories(folder / "adapters" / "ttyUSB3");
  std::ofstream(folder / "adapters" / "ttyUSB3" / "latency_timer") << "16\n";
  std::ofstream(folder / "ttyUSB3").put('x');
  std::ofstream(folder / "ttyACM0").put('x');
  // By its stable name, as udev links it.
  std::filesystem::create_symlink(folder / "ttyUSB3", folder / "usb-FTDI_mtx1");
  const std::string adapters = (folder / "adapters").string();
  EXPECT_EQ(latency_timer_ms((folder / "usb-FTDI_mtx1").string(), adapters), 16);
  EXPECT_FALSE(latency_timer_ms((folder / "ttyACM0").string(), adapters).has_value());
  EXPECT_FALSE(latency_timer_ms((folder / "none").string(), adapters).has_value());
}

TEST(PortProblems, AMissingPortNamesThoseOfItsKindAndWithoutAnySaysThatNoneIsThere) {
  const auto folder = test::scratch_folder();
  const std::string missing = (folder / "ttyX7").string();
  const Error alone = explain_open_failure(missing, ENOENT);
  EXPECT_EQ(alone.what, "port " + missing + " does not exist");
  EXPECT_EQ(alone.remedy.find("ttyX1"), std::string::npos);
  if (serial_ports().empty()) {
    EXPECT_NE(alone.remedy.find("no serial port is there at all"), std::string::npos);
  }
  std::ofstream(folder / "ttyX1").put('x');
  std::ofstream(folder / "ttyY1").put('x');
  const Error among_others = explain_open_failure(missing, ENOENT);
  EXPECT_NE(among_others.remedy.find((folder / "ttyX1").string()), std::string::npos) << among_others.remedy;
  EXPECT_EQ(among_others.remedy.find("ttyY1"), std::string::npos) << "another kind of port";
}

TEST(PortProblems, APortThatNobodyIsSeenToHoldIsSaidToBeInUseAllTheSame) {
  const auto file = test::scratch_folder() / "ttyX0";
  std::ofstream(file).put('x');
  EXPECT_NE(explain_open_failure(file.string(), EBUSY).what.find("in use by another program"),
            std::string::npos);
}

TEST(PortProblems, APortThatTheUnitDoesNotAllowNamesTheUnitsKey) {
  const auto problem = explain_open_failure("/dev/null", EPERM);
  EXPECT_NE(problem.remedy.find("DeviceAllow=char-1 rw"), std::string::npos) << problem.remedy;
  EXPECT_NE(explain_open_failure("/dev/null", EACCES).remedy.find("usermod -aG"), std::string::npos);
}

TEST(PortProblems, TheGroupOfAPortThatIsNotThereIsTheUsualOne) {
  const auto file = test::scratch_folder() / "ttyX0";
  EXPECT_NE(explain_open_failure(file.string(), EACCES).remedy.find("usermod -aG dialout"),
            std::string::npos);
  // A group without a name.
  std::ofstream(file).put('x');
  if (chown(file.c_str(), static_cast<uid_t>(-1), 54'321) != 0)
    GTEST_SKIP() << "giving a file away needs root";
  EXPECT_NE(explain_open_failure(file.string(), EPERM).remedy.find("usermod -aG dialout"), std::string::npos);
}

}  // namespace
}  // namespace imuscope
