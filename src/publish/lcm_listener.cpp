#include "publish/lcm_listener.h"

#include <lcm/lcm-cpp.hpp>
#include <utility>
#include <vector>

#include "publish/lcm_socket_filter.h"

namespace imuscope {

struct LcmListener::Impl {
  Impl(const std::string& url, std::string_view prefix_in) : filter(url), lcm(url), prefix(prefix_in) {}

  LcmSocketFilter filter;  // before the library opens its socket
  lcm::LCM lcm;
  std::string prefix;
  std::vector<std::string> channels;
  std::vector<std::unique_ptr<Handler>> handlers;  // their addresses are the subscriptions' contexts
};

namespace {

void on_message(const lcm::ReceiveBuffer* buffer, const std::string& channel, LcmListener::Handler* handler) {
  (*handler)(channel, {static_cast<const std::uint8_t*>(buffer->data), buffer->data_size});
}

}  // namespace

Result<LcmListener> LcmListener::open(std::string_view url, std::string_view prefix) {
  if (const auto checked = check_lcm_url(url); !checked) return tl::unexpected(checked.error());
  auto impl = std::make_unique<Impl>(std::string(url), prefix);
  if (!impl->lcm.good()) {
    return work_error("LCM could not open " + std::string(url),
                      "check its options; write it as " + std::string(kDefaultLcmUrl));
  }
  return LcmListener(std::move(impl));
}

LcmListener::LcmListener(std::unique_ptr<Impl> impl) noexcept : impl_(std::move(impl)) {}
LcmListener::LcmListener(LcmListener&&) noexcept = default;
LcmListener& LcmListener::operator=(LcmListener&&) noexcept = default;
LcmListener::~LcmListener() = default;

void LcmListener::subscribe(std::string_view kind, Handler handler, int queue) {
  impl_->handlers.push_back(std::make_unique<Handler>(std::move(handler)));
  impl_->channels.push_back(impl_->prefix + "_" + std::string(kind));
  auto* subscription =
      impl_->lcm.subscribeFunction(impl_->channels.back(), on_message, impl_->handlers.back().get());
  subscription->setQueueCapacity(queue);
  impl_->filter.let_through(impl_->channels);
}

int LcmListener::wait(std::chrono::milliseconds timeout) {
  int handled = 0;
  int status = impl_->lcm.handleTimeout(static_cast<int>(timeout.count()));
  while (status > 0) {
    ++handled;
    status = impl_->lcm.handleTimeout(0);
  }
  return status < 0 && handled == 0 ? -1 : handled;
}

}  // namespace imuscope
