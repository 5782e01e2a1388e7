#include "publish/lcm_publisher.h"

#include <lcm/lcm-cpp.hpp>
#include <map>
#include <utility>
#include <vector>

#include "publish/lcm_url.h"
#include "publish/message_builders.h"

namespace imuscope {
struct LcmPublisher::Impl {
  Impl(const std::string& url, std::string_view prefix_in) : lcm(url), prefix(prefix_in) {}

  /// Encodes and sends; `build` makes the message from its sequence number.
  template <typename Build>
  void send(const std::string& channel, const Build& build) {
    std::int64_t& sequence = sequences[channel];
    const auto message = build(sequence);
    sequence += 1;
    const int size = message.getEncodedSize();
    if (size < 0 || static_cast<std::size_t>(size) > kMaxMessageBytes) {
      counters.too_large += 1;
      return;
    }
    buffer.resize(static_cast<std::size_t>(size));
    if (message.encode(buffer.data(), 0, size) != size ||
        lcm.publish(channel, buffer.data(), static_cast<unsigned int>(size)) != 0) {
      counters.failed += 1;
      return;
    }
    counters.published += 1;
    if (tap) tap(channel, message.utime, buffer);
  }

  lcm::LCM lcm;
  std::string prefix;
  std::map<std::string, std::int64_t> sequences;  // by channel; counts what was lost here, too
  std::vector<std::uint8_t> buffer;
  PublishCounters counters;
  Tap tap;
};

Result<LcmPublisher> LcmPublisher::open(std::string_view url, std::string_view prefix) {
  if (const auto checked = check_lcm_url(url); !checked) return tl::unexpected(checked.error());
  auto impl = std::make_unique<Impl>(std::string(url), prefix);
  if (!impl->lcm.good()) {
    return work_error("LCM could not open " + std::string(url), "check its options; " + kLcmUrlRemedy);
  }
  return LcmPublisher(std::move(impl));
}

LcmPublisher::LcmPublisher(std::unique_ptr<Impl> impl) noexcept : impl_(std::move(impl)) {}
LcmPublisher::LcmPublisher(LcmPublisher&&) noexcept = default;
LcmPublisher& LcmPublisher::operator=(LcmPublisher&&) noexcept = default;
LcmPublisher::~LcmPublisher() = default;

void LcmPublisher::publish(const StatusReport& report) {
  impl_->send(channel_name(impl_->prefix, "STATUS"),
              [&](std::int64_t sequence) { return to_message(report, sequence); });
}

void LcmPublisher::publish(const NavigationReport& report) {
  impl_->send(channel_name(impl_->prefix, "NAVIGATION"),
              [&](std::int64_t sequence) { return to_message(report, sequence); });
}

void LcmPublisher::publish(const OdometryReport& report) {
  impl_->send(channel_name(impl_->prefix, "ODOMETRY"),
              [&](std::int64_t sequence) { return to_message(report, sequence); });
}

void LcmPublisher::publish(const CalibrationReport& report, const std::string& name) {
  impl_->send(channel_name(impl_->prefix, "CALIBRATION", name),
              [&](std::int64_t sequence) { return to_message(report, name, sequence); });
}

void LcmPublisher::publish(const ErrorReport& report, const std::string& name) {
  impl_->send(channel_name(impl_->prefix, "ERROR", name),
              [&](std::int64_t sequence) { return to_message(report, name, sequence); });
}

void LcmPublisher::publish(const WaveletVarianceReport& report) {
  impl_->send(channel_name(impl_->prefix, "WV", report.name),
              [&](std::int64_t sequence) { return to_message(report, sequence); });
}

void LcmPublisher::publish(const NoiseModelReport& report) {
  impl_->send(channel_name(impl_->prefix, "NOISE_MODEL", report.name),
              [&](std::int64_t sequence) { return to_message(report, sequence); });
}

void LcmPublisher::publish(const DynamicsReport& report) {
  impl_->send(channel_name(impl_->prefix, "DYNAMICS", report.name),
              [&](std::int64_t sequence) { return to_message(report, sequence); });
}

void LcmPublisher::publish(const PersonEvent& event) {
  impl_->send(channel_name(impl_->prefix, "EVENT"),
              [&](std::int64_t sequence) { return to_message(event, sequence); });
}

void LcmPublisher::publish(const BridgeReport& report) {
  impl_->send(channel_name(impl_->prefix, "POSE"), [&](std::int64_t) { return to_pose(report); });
  impl_->send(channel_name(impl_->prefix, "INS"), [&](std::int64_t) { return to_ins(report); });
}

void LcmPublisher::set_tap(Tap tap) { impl_->tap = std::move(tap); }

const PublishCounters& LcmPublisher::counters() const noexcept { return impl_->counters; }

}  // namespace imuscope
