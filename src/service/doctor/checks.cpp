#include "service/doctor/checks.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <net/if.h>
#include <sched.h>
#include <sys/mman.h>
#include <sys/statvfs.h>
#include <unistd.h>
#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <fstream>
#include <optional>
#include <set>
#include <thread>

#include "base/output_folder.h"
#include "publish/lcm_url.h"
#include "rt/host_clock.h"
#include "rt/thread_setup.h"
#include "service/doors/metrics_server.h"
#include "service/run/alarms.h"
#include "service/run/health.h"

namespace imuscope::doctor {

namespace fs = std::filesystem;

namespace {

/// The lowest priority that any thread of the service asks for; where it is granted, the others are, too.
constexpr int kProbedPriority = 80;
constexpr int kWantedCores = 2;
/// LCM's own advice for its receive buffer.
constexpr double kWantedReceiveBytes = 2.0 * 1024.0 * 1024.0;
constexpr int kWantedFtdiLatency_ms = 1;
constexpr int kCanHardwareType = 280;  // ARPHRD_CAN of <linux/if_arp.h>
constexpr double kBytesPerGb = 1e9;
constexpr double kBytesPerMb = 1e6;
constexpr double kWantedHours = 24.0;
constexpr double kNeededHours = 1.0;
/// The recorder must catch up after a stall: this many times as fast as the bytes come.
constexpr double kWantedSpeedRatio = 10.0;
constexpr std::size_t kProbeBytes = 8U << 20U;

std::optional<std::string> first_word(const fs::path& file) {
  std::ifstream in(file);
  std::string word;
  if (in >> word) return word;
  return std::nullopt;
}

std::vector<fs::path> entries(const fs::path& folder) {
  std::vector<fs::path> found;
  std::error_code absent;
  for (const auto& entry : fs::directory_iterator(folder, absent)) found.push_back(entry.path());
  std::sort(found.begin(), found.end());
  return found;
}

Finding refused(std::string check, const Error& error) {
  return {std::move(check), Verdict::kBad, error.what, error.remedy};
}

}  // namespace

Finding check_real_time() {
  std::vector<Error> errors;
  // In a thread of its own: this one stays as it is.
  std::thread([&] { errors = setup_this_thread({"doctor", Scheduling::kFifo, kProbedPriority, {}}); }).join();
  if (!errors.empty()) return refused("real time", errors.front());
  return {"real time", Verdict::kGood, fmt::format("SCHED_FIFO {} is granted", kProbedPriority), {}};
}

Finding check_memory_lock() {
  if (const auto locked = lock_memory(); !locked) return refused("memory lock", locked.error());
  munlockall();
  return {"memory lock", Verdict::kGood, "all memory can be locked", {}};
}

Finding check_cores() {
  cpu_set_t cores;
  CPU_ZERO(&cores);
  sched_getaffinity(0, sizeof cores, &cores);
  const int n = CPU_COUNT(&cores);
  if (n >= kWantedCores) return {"cores", Verdict::kGood, fmt::format("{} processor cores", n), {}};
  return {"cores", Verdict::kWarning,
          fmt::format("{} processor core for everything: a refit or the disk can delay the estimator", n),
          "give the service two cores (CPUAffinity= in the unit, or the virtual machine's settings)"};
}

Finding check_clock_source(const fs::path& root) {
  const fs::path folder = root / "sys/devices/system/clocksource/clocksource0";
  const auto current = first_word(folder / "current_clocksource");
  static const std::set<std::string> kFast{"tsc", "kvm-clock", "hyperv_clocksource_tsc_page",
                                           "arch_sys_counter", "xen"};
  if (!current)
    return {"clock source", Verdict::kWarning, fmt::format("{} cannot be read", folder.string()),
            "mount /sys"};
  if (kFast.contains(*current)) return {"clock source", Verdict::kGood, *current, {}};
  std::ifstream in(folder / "available_clocksource");
  std::string better;
  for (std::string word; in >> word;) {
    if (better.empty() && kFast.contains(word)) better = word;
  }
  return {
      "clock source", Verdict::kBad,
      fmt::format("{}: each reading of the clock costs microseconds and comes from a slow chip", *current),
      better.empty()
          ? "add clocksource=tsc tsc=reliable to the kernel's command line (GRUB_CMDLINE_LINUX) and "
            "start again; in a virtual machine choose the host's paravirtual clock"
          : fmt::format("echo {} > {}", better, (folder / "current_clocksource").string())};
}

Finding check_governor(const fs::path& root) {
  std::vector<std::string> slow;
  bool any = false;
  std::string governor_seen;
  for (const auto& core : entries(root / "sys/devices/system/cpu")) {
    const auto governor = first_word(core / "cpufreq/scaling_governor");
    if (!governor) continue;
    any = true;
    if (*governor == "performance") continue;
    slow.push_back(core.filename().string());
    governor_seen = *governor;
  }
  if (!any)
    return {"CPU governor", Verdict::kGood, "the processor's frequency is not this kernel's to change", {}};
  if (slow.empty()) return {"CPU governor", Verdict::kGood, "performance on every core", {}};
  return {"CPU governor", Verdict::kWarning,
          fmt::format("{} on {}: a core that slept at low frequency wakes up late", governor_seen,
                      fmt::join(slow, ", ")),
          "cpupower frequency-set -g performance    (apt-get install linux-cpupower)"};
}

Finding check_receive_buffer(const fs::path& root) {
  const fs::path file = root / "proc/sys/net/core/rmem_max";
  const auto word = first_word(file);
  if (!word)
    return {"receive buffer", Verdict::kWarning, fmt::format("{} cannot be read", file.string()),
            "mount /proc"};
  const double bytes = std::strtod(word->c_str(), nullptr);
  if (bytes >= kWantedReceiveBytes)
    return {"receive buffer", Verdict::kGood, fmt::format("rmem_max is {:.0f} bytes", bytes), {}};
  return {"receive buffer", Verdict::kWarning,
          fmt::format("rmem_max is {:.0f} bytes: a viewer on a busy bus loses messages", bytes),
          fmt::format("sysctl -w net.core.rmem_max={0:.0f} && echo net.core.rmem_max={0:.0f} > "
                      "/etc/sysctl.d/60-imuscope.conf",
                      kWantedReceiveBytes)};
}

Finding check_lcm(const std::string& url) {
  const auto checked = check_lcm_bus(url);
  if (checked) return {"LCM", Verdict::kGood, fmt::format("{} can be reached", url), {}};
  return refused("LCM", checked.error());
}

Finding check_udev(const fs::path& root) {
  std::error_code ignored;
  if (fs::exists(root / "run/udev/control", ignored))
    return {"udev", Verdict::kGood, "a device that is plugged in is opened at once", {}};
  return {"udev", Verdict::kWarning,
          "udev does not run: ports get neither their names nor their rights when a device is plugged in",
          "apt-get install udev; in a container, run the service on the host"};
}

std::vector<Finding> check_unit(const fs::path& root) {
  std::error_code ignored;
  if (!fs::exists(root / "lib/systemd/system/imuscope.service", ignored)) return {};
  const auto wanted = root / "etc/systemd/system/multi-user.target.wants/imuscope.service";
  if (fs::is_symlink(fs::symlink_status(wanted, ignored)))
    return {{"start", Verdict::kGood, "the service starts with the PC", {}}};
  return {{"start", Verdict::kWarning, "the service is installed and does not start with the PC",
           "systemctl enable imuscope, where it is to record every drive (docs/vehicle.md)"}};
}

Finding check_wall_clock(UtcTime now) {
  // Nobody has built this program before.
  constexpr UtcTime kEarliest{std::chrono::sys_days{std::chrono::year{2026} / 1 / 1}};
  if (now >= kEarliest) return {"wall clock", Verdict::kGood, "the PC knows the date", {}};
  return {
      "wall clock", Verdict::kWarning,
      "the PC begins in the past: folders of runs get wrong dates, and none is removed by its age",
      "timedatectl set-ntp true, or a battery for its clock; the rows of a run have UTC all the same where a "
      "device tells it"};
}

std::vector<Finding> check_metrics(const MetricsOptions& options) {
  if (options.port == 0) return {};
  const StatusBoard nothing;
  const auto opened = MetricsServer::open(options.address, options.port, nothing);
  const bool is_offered = !opened && offers_metrics(options.address, options.port);
  if (!opened && !is_offered) return {refused("metrics", opened.error())};
  const auto what = fmt::format("{} port {} {}", options.address, options.port,
                                is_offered ? "is where a run offers them now" : "is free");
  const bool is_loopback = options.address.starts_with("127.") || options.address == "::1";
  if (is_loopback) return {{"metrics", Verdict::kGood, what, {}}};
  return {{"metrics", Verdict::kWarning,
           fmt::format("{}; everybody on that network may read names, rates and alarms", what),
           "leave out address in [metrics] where only this PC is to read them"}};
}

Finding check_line(const std::string& device, const Result<void>& opened) {
  if (opened) return {"line of " + device, Verdict::kGood, "opens", {}};
  return refused("line of " + device, opened.error());
}

Finding check_line_of_run(const device_status_t& device) {
  const std::string check = "line of " + device.name;
  if (streams(device))
    return {check, Verdict::kGood, fmt::format("a run has it open: {:.4g} Hz", device.rate_hz), {}};
  const auto problem = condition_of(alarm_kind::kDevice, device.name, device.problem);
  return {check, Verdict::kBad,
          fmt::format("a run has it: {}{}{}", device.state, problem.what.empty() ? "" : ": ", problem.what),
          problem.remedy.empty() ? "imuscope status" : problem.remedy};
}

std::vector<Finding> check_ftdi_latency(const fs::path& root, const std::vector<std::string>& ports) {
  std::set<std::string> wanted;
  for (const auto& port : ports) {
    std::error_code dangling;
    const auto real = fs::canonical(port, dangling);
    wanted.insert((dangling ? fs::path(port) : real).filename().string());
  }
  std::vector<Finding> findings;
  for (const auto& device : entries(root / "sys/bus/usb-serial/devices")) {
    const std::string name = device.filename().string();
    if (!wanted.empty() && !wanted.contains(name)) continue;
    const fs::path timer = device / "latency_timer";
    const auto word = first_word(timer);
    if (!word) continue;  // not an FTDI bridge
    const int latency_ms = std::atoi(word->c_str());
    if (latency_ms <= kWantedFtdiLatency_ms) {
      findings.push_back({"FTDI latency", Verdict::kGood, fmt::format("{}: {} ms", name, latency_ms), {}});
    } else {
      findings.push_back(
          {"FTDI latency", Verdict::kBad,
           fmt::format("{} holds bytes back for up to {} ms: samples arrive in bursts", name, latency_ms),
           fmt::format("echo {} > {}    (for good: the udev rules of imuscope, 60-imuscope.rules)",
                       kWantedFtdiLatency_ms, timer.string())});
    }
  }
  return findings;
}

namespace {

Finding check_can_interface(const fs::path& folder, const std::string& name) {
  const std::string check = "CAN " + name;
  std::error_code absent;
  if (!fs::exists(folder, absent))
    return {
        check, Verdict::kBad, "there is no such interface",
        fmt::format(
            "plug the adapter in and load its driver; `ip link show type can` lists what is there; to try "
            "without hardware: ip link add {} type vcan",
            name)};
  const auto flags = first_word(folder / "flags");
  const unsigned long value = flags ? std::strtoul(flags->c_str(), nullptr, 16) : 0UL;
  if ((value & static_cast<unsigned long>(IFF_UP)) != 0) return {check, Verdict::kGood, "is up", {}};
  return {check, Verdict::kBad, "is down",
          fmt::format("ip link set {} up type can bitrate 500000    (the bus's own rate)", name)};
}

}  // namespace

std::vector<Finding> check_can(const fs::path& root, const std::vector<std::string>& wanted) {
  const fs::path net = root / "sys/class/net";
  std::vector<Finding> findings;
  for (const auto& name : wanted) findings.push_back(check_can_interface(net / name, name));
  if (!wanted.empty()) return findings;
  for (const auto& interface : entries(net)) {
    const auto type = first_word(interface / "type");
    if (!type || std::atoi(type->c_str()) != kCanHardwareType) continue;
    findings.push_back(check_can_interface(interface, interface.filename().string()));
  }
  return findings;
}

Disk measure_disk(const fs::path& folder) {
  fs::path existing = fs::absolute(folder);
  // What lies in a folder that may not be entered is not seen: then that folder says why.
  std::error_code unseen;
  while (!fs::exists(existing, unseen) && existing.has_relative_path()) existing = existing.parent_path();
  Disk disk{existing, {}, 0.0, 0.0};
  struct statvfs space {};
  if (statvfs(existing.c_str(), &space) != 0) {
    disk.problem = std::strerror(errno);
    return disk;
  }
  disk.free_bytes = static_cast<double>(space.f_bavail) * static_cast<double>(space.f_frsize);
  const auto opened = OutputFolder::open(existing);
  auto file = opened ? opened->scratch_file() : tl::unexpected<Error>(opened.error());
  if (!file) {
    disk.problem = file.error().what;
    return disk;
  }
  const int fd = file->get();
  const std::vector<char> bytes(kProbeBytes, 'x');
  const HostTime begin = host_now();
  const ssize_t written = ::write(fd, bytes.data(), bytes.size());
  const bool is_whole = written == static_cast<ssize_t>(bytes.size());
  if (!is_whole || ::fdatasync(fd) != 0)
    disk.problem = std::strerror(written < 0 || is_whole ? errno : ENOSPC);
  const double seconds = to_seconds(host_now() - begin);
  disk.write_bytes_per_s = static_cast<double>(bytes.size()) / seconds;
  return disk;
}

Finding check_disk(const Disk& disk, double recorded_bytes_per_s) {
  const std::string where = disk.folder.string();
  if (!disk.problem.empty())
    return {"disk", Verdict::kBad, fmt::format("nothing can be recorded in {}: {}", where, disk.problem),
            "make room, or set another [record] folder that this user may write"};
  const double hours = disk.free_bytes / recorded_bytes_per_s / 3600.0;
  const std::string room =
      fmt::format("{:.1f} GB free in {}, {:.0f} h of recording; {:.0f} MB/s", disk.free_bytes / kBytesPerGb,
                  where, hours, disk.write_bytes_per_s / kBytesPerMb);
  if (hours < kNeededHours)
    return {"disk", Verdict::kBad, room, "remove old runs, or set another [record] folder"};
  if (disk.write_bytes_per_s < kWantedSpeedRatio * recorded_bytes_per_s)
    return {"disk", Verdict::kBad,
            room + fmt::format("; a run writes {:.2f} MB/s", recorded_bytes_per_s / kBytesPerMb),
            "record on another disk: set [record] folder to a local solid-state disk"};
  if (hours < kWantedHours)
    return {"disk", Verdict::kWarning, room, "remove old runs, or set another [record] folder"};
  return {"disk", Verdict::kGood, room, {}};
}

}  // namespace imuscope::doctor
