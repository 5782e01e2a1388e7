/// `imuscope top` in a terminal: it shows what is heard, a key marks an event, and it leaves the terminal as
/// it was.

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <pty.h>
#include <sched.h>
#include <sys/wait.h>
#include <termios.h>
#include <unistd.h>
#include <utmp.h>

#include <array>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <optional>
#include <string>
#include <vector>

#include "example_messages.h"
#include "publish/lcm_listener.h"
#include "publish/lcm_publisher.h"
#include "publish/message_codec.h"
#include "tests/support/shared_data.h"

namespace imuscope {
namespace {

using std::chrono::milliseconds;
using testing::HasSubstr;

/// The program in a terminal of its own.
class TerminalProgram {
 public:
  TerminalProgram() {
    constexpr winsize kSize{50, 160, 0, 0};
    int far_end = -1;
    openpty(&terminal_, &far_end, nullptr, nullptr, &kSize);
    tcgetattr(far_end, &before_);
    process_ = fork();
    if (process_ == 0) {
      login_tty(far_end);
      setenv("NO_COLOR", "1", 1);  // the words alone; top_view_tests have the colours
      const std::string program = test::program_path("imuscope").string();
      execl(program.c_str(), program.c_str(), "top", nullptr);
      _exit(127);
    }
    far_end_ = far_end;
  }
  ~TerminalProgram() {
    kill(process_, SIGKILL);
    waitpid(process_, nullptr, 0);
    close(terminal_);
    close(far_end_);
  }
  TerminalProgram(const TerminalProgram&) = delete;
  TerminalProgram& operator=(const TerminalProgram&) = delete;

  void type(const std::string& keys) const { (void)!write(terminal_, keys.data(), keys.size()); }

  /// What the program has drawn so far.
  const std::string& screen() {
    pollfd input{terminal_, POLLIN, 0};
    std::array<char, 4096> bytes{};
    while (poll(&input, 1, 0) > 0 && (input.revents & POLLIN) != 0) {
      const auto n = read(terminal_, bytes.data(), bytes.size());
      if (n <= 0) break;
      screen_.append(bytes.data(), static_cast<std::size_t>(n));
    }
    return screen_;
  }
  void forget() { screen_.clear(); }

  int wait() {
    int status = 0;
    waitpid(process_, &status, 0);
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  }
  [[nodiscard]] bool terminal_is_as_before() const {
    termios now{};
    tcgetattr(far_end_, &now);
    return now.c_lflag == before_.c_lflag && now.c_iflag == before_.c_iflag && now.c_oflag == before_.c_oflag;
  }

 private:
  int terminal_ = -1;
  int far_end_ = -1;
  pid_t process_ = -1;
  termios before_{};
  std::string screen_;
};

class TopTerminal : public testing::Test {
 protected:
  void SetUp() override {
    if (unshare(CLONE_NEWNET) != 0) GTEST_SKIP() << "a private network namespace needs root";
    ASSERT_EQ(std::system("ip link set lo up multicast on && ip route add 224.0.0.0/4 dev lo"), 0);
    ear_.emplace(LcmListener::open().value());
    voice_.emplace(LcmPublisher::open().value());
    ASSERT_TRUE(ear_->subscribe("EVENT", [this](const auto&, auto bytes) {
      if (const auto event = decode_message<event_t>(bytes)) events_.push_back(event->text);
    }));
  }

  /// Publishes a status now and again until `condition` holds.
  template <typename Condition>
  bool soon(const Condition& condition) {
    const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(20);
    while (std::chrono::steady_clock::now() < end) {
      voice_->publish(test::example_status(), "STATUS");
      (void)ear_->wait(milliseconds(50));
      if (condition()) return true;
    }
    return false;
  }

  std::optional<LcmListener> ear_;
  std::optional<LcmPublisher> voice_;
  std::vector<std::string> events_;
};

TEST_F(TopTerminal, ShowsWhatIsHeardMarksAnEventAndLeavesTheTerminalAsItWas) {
  TerminalProgram top;
  const auto shows = [&](const std::string& text) {
    return soon([&] { return top.screen().find(text) != std::string::npos; });
  };
  ASSERT_TRUE(shows("run 'demo'  degraded: mtx2 is silent")) << top.screen();
  EXPECT_THAT(top.screen(), HasSubstr("e: mark an event   q: quit"));
  EXPECT_THAT(top.screen(), HasSubstr("\033[?1049h")) << "its own page";

  top.type("e");
  ASSERT_TRUE(shows("event: _   (Enter sends, Esc forgets)")) << top.screen();
  top.type("qx\177roundabout\r");  // q is a letter while a text is typed
  ASSERT_TRUE(soon([&] { return !events_.empty(); })) << top.screen();
  EXPECT_EQ(events_, std::vector<std::string>{"qroundabout"});
  ASSERT_TRUE(shows("event sent: qroundabout")) << top.screen();

  top.forget();
  top.type("q");
  EXPECT_EQ(top.wait(), 0);
  EXPECT_THAT(top.screen(), HasSubstr("\033[?1049l")) << "back to the page of before";
  EXPECT_TRUE(top.terminal_is_as_before());
}

TEST_F(TopTerminal, EscapeForgetsTheText) {
  TerminalProgram top;
  ASSERT_TRUE(soon([&] { return top.screen().find("run 'demo'") != std::string::npos; }));
  top.type("enot this\033");
  top.forget();
  ASSERT_TRUE(soon([&] { return top.screen().find("e: mark an event") != std::string::npos; }));
  top.type("ethis\r");
  ASSERT_TRUE(soon([&] { return !events_.empty(); })) << top.screen();
  EXPECT_EQ(events_, std::vector<std::string>{"this"});
}

}  // namespace
}  // namespace imuscope
