/// The page's door, from outside: who gets in, what a hostile client can do, and that the others do not
/// notice.

#include "view/view_server.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sys/resource.h>
#include <atomic>
#include <chrono>
#include <memory>
#include <mutex>
#include <regex>
#include <thread>
#include <vector>

#include "tests/view/raw_client.h"
#include "view/content_policy.h"
#include "view/page.h"
#include "view/page_command.h"

namespace imuscope::view {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;
using test::RawClient;
using testing::HasSubstr;
using testing::Not;
using testing::StartsWith;

/// Bytes that a browser may load for the page, by the goal.
constexpr std::size_t kTransferMax = 300'000;

class Door : public testing::Test {
 protected:
  void open(const std::string& token = {}, const std::string& address = "127.0.0.1") {
    auto server = ViewServer::open(
        {address, 0, token}, page_html(), [this] { return "whole " + std::to_string(newest_.load()); },
        [this](std::string_view text) {
          const std::scoped_lock lock(mutex_);
          said_.emplace_back(text);
        });
    ASSERT_TRUE(server) << server.error().text();
    server_ = std::move(*server);
    host_ = "127.0.0.1:" + std::to_string(server_->port());
  }
  [[nodiscard]] RawClient client() const { return RawClient(server_->port()); }
  /// A page that has its first picture.
  [[nodiscard]] RawClient page() const {
    RawClient one = client();
    EXPECT_THAT(one.upgrade(host_), StartsWith("HTTP/1.1 101"));
    EXPECT_THAT(one.next_text().value_or(""), StartsWith("whole"));
    return one;
  }
  void send_next() { server_->send("part " + std::to_string(++newest_)); }
  /// Whether a page gets every part, and none twice.
  void expect_undisturbed(RawClient& watching) {
    for (int i = 0; i < 5; ++i) {
      send_next();
      EXPECT_EQ(watching.next_text(), "part " + std::to_string(newest_.load()));
    }
  }
  std::vector<std::string> said() {
    const std::scoped_lock lock(mutex_);
    return said_;
  }

  std::unique_ptr<ViewServer> server_;
  std::string host_;
  std::atomic<int> newest_{0};
  std::mutex mutex_;
  std::vector<std::string> said_;
};

TEST_F(Door, GivesThePageWithHeadersThatLetNothingElseRun) {
  open();
  const std::string answer = client().get("/", host_);
  EXPECT_THAT(answer, StartsWith("HTTP/1.1 200"));
  EXPECT_LT(answer.size(), kTransferMax / 3) << "the rest is for the picture";
  const std::string head = answer.substr(0, answer.find("\r\n\r\n"));
  for (const char* line :
       {"X-Content-Type-Options: nosniff", "X-Frame-Options: DENY", "Referrer-Policy: no-referrer",
        "Cross-Origin-Opener-Policy: same-origin", "Cross-Origin-Resource-Policy: same-origin",
        "Cache-Control: no-store", "Connection: close", "default-src 'none'", "connect-src 'self'",
        "frame-ancestors 'none'", "base-uri 'none'", "form-action 'none'", "script-src 'sha256-"})
    EXPECT_THAT(head, HasSubstr(line));
  EXPECT_THAT(head, Not(HasSubstr("unsafe")));
  EXPECT_THAT(head, Not(HasSubstr("http:")));
  // Nothing comes from elsewhere: no address in the page but the one it came from.
  const std::string page = answer.substr(head.size());
  EXPECT_FALSE(std::regex_search(page, std::regex("(src|href)=\"(?!data:)"))) << "an address";
  EXPECT_THAT(page, Not(HasSubstr("https://")));
  EXPECT_THAT(page, Not(HasSubstr("http://")));
  EXPECT_THAT(page, Not(HasSubstr("innerHTML")));
  EXPECT_THAT(page, Not(HasSubstr("{{")));
  const std::string only_head = client().get("/", host_, {}, "HEAD");
  EXPECT_THAT(only_head, StartsWith("HTTP/1.1 200"));
  EXPECT_EQ(only_head.find("<html"), std::string::npos);
}

TEST(ContentPolicy, NamesTheScriptByItsHash) {
  // echo -n 'alert(1)' | openssl dgst -sha256 -binary | base64
  EXPECT_THAT(content_policy("<p>x</p><script>alert(1)</script>"),
              HasSubstr("script-src 'sha256-bhHHL3z2vDgxUt0W3dWQOrprscmda2Y5pLsLg4GF+pI=';"));
  EXPECT_THAT(content_policy("<p>x</p>"), HasSubstr("script-src 'none'; style-src 'none'"));
}

TEST_F(Door, HasOnePageAndNoFiles) {
  open();
  for (const char* target :
       {"/index.html", "/../../etc/passwd", "/%2e%2e/etc/passwd", "//", "/live/", "http://x/"})
    EXPECT_THAT(client().get(target, host_), StartsWith("HTTP/1.1 404")) << target;
  EXPECT_THAT(client().get("/", host_, {}, "POST"), StartsWith("HTTP/1.1 405"));
  EXPECT_THAT(client().get("/", host_, {}, "DELETE"), StartsWith("HTTP/1.1 405"));
  EXPECT_THAT(client().get("/live", host_), StartsWith("HTTP/1.1 426"));
}

TEST_F(Door, ANameThatLeadsHereIsRefused) {
  open();
  for (const char* host : {"attacker.example", "attacker.example:8088", "192.168.7.7"}) {
    EXPECT_THAT(client().get("/", host), StartsWith("HTTP/1.1 403")) << host;
    EXPECT_THAT(client().upgrade(host), StartsWith("HTTP/1.1 403")) << host;
  }
  RawClient without = client();
  without.send("GET / HTTP/1.1\r\n\r\n");
  EXPECT_THAT(without.rest(), StartsWith("HTTP/1.1 403")) << "a request without a Host";
}

TEST_F(Door, APageOfAnotherOriginGetsNoWebsocket) {
  open();
  for (const char* origin : {"http://attacker.example", "null", "https://127.0.0.1", "http://127.0.0.1:1"})
    EXPECT_THAT(client().upgrade(host_, "/live", std::string("Origin: ") + origin + "\r\n"),
                StartsWith("HTTP/1.1 403"))
        << origin;
  EXPECT_THAT(client().upgrade(host_, "/live", "Origin: http://" + host_ + "\r\n"),
              StartsWith("HTTP/1.1 101"));
  EXPECT_GE(server_->counters().requests_refused, 4U);
}

TEST_F(Door, WithATokenNothingIsToldWithoutIt) {
  open("a-long-secret");
  for (const char* target :
       {"/", "/live", "/?token=", "/?token=a-long-secre", "/?token=a-long-secret2", "/?x=a-long-secret"})
    EXPECT_THAT(client().get(target, host_), StartsWith("HTTP/1.1 401")) << target;
  EXPECT_THAT(client().upgrade(host_), StartsWith("HTTP/1.1 401"));
  EXPECT_THAT(client().get("/?token=a-long-secret", host_), StartsWith("HTTP/1.1 200"));
  EXPECT_THAT(client().upgrade(host_, "/live?token=a-long-secret"), StartsWith("HTTP/1.1 101"));
}

TEST_F(Door, WhatCannotBeOpenedIsTold) {
  const auto fails = [](const ViewDoor& door) {
    return ViewServer::open(
        door, "page", [] { return std::string(); }, [](std::string_view) {});
  };
  EXPECT_EQ(fails({"attacker.example", 0, {}}).error().kind, ErrorKind::kUsage);
  EXPECT_EQ(fails({"127.0.0.1", 0, "short"}).error().kind, ErrorKind::kUsage);
  open();
  const auto taken = fails({"127.0.0.1", server_->port(), {}});
  ASSERT_FALSE(taken);
  EXPECT_EQ(taken.error().kind, ErrorKind::kWork);
  EXPECT_THAT(taken.error().text(), HasSubstr("--port"));
}

TEST_F(Door, APageGetsTheWholeThenEveryPartAndMayAskForSomething) {
  open();
  RawClient one = page();
  RawClient two = page();
  expect_undisturbed(one);
  for (int i = 1; i <= 5; ++i) EXPECT_EQ(two.next_text(), "part " + std::to_string(i));
  one.send(RawClient::frame(R"({"mark":"kerb"})"));
  for (int i = 0; i < 100 && said().empty(); ++i) std::this_thread::sleep_for(milliseconds(20));
  EXPECT_THAT(said(), testing::ElementsAre(R"({"mark":"kerb"})"));
  EXPECT_EQ(server_->counters().pages, 2U);
}

TEST_F(Door, MalformedRequestsAndFramesEndTheirOwnConnectionAlone) {
  open();
  RawClient watching = page();
  const std::vector<std::string> requests{
      std::string(1, '\0'),
      std::string(10'000, 'A'),
      "GET\r\n\r\n",
      "GET / HTTP/9.9\r\n\r\n",
      "GET / HTTP/1.1\r\nHost: " + host_ + "\r\nContent-Length: 99999999999999999999\r\n\r\n",
      "GET / HTTP/1.1\r\nHost: " + host_ + "\r\nContent-Length: 100\r\n\r\n" + std::string(100, 'x'),
      "GET / HTTP/1.1\r\nHost: " + host_ + "\r\nTransfer-Encoding: chunked\r\n\r\nffffffffffffffff\r\n",
      "GET / HTTP/1.1\r\nHost: " + host_ + "\r\nX: " + std::string(2 * ViewServer::kHeaderMax, 'y') +
          "\r\n\r\n",
      "\x16\x03\x01\x02\x01\x01\x01"};
  for (const std::string& request : requests) {
    RawClient one = client();
    one.send(request);
    EXPECT_TRUE(one.is_closed(seconds(ViewServer::kPatience_s + 3))) << request.substr(0, 60);
    expect_undisturbed(watching);
  }
  const std::string huge("\x81\xff\x7f\xff\xff\xff\xff\xff\xff\xff\0\0\0\0", 14);  // a frame of 2^63 bytes
  const std::vector<std::string> frames{
      huge,
      RawClient::frame(std::string(kPageMessageMax + 1, 'x')),
      std::string("\x81\x03xyz"),                     // without a mask
      RawClient::frame("x", 0x80),                    // a continuation of nothing
      RawClient::frame("x", 0xf1),                    // reserved bits
      RawClient::frame("x", 0x83),                    // a reserved opcode
      RawClient::frame("\xff\xfe"),                   // no UTF-8
      RawClient::frame("x", 0x82),                    // binary
      RawClient::frame(std::string(126, 'x'), 0x89),  // a ping that is too long
      RawClient::frame("\x03", 0x88)};                // a close with half a code
  for (std::size_t i = 0; i < frames.size(); ++i) {
    RawClient one = page();
    one.send(frames[i]);
    EXPECT_TRUE(one.is_closed(seconds(ViewServer::kPatience_s + 3))) << "frame " << i;
    expect_undisturbed(watching);
  }
  EXPECT_TRUE(said().empty()) << "nothing of it was taken for a message";
  // The server has seen that the last of them closed, a moment after the test closed it.
  for (int i = 0; i < 100 && server_->counters().pages > 1; ++i)
    std::this_thread::sleep_for(milliseconds(20));
  EXPECT_EQ(server_->counters().pages, 1U);
}

TEST_F(Door, APageThatSendsWithoutEndIsDropped) {
  open();
  RawClient watching = page();
  RawClient flooding = page();
  std::string many;
  for (int i = 0; i < 1000; ++i) many += RawClient::frame(R"({"mark":"x"})");
  flooding.send(many);
  EXPECT_TRUE(flooding.is_closed(seconds(5)));
  EXPECT_LE(said().size(), static_cast<std::size_t>(ViewServer::kMessagesPerSecond));
  expect_undisturbed(watching);
}

/// Sockets of the test itself.
void allow_files(rlim_t wanted) {
  rlimit limit{};
  getrlimit(RLIMIT_NOFILE, &limit);
  if (limit.rlim_cur < wanted) {
    limit.rlim_cur = std::min(wanted, limit.rlim_max);
    setrlimit(RLIMIT_NOFILE, &limit);
  }
}

TEST_F(Door, AThousandClientsDisturbNobody) {
  constexpr int kClients = 1000;
  allow_files(4 * kClients);
  open();
  RawClient watching = page();
  {
    // That say nothing.
    std::vector<std::unique_ptr<RawClient>> silent;
    for (int i = 0; i < kClients; ++i) silent.push_back(std::make_unique<RawClient>(server_->port()));
    expect_undisturbed(watching);
    // The oldest of them goes for whoever comes: a person is served meanwhile.
    EXPECT_THAT(client().get("/", host_), StartsWith("HTTP/1.1 200"));
  }
  {
    // That all want a page.
    std::vector<std::unique_ptr<RawClient>> pages;
    int taken = 0;
    int refused = 0;
    for (int i = 0; i < kClients; ++i) {
      pages.push_back(std::make_unique<RawClient>(server_->port()));
      const std::string head = pages.back()->upgrade(host_);
      if (head.starts_with("HTTP/1.1 101")) ++taken;
      if (head.starts_with("HTTP/1.1 503")) ++refused;
    }
    EXPECT_EQ(taken, static_cast<int>(ViewServer::kPagesMax) - 1);
    EXPECT_EQ(taken + refused, kClients);
    expect_undisturbed(watching);
  }
  for (int i = 0; i < 200 && server_->counters().pages > 1; ++i) {
    send_next();
    (void)watching.next_text();
    std::this_thread::sleep_for(milliseconds(20));
  }
  EXPECT_EQ(server_->counters().pages, 1U) << "who is gone makes room";
  RawClient again = page();
  expect_undisturbed(watching);
}

TEST_F(Door, WhoeverIsTooSlowGetsTheNewestAndCostsNobody) {
  open();
  RawClient watching = page();
  RawClient slow = page();
  const std::string long_text(50'000, 'x');
  constexpr int kParts = 400;  // 20 MB, of which no queue may hold more than kQueueMax
  for (int i = 0; i < kParts; ++i) {
    server_->send("part " + std::to_string(++newest_) + " " + long_text);
    EXPECT_THAT(watching.next_text().value_or("").substr(0, 20),
                StartsWith("part " + std::to_string(newest_.load())));
  }
  EXPECT_GT(server_->counters().parts_left_out, static_cast<std::uint64_t>(kParts) / 2);
  // Now it reads: old parts first, then the whole of now.
  std::size_t got = 0;
  std::string last;
  while (auto text = slow.next_text(milliseconds(500))) {
    got += text->size();
    last = *text;
  }
  EXPECT_LT(got, (ViewServer::kQueueMax + 60) * long_text.size()) << "what the kernel held, and one queue";
  EXPECT_TRUE(last.starts_with("whole") || last.starts_with("part " + std::to_string(kParts)))
      << last.substr(0, 20);
  expect_undisturbed(watching);
  EXPECT_EQ(slow.next_text().value_or("").substr(0, 4), "part") << "and goes on from there";
}

TEST_F(Door, AClientThatDoesNotAskIsLetGo) {
  open();
  RawClient silent = client();
  RawClient half = client();
  half.send("GET / HTTP/1.1\r\nHo");
  EXPECT_TRUE(silent.is_closed(seconds(ViewServer::kPatience_s + 3)));
  EXPECT_TRUE(half.is_closed(seconds(3)));
}

}  // namespace
}  // namespace imuscope::view
