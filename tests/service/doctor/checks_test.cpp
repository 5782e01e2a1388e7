/// Each check against a PC on which it fails, and against one on which it does not.

#include "service/doctor/checks.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sched.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <unistd.h>
#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <memory>
#include <optional>
#include <string>
#include <thread>

#include "rt/host_clock.h"
#include "service/doctor/examination.h"
#include "service/doors/metrics_server.h"
#include "service/doors/status_socket.h"
#include "service/lines/line_factory.h"
#include "tests/support/child_process.h"
#include "tests/support/refused_calls.h"
#include "tests/support/shared_data.h"

namespace imuscope::doctor {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

using test::in_child;
using test::kNotPermitted;

/// A PC's /proc and /sys as a folder.
class FakePc : public testing::Test {
 protected:
  void write(const std::string& file, const std::string& text) const {
    fs::create_directories((root_ / file).parent_path());
    std::ofstream(root_ / file) << text << "\n";
  }
  fs::path root_ = test::scratch_folder();
};

/// An ordinary user without any limit raised: exit code 0 when `check` is bad and its fix holds `fix`.
int as_nobody(Finding (*check)(), const std::string& fix) {
  constexpr rlimit kNone{0, 0};
  if (geteuid() != 0 || setrlimit(RLIMIT_RTPRIO, &kNone) != 0 || setrlimit(RLIMIT_MEMLOCK, &kNone) != 0 ||
      setuid(65534) != 0)
    return kNotPermitted;
  const auto finding = check();
  if (finding.verdict != Verdict::kBad) return 1;
  return finding.fix.find(fix) != std::string::npos ? 0 : 2;
}

TEST(DoctorRights, RealTimeRefusedNamesTheLimitToRaise) {
  const int outcome = in_child([] { return as_nobody(check_real_time, "LimitRTPRIO=80"); });
  if (outcome == kNotPermitted) GTEST_SKIP() << "becoming another user needs root";
  EXPECT_EQ(outcome, 0) << "1: not found bad, 2: without the fix";
}

TEST(DoctorRights, MemoryLockRefusedNamesTheLimitToRaise) {
  const int outcome = in_child([] { return as_nobody(check_memory_lock, "LimitMEMLOCK=infinity"); });
  if (outcome == kNotPermitted) GTEST_SKIP() << "becoming another user needs root";
  EXPECT_EQ(outcome, 0) << "1: not found bad, 2: without the fix";
}

TEST(DoctorRights, RootIsGrantedBoth) {
  if (geteuid() != 0) GTEST_SKIP() << "not root";
  if (check_real_time().verdict != Verdict::kGood) GTEST_SKIP() << "this container withholds real time";
  EXPECT_EQ(check_memory_lock().verdict, Verdict::kGood);
}

TEST(DoctorCores, OneCoreIsAWarning) {
  const int outcome = in_child([] {
    cpu_set_t one;
    CPU_ZERO(&one);
    sched_getaffinity(0, sizeof one, &one);
    for (int core = CPU_SETSIZE - 1; CPU_COUNT(&one) > 1; --core) CPU_CLR(core, &one);
    if (sched_setaffinity(0, sizeof one, &one) != 0) return kNotPermitted;
    return check_cores().verdict == Verdict::kWarning && !check_cores().fix.empty() ? 0 : 1;
  });
  EXPECT_EQ(outcome, 0);
}

TEST_F(FakePc, ASlowClockSourceIsBadAndTheBetterOneIsNamed) {
  const std::string folder = "sys/devices/system/clocksource/clocksource0/";
  write(folder + "current_clocksource", "tsc");
  EXPECT_EQ(check_clock_source(root_).verdict, Verdict::kGood);
  write(folder + "current_clocksource", "acpi_pm");
  write(folder + "available_clocksource", "hpet tsc acpi_pm");
  const auto finding = check_clock_source(root_);
  EXPECT_EQ(finding.verdict, Verdict::kBad);
  EXPECT_THAT(finding.fix, HasSubstr("echo tsc > "));
  write(folder + "available_clocksource", "hpet acpi_pm");
  EXPECT_THAT(check_clock_source(root_).fix, HasSubstr("clocksource=tsc"));
  fs::remove_all(root_ / "sys");
  EXPECT_EQ(check_clock_source(root_).verdict, Verdict::kWarning);
}

TEST_F(FakePc, APowersavingGovernorIsNamedWithItsCores) {
  EXPECT_EQ(check_governor(root_).verdict, Verdict::kGood) << "a virtual machine has none";
  write("sys/devices/system/cpu/cpu0/cpufreq/scaling_governor", "performance");
  write("sys/devices/system/cpu/cpu1/cpufreq/scaling_governor", "performance");
  EXPECT_EQ(check_governor(root_).verdict, Verdict::kGood);
  write("sys/devices/system/cpu/cpu1/cpufreq/scaling_governor", "powersave");
  const auto finding = check_governor(root_);
  EXPECT_EQ(finding.verdict, Verdict::kWarning);
  EXPECT_THAT(finding.what, HasSubstr("powersave on cpu1:"));
  EXPECT_THAT(finding.fix, HasSubstr("cpupower frequency-set -g performance"));
}

TEST_F(FakePc, ASmallReceiveBufferComesWithTheSysctl) {
  write("proc/sys/net/core/rmem_max", "4194304");
  EXPECT_EQ(check_receive_buffer(root_).verdict, Verdict::kGood);
  write("proc/sys/net/core/rmem_max", "212992");
  const auto finding = check_receive_buffer(root_);
  EXPECT_EQ(finding.verdict, Verdict::kWarning);
  EXPECT_THAT(finding.fix, HasSubstr("sysctl -w net.core.rmem_max=2097152"));
}

TEST_F(FakePc, AnFtdiBridgeThatHoldsBytesBackIsBad) {
  write("sys/bus/usb-serial/devices/ttyUSB0/latency_timer", "16");
  write("sys/bus/usb-serial/devices/ttyUSB1/latency_timer", "1");
  fs::create_directories(root_ / "sys/bus/usb-serial/devices/ttyUSB2");  // another maker's bridge
  const auto all = check_ftdi_latency(root_, {});
  ASSERT_THAT(all, SizeIs(2));
  EXPECT_EQ(all[0].verdict, Verdict::kBad);
  EXPECT_THAT(all[0].what, HasSubstr("16 ms"));
  EXPECT_THAT(all[0].fix, HasSubstr("echo 1 > "));
  EXPECT_THAT(all[0].fix, HasSubstr("60-imuscope.rules"));
  EXPECT_EQ(all[1].verdict, Verdict::kGood);
  EXPECT_THAT(check_ftdi_latency(root_, {"/dev/ttyUSB1"}), SizeIs(1)) << "only what is configured";
}

TEST_F(FakePc, ACanInterfaceThatIsDownOrMissingComesWithTheCommand) {
  write("sys/class/net/can0/type", "280");
  write("sys/class/net/can0/flags", "0x40080");
  write("sys/class/net/eth0/type", "1");
  const auto all = check_can(root_, {});
  ASSERT_THAT(all, SizeIs(1)) << "eth0 is no CAN interface";
  EXPECT_EQ(all[0].verdict, Verdict::kBad);
  EXPECT_THAT(all[0].fix, HasSubstr("ip link set can0 up type can bitrate"));
  write("sys/class/net/can0/flags", "0x40081");
  EXPECT_EQ(check_can(root_, {}).front().verdict, Verdict::kGood);
  const auto wanted = check_can(root_, {"can0", "can1"});
  ASSERT_THAT(wanted, SizeIs(2));
  EXPECT_EQ(wanted[1].verdict, Verdict::kBad);
  EXPECT_THAT(wanted[1].what, HasSubstr("no such interface"));
}

TEST(DoctorLcm, WithoutARouteTheTwoCommandsAreTheFix) {
  const int outcome = in_child([] {
    if (unshare(CLONE_NEWNET) != 0) return kNotPermitted;
    const auto finding = check_lcm("udpm://239.255.76.67:7667?ttl=0");
    return finding.verdict == Verdict::kBad &&
                   finding.fix.find("ip route add 224.0.0.0/4 dev lo") != std::string::npos
               ? 0
               : 1;
  });
  if (outcome == kNotPermitted) GTEST_SKIP() << "a private network namespace needs root";
  EXPECT_EQ(outcome, 0);
  EXPECT_EQ(check_lcm("tcpq://localhost").verdict, Verdict::kBad);
}

TEST(DoctorLines, APortThatDoesNotOpenSaysWhy) {
  DeviceConfig device;
  device.name = "mtx1";
  device.serial = SerialConfig{"/dev/imuscope-is-not-here", 115200, 1};
  const auto line = open_line(device, {});
  ASSERT_FALSE(line);
  const auto finding = check_line(device.name, tl::unexpected<Error>(line.error()));
  EXPECT_EQ(finding.verdict, Verdict::kBad);
  EXPECT_THAT(finding.what, HasSubstr("/dev/imuscope-is-not-here does not exist"));
  EXPECT_FALSE(finding.fix.empty());
  EXPECT_EQ(check_line("mtx1", {}).verdict, Verdict::kGood);
}

constexpr double kRate = 0.1e6;

TEST(DoctorDisk, JudgesRoomAndSpeedByWhatARunWrites) {
  const Disk good{"/data", {}, 100e9, 50e6};
  EXPECT_EQ(check_disk(good, kRate).verdict, Verdict::kGood);
  Disk slow = good;
  slow.write_bytes_per_s = 0.5e6;
  EXPECT_EQ(check_disk(slow, kRate).verdict, Verdict::kBad);
  EXPECT_THAT(check_disk(slow, kRate).fix, HasSubstr("another disk"));
  Disk small = good;
  small.free_bytes = 2.0 * 3600.0 * kRate;
  EXPECT_EQ(check_disk(small, kRate).verdict, Verdict::kWarning);
  small.free_bytes = 0.5 * 3600.0 * kRate;
  EXPECT_EQ(check_disk(small, kRate).verdict, Verdict::kBad);
}

TEST(DoctorDisk, ADayOfRecordingIsWantedAnHourNeededAndTenTimesTheSpeedOfARun) {
  constexpr double kBytesPerHour = 3600.0 * kRate;
  const auto verdict = [](double hours, double speed_ratio) {
    return check_disk({"/data", {}, hours * kBytesPerHour, speed_ratio * kRate}, kRate).verdict;
  };
  EXPECT_EQ(verdict(24.0, 10.0), Verdict::kGood);
  EXPECT_EQ(verdict(23.999, 10.0), Verdict::kWarning);
  EXPECT_EQ(verdict(1.0, 10.0), Verdict::kWarning);
  EXPECT_EQ(verdict(0.999, 10.0), Verdict::kBad);
  EXPECT_EQ(verdict(24.0, 9.999), Verdict::kBad);
  const Finding slow = check_disk({"/data", {}, 250.04e9, 2.6e6}, 0.5e6);
  EXPECT_EQ(slow.what, "250.0 GB free in /data, 139 h of recording; 3 MB/s; a run writes 0.50 MB/s");
  EXPECT_EQ(check_disk({"/data", "no room", 1e12, 1e9}, kRate).what,
            "nothing can be recorded in /data: no room");
}

TEST(DoctorDisk, MeasuresAFolderThatIsStillToBeMadeAndLeavesNothing) {
  const auto folder = test::scratch_folder();
  const auto disk = measure_disk(folder / "runs" / "monday");
  EXPECT_EQ(disk.problem, "");
  EXPECT_EQ(disk.folder, folder);
  EXPECT_GT(disk.free_bytes, 0.0);
  EXPECT_GT(disk.write_bytes_per_s, 0.0);
  EXPECT_TRUE(fs::is_empty(folder));
}

TEST(DoctorDisk, AFullDiskIsBad) {
  const auto folder = test::scratch_folder();
  const int outcome = in_child([&] {
    if (!test::mount_disk(folder, "1m")) return kNotPermitted;
    const auto finding = check_disk(measure_disk(folder), kRate);
    return finding.verdict == Verdict::kBad && finding.fix.find("make room") != std::string::npos ? 0 : 1;
  });
  if (outcome == kNotPermitted) GTEST_SKIP() << "mounting needs root";
  EXPECT_EQ(outcome, 0);
}

TEST(DoctorDisk, ADiskThatTakesTheBytesAndLosesThemIsBadForItsOwnReason) {
  const auto folder = test::scratch_folder();
  const test::RefusedCalls lost(test::Call::kFdatasync, EIO);
  const auto disk = measure_disk(folder);
  EXPECT_EQ(disk.problem, std::strerror(EIO));
  EXPECT_TRUE(fs::is_empty(folder));
  const test::RefusedCalls damaged(test::Call::kWrite, EIO);
  EXPECT_EQ(measure_disk(folder).problem, std::strerror(EIO));
}

TEST(DoctorDisk, AFolderThatMayNotBeEnteredOrWrittenIsBadAndNotTheEndOfTheExamination) {
  const auto closed = test::scratch_folder() / "closed";
  fs::create_directory(closed);
  fs::permissions(closed, fs::perms::owner_read);
  const int outcome = in_child([&] {
    if (!test::become_ordinary()) return kNotPermitted;
    for (const auto& folder : {closed, closed / "runs", closed / "runs" / "monday"}) {
      const auto finding = check_disk(measure_disk(folder), kRate);
      if (finding.verdict != Verdict::kBad || finding.what.find(std::strerror(EACCES)) == std::string::npos)
        return 1;
    }
    return 0;
  });
  fs::permissions(closed, fs::perms::owner_all);
  if (outcome == kNotPermitted) GTEST_SKIP() << "becoming another user needs root";
  EXPECT_EQ(outcome, 0);
}

TEST_F(FakePc, WhatCannotBeReadIsAWarningAndNothingIsMadeUp) {
  EXPECT_EQ(check_receive_buffer(root_).verdict, Verdict::kWarning);
  EXPECT_THAT(check_receive_buffer(root_).fix, HasSubstr("mount /proc"));
  EXPECT_THAT(check_clock_source(root_).fix, HasSubstr("mount /sys"));
  EXPECT_THAT(check_can(root_, {}), IsEmpty());
  EXPECT_THAT(check_ftdi_latency(root_, {}), IsEmpty());
  // An interface of which nothing is told is not said to be up.
  fs::create_directories(root_ / "sys/class/net/can0");
  EXPECT_EQ(check_can(root_, {"can0"}).front().verdict, Verdict::kBad);
  const auto nameless = check_can(root_, {std::string(300, 'x')});
  ASSERT_THAT(nameless, SizeIs(1));
  EXPECT_THAT(nameless.front().what, HasSubstr("no such interface"));
}

TEST_F(FakePc, APortIsFoundByItsStableNameAlsoWhereItIsUnplugged) {
  write("sys/bus/usb-serial/devices/ttyUSB0/latency_timer", "16");
  write("dev/ttyUSB0", "");
  fs::create_symlink(root_ / "dev/ttyUSB0", root_ / "mtx1");
  EXPECT_THAT(check_ftdi_latency(root_, {(root_ / "mtx1").string()}), SizeIs(1));
  fs::create_symlink(root_ / "dev/ttyUSB9", root_ / "gone");
  EXPECT_THAT(check_ftdi_latency(root_, {(root_ / "gone").string()}), IsEmpty());
}

TEST_F(FakePc, WithoutUdevADeviceThatComesBackIsNotAnnounced) {
  EXPECT_EQ(check_udev(root_).verdict, Verdict::kWarning);
  write("run/udev/control", "");
  EXPECT_EQ(check_udev(root_).verdict, Verdict::kGood);
}

TEST_F(FakePc, AnInstalledServiceThatDoesNotStartWithTheIgnitionIsTold) {
  EXPECT_THAT(check_unit(root_), IsEmpty()) << "no package, no service";
  write("lib/systemd/system/imuscope.service", "[Unit]");
  ASSERT_THAT(check_unit(root_), SizeIs(1));
  EXPECT_EQ(check_unit(root_)[0].verdict, Verdict::kWarning);
  EXPECT_THAT(check_unit(root_)[0].fix, HasSubstr("systemctl enable imuscope"));
  fs::create_directories(root_ / "etc/systemd/system/multi-user.target.wants");
  // As systemctl makes it: it leads to a place of that PC.
  fs::create_symlink("/lib/systemd/system/imuscope.service",
                     root_ / "etc/systemd/system/multi-user.target.wants/imuscope.service");
  EXPECT_EQ(check_unit(root_)[0].verdict, Verdict::kGood);
}

TEST(DoctorClock, APcThatBeginsInThePastIsTold) {
  EXPECT_EQ(check_wall_clock(utc_time_from_ns(1'000'000'000)).verdict, Verdict::kWarning);
  EXPECT_THAT(check_wall_clock(utc_time_from_ns(1'000'000'000)).fix, HasSubstr("set-ntp"));
  EXPECT_EQ(check_wall_clock(utc_time_from_ns(1'800'000'000'000'000'000)).verdict, Verdict::kGood);
}

TEST(DoctorMetrics, APortThatIsTakenIsBadAndOneForAllIsAWarning) {
  EXPECT_THAT(check_metrics({}), IsEmpty());
  MetricsOptions options;
  options.port = 29849;
  ASSERT_THAT(check_metrics(options), SizeIs(1));
  EXPECT_EQ(check_metrics(options)[0].verdict, Verdict::kGood);
  StatusBoard board;
  const auto other = MetricsServer::open("127.0.0.1", options.port, board);
  ASSERT_TRUE(other);
  EXPECT_EQ(check_metrics(options)[0].verdict, Verdict::kBad) << "no run says anything there";
  board.put(status_t{}, host_now());
  EXPECT_EQ(check_metrics(options)[0].verdict, Verdict::kGood);
  EXPECT_THAT(check_metrics(options)[0].what, HasSubstr("where a run offers them now"));
  options.port = 29850;
  options.address = "0.0.0.0";
  EXPECT_EQ(check_metrics(options)[0].verdict, Verdict::kWarning);
  EXPECT_THAT(check_metrics(options)[0].what, HasSubstr("everybody on that network"));
}

TEST(DoctorMetrics, AnotherProgramAtThePortIsNoRun) {
  const int listener = socket(AF_INET, SOCK_STREAM, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t size = sizeof address;
  ASSERT_EQ(bind(listener, reinterpret_cast<const sockaddr*>(&address), size), 0);
  ASSERT_EQ(listen(listener, 1), 0);
  ASSERT_EQ(getsockname(listener, reinterpret_cast<sockaddr*>(&address), &size), 0);
  std::thread other([listener] {
    const int client = accept(listener, nullptr, nullptr);
    const std::string page = "HTTP/1.1 200 OK\r\nContent-Length: 5\r\n\r\nhello";
    EXPECT_EQ(send(client, page.data(), page.size(), MSG_NOSIGNAL), static_cast<ssize_t>(page.size()));
    std::array<char, 1024> request{};
    while (recv(client, request.data(), request.size(), 0) > 0) {
    }
    close(client);
  });
  MetricsOptions options;
  options.port = ntohs(address.sin_port);
  EXPECT_EQ(check_metrics(options)[0].verdict, Verdict::kBad);
  other.join();
  close(listener);
}

TEST(DoctorLines, OfARunThatGoesOnAreAsThatRunSays) {
  device_status_t device{};
  device.name = "mtx1";
  device.state = "streaming";
  device.rate_hz = 100.0;
  EXPECT_EQ(check_line_of_run(device).verdict, Verdict::kGood);
  EXPECT_THAT(check_line_of_run(device).what, HasSubstr("100 Hz"));
  device.state = "connecting";
  device.problem = "no port /dev/imu; plug it in";
  EXPECT_EQ(check_line_of_run(device).verdict, Verdict::kBad);
  EXPECT_THAT(check_line_of_run(device).what, HasSubstr("connecting: no port /dev/imu"));
  EXPECT_EQ(check_line_of_run(device).fix, "plug it in");
  device.problem.clear();
  EXPECT_EQ(check_line_of_run(device).fix, "imuscope status");
}

TEST(DoctorExamination, WithoutAConfigurationLooksAtThePcAlone) {
  std::vector<std::string> checks;
  for (const auto& finding : examine({})) checks.push_back(finding.check);
  for (const char* check : {"real time", "memory lock", "cores", "LCM", "disk", "udev", "wall clock"})
    EXPECT_THAT(checks, testing::Contains(check));
  for (const auto& check : checks) EXPECT_THAT(check, testing::Not(HasSubstr("line of")));
}

/// Bytes that a run is taken to write in a second, by the room and the hours of the disk's sentence, and how well
/// these tell it.
std::pair<double, double> reckoned_bytes_per_s(const Examination& examination) {
  for (const auto& finding : examine(examination)) {
    if (finding.check != "disk") continue;
    const auto hours_at = finding.what.rfind(", ", finding.what.find(" h of recording"));
    if (hours_at == std::string::npos) return {};
    const double free_gb = std::strtod(finding.what.c_str(), nullptr);
    const double hours = std::strtod(finding.what.c_str() + hours_at + 2, nullptr);
    const double bytes_per_s = 1e9 * free_gb / hours / 3600.0;
    return {bytes_per_s, bytes_per_s * (0.05 / free_gb + 0.5 / hours)};
  }
  return {};
}

TEST(DoctorExamination, ARunWritesWhatItsLinesBringAndWhatItPublishes) {
  Examination examination;
  const auto usual = reckoned_bytes_per_s(examination);
  EXPECT_NEAR(usual.first, 120e3, usual.second) << "of the room that is free here";
  auto configuration = parse_configuration(R"(
[[device]]
name = "r"
role = "reference"
protocol = "ixblue_stdbin"
transport = { kind = "serial", port = "/dev/imuscope-no-r", baud = 921600 }
[[device]]
name = "s"
role = "study"
protocol = "xsens_mt"
transport = { kind = "serial", port = "/dev/imuscope-no-s", baud = 460800 }
)",
                                           "car.toml");
  ASSERT_TRUE(configuration) << configuration.error().text();
  configuration->record.folder = test::scratch_folder().string();
  examination.configuration = *configuration;
  const auto of_two = reckoned_bytes_per_s(examination);
  // Published messages; records around a hundred reads a second of each line; their bytes, ten bits each.
  EXPECT_NEAR(of_two.first, 60e3 + 2 * 7.5e3 + 92'160 + 46'080, of_two.second);
}

TEST(DoctorExamination, ADeviceOnACanBusIsLookedForByItsInterface) {
  auto configuration = parse_configuration(R"(
[[device]]
name = "r"
role = "reference"
protocol = "ixblue_stdbin"
transport = { kind = "serial", port = "/dev/imuscope-no-r" }
[[device]]
name = "s"
role = "study"
protocol = "xsens_can"
transport = { kind = "can", interface = "imuscan7" }
)",
                                           "car.toml");
  ASSERT_TRUE(configuration) << configuration.error().text();
  configuration->record.folder = test::scratch_folder().string();
  Examination examination;
  examination.configuration = *configuration;
  bool is_there = false;
  for (const auto& finding : examine(examination)) {
    if (finding.check != "CAN imuscan7") continue;
    is_there = true;
    EXPECT_EQ(finding.verdict, Verdict::kBad);
    EXPECT_THAT(finding.what, HasSubstr("no such interface"));
  }
  EXPECT_TRUE(is_there);
}

TEST(DoctorExamination, OpensNoLineOfARunThatGoesOn) {
  auto configuration = parse_configuration(R"(
[[device]]
name = "r"
role = "reference"
protocol = "ixblue_stdbin"
transport = { kind = "serial", port = "/dev/imuscope-no-r" }
[[device]]
name = "s"
role = "study"
protocol = "xsens_mt"
transport = { kind = "serial", port = "/dev/imuscope-no-s" }
)",
                                           "car.toml");
  ASSERT_TRUE(configuration) << configuration.error().text();
  configuration->record.folder = test::scratch_folder().string();
  // A socket's name holds at most 107 characters, fewer than a scratch folder may have.
  std::string runtime = "/tmp/imuscope-doctor-XXXXXX";
  ASSERT_NE(mkdtemp(runtime.data()), nullptr);
  unsetenv("RUNTIME_DIRECTORY");
  setenv("XDG_RUNTIME_DIR", runtime.c_str(), 1);
  StatusBoard board;
  status_t status{};
  status.configuration_hash = configuration->sha256;
  for (const char* name : {"r", "s"}) {
    device_status_t device{};
    device.name = name;
    device.state = "streaming";
    device.rate_hz = 100.0;
    status.devices.push_back(device);
  }
  status.n_devices = 2;
  board.put(status, host_now());
  std::optional<Result<std::unique_ptr<StatusSocket>>> door(StatusSocket::open(board));
  ASSERT_TRUE(*door) << door->error().text();
  Examination examination;
  examination.configuration = *configuration;
  const auto bad_lines = [&examination] {
    const auto findings = examine(examination);
    return std::count_if(findings.begin(), findings.end(), [](const Finding& finding) {
      return finding.check.starts_with("line of") && finding.verdict == Verdict::kBad;
    });
  };
  EXPECT_EQ(bad_lines(), 0);
  examination.configuration->sha256 = "of another";
  EXPECT_EQ(bad_lines(), 2) << "that run has lines of its own";
  door.reset();
  unsetenv("XDG_RUNTIME_DIR");
  fs::remove_all(runtime);
}

TEST(DoctorExamination, LooksAtEverythingThatTheConfigurationNames) {
  auto configuration = parse_configuration(R"(
[[device]]
name = "r"
role = "reference"
protocol = "ixblue_stdbin"
transport = { kind = "serial", port = "/dev/imuscope-no-r" }
[[device]]
name = "s"
role = "study"
protocol = "xsens_mt"
transport = { kind = "serial", port = "/dev/imuscope-no-s" }
)",
                                           "car.toml");
  ASSERT_TRUE(configuration);
  configuration->record.folder = test::scratch_folder().string();
  Examination examination;
  examination.configuration = *configuration;
  std::vector<std::string> checks;
  for (const auto& finding : examine(examination)) {
    checks.push_back(finding.check);
    EXPECT_EQ(finding.fix.empty(), finding.verdict == Verdict::kGood)
        << finding.check << ": " << finding.what;
  }
  for (const char* check : {"real time", "memory lock", "cores", "clock source", "CPU governor", "LCM",
                            "receive buffer", "line of r", "line of s", "disk"}) {
    EXPECT_THAT(checks, testing::Contains(check));
  }
}

}  // namespace
}  // namespace imuscope::doctor
