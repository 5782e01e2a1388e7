/// What a listener did not ask for must not wake it up, what a stranger forges must not reach it, and what
/// others asked for must still reach them.

#include "publish/lcm_socket_filter.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/prctl.h>
#include <unistd.h>

#include <cstdlib>
#include <fstream>
#include <functional>
#include <lcm/lcm-cpp.hpp>
#include <sstream>

#include "example_messages.h"
#include "publish/lcm_listener.h"
#include "publish/lcm_publisher.h"
#include "publish/message_codec.h"
#include "tests/support/child_process.h"
#include "tests/support/lcm_datagrams.h"

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
  explicit Ear(const char* kind, const char* url = kDefaultLcmUrl.data())
      : listener(LcmListener::open(url).value()) {
    if (!listener.subscribe(kind, [this](const auto&, auto) { ++heard; })) std::abort();
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
    voice.publish(test::example_status(), "STATUS");
    after_status();
  }
  voice.publish(test::example_calibration(), "CALIBRATION", "mtx1");
  voice.publish(test::example_event(), "EVENT");
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
    voice->publish(test::example_calibration(), "CALIBRATION", "mtx1");
    voice->publish(test::example_calibration(), "CALIBRATION", "another one");
    publish(*voice);
    if (ear.listen_for(3) != 3) return 1;
    return dropped() == kMessages + 1 ? 0 : 2;
  });
  if (outcome == kNotPermitted) GTEST_SKIP() << "a private network namespace needs root";
  EXPECT_EQ(outcome, 0) << "1: not every calibration came, 2: not every other message was dropped";
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

TEST(LcmSocketFilter, TheTwoDatagramsThatKillTheLibrarysReceiverDoNothing) {
  const int outcome = with_multicast([] {
    Ear ear("EVENT");
    const test::BusSender stranger;
    for (const char* channel : {"IMUSCOPE_EVENT", "", "any"}) {
      if (!stranger.send_two_that_kill(channel)) return 1;
    }
    LcmPublisher::open()->publish(test::example_event(), "EVENT");
    if (ear.listen_for(1) != 1) return 2;
    return dropped() == 6 ? 0 : 3;
  });
  if (outcome == kNotPermitted) GTEST_SKIP() << "a private network namespace needs root";
  EXPECT_EQ(outcome, 0)
      << "-1: they killed it, 1: not sent, 2: the event behind them did not come, 3: not dropped";
}

TEST(LcmSocketFilter, NothingButAWholeMessageOnAWantedChannelPasses) {
  const int outcome = with_multicast([] {
    Ear ear("EVENT");
    const test::BusSender stranger;
    const std::string right = test::lc02("IMUSCOPE_EVENT", "content");
    const std::string wrong[] = {"",
                                 "L",
                                 "LC0",
                                 "LC02",
                                 right.substr(0, 8),
                                 right.substr(0, 22),
                                 "LC04" + right.substr(4),
                                 "lc02" + right.substr(4),
                                 test::lc02("IMUSCOPE_EVENTS", "content"),
                                 test::lc02("", "content"),
                                 test::lc02("XIMUSCOPE_EVENT", "content"),
                                 test::lc02(std::string(60'000, 'x'), "content")};
    for (const auto& datagram : wrong) {
      if (!stranger.send(datagram)) return 1;
    }
    if (ear.listener.wait(std::chrono::milliseconds(200)) != 0) return 2;
    if (dropped() != static_cast<int>(std::size(wrong))) return 3;
    if (!stranger.send(right)) return 1;
    return ear.listen_for(1) == 1 ? 0 : 4;
  });
  if (outcome == kNotPermitted) GTEST_SKIP() << "a private network namespace needs root";
  EXPECT_EQ(outcome, 0)
      << "1: not sent, 2: it woke the listener up, 3: not dropped, 4: the right one did not come";
}

/// Another host on a cable to this one: a process in a network of its own, which sends an event with a ttl
/// that carries it across, when told to.
class OtherHost {
 public:
  OtherHost() {
    if (pipe(ready_) != 0 || pipe(go_) != 0 || pipe(sent_) != 0) std::abort();
    process_ = fork();
    if (process_ == 0) {
      prctl(PR_SET_PDEATHSIG, SIGKILL);
      _exit(body());
    }
    wait_for(ready_);
    const std::string id = std::to_string(process_);
    connected_ = std::system(("ip link add here type veth peer name there netns " + id +
                              " && ip addr add 10.77.0.1/24 dev here && ip link set here up && "
                              "ip link set lo up && ip route add 224.0.0.0/4 dev here")
                                 .c_str()) == 0;
  }
  ~OtherHost() {
    kill(process_, SIGKILL);
    waitpid(process_, nullptr, 0);
  }
  OtherHost(const OtherHost&) = delete;
  OtherHost& operator=(const OtherHost&) = delete;

  [[nodiscard]] bool connected() const { return connected_; }
  void send() const {
    tell(go_);
    wait_for(sent_);
  }

 private:
  [[nodiscard]] int body() const {
    if (unshare(CLONE_NEWNET) != 0) return 1;
    tell(ready_);
    wait_for(go_);
    if (std::system("ip addr add 10.77.0.2/24 dev there && ip link set there up && "
                    "ip route add 224.0.0.0/4 dev there") != 0)
      return 2;
    const test::BusSender voice(1);
    // The cable's two ends are up a moment after the command that says so.
    for (int i = 0; i < 10; ++i) {
      (void)voice.send(test::lc02("IMUSCOPE_EVENT", "content"));
      usleep(50'000);
    }
    tell(sent_);
    pause();
    return 0;
  }
  static void tell(const int (&pipe)[2]) { (void)!write(pipe[1], "x", 1); }
  static void wait_for(const int (&pipe)[2]) {
    char byte = 0;
    (void)!read(pipe[0], &byte, 1);
  }

  int ready_[2]{};
  int go_[2]{};
  int sent_[2]{};
  pid_t process_ = -1;
  bool connected_ = false;
};

int hear_from_another_host(const char* url) {
  const OtherHost other;
  if (!other.connected()) return 100;
  Ear ear("EVENT", url);
  other.send();
  return ear.listen_for(1);
}

TEST(LcmSocketFilter, WithoutTtlOnlyThisPcIsHeardAndWithItTheNetwork) {
  const int with_ttl =
      in_private_network([] { return hear_from_another_host("udpm://239.255.76.67:7667?ttl=1"); });
  if (with_ttl == kNotPermitted) GTEST_SKIP() << "a private network namespace needs root";
  ASSERT_GT(with_ttl, 0) << "the other host's events must come with ttl=1, or this test sees nothing";
  ASSERT_LE(with_ttl, 10) << "no cable";
  EXPECT_EQ(in_private_network([] { return hear_from_another_host("udpm://239.255.76.67:7667?ttl=0"); }), 0);
}

TEST(LcmSocketFilter, WithoutTtlThisPcIsHeardOnAnInterfaceThatLeadsOut) {
  const int outcome = in_private_network([] {
    const OtherHost other;
    if (!other.connected()) return 1;
    Ear ear("EVENT");
    LcmPublisher::open()->publish(test::example_event(), "EVENT");
    return ear.listen_for(1) == 1 ? 0 : 2;
  });
  if (outcome == kNotPermitted) GTEST_SKIP() << "a private network namespace needs root";
  EXPECT_EQ(outcome, 0) << "1: no cable, 2: the event did not come";
}

TEST(LcmSocketFilter, WhereItCannotBeAttachedNothingIsHeard) {
  int pipe_ends[2];
  ASSERT_EQ(pipe(pipe_ends), 0);
  const auto attached = attach_lcm_filter(pipe_ends[0], {}, Reach::kThisPc);
  ASSERT_FALSE(attached.has_value());
  EXPECT_THAT(attached.error().text(), testing::HasSubstr("so nothing is listened to"));
}

TEST(LcmListener, ANameThatNoChannelCanHaveIsRefused) {
  const int outcome = with_multicast([] {
    auto ear = LcmListener::open(kDefaultLcmUrl, std::string(60, 'P'));
    const auto subscribed = ear->subscribe("CALIBRATION_.*", [](const auto&, auto) {});
    return !subscribed && subscribed.error().kind == ErrorKind::kUsage ? 0 : 1;
  });
  if (outcome == kNotPermitted) GTEST_SKIP() << "a private network namespace needs root";
  EXPECT_EQ(outcome, 0);
}

TEST(LcmListener, AFloodHoldsItForItsBoundAlone) {
  const int outcome = with_multicast([] {
    Ear ear("EVENT");
    const test::BusSender stranger;
    int most = 0;
    for (int round = 0; round < 5; ++round) {
      for (int i = 0; i < 3 * LcmListener::kMostAtOnce; ++i)
        if (!stranger.send(test::lc02("IMUSCOPE_EVENT", "content"))) return 1;
      most = std::max(most, ear.listener.wait(std::chrono::milliseconds(100)));
    }
    return most > 0 && most <= LcmListener::kMostAtOnce ? 0 : 2;
  });
  if (outcome == kNotPermitted) GTEST_SKIP() << "a private network namespace needs root";
  EXPECT_EQ(outcome, 0) << "1: not sent, 2: it took more at once than it says";
}

}  // namespace
}  // namespace imuscope
