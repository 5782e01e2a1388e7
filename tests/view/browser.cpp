#include "tests/view/browser.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <csignal>
#include <fstream>
#include <thread>

namespace imuscope::test {

namespace {

using nlohmann::json;
using std::chrono::milliseconds;

constexpr int kPatience_ms = 30'000;

/// RFC 4648.
std::string from_base64(const std::string& text) {
  std::string out;
  unsigned bits = 0;
  int n = 0;
  for (const char c : text) {
    const int digit = c >= 'A' && c <= 'Z'   ? c - 'A'
                      : c >= 'a' && c <= 'z' ? c - 'a' + 26
                      : c >= '0' && c <= '9' ? c - '0' + 52
                      : c == '+'             ? 62
                      : c == '/'             ? 63
                                             : -1;
    if (digit < 0) continue;
    bits = bits << 6U | static_cast<unsigned>(digit);
    n += 6;
    if (n < 8) continue;
    n -= 8;
    out.push_back(static_cast<char>(bits >> static_cast<unsigned>(n) & 0xffU));
  }
  return out;
}

}  // namespace

Browser::Browser(const std::filesystem::path& folder) {
  std::array<int, 2> in{};
  std::array<int, 2> out{};
  EXPECT_EQ(::pipe2(in.data(), O_CLOEXEC), 0);
  EXPECT_EQ(::pipe2(out.data(), O_CLOEXEC), 0);
  const std::string profile = "--user-data-dir=" + (folder / "profile").string();
  const std::string log = (folder / "browser.log").string();
  process_ = ::fork();
  if (process_ == 0) {
    // The browser reads 3 and writes 4. The pipe's ends may lie on these numbers: out of the way first.
    const int read_end = ::fcntl(in[0], F_DUPFD, 10);
    const int write_end = ::fcntl(out[1], F_DUPFD, 10);
    ::dup2(read_end, 3);
    ::dup2(write_end, 4);
    const int to_log = ::open(log.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0644);
    ::dup2(to_log, 1);
    ::dup2(to_log, 2);
    ::execl(kProgram, kProgram, "--headless", "--no-sandbox", "--disable-gpu", "--no-first-run",
            "--hide-scrollbars", "--disable-background-networking", "--remote-debugging-pipe",
            profile.c_str(), "about:blank", nullptr);
    ::_exit(127);
  }
  ::close(in[0]);
  ::close(out[1]);
  to_ = in[1];
  from_ = out[0];
  for (int i = 0; i < 100 && session_.empty(); ++i) {
    const json found = call("Target.getTargets");
    for (const json& target : found.value("targetInfos", json::array())) {
      if (target.at("type") != "page") continue;
      session_ = call("Target.attachToTarget", {{"targetId", target.at("targetId")}, {"flatten", true}})
                     .value("sessionId", "");
      break;
    }
    if (session_.empty()) std::this_thread::sleep_for(milliseconds(100));
  }
  EXPECT_FALSE(session_.empty()) << "the browser shows no page";
  for (const char* domain : {"Page.enable", "Runtime.enable", "Log.enable", "Network.enable"}) call(domain);
}

Browser::~Browser() {
  ::close(to_);
  ::close(from_);
  ::kill(process_, SIGKILL);
  ::waitpid(process_, nullptr, 0);
}

json Browser::call(const std::string& method, json parameters) {
  const int number = ++number_;
  json message{{"id", number}, {"method", method}, {"params", std::move(parameters)}};
  if (!session_.empty()) message["sessionId"] = session_;
  const std::string text = message.dump() + '\0';
  if (::write(to_, text.data(), text.size()) != static_cast<ssize_t>(text.size())) return {};
  while (true) {
    std::size_t end = 0;
    while ((end = buffer_.find('\0')) == std::string::npos) {
      pollfd input{from_, POLLIN, 0};
      std::array<char, 65536> block{};
      if (::poll(&input, 1, kPatience_ms) <= 0) {
        ADD_FAILURE() << "the browser does not answer " << method;
        return {};
      }
      const auto n = ::read(from_, block.data(), block.size());
      if (n <= 0) return {};
      buffer_.append(block.data(), static_cast<std::size_t>(n));
    }
    const json answer = json::parse(buffer_.substr(0, end));
    buffer_.erase(0, end + 1);
    if (answer.value("id", 0) == number) return answer.value("result", json::object());
    take(answer);
  }
}

void Browser::take(const json& event) {
  const std::string method = event.value("method", "");
  if (method == "Runtime.exceptionThrown" || method == "Runtime.consoleAPICalled" ||
      method == "Log.entryAdded")
    said_.push_back(event.at("params").dump());
  if (method == "Network.dataReceived") bytes_ += event.at("params").value("dataLength", 0.0);
  if (method == "Network.webSocketFrameReceived")
    bytes_ += static_cast<double>(event.at("params").at("response").value("payloadData", "").size());
}

void Browser::open(const std::string& url) {
  bytes_ = 0.0;
  call("Page.navigate", {{"url", url}});
}

void Browser::resize(int width, int height) {
  call("Emulation.setDeviceMetricsOverride",
       {{"width", width}, {"height", height}, {"deviceScaleFactor", 1}, {"mobile", width < 600}});
}

void Browser::prefer_dark(bool dark) {
  call("Emulation.setEmulatedMedia",
       {{"features", json::array({{{"name", "prefers-color-scheme"}, {"value", dark ? "dark" : "light"}}})}});
}

json Browser::value_of(const std::string& expression) {
  const json answer = call("Runtime.evaluate", {{"expression", expression}, {"returnByValue", true}});
  if (answer.contains("exceptionDetails")) said_.push_back(answer.at("exceptionDetails").dump());
  return answer.value("result", json::object()).value("value", json());
}

bool Browser::becomes_true(const std::string& expression, double patience_s) {
  const auto end = std::chrono::steady_clock::now() + std::chrono::duration<double>(patience_s);
  while (std::chrono::steady_clock::now() < end) {
    if (value_of(expression) == true) return true;
    std::this_thread::sleep_for(milliseconds(100));
  }
  return false;
}

void Browser::photograph(const std::filesystem::path& file) {
  const json size = value_of("[innerWidth, document.documentElement.scrollHeight]");
  resize(size.at(0), size.at(1));
  std::this_thread::sleep_for(std::chrono::seconds(1));  // it draws ten times a second
  std::ofstream(file, std::ios::binary)
      << from_base64(call("Page.captureScreenshot", {{"format", "png"}}).value("data", ""));
}

std::vector<std::string> Browser::said() {
  (void)value_of("0");  // what was on its way comes first
  return said_;
}

double Browser::bytes_received() {
  (void)value_of("0");
  return bytes_;
}

}  // namespace imuscope::test
