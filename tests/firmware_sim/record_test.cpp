#include <fcntl.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <sys/stat.h>
#include <termios.h>
#include <unistd.h>
#include <bit>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>
#include <thread>

#include "firmware_sim/devices/xsens_encoder.h"
#include "firmware_sim/imusim/configuration.h"
#include "firmware_sim/imusim/fault_script.h"
#include "firmware_sim/imusim/live.h"
#include "firmware_sim/imusim/record.h"
#include "firmware_sim/io/pseudo_terminal.h"
#include "tests/support/file_content.h"
#include "tests/support/shared_data.h"

namespace imusim {
namespace {

using imuscope::test::content_of;
using imuscope::test::scratch_folder;

/// A reference, two S-IMUs (one of them turned and with axes of its own) and a receiver, for 15 s.
std::string configuration_text(const std::string& simulation = "", const std::string& folder = "/tmp") {
  return R"(
[run]
name = "test"
[[device]]
name = "ref"
role = "reference"
protocol = "ixblue_stdbin"
transport = { kind = "serial", port = ")" +
         folder + R"(/ref", baud = 460800 }
[[device]]
name = "a"
role = "study"
protocol = "xsens_mt"
transport = { kind = "serial", port = ")" +
         folder + R"(/a", baud = 115200 }
[[device]]
name = "b"
role = "study"
protocol = "xsens_mt"
axes = "-x +y -z"
transport = { kind = "serial", port = ")" +
         folder + R"(/b", baud = 115200 }
[[device]]
name = "gnss"
role = "gnss"
protocol = "greis"
transport = { kind = "serial", port = ")" +
         folder + R"(/gnss", baud = 115200 }
[simulation]
duration_s = 15.0
seed = 3
)" + simulation +
         R"(
[[simulation.imu]]
name = "b"
rotation_vector_b_s_deg = [0.0, 0.0, 90.0]
lever_arm_b_m = [0.1, 0.2, 0.3]
gyro_bias_deg_per_s = [0.5, -0.25, 0.125]
accel_bias_mps2 = [0.0, 0.0, 0.0]
accel_scale_percent = [0.0, 0.0, 0.0]
)";
}

Configuration configuration(const std::string& simulation = "", const std::string& folder = "/tmp") {
  const auto parsed = parse_configuration(configuration_text(simulation, folder), "test.toml");
  EXPECT_TRUE(parsed.has_value()) << (parsed ? "" : parsed.error().text);
  return *parsed;
}

std::string whole_folder(const std::filesystem::path& folder) {
  std::map<std::string, std::string> files;
  for (const auto& entry : std::filesystem::directory_iterator(folder))
    files[entry.path().filename()] = content_of(entry.path());
  std::string all;
  for (const auto& [name, content] : files) all.append(name).append("\n").append(content);
  return all;
}

/// Text of the failure that a configuration meets.
std::string refusal(const std::string& text) {
  const auto parsed = parse_configuration(text, "test.toml");
  if (parsed) return "accepted";
  EXPECT_EQ(parsed.error().exit_code, 2);
  return parsed.error().text;
}

TEST(SimulationConfiguration, RefusesAnUnknownKeyWithItsLineAndTheNearestOne) {
  const std::string text = configuration_text("sede = 4\n");
  const auto line =
      1 + std::count(text.begin(), text.begin() + static_cast<std::ptrdiff_t>(text.find("sede")), '\n');
  EXPECT_EQ(refusal(text),
            "test.toml:" + std::to_string(line) + ": [simulation] has no key 'sede'; the nearest is 'seed'");
}

TEST(SimulationConfiguration, RefusesWhatCannotBe) {
  EXPECT_NE(refusal(configuration_text("scenario = \"boat\"\n")).find("must be one of: drive, static"),
            std::string::npos);
  EXPECT_NE(refusal(configuration_text("[simulation.gnss]\nlatency_ms = -1\n")).find("from 0 to 10000"),
            std::string::npos);
  EXPECT_NE(refusal(configuration_text("[[simulation.imu]]\nname = \"c\"\n")).find("role = \"study\""),
            std::string::npos);
  EXPECT_NE(refusal("x = \n").find("test.toml:1:"), std::string::npos);
  EXPECT_NE(refusal("[run]\nname = \"x\"\n").find("names no devices"), std::string::npos);
  EXPECT_NE(
      refusal("[[device]]\nname = \"a\"\nrole = \"study\"\nprotocol = \"xsens_mt\"\n").find("reference"),
      std::string::npos);
  EXPECT_NE(
      refusal("[[device]]\nname = \"a\"\nrole = \"study\"\nprotocol = \"morse\"\n").find("must be one of"),
      std::string::npos);
}

TEST(SimulationConfiguration, SaysWhatIsWrongWithAFile) {
  const std::filesystem::path folder = scratch_folder();
  EXPECT_NE(load_configuration(folder / "none.toml").error().text.find("does not exist"), std::string::npos);
  EXPECT_NE(load_configuration(folder).error().text.find("is a folder"), std::string::npos);
  std::ofstream(folder / "empty.toml").close();
  EXPECT_NE(load_configuration(folder / "empty.toml").error().text.find("is empty"), std::string::npos);
}

TEST(SimulationConfiguration, TheDemoIsAccepted) {
  const auto demo = load_configuration(imuscope::test::source_path("config/demo.toml"));
  ASSERT_TRUE(demo.has_value()) << demo.error().text;
  EXPECT_EQ(demo->devices.size(), 5U);
  EXPECT_EQ(demo->studies.size(), 3U);
}

TEST(Record, TheSameSeedGivesTheSameBytesAndAnotherSeedOthers) {
  const std::filesystem::path folder = scratch_folder();
  Configuration one = configuration();
  ASSERT_TRUE(record(one, {folder / "first", true, {}}));
  ASSERT_TRUE(record(one, {folder / "second", true, {}}));
  one.scenario.seed = 4;
  ASSERT_TRUE(record(one, {folder / "third", true, {}}));
  EXPECT_TRUE(whole_folder(folder / "first") == whole_folder(folder / "second"));
  EXPECT_NE(content_of(folder / "first" / "a.bin"), content_of(folder / "third" / "a.bin"));
}

TEST(Record, GivingOnePropertyChangesNoOtherDevice) {
  const std::filesystem::path folder = scratch_folder();
  ASSERT_TRUE(record(configuration(), {folder / "plain", false, {}}));
  ASSERT_TRUE(record(configuration("[[simulation.imu]]\nname = \"a\"\nlatency_ms = 5.0\n"),
                     {folder / "late", false, {}}));
  EXPECT_EQ(content_of(folder / "plain" / "b.bin"), content_of(folder / "late" / "b.bin"));
  EXPECT_EQ(content_of(folder / "plain" / "a.bin"), content_of(folder / "late" / "a.bin"));
  EXPECT_NE(content_of(folder / "plain" / "a.arrivals.csv"), content_of(folder / "late" / "a.arrivals.csv"));
}

TEST(Record, WritesEveryFileThatTheDesignPromises) {
  const std::filesystem::path folder = scratch_folder();
  ASSERT_TRUE(record(configuration(), {folder, true, {}}));
  for (const char* name : {"ref.bin", "ref.arrivals.csv", "a.bin", "a.arrivals.csv", "gnss.bin",
                           "capture.lcm", "config.toml", "truth.json", "truth.csv", "errors_truth_a.csv"})
    EXPECT_GT(std::filesystem::file_size(folder / name), 0U) << name;
  EXPECT_TRUE(parse_configuration(content_of(folder / "config.toml"), "config.toml"));
}

TEST(Record, ArrivalsCoverEveryByteOnceAndNeverFall) {
  const std::filesystem::path folder = scratch_folder();
  ASSERT_TRUE(record(configuration(), {folder, false, {}}));
  std::ifstream file(folder / "ref.arrivals.csv");
  std::string line;
  std::getline(file, line);
  EXPECT_EQ(line, "byte_offset,n_bytes,arrival_ns");
  std::uint64_t covered = 0;
  std::int64_t last_ns = 0;
  char comma = 0;
  while (std::getline(file, line)) {
    std::istringstream fields(line);
    std::uint64_t offset = 0;
    std::uint64_t count = 0;
    std::int64_t arrival_ns = 0;
    fields >> offset >> comma >> count >> comma >> arrival_ns;
    ASSERT_EQ(offset, covered);
    ASSERT_GE(arrival_ns, last_ns);
    covered += count;
    last_ns = arrival_ns;
  }
  EXPECT_EQ(covered, std::filesystem::file_size(folder / "ref.bin"));
}

float float_at(const std::string& bytes, std::size_t offset) {
  const auto* const data = reinterpret_cast<const std::uint8_t*>(bytes.data());
  return std::bit_cast<float>(get_be<std::uint32_t>(std::span(data + offset, 4)));
}

TEST(Record, AnMtxAtRestShowsGravityAndItsBiasInItsOwnAxes) {
  const std::filesystem::path folder = scratch_folder();
  ASSERT_TRUE(record(configuration(), {folder, false, {}}));
  // Configuration and the ack of GoToMeasurement come first.
  constexpr std::size_t kAnswers = 123 + 5;
  const std::string bytes = content_of(folder / "b.bin").substr(kAnswers);
  constexpr std::size_t kFrame = 31;
  constexpr std::size_t kSamples = 900;  // 9 s at rest
  Eigen::Vector3d acc = Eigen::Vector3d::Zero();
  Eigen::Vector3d gyr = Eigen::Vector3d::Zero();
  for (std::size_t k = 0; k < kSamples; ++k) {
    ASSERT_EQ(static_cast<std::uint8_t>(bytes[k * kFrame]), 0xFA);
    for (std::size_t i = 0; i < 3; ++i) {
      acc[static_cast<int>(i)] += float_at(bytes, k * kFrame + 4 + 4 * i) / kSamples;
      gyr[static_cast<int>(i)] += float_at(bytes, k * kFrame + 16 + 4 * i) / kSamples;
    }
  }
  const Motion motion(configuration().scenario);
  const Eigen::Vector3d f_b = motion.state_at(1.0).f_b_mps2;
  // C_b_s turns by +90 deg about z: x_s = -y_b, y_s = x_b. The device's own axes are (-x, y, -z) of s.
  const Eigen::Vector3d f_device(f_b.y(), f_b.x(), -f_b.z());
  const double deg = 3.14159265358979323846 / 180.0;
  const Eigen::Vector3d bias_device(-0.5 * deg, -0.25 * deg, -0.125 * deg);
  // Five sigma: accelerometer Gauss-Markov 0.02 m/s^2, gyro white 0.71 deg/s over 900 samples and 0.05 deg/s.
  EXPECT_LT((acc - f_device).cwiseAbs().maxCoeff(), 0.1);
  EXPECT_LT((gyr - bias_device).cwiseAbs().maxCoeff(), 5.0 * 0.053 * deg);
}

TEST(Record, TheTruthIsThatOfTheConfiguration) {
  const std::filesystem::path folder = scratch_folder();
  ASSERT_TRUE(record(configuration(), {folder, false, {}}));
  const auto truth = nlohmann::json::parse(content_of(folder / "truth.json"));
  ASSERT_EQ(truth["imus"].size(), 2U);
  const auto& b = truth["imus"][1];
  EXPECT_EQ(b["name"], "b");
  EXPECT_NEAR(b["C_b_s"][1].get<double>(), -1.0, 1e-12);
  EXPECT_NEAR(b["q_b_s"][3].get<double>(), std::sqrt(0.5), 1e-12);
  EXPECT_EQ(b["r_bs_b_m"][2].get<double>(), 0.3);
  EXPECT_NEAR(b["t_d_s"].get<double>(), 0.001 - 0.002, 1e-12);
  EXPECT_EQ(b["noise"].size(), 12U);
  EXPECT_EQ(b["noise"][0]["parameters"].size(), 5U);
  // The first time tag of the reference is the origin of time_s.
  const std::string reference = content_of(folder / "ref.bin");
  const auto* const data = reinterpret_cast<const std::uint8_t*>(reference.data());
  const auto ticks = get_be<std::uint32_t>(std::span(data + 17, 4));
  const std::string t0 = truth["t0_utc"];
  EXPECT_EQ(t0.substr(0, 19), "2026-03-14T09:30:00");
  EXPECT_NEAR(std::stod(t0.substr(17)), ticks * 1e-4 - (9 * 3600 + 30 * 60), 1e-6);
}

TEST(Record, TheHarshWorldDiffersFromTheIdealOneByWhatItsTruthTells) {
  const auto recorded = [](const std::string& world) {
    const std::filesystem::path folder = scratch_folder() / (world.empty() ? "none" : world);
    const std::string key = world.empty() ? "" : "world = \"" + world + "\"\n";
    EXPECT_TRUE(record(configuration(key), {folder, false, {}}));
    return std::pair{content_of(folder / "a.bin") + content_of(folder / "ref.bin"),
                     nlohmann::json::parse(content_of(folder / "truth.json"))};
  };
  const auto [bytes, untold] = recorded("");
  const auto [ideal_bytes, ideal] = recorded("ideal");
  const auto [harsh_bytes, harsh] = recorded("harsh");
  EXPECT_EQ(bytes, ideal_bytes);
  EXPECT_EQ(untold["world"], "ideal");
  EXPECT_NE(bytes, harsh_bytes);
  EXPECT_EQ(bytes.size(), harsh_bytes.size());
  EXPECT_EQ(harsh["world"], "harsh");
  const auto& tame = ideal["imus"][0];
  const auto& ugly = harsh["imus"][0];
  for (const char* same : {"r_bs_b_m", "gyro_bias_radps", "accel_bias_mps2", "gyro_scale", "noise"})
    EXPECT_EQ(tame[same], ugly[same]) << same;
  // The axes of a crooked triad are its own: x along the x gyro, y in the plane of the x and y gyros.
  double largest = 0.0;
  for (std::size_t i = 0; i < 9; ++i)
    largest = std::max(largest, std::abs(tame["C_b_s"][i].get<double>() - ugly["C_b_s"][i].get<double>()));
  EXPECT_GT(largest, 1e-5);
  EXPECT_LT(largest, 0.01) << "0.1 deg and its like";
  for (const std::size_t above : {1U, 2U, 5U})
    EXPECT_NEAR(ugly["gyro_matrix"][above].get<double>(), 0.0, 1e-12);
  for (const char* drawn : {"gyro_matrix", "accel_matrix", "C_s_accel", "accel_places_s_m", "g_sensitivity",
                            "gyro_low_pass_hz", "own_vibration"})
    EXPECT_NE(tame[drawn], ugly[drawn]) << drawn;
  // sqrt(2) / (2 pi 40 Hz) = 5.6 ms behind a slow motion, within what corners scatter by; t_d says how much later than
  // the reference's gyros.
  const double later_s =
      ugly["gyro_delay_s"].get<double>() - harsh["reference"]["gyro_delay_s"].get<double>();
  EXPECT_NEAR(ugly["gyro_delay_s"].get<double>(), 5.6e-3, 2e-3);
  EXPECT_NEAR(ugly["t_d_s"].get<double>(), tame["t_d_s"].get<double>() - later_s, 1e-12);
  EXPECT_NEAR(
      ugly["accel_t_d_s"].get<double>(),
      harsh["reference"]["accel_delay_s"].get<double>() - ugly["accel_delay_s"].get<double>() + later_s,
      1e-12);
  EXPECT_NE(ugly["accel_delay_s"], ugly["gyro_delay_s"]);
  EXPECT_EQ(ideal["reference"]["gyro_matrix"], nlohmann::json({1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0}));
  EXPECT_NE(harsh["reference"]["gyro_matrix"], ideal["reference"]["gyro_matrix"]);
}

TEST(Record, SaysWhenItsFolderCannotBe) {
  const std::filesystem::path file = scratch_folder() / "file";
  std::ofstream(file) << "x";
  const auto outcome = record(configuration(), {file, false, {}});
  ASSERT_FALSE(outcome.has_value());
  EXPECT_EQ(outcome.error().exit_code, 1);
}

TEST(Record, ReplacesItsOwnRecordingAndTouchesNobodyElsesFile) {
  const std::filesystem::path folder = scratch_folder();
  const std::string fault =
      "[[fault]]\nkind = \"drop\"\ndevice = \"a\"\nat_s = 1.0\nfor_s = 1.0\nshare = 0.5\n";
  Configuration with_fault = configuration();
  ASSERT_TRUE(parse_faults(fault, "faults.toml", with_fault));
  ASSERT_TRUE(record(with_fault, {folder / "own", true, {}}));
  ASSERT_TRUE(std::filesystem::exists(folder / "own" / "fault_log.json"));
  std::ofstream(folder / "own" / "notes.txt") << "mine";
  ASSERT_TRUE(record(configuration(), {folder / "own", false, {}}));
  // Nothing of the first one is taken for the second's.
  for (const char* name : {"faults.toml", "fault_log.json", "errors_truth_a.csv"})
    EXPECT_FALSE(std::filesystem::exists(folder / "own" / name)) << name;
  EXPECT_EQ(content_of(folder / "own" / "notes.txt"), "mine");

  std::filesystem::create_directories(folder / "drive");
  std::ofstream(folder / "drive" / "a.bin") << "of a vehicle";
  const auto refused = record(configuration(), {folder / "drive", false, {}});
  ASSERT_FALSE(refused.has_value());
  EXPECT_NE(refused.error().text.find("holds a.bin, which imusim did not record; choose another --out"),
            std::string::npos)
      << refused.error().text;
  EXPECT_EQ(content_of(folder / "drive" / "a.bin"), "of a vehicle");
  EXPECT_FALSE(std::filesystem::exists(folder / "drive" / "config.toml"));
}

TEST(Record, WritesItsDbcFileNowhereButBesideTheRecording) {
  const std::filesystem::path folder = scratch_folder();
  std::ofstream(folder / "car.dbc") << "of a car";
  Configuration wheels = configuration();
  wheels.devices.front().protocol = Protocol::kCanOdometry;
  for (const std::string& name :
       {(folder / "car.dbc").string(), std::string("../car.dbc"), std::string(".."), std::string(".")}) {
    wheels.devices.front().dbc = name;
    const auto refused = record(wheels, {folder / "drive", false, {}});
    ASSERT_FALSE(refused.has_value()) << name;
    EXPECT_EQ(refused.error().exit_code, 2);
    EXPECT_NE(refused.error().text.find("give dbc a name without a folder"), std::string::npos)
        << refused.error().text;
  }
  EXPECT_EQ(content_of(folder / "car.dbc"), "of a car");
}

/// A program at the near end of a simulated port.
class Reader {
 public:
  explicit Reader(const std::filesystem::path& port)
      : fd_(::open(port.c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK)) {
    termios settings{};
    ::tcgetattr(fd_, &settings);
    ::cfmakeraw(&settings);
    ::tcsetattr(fd_, TCSANOW, &settings);
  }
  Reader(const Reader&) = delete;
  Reader& operator=(const Reader&) = delete;
  ~Reader() { ::close(fd_); }

  void say(const Bytes& bytes) { EXPECT_EQ(::write(fd_, bytes.data(), bytes.size()), std::ssize(bytes)); }

  /// Reads until the bytes are there, at most 5 s.
  bool hears(const Bytes& wanted) {
    constexpr int kSteps = 500;
    for (int step = 0; step < kSteps; ++step) {
      const auto found = std::search(heard_.begin(), heard_.end(), wanted.begin(), wanted.end());
      if (found != heard_.end()) {
        heard_.erase(heard_.begin(), found + static_cast<std::ptrdiff_t>(wanted.size()));
        return true;
      }
      pollfd ready{fd_, POLLIN, 0};
      ::poll(&ready, 1, 10);
      std::array<std::uint8_t, 1024> chunk{};
      const ssize_t count = ::read(fd_, chunk.data(), chunk.size());
      if (count > 0) heard_.insert(heard_.end(), chunk.begin(), chunk.begin() + count);
    }
    return false;
  }

 private:
  int fd_;
  Bytes heard_;
};

TEST(Live, AProgramFindsThePortsShakesHandsAndGetsData) {
  const std::filesystem::path folder = scratch_folder() / "ports";
  std::atomic<bool> stop = false;
  std::atomic<int> opened = 0;
  LiveOptions options;
  options.start_s = 5.0;
  options.on_line = [&](const std::string&) { ++opened; };
  Outcome<std::vector<LiveCounts>> counts;
  std::thread player([&] { counts = play(configuration("", folder.string()), options, stop); });
  while (opened.load() < 4) std::this_thread::sleep_for(std::chrono::milliseconds(1));
  {
    Reader mtx(folder / "a");
    Reader reference(folder / "ref");
    EXPECT_TRUE(reference.hears({'I', 'X', 3}));
    mtx.say(xsens::frame(xsens::kGoToConfig, {}));
    EXPECT_TRUE(mtx.hears(xsens::frame(xsens::kGoToConfig + 1, {})));
    mtx.say(xsens::frame(xsens::kOutputMode, Bytes{0x00, 0x02}));
    EXPECT_TRUE(mtx.hears(xsens::frame(xsens::kOutputMode + 1, {})));
    mtx.say(xsens::frame(xsens::kOutputSettings, Bytes{0x00, 0x00, 0x00, 0x41}));
    EXPECT_TRUE(mtx.hears(xsens::frame(xsens::kOutputSettings + 1, {})));
    mtx.say(xsens::frame(xsens::kGoToMeasurement, {}));
    EXPECT_TRUE(mtx.hears(xsens::frame(xsens::kGoToMeasurement + 1, {})));
    EXPECT_TRUE(mtx.hears({0xFA, 0xFF, xsens::kMtData, 26}));
  }
  stop = true;
  player.join();
  ASSERT_TRUE(counts.has_value()) << counts.error().text;
  EXPECT_GT((*counts)[0].sent_bytes, 0U);
  EXPECT_GT((*counts)[1].received_bytes, 0U);
  EXPECT_EQ((*counts)[2].sent_bytes, 0U);  // nobody opened b's port, and at power-on it said WakeUp
  EXPECT_GT((*counts)[2].dropped_bytes, 0U);
  EXPECT_FALSE(std::filesystem::exists(std::filesystem::symlink_status(folder / "a")));
  EXPECT_EQ(std::filesystem::status(folder).permissions(), std::filesystem::perms::owner_all);
}

TEST(PseudoTerminal, TakesTheLinksPlaceButNotAFiles) {
  const std::filesystem::path folder = scratch_folder();
  std::filesystem::create_symlink("/nowhere", folder / "stale");
  auto terminal = PseudoTerminal::open(folder / "stale", 115200);
  ASSERT_TRUE(terminal.has_value()) << terminal.error();
  EXPECT_EQ(std::filesystem::read_symlink(folder / "stale"), terminal->terminal());
  std::ofstream(folder / "file") << "precious";
  EXPECT_FALSE(PseudoTerminal::open(folder / "file", 115200).has_value());
  EXPECT_EQ(content_of(folder / "file"), "precious");
}

TEST(PseudoTerminal, TakesNoFolderInWhichSomebodyElseCouldPutAnotherPort) {
  const std::filesystem::path folder = scratch_folder();
  const auto refusal = [&](const std::filesystem::path& link) {
    const auto terminal = PseudoTerminal::open(link, 115200);
    return terminal ? std::string("taken") : terminal.error();
  };
  std::filesystem::create_directories(folder / "open" / "mine");
  std::filesystem::permissions(folder / "open", std::filesystem::perms::all);
  EXPECT_NE(refusal(folder / "open" / "port").find("everybody may write in"), std::string::npos);
  EXPECT_NE(refusal(folder / "open" / "mine" / "port").find("everybody may write in"), std::string::npos);
  EXPECT_NE(refusal(folder / "open" / "new" / "port").find("everybody may write in"), std::string::npos);
  // As /tmp: others write there, too, but not over what is ours.
  ASSERT_EQ(::chmod((folder / "open").c_str(), 01777), 0);
  EXPECT_EQ(refusal(folder / "open" / "port"), "taken");

  constexpr uid_t kSomebodyElse = 12'345;
  std::filesystem::create_directories(folder / "theirs" / "mine");
  std::filesystem::create_symlink(folder / "open", folder / "their_link");
  if (::chown((folder / "theirs").c_str(), kSomebodyElse, kSomebodyElse) != 0)
    GTEST_SKIP() << "to give a folder away needs root";
  ASSERT_EQ(::lchown((folder / "their_link").c_str(), kSomebodyElse, kSomebodyElse), 0);
  EXPECT_NE(refusal(folder / "theirs" / "port").find("belongs to somebody else"), std::string::npos);
  EXPECT_NE(refusal(folder / "theirs" / "mine" / "port").find("belongs to somebody else"), std::string::npos);
  EXPECT_NE(refusal(folder / "their_link" / "port").find("belongs to somebody else"), std::string::npos);
}

TEST(PseudoTerminal, AFloodThatTheKernelDoesNotTakeAtOnceArrivesWhole) {
  const std::filesystem::path folder = scratch_folder();
  auto terminal = PseudoTerminal::open(folder / "port", 115200);
  ASSERT_TRUE(terminal.has_value()) << terminal.error();
  Reader reader(folder / "port");
  constexpr std::size_t kFlood = 60'000;  // while nobody reads, the kernel takes some 14 kB of it
  Bytes bytes(kFlood);
  for (std::size_t i = 0; i < bytes.size(); ++i) bytes[i] = static_cast<std::uint8_t>(i * i >> 3U);
  EXPECT_EQ(terminal->write(bytes), 0U);
  std::atomic<bool> heard = false;
  std::jthread device([&] {
    while (!heard.load()) (void)terminal->read();
  });
  EXPECT_TRUE(reader.hears(bytes));
  heard = true;
}

TEST(PseudoTerminal, DropsWhatNobodyReadsWithoutWaiting) {
  const std::filesystem::path folder = scratch_folder();
  auto terminal = PseudoTerminal::open(folder / "port", 115200);
  ASSERT_TRUE(terminal.has_value()) << terminal.error();
  const Bytes bytes(1000, 0x55);
  EXPECT_FALSE(terminal->is_open_elsewhere());
  EXPECT_EQ(terminal->write(bytes), bytes.size());
  const Reader silent(folder / "port");
  EXPECT_TRUE(terminal->is_open_elsewhere());
  std::size_t dropped = 0;
  for (int i = 0; i < 1000; ++i) dropped += terminal->write(bytes);
  EXPECT_GT(dropped, 0U);
  EXPECT_LT(dropped, 1000 * bytes.size());
}

}  // namespace
}  // namespace imusim
