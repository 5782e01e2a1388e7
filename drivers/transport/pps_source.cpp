#include "drivers/transport/pps_source.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/ioctl.h>
#include <sys/timerfd.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <vector>

#include "base/contracts.h"

namespace imuscope {
namespace {

constexpr long kAskEvery_ns = 20'000'000;
/// NTP slews both clocks alike: what lies between them changes by steps of the wall clock alone.
constexpr Duration kWallStepMin = std::chrono::microseconds(200);

/// A device file of the kernel.
class KernelPpsDevice final : public PpsDevice {
 public:
  explicit KernelPpsDevice(int fd) noexcept : fd_(fd) {}
  KernelPpsDevice(const KernelPpsDevice&) = delete;
  KernelPpsDevice& operator=(const KernelPpsDevice&) = delete;
  ~KernelPpsDevice() override { ::close(fd_); }

  int capabilities(int& modes) noexcept override { return call(PPS_GETCAP, &modes); }
  int parameters(pps_kparams& params) noexcept override { return call(PPS_GETPARAMS, &params); }
  int set_parameters(const pps_kparams& params) noexcept override {
    pps_kparams copy = params;
    return call(PPS_SETPARAMS, &copy);
  }
  int fetch(pps_kinfo& newest) noexcept override {
    pps_fdata data{};  // no time to wait: what there is
    const int error = call(PPS_FETCH, &data);
    newest = data.info;
    return error;
  }

 private:
  int call(unsigned long request, void* argument) noexcept {
    return ioctl(fd_, request, argument) == 0 ? 0 : errno;
  }
  int fd_;
};

std::string devices_there() {
  std::vector<std::string> names;
  std::error_code error;
  for (const auto& entry : std::filesystem::directory_iterator("/dev", error)) {
    const std::string name = entry.path().filename().string();
    if (name.starts_with("pps")) names.push_back(entry.path().string());
  }
  std::sort(names.begin(), names.end());
  if (names.empty())
    return "this PC has none; load pps-gpio, or attach a serial port whose DCD pin the pulse is on: "
           "sudo ldattach pps /dev/ttyS0";
  return fmt::format("there are: {}", fmt::join(names, ", "));
}

Error no_device(const std::string& path, int error) {
  const std::string what = fmt::format("{} cannot be opened: {}", path, std::strerror(error));
  if (error == ENOENT || error == ENODEV || error == ENXIO) return {ErrorKind::kWork, what, devices_there()};
  if (error == EACCES || error == EPERM) {
    return {ErrorKind::kWork, what,
            "join the group of the device (the package's udev rule gives it to dialout): sudo usermod -aG "
            "dialout $USER"};
  }
  return {ErrorKind::kWork, what, "check the device"};
}

std::string_view edge_name(PulseEdge edge) noexcept {
  return edge == PulseEdge::kAssert ? "assert" : "clear";
}

}  // namespace

PpsSource::PpsSource(PpsSettings settings, std::unique_ptr<PpsDevice> device, int timer)
    : settings_(std::move(settings)), device_(std::move(device)), timer_(timer) {}

PpsSource::~PpsSource() { ::close(timer_); }

Result<std::unique_ptr<PpsSource>> PpsSource::open(const PpsSettings& settings) {
  const int fd = ::open(settings.path.c_str(), O_RDWR | O_CLOEXEC);
  if (fd < 0) return tl::unexpected<Error>(no_device(settings.path, errno));
  return with(settings, std::make_unique<KernelPpsDevice>(fd));
}

Result<std::unique_ptr<PpsSource>> PpsSource::with(const PpsSettings& settings,
                                                   std::unique_ptr<PpsDevice> device) {
  const int timer = timerfd_create(CLOCK_MONOTONIC, TFD_NONBLOCK | TFD_CLOEXEC);
  if (timer < 0) return work_error(fmt::format("no timer: {}", std::strerror(errno)));
  std::unique_ptr<PpsSource> opened(new PpsSource(settings, std::move(device), timer));
  if (auto chosen = opened->choose_edge(); !chosen) return tl::unexpected<Error>(std::move(chosen.error()));
  const itimerspec every{{0, kAskEvery_ns}, {0, kAskEvery_ns}};
  if (timerfd_settime(timer, 0, &every, nullptr) != 0)
    return work_error(fmt::format("no timer: {}", std::strerror(errno)));
  return opened;
}

/// Most sources capture what they can from the start; to change that takes the right to set clocks.
Result<void> PpsSource::choose_edge() {
  const int wanted = settings_.edge == PulseEdge::kAssert ? PPS_CAPTUREASSERT : PPS_CAPTURECLEAR;
  int modes = 0;
  if (const int error = device_->capabilities(modes); error != 0) {
    return work_error(fmt::format("{} is no PPS device: {}", settings_.path, std::strerror(error)),
                      devices_there());
  }
  if ((modes & wanted) == 0) {
    return usage_error(
        fmt::format("{} does not see the {} edge", settings_.path, edge_name(settings_.edge)),
        fmt::format("set edge = \"{}\"", settings_.edge == PulseEdge::kAssert ? "clear" : "assert"));
  }
  pps_kparams params{};
  if (const int error = device_->parameters(params); error != 0)
    return work_error(fmt::format("{}: {}", settings_.path, std::strerror(error)));
  if ((params.mode & wanted) != 0) return {};
  params.mode |= wanted;
  if (const int error = device_->set_parameters(params); error != 0) {
    return work_error(fmt::format("{} does not capture the {} edge, and cannot be told to: {}",
                                  settings_.path, edge_name(settings_.edge), std::strerror(error)),
                      fmt::format("take the other edge, or once, as root: ppstest {}", settings_.path));
  }
  return {};
}

IoResult PpsSource::read(std::span<std::uint8_t> buffer) noexcept {
  IMUSCOPE_EXPECTS(buffer.size() >= kReadBytes);
  std::uint64_t expirations = 0;
  (void)!::read(timer_, &expirations, sizeof expirations);
  pps_kinfo newest{};
  const int error = device_->fetch(newest);
  if (error != 0)
    return {error == EINTR || error == ETIMEDOUT || error == EAGAIN ? IoStatus::kNothing : IoStatus::kGone};
  const auto pulse = newest_pulse(newest);
  std::size_t n = 0;
  if (const auto steering = steering_.look(read_quartz())) n += write_steering_record(*steering, buffer);
  if (pulse) n += write_pulse_record(*pulse, buffer.subspan(n));
  return n == 0 ? IoResult{} : IoResult{IoStatus::kDone, n};
}

std::optional<UtcPulse> PpsSource::newest_pulse(const pps_kinfo& newest) noexcept {
  const BothClocks now = read_both_clocks();
  const Duration wall_minus_host = now.wall.time_since_epoch() - now.host.time_since_epoch();
  if (has_clocks_) {
    const Duration before = clocks_.wall.time_since_epoch() - clocks_.host.time_since_epoch();
    if (std::chrono::abs(wall_minus_host - before) > kWallStepMin + now.apart + clocks_.apart)
      trusted_from_ = now.host;
  }
  has_clocks_ = true;
  clocks_ = now;

  const bool is_assert = settings_.edge == PulseEdge::kAssert;
  const std::uint32_t sequence = is_assert ? newest.assert_sequence : newest.clear_sequence;
  const pps_ktime& stamp = is_assert ? newest.assert_tu : newest.clear_tu;
  const bool is_new = has_last_ && sequence != last_sequence_;
  // The first that is seen may be of an hour ago.
  has_last_ = true;
  last_sequence_ = sequence;
  if (!is_new) return std::nullopt;
  UtcPulse pulse;
  pulse.edge = settings_.edge;
  pulse.sequence = sequence;
  pulse.wall = UtcTime(std::chrono::seconds(stamp.sec) + Duration(stamp.nsec));
  pulse.time = host_time_from_ns(0) + (pulse.wall.time_since_epoch() - wall_minus_host);
  pulse.apart = now.apart;
  // Stamped by a wall clock that has been stepped since: nobody knows when it came.
  if (pulse.time < trusted_from_ || pulse.time > now.host) return std::nullopt;
  return pulse;
}

IoResult PpsSource::write(std::span<const std::uint8_t>) noexcept { return {}; }

LineHealth PpsSource::health() noexcept {
  LineHealth health;
  health.stamps.by = StampedBy::kKernel;
  return health;
}

std::string PpsSource::describe() const {
  return fmt::format("{} ({} edge)", settings_.path, edge_name(settings_.edge));
}

}  // namespace imuscope
