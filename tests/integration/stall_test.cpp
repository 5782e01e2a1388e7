/// A host that stands still, and loses nothing by it: the service is stopped, its I/O thread or its estimator
/// gets no processor, on lines of every kind. When it moves again no clock has begun anew, no S-IMU sits
/// differently, every sample that the kernel kept has its row, and the capture replays to the same rows.

#include <gtest/gtest.h>
#include <chrono>
#include <cmath>
#include <csignal>
#include <cstdlib>
#include <fstream>
#include <limits>
#include <list>
#include <optional>
#include <regex>
#include <sstream>

#include "programs.h"
#include "status_listener.h"
#include "tests/support/shared_data.h"

namespace imuscope::test {
namespace {

using std::chrono::duration;
using std::chrono::seconds;

constexpr double kRate_hz = 100.0;
constexpr seconds kSettle{25};
/// A core catches up ten times as fast as it fell behind; then some normal seconds.
constexpr seconds kAfter{6};
constexpr int kCatchUpShare = 8;

/// What is done to the service ('S': stopped; else as host_fault.cpp has it), and for how long.
struct Stall {
  char what;
  seconds lasts;
};

/// The short ones, or with IMUSCOPE_LONG_STALLS each length with each thing that stands still.
std::vector<Stall> stalls() {
  if (std::getenv("IMUSCOPE_LONG_STALLS") == nullptr)
    return {{'S', seconds(11)}, {'i', seconds(15)}, {'e', seconds(15)}};
  std::vector<Stall> all;
  for (const int length_s : {5, 11, 15, 60}) {
    for (const char what : {'S', 'i', 'e'}) all.push_back({what, seconds(length_s)});
  }
  return all;
}

constexpr const char* kPrior =
    "prior = { rotation_vector_b_s_deg = [0.8, -1.1, 0.6], boresight_sd_deg = 3.0, lever_arm_sd_m = 0.5, "
    "time_offset_ms = 0.0, time_offset_sd_ms = 10.0 }\n";

std::string device(const std::string& name, const std::string& role, const std::string& protocol,
                   const std::string& transport, const std::string& more = "") {
  return "\n[[device]]\nname = \"" + name + "\"\nrole = \"" + role + "\"\nprotocol = \"" + protocol +
         "\"\ntransport = { " + transport + " }\n" + more;
}

std::string serial(const std::filesystem::path& folder, const std::string& name, int baud) {
  return "kind = \"serial\", port = \"" + (folder / "ports" / name).string() +
         "\", baud = " + std::to_string(baud);
}
std::string tcp(int port) { return R"(kind = "tcp", host = "127.0.0.1", port = )" + std::to_string(port); }
std::string udp(int port) { return R"(kind = "udp", port = )" + std::to_string(port); }

/// A reference and two S-IMUs, one of which speaks and needs a line in both directions.
struct Lines {
  std::string kind;
  std::string airins;
  std::string ins;
  std::string mtx;
};

/// One vehicle on lines of one kind, and the service beside it.
class Vehicle {
 public:
  Vehicle(const std::filesystem::path& folder, const Lines& lines) : folder_(folder) {
    std::filesystem::create_directories(folder_);
    const std::string imu =
        "\nrotation_vector_b_s_deg = [0.8, -1.1, 0.6]\nlever_arm_b_m = [0.35, -0.22, 0.12]\n";
    std::ofstream(folder_ / "car.toml")
        << "[run]\nname = \"" << lines.kind << "\"\n"
        << device("airins", "reference", "ixblue_stdbin", lines.airins, "axes = \"+x -y -z\"\n")
        << device("ins", "study", "ixblue_stdbin", lines.ins, kPrior)
        << device("mtx", "study", "xsens_mt", lines.mtx, kPrior)
        << "\n[simulation]\nduration_s = 1200.0\n[[simulation.imu]]\nname = \"ins\"" << imu
        << "[[simulation.imu]]\nname = \"mtx\"" << imu;
    simulator_.emplace("imusim",
                       std::vector<std::string>{"live", (folder_ / "car.toml").string(), "--skip-static"},
                       folder_ / "imusim.log");
    service_.emplace("imuscope",
                     std::vector<std::string>{"run", (folder_ / "car.toml").string(), "--out",
                                              (folder_ / "live").string()},
                     folder_ / "imuscope.log");
  }
  void send(int signal) const { service_->send(signal); }
  void end() {
    service_->interrupt();
    EXPECT_EQ(service_->wait(), 0) << log();
    simulator_->interrupt();
    simulator_->wait();
  }
  [[nodiscard]] std::string log() const { return read_text(folder_ / "imuscope.log"); }
  [[nodiscard]] const std::filesystem::path& folder() const { return folder_; }

 private:
  std::filesystem::path folder_;
  std::optional<BackgroundProgram> simulator_;
  std::optional<BackgroundProgram> service_;
};

/// Samples without a row, between the first row and the last.
struct Rows {
  double first_s = 0.0;
  double last_s = 0.0;
  std::int64_t missing = 0;
  int gaps = 0;
};
Rows rows_of(const std::filesystem::path& file) {
  std::ifstream in(file);
  std::string line;
  std::getline(in, line);
  std::istringstream header(line);
  std::size_t column = 0;
  for (std::string name; std::getline(header, name, ',') && name != "time_s"; ++column) {
  }
  Rows rows;
  double previous_s = std::numeric_limits<double>::quiet_NaN();
  while (std::getline(in, line)) {
    std::istringstream fields(line);
    std::string field;
    for (std::size_t i = 0; i <= column; ++i) std::getline(fields, field, ',');
    const double time_s = std::stod(field);
    if (std::isnan(previous_s)) rows.first_s = previous_s = time_s;
    const auto steps = std::llround((time_s - previous_s) * kRate_hz);
    if (steps > 1) {
      rows.missing += steps - 1;
      ++rows.gaps;
    }
    previous_s = rows.last_s = time_s;
  }
  return rows;
}

const nlohmann::json& named(const nlohmann::json& devices, const std::string& name) {
  for (const auto& one : devices) {
    if (one.at("name") == name) return one;
  }
  static const nlohmann::json kNone;
  ADD_FAILURE() << name;
  return kNone;
}

void wait(seconds length) { std::this_thread::sleep_for(length); }

void check(const Vehicle& vehicle, seconds length) {
  const auto run = read_json(vehicle.folder() / "live" / "run.json");
  const auto& devices = run.at("devices");
  const auto lost = [&](const std::string& name) {
    return named(devices, name).at("samples_lost").get<std::int64_t>();
  };
  for (const auto& one : devices) {
    EXPECT_EQ(one.at("clock_resets"), 0) << one.at("name");
    EXPECT_EQ(one.at("refused"), 0) << one.at("name");
  }
  for (const auto& event : run.at("events")) {
    const auto text = event.at("text").get<std::string>();
    EXPECT_EQ(text.find("sits differently"), std::string::npos) << text;
    EXPECT_EQ(text.find("calibrated anew"), std::string::npos) << text;
  }
  for (const std::string name : {"ins", "mtx"}) {
    const Rows rows = rows_of(vehicle.folder() / "live" / ("errors_" + name + ".csv"));
    // Beside a gap of the reference the window of its samples is not whole.
    constexpr std::int64_t kAtAGap = 8;
    const std::int64_t explained =
        lost(name) + lost("airins") + (lost("airins") > 0 ? kAtAGap * rows.gaps : 0);
    EXPECT_LE(rows.missing, explained) << name;
    EXPECT_GT(rows.last_s - rows.first_s, duration<double>(length - kSettle).count()) << name;
    EXPECT_EQ(named(devices, name).at("late"), 0) << name;
    std::printf("%-22s %-4s lost %5ld (reference %5ld), without a row %5ld, dropped %s, late %s\n",
                vehicle.folder().filename().c_str(), name.c_str(), lost(name), lost("airins"), rows.missing,
                named(devices, name).at("frames_dropped").dump().c_str(),
                named(devices, name).at("late").dump().c_str());
  }
}

void check_replay(const Vehicle& vehicle) {
  const auto again = vehicle.folder() / "again";
  ASSERT_EQ(
      run_program("imuscope",
                  {"replay", (vehicle.folder() / "live" / "capture.lcm").string(), "--out", again.string()},
                  vehicle.folder() / "replay.log"),
      0)
      << read_text(vehicle.folder() / "replay.log");
  for (const char* name :
       {"errors_ins.csv", "errors_mtx.csv", "calibration_ins.csv", "calibration_mtx.csv"}) {
    const auto live = read_text(vehicle.folder() / "live" / name);
    EXPECT_GT(live.size(), 1000U) << name;
    EXPECT_TRUE(live == read_text(again / name)) << name << " differs between live and replay";
  }
}

class Stalls : public testing::Test {
 protected:
  void SetUp() override {
    if (!enter_private_network()) GTEST_SKIP() << "a private network namespace needs root";
    do_to_services('-');
    ::setenv("LD_PRELOAD", program_path("libhost_fault.so").c_str(), 1);
    ::setenv("HOST_FAULT_CONTROL", (folder_ / "control").c_str(), 1);
  }
  void TearDown() override {
    ::unsetenv("LD_PRELOAD");
    ::unsetenv("HOST_FAULT_CONTROL");
  }
  void do_to_services(char fault) const { std::ofstream(folder_ / "control") << fault; }
  std::filesystem::path folder_ = scratch_folder();
};

TEST_F(Stalls, LeaveClocksMountingsAndSamplesAlone) {
  std::list<Vehicle> vehicles;
  for (const Lines& lines :
       {Lines{"pty", serial(folder_ / "pty", "airins", 460800), serial(folder_ / "pty", "ins", 460800),
              serial(folder_ / "pty", "mtx", 115200)},
        Lines{"tcp", tcp(29400), tcp(29401), tcp(29402)},
        Lines{"udp", udp(29403), udp(29404), serial(folder_ / "udp", "mtx", 115200)}})
    vehicles.emplace_back(folder_ / lines.kind, lines);

  const auto began = std::chrono::steady_clock::now();
  wait(kSettle);
  for (const Stall& stall : stalls()) {
    const bool stops = stall.what == 'S';
    for (const Vehicle& vehicle : vehicles) {
      if (stops) vehicle.send(SIGSTOP);
    }
    if (!stops) do_to_services(stall.what);
    wait(stall.lasts);
    do_to_services('-');
    for (const Vehicle& vehicle : vehicles) {
      if (stops) vehicle.send(SIGCONT);
    }
    wait(kAfter + stall.lasts / kCatchUpShare);
  }
  for (Vehicle& vehicle : vehicles) vehicle.end();
  const auto length = std::chrono::duration_cast<seconds>(std::chrono::steady_clock::now() - began);
  for (const Vehicle& vehicle : vehicles) {
    SCOPED_TRACE(vehicle.folder().string() + "\n" + vehicle.log());
    check(vehicle, length);
    check_replay(vehicle);
  }
}

}  // namespace
}  // namespace imuscope::test
