#include "drivers/transport/port_problems.h"

#include <gtest/gtest.h>

#include <cerrno>

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
}

}  // namespace
}  // namespace imuscope
