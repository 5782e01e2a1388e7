/// The page in a real browser: beside a live service it shows what the simulator knows, row by row; it
/// outlives the service and its own program; a recording plays. What strangers send stays text. The pictures
/// remain in the test's folder to be looked at.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <unistd.h>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <csignal>
#include <cstdlib>
#include <fstream>
#include <map>
#include <memory>
#include <optional>
#include <regex>
#include <sstream>
#include <thread>

#include "example_messages.h"
#include "mounting_compare.h"
#include "programs.h"
#include "publish/lcm_publisher.h"
#include "status_listener.h"
#include "tests/support/shared_data.h"
#include "tests/view/browser.h"
#include "tests/view/raw_client.h"

namespace imuscope::test {
namespace {

using nlohmann::json;
using std::chrono::seconds;
using testing::HasSubstr;
using testing::IsEmpty;

// The goals of the page.
constexpr double kFirstPaintMax_ms = 1000.0;
constexpr double kTransferMax = 300'000.0;
constexpr double kProcessorMax = 0.03;
constexpr int kImus = 6;
constexpr seconds kSettle{35};
/// With IMUSCOPE_LONG_PAGE a minute.
const seconds kMeasured{std::getenv("IMUSCOPE_LONG_PAGE") == nullptr ? 25 : 60};
/// Scenario time (kBegin_s is when the drive begins) of a stroke of bad luck within what is measured.
constexpr const char* kFault = R"(
[[fault]]
kind = "cut"
device = "mtx2"
at_s = 110.0
for_s = 5.0
share = 0.1
)";

std::string name_of(int imu) { return "mtx" + std::to_string(imu); }

/// Of what the demo's sensors are, six; the mountings of the further ones are turned a little more.
std::string configuration(const std::filesystem::path& folder) {
  std::string text = read_text(source_path("config/demo.toml"));
  text = std::regex_replace(text, std::regex("/tmp/imuscope-demo"), (folder / "ports").string());
  std::ostringstream devices;
  std::ostringstream truth;
  for (int i = 4; i <= kImus; ++i) {
    devices << "[[device]]\nname = \"" << name_of(i)
            << "\"\nrole = \"study\"\nprotocol = \"xsens_mt\"\nrate_hz = 100.0\ntransport = { kind = "
               "\"serial\", port = "
            << folder / "ports" / name_of(i) << ", baud = 115200 }\n\n";
    truth << "[[simulation.imu]]\nname = \"" << name_of(i) << "\"\nrotation_vector_b_s_deg = [" << 10 * i
          << ".0, -5.0, 3.0]\nlever_arm_b_m = [0.1, 0." << i << ", -0.2]\nlatency_ms = 2.0\n";
  }
  const std::string gnss = "[[device]]\nname = \"gnss\"";
  text.insert(text.find(gnss), devices.str());
  return text + truth.str() + "\n[noise]\nrefit_interval_s = 15.0\n";
}

double processor_s(pid_t process) {
  const std::string stat = read_text("/proc/" + std::to_string(process) + "/stat");
  std::istringstream fields(stat.substr(stat.rfind(')') + 1));
  std::string skipped;
  constexpr int kBeforeUserTime = 11;  // proc(5): fields 3 to 13
  for (int i = 0; i < kBeforeUserTime; ++i) fields >> skipped;
  double user = 0.0;
  double system = 0.0;
  fields >> user >> system;
  return (user + system) / static_cast<double>(sysconf(_SC_CLK_TCK));
}

/// Numbers in a text, in order.
std::vector<double> numbers_in(const std::string& text) {
  std::vector<double> numbers;
  const std::regex pattern(R"([-+]?\d+(\.\d+)?(e[-+]?\d+)?)");
  for (std::sregex_iterator at(text.begin(), text.end(), pattern), end; at != end; ++at)
    numbers.push_back(std::stod(at->str()));
  return numbers;
}

/// The program of the page, and where it says that the page is.
class View {
 public:
  View(std::vector<std::string> arguments, const std::filesystem::path& log) : log_(log) {
    arguments.insert(arguments.begin(), "view");
    program_.emplace("imuscope", arguments, log);
    const auto end = std::chrono::steady_clock::now() + seconds(20);
    while (read_text(log).find('\n') == std::string::npos && std::chrono::steady_clock::now() < end)
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
    const std::string text = read_text(log);
    std::smatch found;
    EXPECT_TRUE(std::regex_search(text, found, std::regex("(http://[0-9.]+:(\\d+)/\\S*)\n"))) << text;
    if (found.empty()) return;
    url_ = found[1];
    port_ = static_cast<std::uint16_t>(std::stoi(found[2]));
  }
  [[nodiscard]] const std::string& url() const { return url_; }
  [[nodiscard]] std::uint16_t port() const { return port_; }
  [[nodiscard]] pid_t id() const { return program_->id(); }
  void end() {
    program_->interrupt();
    EXPECT_EQ(program_->wait(), 0) << read_text(log_);
  }

 private:
  std::filesystem::path log_;
  std::optional<BackgroundProgram> program_;
  std::string url_;
  std::uint16_t port_ = 0;
};

/// A page of somebody else: its origin is another port.
class ForeignPage {
 public:
  ForeignPage() : socket_(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t size = sizeof address;
    EXPECT_EQ(::bind(socket_, reinterpret_cast<sockaddr*>(&address), size), 0);
    EXPECT_EQ(::listen(socket_, 8), 0);
    EXPECT_EQ(::getsockname(socket_, reinterpret_cast<sockaddr*>(&address), &size), 0);
    port_ = ntohs(address.sin_port);
    thread_ = std::thread([this] { serve(); });
  }
  ForeignPage(const ForeignPage&) = delete;
  ForeignPage& operator=(const ForeignPage&) = delete;
  ~ForeignPage() {
    ::shutdown(socket_, SHUT_RDWR);  // accept() returns
    thread_.join();
    ::close(socket_);
  }
  [[nodiscard]] std::uint16_t port() const { return port_; }

 private:
  void serve() const {
    const std::string answer =
        "HTTP/1.1 200 OK\r\nContent-Type: text/html\r\nContent-Length: 22\r\nConnection: close\r\n\r\n"
        "<title>foreign</title>";
    for (int client = 0; (client = ::accept(socket_, nullptr, nullptr)) >= 0;) {
      constexpr timeval kPatience{0, 300'000};  // browsers open connections that they do not use
      ::setsockopt(client, SOL_SOCKET, SO_RCVTIMEO, &kPatience, sizeof kPatience);
      std::array<char, 4096> request{};
      (void)::recv(client, request.data(), request.size(), 0);
      (void)::send(client, answer.data(), answer.size(), MSG_NOSIGNAL);
      ::close(client);
    }
  }

  int socket_;
  std::uint16_t port_ = 0;
  std::thread thread_;
};

class ViewPage : public testing::Test {
 protected:
  void SetUp() override {
    if (!std::filesystem::exists(Browser::kProgram))
      GTEST_SKIP() << "needs " << Browser::kProgram << " (Debian package chromium), which is absent here";
    if (!enter_private_network()) GTEST_SKIP() << "a private network namespace needs root";
    folder_ = scratch_folder();
    browser_ = std::make_unique<Browser>(folder_);
    browser_->resize(1280, 900);
    browser_->prefer_dark(false);
  }

  [[nodiscard]] std::string text_at(const std::string& selector) const {
    const json text =
        browser_->value_of("(document.querySelector(" + json(selector).dump() + ") ?? {}).textContent");
    return text.is_string() ? text.get<std::string>() : "";
  }
  /// Of a tile, by what it is of.
  [[nodiscard]] std::string field(const std::string& section, const std::string& name,
                                  const std::string& which) const {
    return text_at("#" + section + " [data-key=\"" + name + "\"] [data-field=\"" + which + "\"]");
  }
  [[nodiscard]] json counts() const { return browser_->value_of("imuscope.counts"); }

  void photograph_all(const std::string& name) {
    for (const int width : {1280, 390}) {
      browser_->resize(width, 900);
      for (const bool night : {false, true}) {
        browser_->prefer_dark(night);
        EXPECT_TRUE(
            browser_->becomes_true("document.documentElement.scrollWidth <= " + std::to_string(width), 3.0))
            << "the page scrolls sideways at " << width;
        const auto picture =
            folder_ / (name + "_" + std::to_string(width) + (night ? "_night.png" : "_day.png"));
        browser_->photograph(picture);
        EXPECT_GT(std::filesystem::file_size(picture), 50'000U) << picture;
        browser_->resize(width, 900);
      }
    }
    browser_->resize(1280, 900);
    browser_->prefer_dark(false);
  }

  /// Canvases without ink.
  [[nodiscard]] json blank_figures() const {
    return browser_->value_of(
        "[...document.querySelectorAll('canvas')].filter((c) => !(c.width > 0 && c.getContext('2d')"
        ".getImageData(0, 0, c.width, c.height).data.some((v, i) => i % 4 === 3 && v > 0))).length");
  }

  std::filesystem::path folder_;
  std::unique_ptr<Browser> browser_;
};

class LivePage : public ViewPage {
 protected:
  /// What the tiles show of one status: rate and count of samples, by name.
  [[nodiscard]] json shown_devices() const {
    return browser_->value_of(
        "Object.fromEntries([...document.querySelectorAll('#devices .tile')].map((t) => [t.dataset.key, {"
        "rate: t.querySelector('[data-field=rate]').textContent,"
        "samples: t.querySelector('[data-field=samples]').textContent}]))");
  }

  void check_devices() const {
    const std::map<std::string, std::string> roles{{"airins", "reference"}, {"gnss", "gnss"}};
    EXPECT_EQ(browser_->value_of("document.querySelectorAll('#devices .tile').length"), kImus + 2);
    // A status may miss or gain what came in two reads, which the next one makes good: of statuses that follow each
    // other, each counted once, the mean lacks a message at most.
    constexpr int kStatuses = 10;
    constexpr auto kPatience = seconds(30);
    std::map<std::string, double> sums_hz;
    const auto end = std::chrono::steady_clock::now() + kPatience;
    json last = shown_devices();
    int statuses = 0;
    while (statuses < kStatuses && std::chrono::steady_clock::now() < end) {
      std::this_thread::sleep_for(milliseconds(50));
      const json now = shown_devices();
      if (now == last) continue;
      last = now;
      ++statuses;
      for (const auto& [name, device] : now.items())
        if (name != "airins") sums_hz[name] += numbers_in(device.at("rate")).at(0);
    }
    ASSERT_EQ(statuses, kStatuses);
    EXPECT_EQ(sums_hz.size(), kImus + 1U);
    for (const auto& [name, sum_hz] : sums_hz) {
      const double sent_hz = name == "gnss" ? 10.0 : 100.0;
      EXPECT_NEAR(sum_hz / kStatuses, sent_hz, 0.03 * sent_hz) << name;
      EXPECT_EQ(field("devices", name, "state"), "streaming") << name;
    }
    for (const auto& [name, role] : roles)
      EXPECT_THAT(text_at("#devices [data-key=\"" + name + "\"] .head span"), HasSubstr(role));
  }

  void check_losses() const {
    // What the simulator cut off is what the page says was lost, of that device alone.
    const auto hit =
        read_json(folder_ / "truth" / "fault_log.json").at("faults").at(0).at("hit").get<double>();
    EXPECT_GT(hit, 20.0);
    EXPECT_EQ(numbers_in(field("devices", "mtx2", "lost")).at(0), hit);
    EXPECT_EQ(field("devices", "mtx1", "lost"), "0");
  }

  void check_calibration(const json& truth) const {
    constexpr double kSds = 4.0;
    constexpr double kRounding_deg = 0.002;
    for (const auto& imu : truth.at("imus")) {
      const std::string name = imu.at("name");
      const auto rotation = numbers_in(field("calibration", name, "psi.value"));
      const auto sd_mdeg = numbers_in(field("calibration", name, "psi.sd"));
      ASSERT_EQ(rotation.size(), 3U) << name;
      ASSERT_EQ(sd_mdeg.size(), 2U) << name;
      EXPECT_EQ(sd_mdeg[1], 100.0) << "the goal of a sensor whose axes lean by 0.1 deg";
      const Eigen::Vector3d shown_deg(rotation[0], rotation[1], rotation[2]);
      const Eigen::Matrix3d shown =
          Eigen::AngleAxisd(shown_deg.norm() * M_PI / 180.0, shown_deg.normalized()).toRotationMatrix();
      const double off_deg =
          rotation_between_b(matrix_of(imu.at("C_b_s")), shown).cwiseAbs().maxCoeff() * 180.0 / M_PI;
      EXPECT_LT(off_deg, kSds * 1e-3 * sd_mdeg[0] + kRounding_deg) << name;
      const auto arm_mm = numbers_in(field("calibration", name, "r.value"));
      const auto sd_mm = numbers_in(field("calibration", name, "r.sd"));
      ASSERT_EQ(arm_mm.size(), 3U) << name;
      const Eigen::Vector3d known_m = vector_of(imu.at("r_bs_b_m"));
      for (int i = 0; i < 3; ++i)
        EXPECT_NEAR(arm_mm[static_cast<std::size_t>(i)], 1e3 * known_m[i], kSds * sd_mm.at(0) + 0.1) << name;
      // The pace of the pseudo-terminals adds up to some milliseconds of a loaded machine's scheduling.
      EXPECT_NEAR(numbers_in(field("calibration", name, "t.value")).at(0),
                  1e3 * imu.at("t_d_s").get<double>(), 5.0)
          << name;
    }
  }

  /// The drawing from above: page right is to the right, page down is backwards, in one scale.
  void check_mounting(const json& truth) const {
    const json circles = browser_->value_of(
        "[...document.querySelectorAll('#mounting svg')[0].querySelectorAll('circle.imu')].map("
        "(c) => [c.cx.baseVal.value, c.cy.baseVal.value])");
    const json& imus = truth.at("imus");
    ASSERT_EQ(circles.size(), imus.size());
    constexpr double kMiddle_px = 110.0;
    std::map<std::string, Eigen::Vector2d> known_m;  // in the order of the drawing, which is that of names
    double farthest_m = 0.0;
    double farthest_px = 0.0;
    for (const auto& imu : imus) {
      const Eigen::Vector3d r_bs_b_m = vector_of(imu.at("r_bs_b_m"));
      known_m[imu.at("name")] = {r_bs_b_m.y(), -r_bs_b_m.x()};
      farthest_m = std::max(farthest_m, r_bs_b_m.head<2>().norm());
    }
    for (const json& circle : circles) {
      farthest_px = std::max(farthest_px, std::hypot(circle.at(0).get<double>() - kMiddle_px,
                                                     circle.at(1).get<double>() - kMiddle_px));
    }
    constexpr double kWidthOfALine_px = 2.0;
    std::size_t i = 0;
    for (const auto& [name, place_m] : known_m) {
      const Eigen::Vector2d place_px = farthest_px / farthest_m * place_m;
      EXPECT_NEAR(circles.at(i).at(0).get<double>() - kMiddle_px, place_px.x(), kWidthOfALine_px) << name;
      EXPECT_NEAR(circles.at(i).at(1).get<double>() - kMiddle_px, place_px.y(), kWidthOfALine_px) << name;
      ++i;
    }
  }

  /// Where the page says that the vehicle is, against the simulator's table; both by the same UTC.
  void check_position(const json& truth) const {
    const json shown = browser_->value_of(
        "({n: imuscope.known.navigation, text: document.getElementById('position').textContent})");
    std::tm utc{};
    const std::string begin = truth.at("t0_utc");
    std::istringstream(begin) >> std::get_time(&utc, "%Y-%m-%dT%H:%M:%S");
    const double fraction = std::stod(std::regex_replace(begin, std::regex(".*(\\.[0-9]+)Z"), "0$1"));
    const double t_s =
        shown.at("n").at("utime").get<double>() * 1e-6 - static_cast<double>(timegm(&utc)) - fraction;
    std::ifstream table(folder_ / "truth" / "truth.csv");
    std::string line;
    std::getline(table, line);
    std::vector<double> nearest;
    while (std::getline(table, line)) {
      const auto row = numbers_in(line);
      if (nearest.empty() || std::abs(row.at(0) - t_s) < std::abs(nearest[0] - t_s)) nearest = row;
    }
    ASSERT_GE(nearest.size(), 10U);
    constexpr double kDegPerMetre = 1.0 / 111'200.0;
    const double moved_m = std::hypot(nearest[4], nearest[5]) * 0.06 + 0.2;  // between two rows of the table
    EXPECT_NEAR(shown.at("n").at("lat_deg").get<double>(), nearest[1], moved_m * kDegPerMetre);
    EXPECT_NEAR(shown.at("n").at("lon_deg").get<double>(), nearest[2], 1.6 * moved_m * kDegPerMetre);
    const auto text = numbers_in(shown.at("text"));
    EXPECT_NEAR(text.at(0), nearest[1], 1e-4) << "and so the words say";
    EXPECT_NEAR(text.at(1), nearest[2], 1e-4);
    // As far as the vehicle drove: the track's ends are the table's.
    const json track = browser_->value_of("imuscope.known.track");
    EXPECT_GT(track.size(), 100U);
  }

  /// The first level of the wavelet variance is half the white noise of Table II in motion, 0.654 (deg/s)^2,
  /// and the fitted line goes through it.
  void check_wavelets() const {
    const json imu = browser_->value_of(
        "({v: imuscope.known.imus.get('mtx1').variances, m: imuscope.known.imus.get('mtx1').models})");
    ASSERT_TRUE(imu.at("v").is_array());
    bool found = false;
    for (const json& one : imu.at("v")) {
      if (one.at("axis") != "gyro_x" || one.at("regime") != "dynamic") continue;
      found = true;
      constexpr double kDeg2 = 180.0 / M_PI * 180.0 / M_PI;
      EXPECT_NEAR(2.0 * one.at("value").at(0).get<double>() * kDeg2, 0.654, 0.15 * 0.654);
      for (const json& model : imu.at("m")) {
        if (model.at("axis") != "gyro_x" || model.at("regime") != "dynamic") continue;
        const auto measured = one.at("value").at(0).get<double>();
        EXPECT_NEAR(model.at("fitted").at(0).get<double>(), measured, 0.15 * measured);
      }
    }
    EXPECT_TRUE(found);
    EXPECT_EQ(browser_->value_of("document.querySelectorAll('#wavelets canvas').length"), 6);
  }

  /// Rows of all error processes that the service wrote.
  [[nodiscard]] std::uint64_t rows_written(const std::filesystem::path& run) const {
    std::uint64_t rows = 0;
    for (int i = 1; i <= kImus; ++i) {
      const std::string text = read_text(run / ("errors_" + name_of(i) + ".csv"));
      rows += static_cast<std::uint64_t>(std::count(text.begin(), text.end(), '\n')) - 1;
    }
    return rows;
  }
};

TEST_F(LivePage, ShowsWhatTheSimulatorKnowsAndOutlivesServiceAndProgram) {
  std::ofstream(folder_ / "live.toml") << configuration(folder_);
  std::ofstream(folder_ / "faults.toml") << kFault;
  View view({"--port", "0"}, folder_ / "view.log");
  ASSERT_NE(view.port(), 0);
  browser_->open(view.url());
  ASSERT_TRUE(
      browser_->becomes_true("document.getElementById('state')?.textContent === 'no service heard'", 10.0));
  ASSERT_TRUE(
      browser_->becomes_true("performance.getEntriesByName('first-contentful-paint').length === 1", 10.0));
  const json paint =
      browser_->value_of("performance.getEntriesByName('first-contentful-paint')[0].startTime");
  std::printf("first paint after %.0f ms\n", paint.get<double>());
  EXPECT_LE(paint.get<double>(), kFirstPaintMax_ms);

  BackgroundProgram simulator("imusim",
                              {"live", (folder_ / "live.toml").string(), "--skip-static", "--faults",
                               (folder_ / "faults.toml").string(), "--out", (folder_ / "truth").string()},
                              folder_ / "imusim.log");
  std::this_thread::sleep_for(seconds(1));  // its ports are there
  auto service = std::make_unique<BackgroundProgram>(
      "imuscope",
      std::vector<std::string>{"run", (folder_ / "live.toml").string(), "--out", (folder_ / "live").string()},
      folder_ / "imuscope.log");
  std::this_thread::sleep_for(kSettle);
  const double before_s = processor_s(view.id());
  const json before = counts();
  std::this_thread::sleep_for(kMeasured);
  const double share = (processor_s(view.id()) - before_s) / static_cast<double>(kMeasured.count());
  const json after = counts();
  SCOPED_TRACE(read_text(folder_ / "imuscope.log"));
  std::printf("%.2f %% of a core; %lld rows in %lld s, %lld missed, %lld lost; %.0f kB/s\n", 100.0 * share,
              after.at("rows").get<long long>() - before.at("rows").get<long long>(),
              static_cast<long long>(kMeasured.count()), after.at("missed").get<long long>(),
              after.at("lost").get<long long>(),
              1e-3 * (after.at("bytes").get<double>() - before.at("bytes").get<double>()) /
                  static_cast<double>(kMeasured.count()));
  EXPECT_LT(share, kProcessorMax);
  EXPECT_EQ(after.at("missed"), 0);
  EXPECT_EQ(after.at("lost"), 0);
  EXPECT_EQ(after.at("leftOut"), 0);
  EXPECT_GT(after.at("rows").get<double>() - before.at("rows").get<double>(),
            0.95 * 100.0 * kImus * static_cast<double>(kMeasured.count()));

  // What a browser loads that comes late: the page, and the picture with its past.
  {
    RawClient client(view.port());
    const std::string host = "127.0.0.1:" + std::to_string(view.port());
    const auto page = static_cast<double>(client.get("/", host).size());
    RawClient socket(view.port());
    (void)socket.upgrade(host);
    const auto picture = static_cast<double>(socket.next_text().value_or("").size());
    std::printf("transferred until it shows all: %.0f kB of page, %.0f kB of picture\n", 1e-3 * page,
                1e-3 * picture);
    EXPECT_GT(picture, 10'000.0);
    EXPECT_LE(page + picture, kTransferMax);
  }

  EXPECT_EQ(text_at("#run"), "demo");
  const std::string state = text_at("#state");
  EXPECT_TRUE(state == "running" || state == "degraded") << state;
  browser_->value_of(
      "document.getElementById('mark-text').value = 'kerb on the <left>'; "
      "document.getElementById('mark').click()");
  EXPECT_TRUE(browser_->becomes_true(
      "document.getElementById('marks').textContent.includes('kerb on the <left>')", 5.0));
  EXPECT_THAT(read_text(folder_ / "imuscope.log"),
              HasSubstr("event: kerb on the <left> (from imuscope view on "));
  check_devices();
  EXPECT_EQ(blank_figures(), 0);
  photograph_all("live");

  // Values are looked at beside the truth when nothing moves on any more.
  service->interrupt();
  ASSERT_EQ(service->wait(), 0) << read_text(folder_ / "imuscope.log");
  simulator.interrupt();
  simulator.wait();
  EXPECT_TRUE(
      browser_->becomes_true("document.getElementById('state').textContent.startsWith('silent for')", 15.0));
  EXPECT_EQ(counts().at("rows"), rows_written(folder_ / "live"))
      << "every row that the service wrote was drawn";
  const json truth = read_json(folder_ / "truth" / "truth.json");
  check_losses();
  check_calibration(truth);
  check_mounting(truth);
  check_position(truth);
  check_wavelets();

  // The program of the page is started anew: the page finds it again.
  const std::string port = std::to_string(view.port());
  view.end();
  EXPECT_TRUE(
      browser_->becomes_true("document.getElementById('state').textContent === 'page offline'", 10.0));
  View again({"--port", port}, folder_ / "again.log");
  EXPECT_TRUE(browser_->becomes_true("imuscope.counts.connections === 2", 15.0));

  // A service that begins anew is another picture.
  BackgroundProgram vehicle("imusim", {"live", (folder_ / "live.toml").string(), "--skip-static"},
                            folder_ / "imusim2.log");
  std::this_thread::sleep_for(seconds(1));
  {
    BackgroundProgram second("imuscope",
                             {"run", (folder_ / "live.toml").string(), "--out", (folder_ / "live2").string()},
                             folder_ / "imuscope2.log");
    EXPECT_TRUE(browser_->becomes_true("document.querySelectorAll('#devices .tile').length === 8", 15.0));
    second.interrupt();
    EXPECT_EQ(second.wait(), 0);
  }
  const json picture = browser_->value_of("imuscope.picture");
  {
    BackgroundProgram third("imuscope",
                            {"run", (folder_ / "live.toml").string(), "--out", (folder_ / "live3").string()},
                            folder_ / "imuscope3.log");
    EXPECT_TRUE(browser_->becomes_true("imuscope.picture > " + picture.dump(), 15.0));
    EXPECT_TRUE(browser_->becomes_true(
        "document.querySelector('#devices [data-key=mtx1] [data-field=state]')?.textContent === 'streaming'",
        20.0));
    // Without the vehicle there is something that wants a person, with the device's name.
    vehicle.interrupt();
    vehicle.wait();
    EXPECT_TRUE(browser_->becomes_true(
        "[...document.querySelectorAll('#alarms .now')].some((a) => a.textContent.includes('mtx1'))", 20.0));
    third.interrupt();
    EXPECT_EQ(third.wait(), 0);
  }
  again.end();
  // A server that is gone is told by the browser itself; the page says nothing.
  for (const std::string& said : browser_->said())
    EXPECT_THAT(said, testing::AnyOf(HasSubstr("ERR_CONNECTION_REFUSED"), HasSubstr("WebSocket connection")))
        << said;

  // The recording of the same run plays, and a slider leads to any time of it.
  View recorded({(folder_ / "live").string(), "--port", "0"}, folder_ / "recorded.log");
  browser_->open(recorded.url());
  ASSERT_TRUE(browser_->becomes_true("imuscope.play && imuscope.known.time_s > 1", 15.0));
  const double length_s = browser_->value_of("imuscope.play.length_s");
  EXPECT_GT(length_s, static_cast<double>((kSettle + kMeasured).count()));
  const auto slide_to = [&](double time_s) {
    browser_->value_of("{const s = document.getElementById('slider'); s.value = " + std::to_string(time_s) +
                       "; s.dispatchEvent(new Event('input'));}");
    return browser_->becomes_true("Math.abs(imuscope.known.time_s - " + std::to_string(time_s) + ") < 1.5",
                                  10.0);
  };
  const auto press_play = [&](const char* playing) {
    browser_->value_of("document.getElementById('play').click()");
    return browser_->becomes_true("imuscope.play.playing === " + std::string(playing), 10.0);
  };
  // It stands still, so that a page that is late sees the same.
  EXPECT_TRUE(press_play("false"));
  EXPECT_TRUE(slide_to(0.5 * length_s));
  EXPECT_TRUE(slide_to(0.25 * length_s));
  EXPECT_TRUE(press_play("true"));
  EXPECT_TRUE(
      browser_->becomes_true("imuscope.known.time_s > " + std::to_string(0.25 * length_s + 2.0), 10.0));
  EXPECT_TRUE(slide_to(length_s - 0.1));
  EXPECT_TRUE(browser_->becomes_true("document.getElementById('marks').textContent.includes('kerb')", 5.0));
  check_calibration(truth);
  check_mounting(truth);
  photograph_all("recorded");
  recorded.end();
}

TEST_F(ViewPage, WhatAStrangerSendsIsTextAndAPageOfAnotherOriginHearsNothing) {
  const std::vector<std::string> payloads{"<img src=x onerror=pwned()>",
                                          "</script><script>pwned()</script>",
                                          "<svg onload=pwned()>",
                                          "javascript:pwned()",
                                          "__proto__",
                                          "constructor",
                                          "\"><iframe srcdoc='<script>parent.pwned()</script>'>"};
  View view({"--port", "0"}, folder_ / "view.log");
  browser_->open(view.url());
  ASSERT_TRUE(browser_->becomes_true("!!window.imuscope", 10.0));
  browser_->value_of("window.called = 0; window.pwned = () => { ++window.called; }");
  auto bus = LcmPublisher::open();
  ASSERT_TRUE(bus) << bus.error().text();
  for (const std::string& payload : payloads) {
    auto status = example_status();
    status.run = status.reason = status.version = status.capture_path = payload;
    status.state = payload;
    status.devices[0].name = status.devices[0].role = status.devices[0].problem = payload;
    status.studies[0].name = status.studies[0].manoeuvre = status.threads[0].name = payload;
    status.alarms[0].what = status.alarms[0].remedy = status.alarms[0].kind = payload;
    bus->publish(status, "STATUS");
    auto calibration = example_calibration();
    calibration.name = calibration.advice = payload;
    calibration.q_w = 1.0;
    calibration.q_x = calibration.q_y = calibration.q_z = 0.0;
    bus->publish(calibration, "CALIBRATION", "mtx1");
    bus->publish(example_error(payload), "ERROR", "mtx1");
    auto variances = example_wavelet_variance();
    variances.name = payload;
    for (auto& axis : variances.axes) {
      axis.axis = "gyro_x";
      axis.regime = payload;
    }
    bus->publish(variances, "WV", "mtx1");
    bus->publish(example_event(payload), "EVENT");
    std::this_thread::sleep_for(std::chrono::milliseconds(300));
  }
  EXPECT_TRUE(browser_->becomes_true("document.body.textContent.includes('onerror=pwned')", 5.0))
      << "it is read as text";
  EXPECT_EQ(browser_->value_of("window.called"), 0);
  EXPECT_EQ(browser_->value_of("document.querySelectorAll('img, iframe, object, embed, form, a').length"), 0);
  EXPECT_EQ(browser_->value_of("document.querySelectorAll('svg').length"), 3) << "the mounting's own";
  EXPECT_TRUE(browser_->becomes_true(
      "[...document.querySelectorAll('svg text.name')].some((name) => name.textContent.startsWith('<svg'))",
      5.0));
  EXPECT_EQ(browser_->value_of("document.querySelectorAll('script').length"), 1);
  EXPECT_THAT(browser_->said(), IsEmpty());

  // A script that got into the page does not run; a page of another origin gets no websocket.
  browser_->value_of(
      "{const s = document.createElement('script'); s.textContent = 'pwned()'; document.body.append(s);}");
  EXPECT_EQ(browser_->value_of("window.called"), 0);
  const ForeignPage foreign;
  browser_->open("http://127.0.0.1:" + std::to_string(foreign.port()) + "/");
  ASSERT_TRUE(browser_->becomes_true("document.title === 'foreign'", 5.0));
  browser_->value_of(
      "window.heard = 0; window.ended = 0; window.socket = new WebSocket('ws://127.0.0.1:" +
      std::to_string(view.port()) +
      "/live'); socket.onmessage = () => { ++window.heard; }; socket.onclose = () => { ++window.ended; }");
  EXPECT_TRUE(browser_->becomes_true("window.ended === 1", 10.0));
  EXPECT_EQ(browser_->value_of("window.heard"), 0);
  EXPECT_EQ(browser_->value_of("window.socket.readyState"), 3) << "it was never open";
  view.end();
}

TEST(ViewCommand, BeyondThisPcThereIsAlwaysAToken) {
  if (!enter_private_network()) GTEST_SKIP() << "a private network namespace needs root";
  const auto folder = scratch_folder();
  View open({"--address", "0.0.0.0", "--port", "0"}, folder / "open.log");
  std::smatch found;
  ASSERT_TRUE(std::regex_search(open.url(), found, std::regex("\\?token=([0-9a-f]{32})$"))) << open.url();
  const std::string host = "127.0.0.1:" + std::to_string(open.port());
  EXPECT_THAT(RawClient(open.port()).get("/", host), testing::StartsWith("HTTP/1.1 401"));
  EXPECT_THAT(RawClient(open.port()).get("/?token=" + found[1].str(), host),
              testing::StartsWith("HTTP/1.1 200"));
  View again({"--address", "0.0.0.0", "--port", "0"}, folder / "again.log");
  EXPECT_THAT(again.url(), testing::Not(HasSubstr(found[1].str()))) << "it is another one each time";
  View own({"--port", "0", "--token", "a-long-secret"}, folder / "own.log");
  EXPECT_THAT(own.url(), testing::EndsWith("/?token=a-long-secret"));
  EXPECT_THAT(RawClient(own.port()).get("/", "127.0.0.1"), testing::StartsWith("HTTP/1.1 401"))
      << "on loopback, too";
  for (View* view : {&open, &again, &own}) view->end();
}

TEST(ViewCommand, WhatCannotBeShownIsToldWithWhatToDo) {
  if (!enter_private_network()) GTEST_SKIP() << "a private network namespace needs root";
  const auto folder = scratch_folder();
  const auto log = folder / "view.log";
  View taken({"--port", "0"}, folder / "taken.log");
  const auto told = [&](const std::vector<std::string>& arguments, int code) {
    std::vector<std::string> all{"view"};
    all.insert(all.end(), arguments.begin(), arguments.end());
    EXPECT_EQ(run_program("imuscope", all, log), code) << arguments.front();
    return read_text(log);
  };
  EXPECT_THAT(told({"--port", std::to_string(taken.port())}, 1), HasSubstr("choose another --port"));
  EXPECT_THAT(told({"--address", "tablet.local"}, 2), HasSubstr("0.0.0.0 is all of them"));
  EXPECT_THAT(told({"--token", "short"}, 2), HasSubstr("8 to 128"));
  EXPECT_THAT(told({"--port", "99999"}, 2), HasSubstr("--port"));
  EXPECT_THAT(told({(folder / "absent").string()}, 2), HasSubstr("absent"));
  taken.end();
}

}  // namespace
}  // namespace imuscope::test
