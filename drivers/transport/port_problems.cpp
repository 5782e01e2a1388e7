#include "drivers/transport/port_problems.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <grp.h>
#include <sys/stat.h>
#include <sys/sysmacros.h>
#include <unistd.h>

#include <algorithm>
#include <cctype>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>

namespace imuscope {
namespace fs = std::filesystem;
namespace {

std::vector<std::string> entries(const fs::path& folder, const std::string& prefix) {
  std::vector<std::string> found;
  std::error_code ignored;
  for (fs::directory_iterator it(folder, ignored), end; !ignored && it != end; it.increment(ignored)) {
    if (it->path().filename().string().rfind(prefix, 0) == 0) found.push_back(it->path().string());
  }
  std::sort(found.begin(), found.end());
  return found;
}

/// "/dev/ttyUSB3" to "ttyUSB".
std::string name_without_number(const fs::path& path) {
  std::string name = path.filename().string();
  while (!name.empty() && std::isdigit(static_cast<unsigned char>(name.back())) != 0) name.pop_back();
  return name;
}

std::string process_name(const fs::path& process) {
  std::string name;
  std::ifstream file(process / "comm");
  std::getline(file, name);
  return name.empty() ? "?" : name;
}

bool is_same_file(const std::string& one, const std::string& other) {
  struct stat a {};
  struct stat b {};
  return stat(one.c_str(), &a) == 0 && stat(other.c_str(), &b) == 0 && a.st_dev == b.st_dev &&
         a.st_ino == b.st_ino;
}

struct Holders {
  std::vector<std::string> others;  ///< as "1234 (name)"
  bool own = false;                 ///< this process, too
};

/// Processes that have the file open; only those that this user may look into.
Holders holders(const std::string& path) {
  Holders found;
  std::error_code ignored;
  const fs::path real = fs::canonical(path, ignored);
  const std::string self = std::to_string(getpid());
  // Every root that has its own /dev/pts counts pseudo-terminals anew: there, a name alone says little.
  const bool is_pseudo = real.parent_path() == "/dev/pts";
  for (const std::string& process : entries("/proc", "")) {
    const std::string pid = fs::path(process).filename().string();
    if (pid.empty() || std::isdigit(static_cast<unsigned char>(pid[0])) == 0) continue;
    for (const std::string& fd : entries(process + "/fd", "")) {
      std::error_code unreadable;
      if (fs::read_symlink(fd, unreadable) != real) continue;
      if (is_pseudo && !is_same_file(fd, real)) continue;
      if (pid != self) found.others.push_back(fmt::format("{} ({})", pid, process_name(process)));
      found.own = found.own || pid == self;
      break;
    }
  }
  return found;
}

Error busy(const std::string& path, const std::vector<std::string>& by) {
  return {
      ErrorKind::kWork,
      by.empty() ? fmt::format("port {} is in use by another program", path)
                 : fmt::format("port {} is in use by process {}", path, fmt::join(by, ", ")),
      fmt::format("{}stop that program (the service: systemctl stop imuscope); ModemManager leaves a port "
                  "alone with the udev rule ENV{{ID_MM_DEVICE_IGNORE}}=\"1\"",
                  by.empty() ? fmt::format("see who with 'sudo fuser -v {}' and ", path) : "")};
}

/// Major number of a character device.
std::optional<unsigned> character_device(const std::string& path) {
  struct stat info {};
  if (stat(path.c_str(), &info) != 0 || !S_ISCHR(info.st_mode)) return std::nullopt;
  return major(info.st_rdev);
}

std::string group_of(const std::string& path) {
  struct stat info {};
  if (stat(path.c_str(), &info) != 0) return "dialout";
  const group* owner = getgrgid(info.st_gid);
  return owner != nullptr ? owner->gr_name : "dialout";
}

Error missing(const std::string& path) {
  std::vector<std::string> others = entries(fs::path(path).parent_path(), name_without_number(path));
  for (std::string& port : serial_ports()) {
    if (std::find(others.begin(), others.end(), port) == others.end()) others.push_back(std::move(port));
  }
  return {ErrorKind::kWork, fmt::format("port {} does not exist", path),
          others.empty() ? "plug the device in; no serial port is there at all"
                         : fmt::format("plug the device in, or use one of: {}", fmt::join(others, ", "))};
}

}  // namespace

std::vector<std::string> serial_ports() {
  std::vector<std::string> ports = entries("/dev/serial/by-id", "");
  std::vector<fs::path> named;
  for (const std::string& port : ports) {
    std::error_code ignored;
    named.push_back(fs::canonical(port, ignored));
  }
  for (const char* prefix : {"ttyUSB", "ttyACM"}) {
    for (std::string& port : entries("/dev", prefix)) {
      if (std::find(named.begin(), named.end(), port) == named.end()) ports.push_back(std::move(port));
    }
  }
  return ports;
}

std::optional<int> latency_timer_ms(const std::string& port, const std::string& adapters) {
  std::error_code ignored;
  const fs::path real = fs::canonical(port, ignored);
  int timer_ms = 0;
  if (ignored || !(std::ifstream(fs::path(adapters) / real.filename() / "latency_timer") >> timer_ms))
    return std::nullopt;
  return timer_ms;
}

std::optional<Error> shared_with_others(const std::string& path) {
  const auto by = holders(path);
  if (by.others.empty()) return std::nullopt;
  return busy(path, by.others);
}

Error explain_open_failure(const std::string& path, int error) {
  switch (error) {
    case ENOENT:
      return missing(path);
    case EPERM:
      if (const auto number = character_device(path)) {
        return {ErrorKind::kWork, fmt::format("this program may not open ports of the kind of {}", path),
                fmt::format(
                    "allow them to its unit: 'systemctl edit imuscope', [Service], DeviceAllow=char-{} rw; "
                    "in a container, to the container",
                    *number)};
      }
      [[fallthrough]];
    case EACCES: {
      const std::string group = group_of(path);
      return {
          ErrorKind::kWork, fmt::format("no permission for port {}", path),
          fmt::format(
              "add yourself to its group (sudo usermod -aG {0} $USER, then log in again), or open it up to "
              "that group by a udev rule: SUBSYSTEM==\"tty\", GROUP=\"{0}\", MODE=\"0660\"",
              group)};
    }
    case EBUSY: {
      auto by = holders(path);
      // Whoever asks for the port may have it open while it is refused: where others hold it, they are meant.
      if (by.own && by.others.empty()) by.others.emplace_back("this program");
      return busy(path, by.others);
    }
    case ENXIO:
    case ENODEV:
    case EIO:
      return {ErrorKind::kWork,
              fmt::format("port {} has no device behind it ({})", path, std::strerror(error)),
              "plug the device in again"};
    case EISDIR:
      return {ErrorKind::kWork, fmt::format("{} is a folder, not a serial port", path),
              "give a tty, such as one of /dev/serial/by-id"};
    default:
      return {ErrorKind::kWork, fmt::format("port {} does not open: {}", path, std::strerror(error)), ""};
  }
}

}  // namespace imuscope
