/// What a listener did not ask for must not wake it up, and what others asked for must still reach them.

#include "publish/lcm_socket_filter.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdlib>
#include <fstream>
#include <functional>
#include <lcm/lcm-cpp.hpp>
#include <sstream>

#include "example_reports.h"
#include "publish/lcm_listener.h"
#include "publish/lcm_publisher.h"
#include "tests/support/child_process.h"

namespace imuscope {
namespace {

using test::in_private_network;
using test::kNotPermitted;

constexpr int kNoNetwork = 78;
constexpr int kMessages = 50;

/// Runs `body` in a child process with a network of its own, whose loopback interface carries multicast.
int with_multicast(const std::function<int()>& body) {
  return in_private_network([&] {
    if (std::system("ip link set lo up multicast on && ip route add 224.0.0.0/4 dev lo") != 0)
      return kNoNetwork;
    return body();
  });
}

/// Datagrams that the kernel kept from the sockets of this network: the last column of /proc/net/udp.
int dropped() {
  std::ifstream table("/proc/self/net/udp");
  std::string row;
  std::getline(table, row);  // the head
  int sum = 0;
  while (std::getline(table, row)) {
    std::istringstream words(row);
    std::string last;
    for (std::string word; words >> word;) last = word;
    sum += std::atoi(last.c_str());
  }
  return sum;
}

struct Ear {
  explicit Ear(const char* kind) : listener(LcmListener::open().value()) {
    listener.subscribe(
        kind, [this](const auto&, auto) { ++heard; }, 2 * kMessages);
  }
  int listen_for(int wanted) {
    for (int i = 0; i < 20 && heard < wanted; ++i) (void)listener.wait(std::chrono::milliseconds(100));
    return heard;
  }
  LcmListener listener;
  int heard = 0;
};

/// Fifty statuses, then one event and one calibration. Who wants the statuses takes each `after_status`: a
/// socket's buffer does not hold fifty of them.
void publish(
    LcmPublisher& voice, const std::function<void()>& after_status = [] {}) {
  for (int i = 0; i < kMessages; ++i) {
    voice.publish(test::example_status());
    after_status();
  }
  voice.publish(test::example_calibration(), "mtx1");
  voice.publish(PersonEvent{test::kExampleUtc, "test", "here"});
}

TEST(LcmSocketFilter, TheKernelDropsWhatNobodyAskedForAndTheWantedChannelComes) {
  const int outcome = with_multicast([] {
    Ear ear("EVENT");
    auto voice = LcmPublisher::open();
    publish(*voice);
    if (ear.listen_for(1) != 1) return 1;
    return dropped() == kMessages + 1 ? 0 : 2;
  });
  if (outcome == kNotPermitted) GTEST_SKIP() << "a private network namespace needs root";
  EXPECT_EQ(outcome, 0) << "1: the event did not come, 2: not every other message was dropped";
}

TEST(LcmSocketFilter, ABeginningLetsEveryNameThroughThatHasIt) {
  const int outcome = with_multicast([] {
    Ear ear("CALIBRATION_.*");
    auto voice = LcmPublisher::open();
    voice->publish(test::example_calibration(), "mtx1");
    voice->publish(test::example_calibration(), "another one");
    publish(*voice);
    if (ear.listen_for(3) != 3) return 1;
    return dropped() == kMessages + 1 ? 0 : 2;
  });
  if (outcome == kNotPermitted) GTEST_SKIP() << "a private network namespace needs root";
  EXPECT_EQ(outcome, 0) << "1: not every calibration came, 2: not every other message was dropped";
}

TEST(LcmSocketFilter, AnotherExpressionLetsEverythingThrough) {
  const int outcome = with_multicast([] {
    Ear ear("(EVENT|STATUS)");
    auto voice = LcmPublisher::open();
    publish(*voice, [&, sent = 0]() mutable { ear.listen_for(++sent); });
    if (ear.listen_for(kMessages + 1) != kMessages + 1) return 1;
    return dropped() == 0 ? 0 : 2;
  });
  if (outcome == kNotPermitted) GTEST_SKIP() << "a private network namespace needs root";
  EXPECT_EQ(outcome, 0) << "1: messages are missing, 2: something was dropped";
}

struct Counter {
  int count = 0;
  void on_message(const lcm::ReceiveBuffer* /*buffer*/, const std::string& /*channel*/) { ++count; }
};

TEST(LcmSocketFilter, AReceiverThatWasThereBeforeIsLeftAlone) {
  const int outcome = with_multicast([] {
    lcm::LCM other{std::string(kDefaultLcmUrl)};
    Counter counter;
    other.subscribe("IMUSCOPE_STATUS", &Counter::on_message, &counter)->setQueueCapacity(2 * kMessages);
    Ear ear("EVENT");
    auto voice = LcmPublisher::open();
    publish(*voice, [&] { other.handleTimeout(1000); });
    if (ear.listen_for(1) != 1) return 1;
    return counter.count == kMessages ? 0 : 2;
  });
  if (outcome == kNotPermitted) GTEST_SKIP() << "a private network namespace needs root";
  EXPECT_EQ(outcome, 0) << "1: the event did not come, 2: the other receiver lost messages";
}

}  // namespace
}  // namespace imuscope
