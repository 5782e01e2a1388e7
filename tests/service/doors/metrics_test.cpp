/// The numbers for a monitoring system: what is written, and the door that gives it.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <arpa/inet.h>
#include <fmt/format.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <sstream>
#include <string>
#include <thread>
#include <vector>

#include "base/output_folder.h"
#include "example_messages.h"
#include "rt/host_clock.h"
#include "service/doors/metrics_server.h"
#include "service/doors/metrics_text.h"
#include "tests/support/recorded_answer.h"
#include "tests/support/shared_data.h"

namespace imuscope {
namespace {

using testing::ContainsRegex;
using testing::HasSubstr;
using testing::Not;
using testing::StartsWith;

constexpr int kSkipped = 77;

/// The parser of Prometheus itself. 0: it takes the text and has nothing to remark.
int check_by_prometheus(const std::string& text) {
  if (std::system("command -v promtool >/dev/null") != 0) return kSkipped;
  const auto file = test::scratch_folder() / "metrics.txt";
  std::ofstream(file) << text;
  return std::system(fmt::format("promtool check metrics <{}", file.string()).c_str());
}

TEST(MetricsText, PrometheusTakesItWithoutARemark) {
  status_t status = test::example_status();
  status.devices[1].name = "mtx2";
  status.devices[1].latency_ms = std::nan("");
  const int verdict = check_by_prometheus(metrics_text(status, 0.3));
  if (verdict == kSkipped) GTEST_SKIP() << "promtool is missing: apt-get install prometheus";
  EXPECT_EQ(verdict, 0);
}

TEST(MetricsText, PrometheusRefusesWhatIsWrong) {
  const int verdict = check_by_prometheus(
      "# TYPE imuscope_ticks_total counter\nimuscope_ticks_total 1\n"
      "imuscope_ticks_total 2\n");
  if (verdict == kSkipped) GTEST_SKIP() << "promtool is missing: apt-get install prometheus";
  EXPECT_NE(verdict, 0) << "the judge of the other test judges";
}

TEST(MetricsText, NamesOfOthersAreTextAndStandOnce) {
  status_t status = test::example_status();
  status.run = "a\"b\\c\nimuscope_forged 1";
  status.threads.push_back(status.threads[0]);
  const auto text = metrics_text(status, 0.0);
  EXPECT_THAT(text, HasSubstr("run=\"a\\\"b\\\\c?imuscope_forged 1\""));
  EXPECT_THAT(text, Not(HasSubstr("\nimuscope_forged")));
  const auto line = std::string("\nimuscope_thread_ticks_total{thread=\"estimator\"} 10\n");
  ASSERT_THAT(text, HasSubstr(line));
  EXPECT_EQ(text.find(line), text.rfind(line));
  const int verdict = check_by_prometheus(text);
  EXPECT_TRUE(verdict == 0 || verdict == kSkipped);
}

TEST(MetricsText, SaysWhatTheStatusSaysInBaseUnits) {
  const auto text = metrics_text(test::example_status(), 0.25);
  for (const char* line :
       {"imuscope_state{state=\"degraded\"} 1", "imuscope_state{state=\"running\"} 0",
        "imuscope_ticks_total 6151", "imuscope_capture_lost_records_total 4",
        "imuscope_device_rate_hertz{device=\"mtx1\"} 99.9",
        "imuscope_device_lost_samples_total{device=\"mtx1\"} ", "imuscope_thread_heartbeat_age_seconds",
        "imuscope_alarm_active{kind=\"bus\",subject=\"LCM\"} 1",
        "imuscope_alarm_begins_total{kind=\"bus\",subject=\"LCM\"} 22", "imuscope_status_age_seconds 0.25",
        "imuscope_ring_high_water{ring=\"samples\"} 18"})
    EXPECT_THAT(text, HasSubstr(line));
  EXPECT_THAT(text, HasSubstr("imuscope_device_latency_seconds{device=\"mtx1\"} 0.0042"));
}

TEST(MetricsText, TheWholePage) {
  status_t status = test::example_status();
  status.devices[1].name = "mtx2";
  status.devices[1].state = "failed";
  status.devices[1].data_age_s = 3.5;
  status.devices[1].clock_drift_ppm = std::nan("");
  status.alarms.push_back(status.alarms[0]);
  status.alarms[1].kind = "disk";
  status.alarms[1].active = 0;
  status.alarms[1].times = 33;
  test::expect_recorded("service/doors/metrics.txt", metrics_text(status, 0.25));
}

TEST(MetricsText, ThePageOfTheDocumentsHasEveryFamilyAndNoOther) {
  std::ifstream page(test::source_path("docs/metrics.md"));
  std::stringstream content;
  content << page.rdbuf();
  const std::string text = content.str();
  std::size_t rows = 0;
  for (std::size_t at = 0; (at = text.find("| `imuscope_", at)) != std::string::npos; ++at) ++rows;
  EXPECT_EQ(rows, metric_families().size());
  for (const auto& family : metric_families()) {
    EXPECT_THAT(text, HasSubstr(fmt::format("| `{}` | {} | {} | {} |", family.name, family.type,
                                            family.labels, family.help)));
  }
}

/// A client of HTTP as simple as it gets.
class Client {
 public:
  explicit Client(std::uint16_t port) : socket_(socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(port);
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    connected_ = connect(socket_.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0;
    constexpr timeval kPatience{10, 0};
    setsockopt(socket_.get(), SOL_SOCKET, SO_RCVTIMEO, &kPatience, sizeof kPatience);
  }
  [[nodiscard]] bool connected() const { return connected_; }
  [[nodiscard]] std::string ask(const std::string& request) const {
    (void)send(socket_.get(), request.data(), request.size(), MSG_NOSIGNAL);
    return rest();
  }
  [[nodiscard]] std::string rest() const {
    std::string all;
    std::array<char, 4096> part{};
    for (ssize_t n = 0; (n = recv(socket_.get(), part.data(), part.size(), 0)) > 0;)
      all.append(part.data(), static_cast<std::size_t>(n));
    return all;
  }

 private:
  Descriptor socket_;
  bool connected_ = false;
};

class MetricsDoor : public testing::Test {
 protected:
  void SetUp() override {
    for (port_ = 29847; port_ < 29947 && !server_; ++port_) {
      if (auto opened = MetricsServer::open("127.0.0.1", port_, board_)) server_ = std::move(*opened);
    }
    --port_;
    ASSERT_TRUE(server_);
  }
  [[nodiscard]] std::string get(const std::string& request) const { return Client(port_).ask(request); }

  StatusBoard board_;
  std::unique_ptr<MetricsServer> server_;
  std::uint16_t port_ = 0;
};

TEST_F(MetricsDoor, GivesTheNewestStatusAndNothingElse) {
  EXPECT_THAT(get("GET /metrics HTTP/1.1\r\nHost: localhost\r\n\r\n"), StartsWith("HTTP/1.1 503"));
  board_.put(test::example_status(), host_now());
  const auto page = get("GET /metrics HTTP/1.1\r\nHost: 127.0.0.1:9847\r\n\r\n");
  EXPECT_THAT(page, StartsWith("HTTP/1.1 200"));
  EXPECT_THAT(page, HasSubstr("text/plain; version=0.0.4"));
  EXPECT_THAT(page, HasSubstr("imuscope_ticks_total 6151\n"));
  const auto head = get("HEAD /metrics HTTP/1.1\r\nHost: localhost\r\n\r\n");
  EXPECT_THAT(head, StartsWith("HTTP/1.1 200"));
  EXPECT_THAT(head, ContainsRegex("Content-Length: [1-9]"));
  EXPECT_TRUE(head.ends_with("\r\n\r\n")) << "a body follows the header";
  EXPECT_THAT(get("GET / HTTP/1.1\r\nHost: localhost\r\n\r\n"), StartsWith("HTTP/1.1 404"));
  EXPECT_THAT(get("GET /metrics/../etc/passwd HTTP/1.1\r\nHost: localhost\r\n\r\n"),
              StartsWith("HTTP/1.1 404"));
  EXPECT_THAT(get("DELETE /metrics HTTP/1.1\r\nHost: localhost\r\n\r\n"), StartsWith("HTTP/1.1 405"));
}

TEST_F(MetricsDoor, APageOfABrowserWhoseNameLeadsHereIsRefused) {
  board_.put(test::example_status(), host_now());
  for (const char* host :
       {"forged.example", "127.forged.example", "127.0.0.1.forged.example", "[::1].forged.example"})
    EXPECT_THAT(get(std::string("GET /metrics HTTP/1.1\r\nHost: ") + host + "\r\n\r\n"),
                StartsWith("HTTP/1.1 403"))
        << host;
  EXPECT_THAT(get("GET /metrics HTTP/1.0\r\n\r\n"), StartsWith("HTTP/1.0 200"));  // no browser leaves it out
}

TEST_F(MetricsDoor, WhoeverHoldsItOpenHoldsItForItsTimeAlone) {
  board_.put(test::example_status(), host_now());
  std::vector<std::unique_ptr<Client>> holders;
  for (unsigned i = 0; i < 4 * MetricsServer::kClientsMax; ++i)
    holders.push_back(std::make_unique<Client>(port_));
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(6 * MetricsServer::kPatience_s);
  bool answered = false;
  while (!answered && std::chrono::steady_clock::now() < end) {
    answered = get("GET /metrics HTTP/1.1\r\nHost: localhost\r\n\r\n").starts_with("HTTP/1.1 200");
    if (!answered) std::this_thread::sleep_for(std::chrono::milliseconds(200));
  }
  EXPECT_TRUE(answered);
}

TEST_F(MetricsDoor, ARequestWithoutEndIsCutOff) {
  board_.put(test::example_status(), host_now());
  std::string request = "GET /metrics HTTP/1.1\r\nHost: localhost\r\n";
  for (int i = 0; i < 20'000; ++i) request += fmt::format("X-{}: {}\r\n", i, std::string(100, 'x'));
  EXPECT_THAT(get(request), Not(StartsWith("HTTP/1.1 200")));
  EXPECT_THAT(get("GET /metrics HTTP/1.1\r\nHost: localhost\r\n\r\n"), StartsWith("HTTP/1.1 200"));
}

TEST(MetricsAddress, WhatIsNoAddressAndWhatIsTakenIsTold) {
  const StatusBoard board;
  EXPECT_FALSE(MetricsServer::open("vehicle", 29999, board));
  const auto first = MetricsServer::open("::1", 29998, board);
  if (!first) GTEST_SKIP() << "no IPv6 here: " << first.error().text();
  const auto second = MetricsServer::open("::1", 29998, board);
  ASSERT_FALSE(second);
  EXPECT_THAT(second.error().text(), HasSubstr("port 29998"));
}

}  // namespace
}  // namespace imuscope
