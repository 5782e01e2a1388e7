#include "publish/lcm_publisher.h"

#include <lcm/lcm-cpp.hpp>
#include <map>
#include <utility>

#include "publish/lcm_url.h"

namespace imuscope {
struct LcmPublisher::Impl {
  explicit Impl(std::string_view prefix_in) : prefix(prefix_in) {}

  std::unique_ptr<lcm::LCM> lcm;
  std::string prefix;
  std::map<std::string, std::int64_t> sequences;  // by channel; counts what was lost here, too
  PublishCounters counters;
  Tap tap;
};

Result<LcmPublisher> LcmPublisher::open(std::string_view url, std::string_view prefix) {
  auto publisher = unconnected(prefix);
  if (auto connected = publisher.connect(url); !connected) return tl::unexpected<Error>(connected.error());
  return publisher;
}

LcmPublisher LcmPublisher::unconnected(std::string_view prefix) {
  return LcmPublisher(std::make_unique<Impl>(prefix));
}

Result<void> LcmPublisher::connect(std::string_view url) {
  if (auto checked = check_lcm_url(url); !checked) return checked;
  auto lcm = std::make_unique<lcm::LCM>(std::string(url));
  if (!lcm->good()) {
    return work_error("LCM could not open " + std::string(url), "check its options; " + kLcmUrlRemedy);
  }
  impl_->lcm = std::move(lcm);
  return {};
}

LcmPublisher::LcmPublisher(std::unique_ptr<Impl> impl) noexcept : impl_(std::move(impl)) {}
LcmPublisher::LcmPublisher(LcmPublisher&&) noexcept = default;
LcmPublisher& LcmPublisher::operator=(LcmPublisher&&) noexcept = default;
LcmPublisher::~LcmPublisher() = default;

std::string LcmPublisher::channel_of(std::string_view kind, std::string_view name) const {
  return channel_name(impl_->prefix, kind, name);
}

std::int64_t LcmPublisher::next_sequence(const std::string& channel) { return impl_->sequences[channel]++; }

void LcmPublisher::send(const std::string& channel, std::int64_t utime,
                        std::span<const std::uint8_t> message) {
  if (message.size() > kMaxMessageBytes) {
    impl_->counters.too_large += 1;
    return;
  }
  if (impl_->tap) impl_->tap(channel, utime, message);
  if (!impl_->lcm) return;
  const bool sent =
      impl_->lcm->publish(channel, message.data(), static_cast<unsigned int>(message.size())) == 0;
  (sent ? impl_->counters.published : impl_->counters.failed) += 1;
}

void LcmPublisher::set_tap(Tap tap) { impl_->tap = std::move(tap); }

const PublishCounters& LcmPublisher::counters() const noexcept { return impl_->counters; }

}  // namespace imuscope
